//! A dataset's contents in a few numbers: for `info`, reports and tests.

use super::{Axis, Dataset, Provenance, store::Store};
use crate::contact::Status;
use serde::Serialize;

/// Key figures of a dataset.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// The grid's axes.
    pub axes: Vec<Axis>,
    /// Grid points, and how they divide by status.
    pub points: usize,
    /// By status.
    #[serde(flatten)]
    pub statuses: StatusCounts,
    /// Least and greatest trusted torque of each joint (0 included, as in free space) (N m or N).
    pub torque: Vec<[f64; 2]>,
    /// Greatest stored energy at a converged point (J).
    pub max_energy: Option<f64>,
    /// Greatest depth of a proxy node below the surface at rest; negative when none gets inside (m).
    pub max_depth: Option<f64>,
    /// Greatest residual of a converged point in contact (1).
    pub max_residual: Option<f64>,
    /// Stored contact forces, over all points.
    pub contacts: Option<usize>,
    /// Most contact forces at one point.
    pub max_contacts: Option<usize>,
    /// Greatest contact force on a node at a converged point (N).
    pub max_force: Option<f64>,
    /// Nodes and triangles of the object's surface.
    pub surface: Option<[usize; 2]>,
    /// Refinement of the grid.
    pub refinement: Option<Refinement>,
    /// Memory of all columns, and of what refines them (bytes).
    pub bytes: usize,
    /// Where the dataset comes from.
    pub provenance: Provenance,
}

/// Key figures of a store that refines a dataset.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Refinement {
    /// Nodes of each level, the grid's first.
    pub nodes: Vec<usize>,
    /// Memory (bytes).
    pub bytes: usize,
}

impl Refinement {
    fn of(store: &Store) -> Self {
        let mut nodes = vec![0; store.space().levels() as usize];
        store.nodes().for_each(|node| nodes[node.level as usize] += 1);
        Self { nodes, bytes: store.bytes() }
    }
}

/// Number of points of each status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct StatusCounts {
    /// [`Status::Free`].
    pub free: usize,
    /// [`Status::Contact`].
    pub contact: usize,
    /// [`Status::Unconverged`].
    pub unconverged: usize,
    /// [`Status::Overflow`].
    pub overflow: usize,
    /// [`Status::Outside`].
    pub outside: usize,
}

impl StatusCounts {
    /// Counts a point of `status`.
    pub fn add(&mut self, status: Status) {
        *match status {
            Status::Free => &mut self.free,
            Status::Contact => &mut self.contact,
            Status::Unconverged => &mut self.unconverged,
            Status::Overflow => &mut self.overflow,
            Status::Outside => &mut self.outside,
        } += 1;
    }

    /// Points at which something touches, converged or not.
    #[must_use]
    pub fn in_contact(&self) -> usize {
        self.contact + self.unconverged + self.overflow
    }
}

impl Dataset {
    /// Number of points of each status.
    #[must_use]
    pub fn status_counts(&self) -> StatusCounts {
        let mut counts = StatusCounts::default();
        (0..self.status.len()).for_each(|point| counts.add(self.status(point)));
        counts
    }

    /// Returns the key figures of the dataset.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let points = self.grid.points();
        let converged = || (0..points).filter(|&point| self.status(point) == Status::Contact);
        let mut torque = vec![[0.0_f64; 2]; self.grid.joints()];
        for point in converged() {
            for (range, &tau) in torque.iter_mut().zip(self.torque(point)) {
                *range = [range[0].min(tau), range[1].max(tau)];
            }
        }
        let force = |point| self.forces(point).map(|contact| contact.force.length()).fold(0.0, f64::max);
        let rows = self.contacts.as_ref().map(|contacts| contacts.offsets.windows(2).map(|pair| pair[1] - pair[0]));
        let refinement = self.refinement.as_deref().map(Refinement::of);
        Summary {
            axes: self.grid.axes.clone(),
            points,
            statuses: self.status_counts(),
            torque,
            max_energy: self.energy.as_ref().map(|energy| converged().map(|point| energy[point]).fold(0.0, f64::max)),
            max_depth: self.gap.as_ref().map(|gap| -f64::from(gap.iter().copied().fold(f32::INFINITY, f32::min))),
            max_residual: self
                .residual
                .as_ref()
                .map(|all| converged().map(|point| all[point].into()).fold(0.0, f64::max)),
            contacts: self.contacts.as_ref().map(|contacts| contacts.nodes.len()),
            max_contacts: rows.map(|rows| rows.max().unwrap_or(0) as usize),
            max_force: self.contacts.as_ref().map(|_| converged().map(force).fold(0.0, f64::max)),
            surface: self.surface.as_ref().map(|surface| [surface.nodes.len() / 3, surface.triangles.len() / 3]),
            bytes: super::file::bytes(self) + refinement.as_ref().map_or(0, |refinement| refinement.bytes),
            refinement,
            provenance: self.provenance.clone(),
        }
    }
}
