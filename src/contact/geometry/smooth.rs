//! The smooth contact surface: which nodes bend each facet, and how.
//!
//! The middle of an edge ab stands where one step of the butterfly scheme would put a node (Dyn, Levin & Gregory, A butterfly subdivision
//! scheme for surface interpolation with tension control, 1990): `(a + b)/2 + (c + d)/8 - (e + f + g + h)/16`, c and d being the corners across
//! the edge and e to h those across the other edges of its two triangles. So the sagitta of an edge is a linear function of eight
//! nodes, a facet of twelve, and the surface passes through all nodes of the mesh. Where a smooth surface with edges of length h
//! is sampled, normals of neighbouring facets differ by O(h^2) at their edge, instead of by O(h) as those of flat facets do.

use super::facet::{Direction, Facet, MOST_BUBBLES, bubble_slopes, bubbles};
use crate::object::Topology;
use glam::DVec3;

/// Nodes on which a bent facet depends: its corners, the corners across its edges, and for each edge the two across the other
/// edges of the triangle there.
pub const CARRIERS: usize = 12;

/// Weight of the corners across an edge in its sagitta.
const ACROSS: f64 = 1.0 / 8.0;

/// Weight of the corners beyond.
const BEYOND: f64 = -1.0 / 16.0;

/// The facets' nodes.
pub struct SmoothSurface {
    /// Of each triangle: corners 0 to 2, across edge k 3 + k, beyond that 6 + 2 k and 7 + 2 k.
    pub nodes: Vec<[u32; CARRIERS]>,
}

impl SmoothSurface {
    /// Prepares the smooth surface through the nodes of a closed mesh.
    #[must_use]
    pub fn new(triangles: &[[u32; 3]], topology: &Topology) -> Self {
        let nodes = |t: usize| {
            let mut nodes = [0; CARRIERS];
            nodes[..3].copy_from_slice(&triangles[t]);
            for k in 0..3 {
                let (across, back) = across(triangles, topology, t, k);
                nodes[3 + k] = triangles[across][(back + 2) % 3];
                for side in 0..2 {
                    let (beyond, back) = self::across(triangles, topology, across, (back + 1 + side) % 3);
                    nodes[6 + 2 * k + side] = triangles[beyond][(back + 2) % 3];
                }
            }
            nodes
        };
        Self { nodes: (0..triangles.len()).map(nodes).collect() }
    }

    /// Returns facet `t` with nodes at `positions` [m].
    #[inline]
    #[must_use]
    pub fn facet(&self, positions: &[DVec3], t: u32) -> Facet {
        let nodes = &self.nodes[t as usize];
        let at = |j: usize| positions[nodes[j] as usize];
        let (corners, opposite) = ([at(0), at(1), at(2)], [at(3), at(4), at(5)]);
        let mut sagittas = [DVec3::ZERO; 3];
        for (k, sagitta) in sagittas.iter_mut().enumerate() {
            let (next, last) = ((k + 1) % 3, (k + 2) % 3);
            let beyond = opposite[next] + opposite[last] + at(6 + 2 * k) + at(7 + 2 * k);
            *sagitta = (corners[last] + opposite[k]) * ACROSS + beyond * BEYOND;
        }
        Facet { corners, sagittas: Some(sagittas) }
    }

    /// Returns by how much the facets stand off the flat triangles at most, with nodes at `positions` [m].
    #[must_use]
    pub fn bulge(&self, positions: &[DVec3]) -> f64 {
        let longest = |t: usize| {
            let sagittas = self.facet(positions, t as u32).sagittas.into_iter().flatten();
            sagittas.map(|sagitta| sagitta.length()).fold(0.0, f64::max)
        };
        MOST_BUBBLES * (0..self.nodes.len()).map(longest).fold(0.0, f64::max)
    }

    /// Returns a bound of the square of what the facets stand off the flat triangles by, where `square` bounds that of a sagitta, given as the
    /// nodes that it depends on and their weights.
    pub fn bulge_squared(&self, square: impl Fn(&[(u32, f64)]) -> f64) -> f64 {
        let mut most = 0.0_f64;
        for nodes in &self.nodes {
            for k in 0..3 {
                let mut unit = [0.0; 3];
                unit[k] = 1.0;
                let weights = weights([0.0; 3], unit);
                let terms: [(u32, f64); CARRIERS] = std::array::from_fn(|j| (nodes[j], weights[j]));
                most = most.max(square(&terms));
            }
        }
        MOST_BUBBLES * MOST_BUBBLES * most
    }
}

/// Returns the triangle across edge `k` of triangle `t`, and which of its edges that is.
pub fn across(triangles: &[[u32; 3]], topology: &Topology, t: usize, k: usize) -> (usize, usize) {
    let across = topology.across[t][k] as usize;
    let end = triangles[t][(k + 1) % 3];
    (across, triangles[across].iter().position(|&corner| corner == end).unwrap_or(0))
}

/// Returns the weights of a facet's nodes in a sum of its corners and of its sagittas with these factors.
#[inline]
fn weights(corners: [f64; 3], sagittas: [f64; 3]) -> [f64; CARRIERS] {
    let mut weights = [0.0; CARRIERS];
    for k in 0..3 {
        let (next, last) = ((k + 1) % 3, (k + 2) % 3);
        weights[k] = corners[k] + ACROSS * sagittas[next];
        weights[3 + k] = ACROSS * sagittas[k] + BEYOND * (sagittas[next] + sagittas[last]);
        weights[6 + 2 * k] = BEYOND * sagittas[k];
        weights[7 + 2 * k] = BEYOND * sagittas[k];
    }
    weights
}

/// Returns the weights of a facet's nodes in its point at barycentric weights `w` [1].
#[inline]
#[must_use]
pub fn point_weights(w: [f64; 3]) -> [f64; CARRIERS] {
    weights(w, bubbles(w))
}

/// Returns their derivative at `w` along `d`.
#[inline]
#[must_use]
pub fn point_slopes(w: [f64; 3], d: Direction) -> [f64; CARRIERS] {
    weights(d, bubble_slopes(w, d))
}
