//! Buffers on the device: those that kernels bind, and those by which the host reads.

use super::{context::Context, error::GpuError};
use bytemuck::Pod;

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

    /// Size (B).
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
        staging.copy(&mut encoder, 0, self, bytes);
        let submission = context.queue.submit([encoder.finish()]);
        staging.take(context, &submission, bytes, bytemuck::pod_collect_to_vec)
    }
}

/// A buffer that the host maps, filled from storage buffers.
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
