//! One compute pipeline with its bindings, its dispatches, and the storage buffers it works on.
//!
//! Group 0 holds all bindings. Their kinds and least sizes are read from the shader, and buffers are bound by the names
//! that it gives them. Counts of workgroups above the
//! limit of one dimension are folded into two; the shader unfolds them and guards the tail.

use super::{
    context::{Context, GpuError},
    shaders::{self, Shader},
};
use bytemuck::Pod;
use std::sync::PoisonError;

/// Every byte of an output before the dispatch that writes it. As u32 it is no status, count or node number in use; as
/// f32 it is -1.2e13, no length, force or energy of a haptic scene.
#[cfg(test)]
pub const POISON: u8 = 0xD5;

/// A binding of a kernel, as the shader declares it.
#[derive(Clone, Debug)]
struct Binding {
    number: u32,
    name: String,
    ty: wgpu::BufferBindingType,
    /// Least size of the buffer: that of the struct, or of one element [B].
    least: u64,
}

impl Binding {
    /// Those that the entry point of `shader` uses.
    fn of(shader: &Shader) -> Result<Vec<Self>, GpuError> {
        let module = shaders::parse(shader).map_err(GpuError::Refused)?;
        let info = shaders::validate(shader, &module).map_err(GpuError::Refused)?;
        let entry = module.entry_points.iter().position(|point| point.name == shader.entry);
        let entry = entry.ok_or_else(|| GpuError::Refused(format!("{} has no {}", shader.name, shader.entry)))?;
        let used = info.get_entry_point(entry);
        let binding = |(handle, global): (naga::Handle<naga::GlobalVariable>, &naga::GlobalVariable)| {
            let number = global.binding.as_ref().filter(|_| !used[handle].is_empty())?.binding;
            let ty = match global.space {
                naga::AddressSpace::Storage { access } => {
                    let read_only = !access.contains(naga::StorageAccess::STORE);
                    wgpu::BufferBindingType::Storage { read_only }
                }
                _ => wgpu::BufferBindingType::Uniform,
            };
            let least = module.types[global.ty].inner.size(module.to_ctx()).into();
            Some(Self { number, name: global.name.clone().unwrap_or_default(), ty, least })
        };
        Ok(module.global_variables.iter().filter_map(binding).collect())
    }

    fn layout(&self) -> wgpu::BindGroupLayoutEntry {
        let min_binding_size = std::num::NonZeroU64::new(self.least);
        wgpu::BindGroupLayoutEntry {
            binding: self.number,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty: self.ty, has_dynamic_offset: false, min_binding_size },
            count: None,
        }
    }
}

/// A compute pipeline.
#[derive(Clone)]
pub struct Kernel {
    /// The shader's, and that of its entry point where it has several.
    pub(super) name: String,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    bindings: Vec<Binding>,
}

impl Kernel {
    /// `shader` with the given override constants: compiled when a device is first asked for it.
    ///
    /// # Errors
    /// When the device refuses the shader or runs out of memory.
    pub fn new(context: &Context, shader: &Shader, overrides: &[(&str, f64)]) -> Result<Self, GpuError> {
        let name = match shader.entry {
            "main" => shader.name.to_owned(),
            entry => format!("{} {entry}", shader.name),
        };
        // The lock is held meanwhile, so that of two threads that want one kernel the second gets the first's.
        let mut compiled = context.kernels.lock().unwrap_or_else(PoisonError::into_inner);
        let key = format!("{name} {:?} {overrides:?}", shader.precision);
        if let Some(kernel) = compiled.get(&key) {
            return Ok(kernel.clone());
        }
        let bindings = Binding::of(shader)?;
        let (pipeline, layout) = Self::compile(context, shader, overrides, &bindings)?;
        let kernel = Self { name, pipeline, layout, bindings };
        compiled.insert(key, kernel.clone());
        Ok(kernel)
    }

