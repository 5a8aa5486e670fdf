//! The memory and disk that a sweep takes, stated before it begins.

use super::{chunks::BEHIND, tile::Shape};
use crate::{
    JointVector,
    contact::{CHUNKS_IN_FLIGHT, Equilibrium, NodeForce, Touch},
};

/// Memory and disk of a sweep. The object, its compliance and the backend's own buffers come on top: they do not grow
/// with the grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Footprint {
    /// Memory (bytes).
    pub memory: Bounds,
    /// The dataset on disk, its header aside; twice as much for a moment, while it is put together from its part. Zero
    /// for a sweep in memory (bytes).
    pub disk: Bounds,
}

/// From where nothing touches anywhere, to where every node of the proxy touches three nodes of the object everywhere.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Bounds {
    /// Nothing touches.
    pub least: usize,
    /// Everything touches.
    pub most: usize,
}

impl Bounds {
    /// Evaluates `bytes`, a function of the number of proxy nodes in contact at each point, at its two ends.
    pub(super) fn of(proxy_nodes: usize, bytes: impl Fn(usize) -> usize) -> Self {
        Self { least: bytes(0), most: bytes(proxy_nodes) }
    }
}

/// Results of `points` points at each of which `touching` nodes of the proxy touch (bytes).
pub(super) fn results(points: usize, touching: usize, shape: Shape) -> usize {
    let contacts = if shape.extras.forces { node_forces(touching, shape) } else { 0 };
    shape.size(points, points.saturating_mul(contacts))
}

/// Chunks on their way: `solved` configurations of each and their equilibria, and the columns of `points` points, and
/// of the chunks before that are being kept (bytes).
pub(super) fn chunk(solved: usize, points: usize, touching: usize, shape: Shape) -> usize {
    // Lists grow by doubling.
    let lists = 2 * (node_forces(touching, shape) * size_of::<NodeForce>() + touching * size_of::<Touch>());
    let each = size_of::<JointVector>() + size_of::<Equilibrium>() + lists;
    let contacts = if shape.extras.forces { 2 * solved.saturating_mul(node_forces(touching, shape)) } else { 0 };
    let kept = shape.size(points, contacts);
    let under_way = solved.saturating_mul(each).saturating_add(points.saturating_mul(size_of::<Option<f32>>()));
    under_way.saturating_mul(CHUNKS_IN_FLIGHT).saturating_add(kept.saturating_mul(1 + BEHIND))
}

/// Nodes of the object that `touching` nodes of the proxy touch.
fn node_forces(touching: usize, shape: Shape) -> usize {
    (3 * touching).min(shape.surface_nodes)
}
