//! Normals of the deformed faceted surface.
//!
//! Inside or outside is decided by the angle-weighted pseudonormal of the closest feature (Baerentzen & Aanaes, Signed
//! distance computation using the angle weighted pseudonormal, 2005): the face's normal, the sum of the two faces'
//! normals at an edge, and the sum over the faces around a vertex weighted by their angles there. The sign of its inner
//! product with x - p is right for every closed surface, sharp edges included, where any single face's normal would
//! fail.

use super::closest_point::Feature;
use crate::contact::MINIMUM_SQUARE;
use crate::object::Topology;
use glam::DVec3;

/// Corner positions of triangle `t`.
#[inline]
#[must_use]
pub fn corners(positions: &[DVec3], [a, b, c]: [u32; 3]) -> [DVec3; 3] {
    [positions[a as usize], positions[b as usize], positions[c as usize]]
}

/// Mean length of the triangles' edges (m).
#[must_use]
pub fn mean_edge(positions: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let around = |[a, b, c]: [DVec3; 3]| a.distance(b) + b.distance(c) + c.distance(a);
    let sum: f64 = triangles.iter().map(|&nodes| around(corners(positions, nodes))).sum();
    sum / (3.0 * triangles.len() as f64)
}

/// Twice the area times the outward unit normal of a triangle (m^2).
#[must_use]
pub fn area_vector(corners: [DVec3; 3]) -> DVec3 {
    (corners[1] - corners[0]).cross(corners[2] - corners[0])
}

/// `vector` scaled to length one; a vector too short to have a direction becomes zero.
#[must_use]
pub fn unit_or_zero(vector: DVec3) -> DVec3 {
    let square = vector.length_squared();
    if square > MINIMUM_SQUARE { vector / square.sqrt() } else { DVec3::ZERO }
}

/// Pseudonormal of a feature of triangle `t`, outward, not of length one.
#[must_use]
pub fn pseudonormal(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    topology: &Topology,
    t: usize,
    feature: Feature,
) -> DVec3 {
    let normal = |t: usize| unit_or_zero(area_vector(corners(positions, triangles[t])));
    match feature {
        Feature::Face => normal(t),
        Feature::Edge(k) => normal(t) + normal(topology.across[t][k] as usize),
        Feature::Vertex(k) => {
            let node = triangles[t][k];
            let mut sum = DVec3::ZERO;
            for &around in topology.triangles_around(node as usize) {
                let around = around as usize;
                sum += normal(around) * corner_angle(positions, triangles[around], node);
            }
            sum
        }
    }
}

/// Outward unit normal of the surface at `node`: mean of the normals of the triangles around it, weighted by their
/// areas.
#[must_use]
pub fn vertex_normal(positions: &[DVec3], triangles: &[[u32; 3]], topology: &Topology, node: u32) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for &t in topology.triangles_around(node as usize) {
        sum += area_vector(corners(positions, triangles[t as usize]));
    }
    unit_or_zero(sum)
}

/// Returns how often the surface winds around `x`: the solid angles of all triangles over 4 pi (Van Oosterom & Strackee
/// 1983). One inside, zero outside; it changes nowhere but on the surface, also where deformation has folded that over
/// itself (1).
#[cfg(test)]
#[must_use]
pub fn winding_number(positions: &[DVec3], triangles: &[[u32; 3]], x: DVec3) -> f64 {
    let mut sum = 0.0;
    for triangle in triangles {
        let [a, b, c] = corners(positions, *triangle).map(|corner| corner - x);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        sum += a.dot(b.cross(c)).atan2(below);
    }
    sum / std::f64::consts::TAU
}

/// Angle of a triangle at its corner `node` (rad).
fn corner_angle(positions: &[DVec3], triangle: [u32; 3], node: u32) -> f64 {
    let k = triangle.iter().position(|&corner| corner == node).unwrap_or(0);
    let [a, b, c] = corners(positions, triangle);
    let (apex, left, right) = [(a, b, c), (b, c, a), (c, a, b)][k];
    let (left, right) = (left - apex, right - apex);
    left.cross(right).length().atan2(left.dot(right))
}
