//! Shapes of links as the device draws them.

use crate::{
    draw::colour::Colour,
    gpu::{Context, GpuError},
    proxy::{Pose, shape_frame, shape_triangles},
    scene::LinkShape,
};
use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DMat4, DVec3};

/// A corner of a flat triangle.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Corner {
    /// In the frame that moves it (m).
    place: [f32; 3],
    normal: [f32; 3],
    /// Number of the frame: 0 for what stands still, then the links.
    frame: u32,
}

/// The shapes of an arm: corners on the device.
pub struct Links {
    pub(super) corners: wgpu::Buffer,
    pub(super) count: u32,
    /// Whether each link has a shape.
    shaped: Vec<bool>,
}

/// Shapes to draw, with the arm somewhere.
pub struct DrawnLinks<'a> {
    /// The shapes.
    pub links: &'a Links,
    /// From each frame to the world, column by column.
    pub frames: Vec<[f32; 16]>,
    /// Their colour.
    pub colour: Colour,
}

/// Returns the corners of `shapes`.
fn corners(shapes: &[LinkShape]) -> Vec<Corner> {
    let mut corners = Vec::new();
    for shape in shapes {
        let (nodes, triangles) = shape_triangles(shape);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|node| nodes.get(node as usize).copied().unwrap_or(DVec3::ZERO));
            let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array();
            let frame = shape.joint.map_or(0, |joint| joint as u32 + 1);
            corners.extend([a, b, c].map(|place| Corner { place: place.as_vec3().to_array(), normal, frame }));
        }
    }
    corners
}

impl Links {
    /// Returns the shapes of an arm of `joints` joints; `None` where it has none.
    ///
    /// # Errors
    /// When the device refuses the buffer.
    pub fn new(context: &Context, shapes: &[LinkShape], joints: usize) -> Result<Option<Self>, GpuError> {
        let corners = corners(shapes);
        if corners.is_empty() {
            return Ok(None);
        }
        let contents = bytemuck::cast_slice(&corners);
        let usage = wgpu::BufferUsages::VERTEX;
        let buffer = context.scoped(|device| filled(device, &context.queue, "links", contents, usage))?;
        let shaped = (0..joints).map(|joint| shapes.iter().any(|shape| shape.joint == Some(joint))).collect();
        Ok(Some(Self { corners: buffer, count: corners.len() as u32, shaped }))
    }

    /// Returns whether the link of `joint` has a shape.
    #[must_use]
    pub fn is_shaped(&self, joint: usize) -> bool {
        self.shaped.get(joint).copied().unwrap_or(false)
    }

    /// Returns the shapes with the arm at `pose`.
    #[must_use]
    pub fn at(&self, pose: &Pose, colour: Colour) -> DrawnLinks<'_> {
        let frames = std::iter::once(None).chain((0..self.shaped.len()).map(Some));
        DrawnLinks { links: self, frames: frames.map(|joint| columns(shape_frame(joint, pose))).collect(), colour }
    }
}

fn columns(frame: DAffine3) -> [f32; 16] {
    DMat4::from(frame).as_mat4().to_cols_array()
}

/// A buffer that holds `contents`, of whole words. wgpu's own way to make one panics where the device is lost.
pub(super) fn filled(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    label: &str,
    contents: &[u8],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: contents.len() as u64,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    queue.write_buffer(&buffer, 0, contents);
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::LinkForm;

    #[test]
    fn corners_name_their_frame_and_stand_where_the_shape_does() {
        let shape = |joint, place| LinkShape { joint, place, form: LinkForm::Box(DVec3::splat(0.2)) };
        let shapes = [shape(None, DAffine3::IDENTITY), shape(Some(1), DAffine3::from_translation(DVec3::X))];
        let corners = corners(&shapes);
        assert_eq!(corners.len(), 2 * 36);
        assert!(corners[..36].iter().all(|corner| corner.frame == 0 && corner.place[0].abs() < 0.11));
        assert!(corners[36..].iter().all(|corner| corner.frame == 2 && (corner.place[0] - 1.0).abs() < 0.11));
        let frame = columns(DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0)));
        assert_eq!(frame[12..], [1.0, 2.0, 3.0, 1.0]);
    }
}
