//! One compute pipeline with its bindings.
//!
//! Group 0 holds all bindings. Their kinds and least sizes are read from the shader, and buffers are bound by the names
//! that it gives them.

use super::{
    buffer::StorageBuffer,
    compiled::{Binding, Compiled},
    context::Context,
    dispatch::fold,
    error::GpuError,
    shaders::Shader,
};
use std::sync::PoisonError;

/// A compute pipeline.
pub struct Kernel {
    /// The shader's, and that of its entry point where it has several.
    name: String,
    compiled: Compiled,
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
        let mut compiled = context.compiled.lock().unwrap_or_else(PoisonError::into_inner);
        let key = format!("{name} {overrides:?}");
        let compiled = match compiled.get(&key) {
            Some(compiled) => compiled.clone(),
            None => compiled.entry(key).insert_entry(Self::compile(context, shader, overrides)?).get().clone(),
        };
        Ok(Self { name, compiled })
    }

    fn compile(context: &Context, shader: &Shader, overrides: &[(&str, f64)]) -> Result<Compiled, GpuError> {
        let bindings = Binding::of(shader)?;
        context.scoped(|device| {
            let descriptor = wgpu::ShaderModuleDescriptor {
                label: Some(shader.name),
                source: wgpu::ShaderSource::Wgsl(shader.source().into()),
            };
            // Counting the passes of every loop costs a GPU a tenth of its speed.
            let bounded = !context.adapter().hardware;
            let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: bounded, ..Default::default() };
            // SAFETY: all loops of the shaders end, whatever they read: each counts up to a number, takes a bit off a
            // word, goes on to the next node of a tree whose nodes are numbered in the order in which it is searched,
            // or adds up its passes and ends at a limit. All other checks stay.
            let module = unsafe { device.create_shader_module_trusted(descriptor, checks) };
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
            Compiled { pipeline, layout, bindings }
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
        let entries = self.compiled.bindings.iter().map(entry).collect::<Result<Vec<_>, GpuError>>()?;
        context.scoped(|device| {
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &self.compiled.layout,
                entries: &entries,
            })
        })
    }

    /// Records in `pass` so many workgroups of it on what [`Self::bind`] gave.
    pub fn record(&self, pass: &mut wgpu::ComputePass<'_>, bound: &wgpu::BindGroup, workgroups: u32) {
        if workgroups == 0 {
            return;
        }
        let [x, y] = fold(workgroups);
        pass.set_pipeline(&self.compiled.pipeline);
        pass.set_bind_group(0, bound, &[]);
        pass.dispatch_workgroups(x, y, 1);
    }
}
