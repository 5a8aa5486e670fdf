//! The haptization dataset D(q) = {q, tau, Cvo, f_j} (equation (1)) over a uniform grid in C-space, in memory and on
//! disk.
//!
//! Per grid point: torque, stored energy, gap, status, residual, iterations. Contacts as compressed sparse rows:
//! those of point p are `contact_nodes[offsets[p]..offsets[p + 1]]` with `contact_forces` beside them.
//! Points are numbered with the last axis fastest.

mod column;
mod grid;

pub use column::Column;
pub use grid::{Axis, Grid};

use crate::contact::Status;

/// A dataset. Columns are owned (just baked) or lie in a mapped file (just opened); both read alike.
pub struct Dataset {
    pub grid: Grid,
    /// tau, joint fastest: entry `point * joints + joint` [N m].
    pub torque: Column<f64>,
    /// U [J]; absent in scanned datasets.
    pub energy: Option<Column<f64>>,
    /// Smallest signed distance of the proxy to the surface at rest [m]; absent in scanned datasets.
    pub gap: Option<Column<f32>>,
    /// [`Status`] as its number.
    pub status: Column<u8>,
    /// Relative residual [1]; absent in scanned datasets.
    pub residual: Option<Column<f32>>,
    /// Iterations of the contact solver; absent in scanned datasets.
    pub iterations: Option<Column<u32>>,
    /// Absent where the scene has no graphics, and in scanned datasets.
    pub contacts: Option<Contacts>,
    /// The object's surface at rest; absent in scanned datasets.
    pub surface: Option<Surface>,
    /// The scene's text; empty for scanned datasets without one.
    pub scene: String,
    pub provenance: Provenance,
}

/// Contact forces f_j on the object's nodes, compressed sparse rows.
pub struct Contacts {
    /// One more than there are points.
    pub offsets: Column<u64>,
    pub nodes: Column<u32>,
    /// Three numbers a contact [N].
    pub forces: Column<f32>,
}

/// The object's surface at rest.
pub struct Surface {
    /// Three numbers a node [m].
    pub nodes: Column<f64>,
    /// Three node numbers a triangle.
    pub triangles: Column<u32>,
}

/// Where a dataset comes from.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Provenance {
    /// Version of this crate.
    pub version: String,
    pub algorithm: String,
    /// Relative residual asked for [1].
    pub tolerance: f64,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Name of the adapter, or of the CPU backend's threads.
    pub adapter: String,
    /// Date of the bake, ISO 8601, UTC.
    pub date: String,
}

impl Dataset {
    /// Status of grid point `point`.
    #[must_use]
    pub fn status(&self, point: usize) -> Status {
        Status::from_number(self.status[point]).unwrap_or(Status::Outside)
    }

    /// tau of grid point `point` [N m].
    #[must_use]
    pub fn torque(&self, point: usize) -> &[f64] {
        let joints = self.grid.joints();
        &self.torque[point * joints..(point + 1) * joints]
    }
}
