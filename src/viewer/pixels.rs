//! A texture read back as an image: for screenshots and tests only; the window never waits for the device.

use crate::gpu::{Context, GpuError};

/// Pixels of a texture of four bytes a pixel, row by row, without padding.
///
/// # Errors
/// When the device fails.
pub fn read(context: &Context, texture: &wgpu::Texture) -> Result<Vec<u8>, GpuError> {
    let size = texture.size();
    let row = 4 * size.width;
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let (buffer, commands) = context.scoped(|device| {
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("pixels"),
            size: u64::from(padded) * u64::from(size.height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None },
            },
            size,
        );
        (buffer, encoder.finish())
    })?;
    let submission = context.queue.submit([commands]);
    let view = context.map(&buffer, buffer.size(), &submission)?;
    Ok(view.chunks_exact(padded as usize).flat_map(|line| &line[..row as usize]).copied().collect())
}
