//! Triangles of the links' shapes, for pictures.

use super::Pose;
use crate::object;
use crate::scene::{LinkForm, LinkShape};
use glam::{DAffine3, DMat3, DVec3};
use std::f64::consts::TAU;

/// Sides of a cylinder: its surface is met to 0.12 % of the radius.
const SIDES: usize = 64;

/// Parts of an edge of the icosahedron that stands for a sphere: it is met to 0.4 % of the radius.
const DIVISIONS: usize = 8;

/// Faces of a box, whose corner k has the upper x, y and z where bit 0, 1 and 2 of k are set.
const FACES: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// Nodes (m) and triangles, outward.
pub type Triangles = (Vec<DVec3>, Vec<[u32; 3]>);

/// Returns the surface of a shape in its link's frame; an empty one for a sphere that is none.
#[must_use]
pub fn shape_triangles(shape: &LinkShape) -> Triangles {
    let (mut nodes, triangles) = match &shape.form {
        LinkForm::Box(size) => block(*size),
        LinkForm::Cylinder { radius, length } => cylinder(*radius, *length),
        LinkForm::Sphere(radius) => sphere(*radius),
        LinkForm::Surface(surface) => (surface.nodes.clone(), surface.triangles.clone()),
    };
    nodes.iter_mut().for_each(|node| *node = shape.place.transform_point3(*node));
    (nodes, triangles)
}

/// Returns where the frame of `shape` is, with the arm at `pose`.
#[must_use]
pub fn shape_frame(joint: Option<usize>, pose: &Pose) -> DAffine3 {
    let of =
        |joint: usize| Some(DAffine3::from_mat3_translation(*pose.rotations.get(joint)?, *pose.origins.get(joint)?));
    joint.and_then(of).unwrap_or(DAffine3::from_mat3_translation(DMat3::IDENTITY, DVec3::ZERO))
}

/// Returns a box about the origin, edges (m) along the axes.
#[must_use]
pub fn block(size: DVec3) -> Triangles {
    let corner =
        |k: u32| 0.5 * size * DVec3::from_array([0, 1, 2].map(|bit| if k >> bit & 1 == 1 { 1.0 } else { -1.0 }));
    let triangles = FACES.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    ((0..8).map(corner).collect(), triangles.collect())
}

/// Returns a cylinder about the origin, along z (m).
#[must_use]
pub fn cylinder(radius: f64, length: f64) -> Triangles {
    let mut nodes = vec![DVec3::Z * -0.5 * length, DVec3::Z * 0.5 * length];
    for side in 0..SIDES {
        let (sin, cos) = (TAU * side as f64 / SIDES as f64).sin_cos();
        nodes.extend([-0.5, 0.5].map(|end| DVec3::new(radius * cos, radius * sin, end * length)));
    }
    let rim = |side: usize, end: u32| 2 + 2 * (side % SIDES) as u32 + end;
    let triangles = (0..SIDES).flat_map(|side| {
        let [a, b] = [0, 1].map(|end| rim(side, end));
        let [c, d] = [0, 1].map(|end| rim(side + 1, end));
        [[a, c, d], [a, d, b], [0, c, a], [1, b, d]]
    });
    (nodes, triangles.collect())
}

/// Returns a sphere about the origin; an empty surface for a radius (m) that is none.
#[must_use]
pub fn sphere(radius: f64) -> Triangles {
    object::icosphere(DVec3::ZERO, radius, DIVISIONS).unwrap_or_default()
}

/// Returns a capsule about the origin, along z, `length` (m) between the middles of its spheres.
#[must_use]
pub fn capsule(radius: f64, length: f64) -> Triangles {
    let half = SIDES / 4;
    let mut nodes = [-1.0, 1.0].map(|end| end * (radius + 0.5 * length) * DVec3::Z).to_vec();
    // Rings from pole to pole; both spheres have one at their equator.
    for ring in 1..=2 * half {
        let (step, end) =
            if ring <= half { (ring as f64 - half as f64, -0.5) } else { ((ring - half - 1) as f64, 0.5) };
        let (sin, cos) = (0.25 * TAU * step / half as f64).sin_cos();
        for side in 0..SIDES {
            let (y, x) = (TAU * side as f64 / SIDES as f64).sin_cos();
            nodes.push(radius * DVec3::new(x * cos, y * cos, sin) + end * length * DVec3::Z);
        }
    }
    let rim = |ring: usize, side: usize| (2 + ring * SIDES + side % SIDES) as u32;
    let last = 2 * half - 1;
    let triangles = (0..SIDES).flat_map(|side| {
        let ends = [[0, rim(0, side + 1), rim(0, side)], [1, rim(last, side), rim(last, side + 1)]];
        let sides = (0..last).flat_map(move |ring| {
            let [a, b, c, d] = [rim(ring, side), rim(ring, side + 1), rim(ring + 1, side), rim(ring + 1, side + 1)];
            [[a, b, d], [a, d, c]]
        });
        sides.chain(ends)
    });
    (nodes, triangles.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_closed_outward_and_have_the_area_and_volume_of_their_shape() {
        let corners = |(nodes, triangles): &Triangles| -> Vec<[DVec3; 3]> {
            triangles.iter().map(|triangle| triangle.map(|node| nodes[node as usize])).collect()
        };
        let area = |surface: &Triangles| -> f64 {
            corners(surface).iter().map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).length()).sum()
        };
        let volume =
            |surface: &Triangles| -> f64 { corners(surface).iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum() };
        let block = block(DVec3::new(0.1, 0.2, 0.3));
        assert!((area(&block) - 0.22).abs() < 1e-15 && (volume(&block) - 0.006).abs() < 1e-15);
        let cylinder = cylinder(0.1, 0.5);
        assert!((area(&cylinder) / (TAU * 0.1 * 0.5 + TAU * 0.01) - 1.0).abs() < 2e-3);
        assert!((volume(&cylinder) / (0.5 * TAU * 0.01 * 0.5) - 1.0).abs() < 2e-3);
        let capsule = capsule(0.1, 0.5);
        assert!((area(&capsule) / (TAU * 0.1 * 0.5 + 2.0 * TAU * 0.01) - 1.0).abs() < 3e-3, "{}", area(&capsule));
        assert!((volume(&capsule) / (0.5 * TAU * 0.01 * 0.5 + 2.0 / 3.0 * TAU * 1e-3) - 1.0).abs() < 4e-3);
        assert!((volume(&sphere(0.1)) / (2.0 / 3.0 * TAU * 1e-3) - 1.0).abs() < 2e-2);
    }
}
