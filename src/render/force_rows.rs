//! Contact forces of a dataset's grid points, copied out of its file: compressed rows, interpolated between the points.

use crate::dataset::{Contacts, Grid};
use glam::DVec3;

/// Contact forces on the nodes of the object, or on those of the proxy.
pub struct ForceRows {
    grid: Grid,
    /// One more than there are grid points.
    offsets: Vec<usize>,
    nodes: Vec<u32>,
    /// (N)
    forces: Vec<[f32; 3]>,
}

impl ForceRows {
    /// The forces `contacts` over `grid`, on `nodes` nodes; `None` where they do not fit, or the grid is none.
    pub fn new(grid: &Grid, contacts: &Contacts, nodes: usize) -> Option<Self> {
        let count = contacts.nodes.len();
        let offsets: Vec<usize> = contacts.offsets.iter().map(|&o| usize::try_from(o).unwrap_or(usize::MAX)).collect();
        let fits = grid.check().is_ok_and(|points| offsets.len() == points + 1)
            && offsets.is_sorted()
            && offsets.last() == Some(&count)
            && contacts.forces.len() == 3 * count
            && contacts.nodes.iter().all(|&node| (node as usize) < nodes)
            && contacts.forces.iter().all(|f| f.is_finite());
        let forces = || contacts.forces.as_chunks().0.to_vec();
        fits.then(|| Self { grid: grid.clone(), offsets, nodes: contacts.nodes.to_vec(), forces: forces() })
    }

    /// Calls `add` with each node that has a force at a corner of the cell around `q`: with the corner's weight times
    /// `share`, where that is above zero, and the force there (N).
    #[inline]
    pub(super) fn at(&self, q: &[f64], share: f64, mut add: impl FnMut(usize, f64, DVec3)) {
        for (point, weight) in self.grid.locate(q).corners() {
            let scale = share * weight;
            if scale > 0.0 {
                let row = self.offsets[point]..self.offsets[point + 1];
                for (&node, force) in self.nodes[row.clone()].iter().zip(&self.forces[row]) {
                    add(node as usize, scale, DVec3::from(force.map(f64::from)));
                }
            }
        }
    }
}
