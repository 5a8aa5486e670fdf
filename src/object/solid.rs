//! A solid: tetrahedra on the nodes of an object, and what is tied to them.

use glam::DVec3;

/// Tetrahedra on the nodes of an object.
#[derive(Clone, Debug, Default)]
pub(super) struct Solid {
    /// Corners, in an order that makes [`volume`] positive.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Share of each that is filled with material (1).
    pub filled: Vec<f64>,
    /// Physical volume of each; empty if there are none.
    pub regions: Vec<u32>,
    /// Surface nodes tied to a point in a tetrahedron: node, corners, barycentric weights.
    pub ties: Vec<(u32, [u32; 4], [f64; 4])>,
    /// Stiffness of each tie, in units of Young's modulus (m).
    pub tie_length: f64,
}

/// Signed volume: a sixth of (b - a) . ((c - a) x (d - a)) (m^3).
pub(super) fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).dot((c - a).cross(d - a)) / 6.0
}

impl Solid {
    /// Each pair of nodes that act on each other, once.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges = Vec::with_capacity(6 * self.tetrahedra.len());
        let mut add = |a: u32, b: u32| edges.push([a.min(b), a.max(b)]);
        for corners in &self.tetrahedra {
            for a in 0..4 {
                (a + 1..4).for_each(|b| add(corners[a], corners[b]));
            }
        }
        for (node, corners, _) in &self.ties {
            corners.iter().for_each(|&corner| add(*node, corner));
        }
        edges.sort_unstable();
        edges.dedup();
        edges
    }
}