    fn compile(
        context: &Context,
        shader: &Shader,
        overrides: &[(&str, f64)],
        bindings: &[Binding],
    ) -> Result<(wgpu::ComputePipeline, wgpu::BindGroupLayout), GpuError> {
        context.scoped(|device| {
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(shader.name),
                source: wgpu::ShaderSource::Wgsl(shader.source().into()),
            });
            let entries: Vec<_> = bindings.iter().map(Binding::layout).collect();
            let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(shader.name),
                entries: &entries,
            });
            let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(shader.name),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(shader.name),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(shader.entry),
                compilation_options: wgpu::PipelineCompilationOptions { constants: overrides, ..Default::default() },
                cache: None,
            });
            (pipeline, layout)
        })
    }

    /// Binds what the kernel uses of `buffers`, which have the names that the shader gives them.
    ///
    /// # Errors
    /// When one is missing, or kind or size do not fit.
    pub fn bind(&self, context: &Context, buffers: &[(&str, &StorageBuffer)]) -> Result<wgpu::BindGroup, GpuError> {
        let entry = |binding: &Binding| {
            let named = buffers.iter().find(|(name, _)| *name == binding.name);
            let (_, buffer) = named.ok_or_else(|| {
                GpuError::Refused(format!("the kernel {} is bound to no {}", self.name, binding.name))
            })?;
            Ok(wgpu::BindGroupEntry { binding: binding.number, resource: buffer.raw.as_entire_binding() })
        };
        let entries = self.bindings.iter().map(entry).collect::<Result<Vec<_>, GpuError>>()?;
        context.scoped(|device| {
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &self.layout,
                entries: &entries,
            })
        })
    }
}

/// One dispatch of a kernel.
#[derive(Clone, Copy)]
pub struct Dispatch<'a> {
    /// Kernel.
    pub kernel: &'a Kernel,
    /// On what.
    pub bound: &'a wgpu::BindGroup,
    /// Number of workgroups.
    pub workgroups: u32,
    /// Bytes that it reads and writes, each element once, twice where it does both [B].
    pub bytes: u64,
}

impl Dispatch<'_> {
    /// Records it in `pass`.
    pub fn record(&self, pass: &mut wgpu::ComputePass<'_>) {
        if self.workgroups == 0 {
            return;
        }
        let [x, y] = fold(self.workgroups);
        pass.set_pipeline(&self.kernel.pipeline);
        pass.set_bind_group(0, self.bound, &[]);
        pass.dispatch_workgroups(x, y, 1);
    }
}

impl Context {
    /// Records `dispatches`, in order: in one pass, unless they are timed.
    pub(super) fn record<'a>(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        dispatches: impl IntoIterator<Item = Dispatch<'a>>,
    ) {
        if let Some(stopwatch) = &self.stopwatch {
            return stopwatch.record(&self.device, encoder, dispatches);
        }
        let mut pass = encoder.begin_compute_pass(&Default::default());
        dispatches.into_iter().for_each(|dispatch| dispatch.record(&mut pass));
    }
}

/// Most workgroups that one dimension of a dispatch may have: WebGPU's default limit.
pub const WORKGROUPS_PER_DIMENSION: u32 = 65_535;

/// Least two-dimensional grid of workgroups with at least `workgroups` of them, as square as the fold demands.
#[must_use]
pub fn fold(workgroups: u32) -> [u32; 2] {
    let rows = workgroups.div_ceil(WORKGROUPS_PER_DIMENSION).max(1);
    [workgroups.div_ceil(rows), rows]
}

/// A buffer on the device that kernels bind and the host fills and reads.
pub struct StorageBuffer {
    pub(super) raw: wgpu::Buffer,
}

impl StorageBuffer {
    /// A buffer of `bytes` bytes, at least 16 (an empty binding is not allowed).
    ///
    /// # Errors
    /// When it exceeds what one binding reaches, or memory.
    pub fn new(context: &Context, what: &'static str, bytes: u64) -> Result<Self, GpuError> {
        Self::with_usage(context, what, bytes, wgpu::BufferUsages::STORAGE)
    }

    /// A uniform buffer that holds `values`.
    ///
    /// # Errors
    /// When memory is exhausted.
    pub fn uniform<T: Pod>(context: &Context, what: &'static str, values: &[T]) -> Result<Self, GpuError> {
        let buffer = Self::with_usage(context, what, size_of_val(values) as u64, wgpu::BufferUsages::UNIFORM)?;
        buffer.write(context, values);
        Ok(buffer)
    }

    /// A buffer that holds `values`.
    ///
    /// # Errors
    /// When it exceeds what one binding reaches, or memory.
    pub fn from_slice<T: Pod>(context: &Context, what: &'static str, values: &[T]) -> Result<Self, GpuError> {
        let buffer = Self::new(context, what, size_of_val(values) as u64)?;
        buffer.write(context, values);
        Ok(buffer)
    }

