//! Rounded cones as the device draws them: links, nodes, force arrows.

use crate::draw::solid::Cone;
use bytemuck::{Pod, Zeroable};

/// A [`Cone`] on the device.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Shape {
    /// End (m) and its radius (m).
    tail: [f32; 4],
    head: [f32; 4],
    /// Gamma-encoded red, green, blue from 0 to 1, and how much of it takes light.
    colour: [f32; 4],
    /// One more than the node of the object that it is anchored to; 0 for none.
    anchor: u32,
}

impl From<&Cone> for Shape {
    fn from(cone: &Cone) -> Self {
        let end = |k: usize| cone.ends[k].as_vec3().extend(cone.radii[k] as f32).to_array();
        let [red, green, blue] = cone.colour.channels();
        Self { tail: end(0), head: end(1), colour: [red, green, blue, 1.0], anchor: 0 }
    }
}

impl Shape {
    /// The same in its plain colour, whatever the light.
    #[must_use]
    pub fn unlit(mut self) -> Self {
        self.colour[3] = 0.0;
        self
    }

    /// The same, moved by whatever node `node` of the object is displaced by.
    #[must_use]
    pub fn anchored(mut self, node: usize) -> Self {
        self.anchor = node as u32 + 1;
        self
    }
}

/// The unit shape: points of the unit sphere and which end they belong to, as triangles.
pub(super) fn unit_shape() -> Vec<[f32; 4]> {
    const AROUND: usize = 20;
    const FROM_POLE_TO_EQUATOR: usize = 6;
    // Rows of a sphere cut at its equator: the lower half hangs on the tail, the upper on the head.
    let mut rows = Vec::new();
    for (end, start) in [(0.0f32, -1.0f32), (1.0, 0.0)] {
        for k in 0..=FROM_POLE_TO_EQUATOR {
            let latitude = std::f32::consts::FRAC_PI_2 * (start + k as f32 / FROM_POLE_TO_EQUATOR as f32);
            rows.push((latitude, end));
        }
    }
    let point = |row: usize, column: usize| {
        let (latitude, end) = rows[row];
        let longitude = std::f32::consts::TAU * (column % AROUND) as f32 / AROUND as f32;
        [latitude.cos() * longitude.cos(), latitude.cos() * longitude.sin(), latitude.sin(), end]
    };
    let mut triangles = Vec::new();
    for row in 0..rows.len() - 1 {
        for column in 0..AROUND {
            let [a, b] = [point(row, column), point(row, column + 1)];
            let [c, d] = [point(row + 1, column), point(row + 1, column + 1)];
            triangles.extend([a, b, d, a, d, c]);
        }
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn the_unit_shape_is_closed_and_of_unit_radius() {
        let points = unit_shape();
        assert_eq!(points.len() % 3, 0);
        let mut volume = 0.0;
        for corners in points.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|k| Vec3::from_slice(&corners[k][..3]));
            for corner in [a, b, c] {
                assert!((corner.length() - 1.0).abs() < 1e-5);
            }
            volume += a.dot(b.cross(c)) / 6.0;
        }
        let ball = 4.0 / 3.0 * std::f32::consts::PI;
        assert!((volume.abs() / ball - 1.0).abs() < 0.05, "{volume}");
    }
}
