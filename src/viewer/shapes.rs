//! Rounded cones, drawn besides the surface: links, nodes, force arrows, axes.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// A rounded cone between two ends.
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

/// An arrow over the radius of its shaft (1): length below which it is not seen for the ball at its tail; length and
/// radius of its head. And the head's greatest share of the whole (1).
const LEAST_ARROW: f32 = 2.0;
const HEAD_LENGTH: f32 = 5.0;
const HEAD_RADIUS: f32 = 2.2;
const HEAD_SHARE: f32 = 0.6;

/// Red, green, blue, gamma-encoded, from 0 to 1.
pub type Colour = [f32; 3];

impl Shape {
    /// A ball.
    #[must_use]
    pub fn ball(centre: Vec3, radius: f32, colour: Colour) -> Self {
        Self::capsule(centre, centre, radius, colour)
    }

    /// A rod with round ends.
    #[must_use]
    pub fn capsule(from: Vec3, to: Vec3, radius: f32, colour: Colour) -> Self {
        Self::cone(from, to, [radius, radius], colour)
    }

    /// A rod whose radius goes from the first to the second number.
    #[must_use]
    pub fn cone(from: Vec3, to: Vec3, radii: [f32; 2], colour: Colour) -> Self {
        let [red, green, blue] = colour;
        Self {
            tail: from.extend(radii[0]).to_array(),
            head: to.extend(radii[1]).to_array(),
            colour: [red, green, blue, 1.0],
            anchor: 0,
        }
    }

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

    /// An arrow from `tail` along `span`, with a shaft of the given radius; none for a span too short to show.
    #[must_use]
    pub fn arrow(tail: Vec3, span: Vec3, radius: f32, colour: Colour) -> Vec<Self> {
        let length = span.length();
        if length < LEAST_ARROW * radius {
            return Vec::new();
        }
        let head_length = (HEAD_LENGTH * radius).min(HEAD_SHARE * length);
        let neck = tail + span * (1.0 - head_length / length);
        vec![
            Self::capsule(tail, neck, radius, colour),
            Self::cone(neck, tail + span, [HEAD_RADIUS * radius, 0.0], colour),
        ]
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

    #[test]
    fn an_arrow_ends_where_its_span_ends_and_vanishes_with_it() {
        let arrow = Shape::arrow(Vec3::ONE, Vec3::X, 0.01, [1.0, 0.0, 0.0]);
        assert_eq!(arrow[1].head, [2.0, 1.0, 1.0, 0.0]);
        assert!(Shape::arrow(Vec3::ONE, Vec3::ZERO, 0.01, [1.0, 0.0, 0.0]).is_empty());
    }
}