    fn with_usage(
        context: &Context,
        what: &'static str,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<Self, GpuError> {
        let limit = context.binding_limit();
        if bytes > limit {
            return Err(GpuError::TooLarge { what, needed: bytes, limit });
        }
        let raw = context.scoped(|device| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(what),
                size: bytes.next_multiple_of(4).max(16),
                usage: usage | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        })?;
        Ok(Self { raw })
    }

    /// Size [B].
    #[must_use]
    pub fn size(&self) -> u64 {
        self.raw.size()
    }

    /// Copies `values` to the buffer's start, before the next submission.
    pub fn write<T: Pod>(&self, context: &Context, values: &[T]) {
        if !values.is_empty() {
            context.queue.write_buffer(&self.raw, 0, bytemuck::cast_slice(values));
        }
    }

    /// Fills the first `bytes` bytes with [`POISON`], before the next submission.
    #[cfg(test)]
    pub fn poison(&self, context: &Context, bytes: u64) {
        let bytes = usize::try_from(bytes.min(self.size())).unwrap_or(usize::MAX) / 4 * 4;
        context.queue.write_buffer(&self.raw, 0, &vec![POISON; bytes]);
    }

    /// Records that the first `bytes` bytes become zero.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder, bytes: u64) {
        encoder.clear_buffer(&self.raw, 0, Some(bytes));
    }

    /// Reads the first `count` elements. Submits, and waits.
    ///
    /// # Errors
    /// When the device fails.
    pub fn read<T: Pod>(&self, context: &Context, count: usize) -> Result<Vec<T>, GpuError> {
        let bytes = (count * size_of::<T>()) as u64;
        let staging = Staging::new(context, bytes)?;
        let mut encoder = context.device.create_command_encoder(&Default::default());
        staging.record(&mut encoder, &[(self, bytes)]);
        let submission = context.queue.submit([encoder.finish()]);
        staging.take(context, &submission, bytes, bytemuck::pod_collect_to_vec)
    }
}

/// A buffer that the host maps, filled from storage buffers one behind the other.
pub struct Staging {
    raw: wgpu::Buffer,
}

impl Staging {
    /// Room for `bytes` bytes.
    ///
    /// # Errors
    /// When memory is exhausted.
    pub fn new(context: &Context, bytes: u64) -> Result<Self, GpuError> {
        let raw = context.scoped(|device| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("staging"),
                size: bytes.next_multiple_of(8).max(16),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })?;
        Ok(Self { raw })
    }

    /// Records copies of the first bytes of `sources`, one behind the other.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, sources: &[(&StorageBuffer, u64)]) {
        let mut offset = 0;
        for (source, bytes) in sources {
            encoder.copy_buffer_to_buffer(&source.raw, 0, &self.raw, offset, *bytes);
            offset += bytes;
        }
    }

    /// Records a copy of the first `bytes` bytes of `source` to `place`.
    pub fn copy(&self, encoder: &mut wgpu::CommandEncoder, place: u64, source: &StorageBuffer, bytes: u64) {
        self.copy_from(encoder, place, (source, 0), bytes);
    }

    /// Records a copy of `bytes` bytes of a buffer, from an offset on, to `place`.
    pub fn copy_from(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        place: u64,
        (source, offset): (&StorageBuffer, u64),
        bytes: u64,
    ) {
        encoder.copy_buffer_to_buffer(&source.raw, offset, &self.raw, place, bytes);
    }

    /// Waits for `submission` and hands the first `bytes` bytes to `use_bytes`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn take<T>(
        &self,
        context: &Context,
        submission: &wgpu::SubmissionIndex,
        bytes: u64,
        use_bytes: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, GpuError> {
        let view = context.map(&self.raw, bytes.next_multiple_of(4), submission)?;
        let used = use_bytes(&view);
        drop(view);
        self.raw.unmap();
        Ok(used)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folding_covers_every_workgroup_and_stays_within_the_limit() {
        for workgroups in [1, 2, 65_534, 65_535, 65_536, 131_070, 131_071, 1 << 24, u32::MAX >> 1] {
            let [x, y] = fold(workgroups);
            assert!(x <= WORKGROUPS_PER_DIMENSION, "{workgroups}");
            assert!(u64::from(x) * u64::from(y) >= u64::from(workgroups), "{workgroups}");
            assert!(u64::from(x) * u64::from(y) < u64::from(workgroups) + u64::from(y), "{workgroups}: no wasted row");
        }
        assert_eq!(fold(65_535), [65_535, 1]);
    }
}
