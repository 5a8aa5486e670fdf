//! The haptization dataset D(q) = {q, tau, Cvo, f_j} (equation (1)) over a uniform grid in C-space, in memory and on
//! disk.
//!
//! Per grid point: torque, stored energy, gap, status, residual, iterations. Contacts as compressed sparse rows:
//! those of point p are `contact_nodes[offsets[p]..offsets[p + 1]]` with `contact_forces` beside them.
//! Points are numbered with the last axis fastest.

mod accuracy;
mod agreement;
mod atomic;
pub(crate) mod check;
mod column;
mod error;
mod export;
mod file;
mod grid;
mod known;
mod read;
mod stencil;
pub mod store;
mod stored;
mod summary;
mod surface;

pub use accuracy::{
    FrictionExcess, GeometryError, IdentifiedFriction, IdentifiedRelaxation, InterpolationError, MeasuredError,
};
pub(crate) use atomic::BUFFER;
pub use atomic::{Replacement, discard_unfinished, replace_file, resolved};
pub use column::Column;
pub use export::Format;
pub(crate) use file::{
    Contents as TensorContents, Element, Heading, PIECE_BUFFER, Tensor, check_place, may_be_dataset, surface_tensors,
    write_file,
};
pub use grid::{Axis, Grid, JointLabel};
pub use stencil::Stencil;
pub(crate) use stencil::corners;
pub(crate) use stored::{Extras, RESULTS, Source, Stored};
pub use summary::{Refinement, StatusCounts, Summary};

use crate::contact::{MeshRipple, NodeForce, Status};
use glam::DVec3;
use std::sync::Arc;

/// A dataset. Columns are owned (just baked) or lie in a mapped file (just opened); both read alike.
pub struct Dataset {
    /// The configurations q.
    pub grid: Grid,
    /// tau, joint fastest: entry `point * joints + joint` (N m).
    pub torque: Column<f64>,
    /// U (J); absent in scanned datasets.
    pub energy: Option<Column<f64>>,
    /// Lower triangle of the tangent d tau/d q, row by row: (0, 0), (1, 0), (1, 1) and so on, a point's entries side by
    /// side; zeros where nothing touches or there is no derivative. Absent where the interpolation does not use it, and
    /// in scanned datasets (N m/rad).
    pub tangent: Option<Column<f32>>,
    /// How the proxy slides on its contacts ([`crate::contact::Slip`]); absent where the scene names no friction, and in
    /// scanned datasets.
    pub slip: Option<SlipColumns>,
    /// Smallest signed distance of the proxy to the surface at rest (m); more than two grid steps away from every point
    /// in contact it may be a positive lower bound of that, where nothing was solved. Absent in scanned datasets.
    pub gap: Option<Column<f32>>,
    /// [`Status`] as its number.
    pub status: Column<u8>,
    /// Relative residual (1); absent in scanned datasets.
    pub residual: Option<Column<f32>>,
    /// Iterations of the contact solver; absent in scanned datasets.
    pub iterations: Option<Column<u32>>,
    /// On the object's nodes; absent where the scene has no graphics, and in scanned datasets.
    pub contacts: Option<Contacts>,
    /// The object's geometry at rest; absent in scanned datasets.
    pub surface: Option<Surface>,
    /// Nodes between the grid's points, and those on them from which the columns were taken; absent where the grid is
    /// all there is. Shared with those that solve more of it.
    pub refinement: Option<Arc<store::Store>>,
    /// The scene's text; empty for scanned datasets without one.
    pub scene: String,
    /// Where it comes from.
    pub provenance: Provenance,
}

/// Slip of the contacts at each grid point; zeros where nothing touches.
pub struct SlipColumns {
    /// N, sum of the normal forces, one number a point (N).
    pub normal_force: Column<f32>,
    /// Lower triangle of the symmetric B, row by row, a point's entries side by side (m/rad).
    pub jacobian: Column<f32>,
}

/// Contact forces on nodes of the object, f_j: compressed sparse rows.
pub struct Contacts {
    /// One more than there are points.
    pub offsets: Column<u64>,
    /// Nodes of the object's surface; ascending within a row.
    pub nodes: Column<u32>,
    /// Three numbers a contact (N).
    pub forces: Column<f32>,
}

/// The object's geometry at rest: its surface, and what is inside where the scene's mesh is one of tetrahedra.
#[derive(Clone)]
pub struct Surface {
    /// Three numbers a node (m).
    pub nodes: Column<f64>,
    /// Three node numbers a triangle.
    pub triangles: Column<u32>,
    /// The tetrahedra; absent where the object is made of its surface alone.
    pub solid: Option<Solid>,
}

/// Tetrahedra inside a surface.
#[derive(Clone)]
pub struct Solid {
    /// Nodes that are not on the surface, numbered behind those that are, three numbers each (m).
    pub inner_nodes: Column<f64>,
    /// Four node numbers a tetrahedron.
    pub tetrahedra: Column<u32>,
    /// Six more, of the nodes in the middles of its edges; empty where the edges are straight.
    pub mid_nodes: Column<u32>,
    /// Physical volume of each tetrahedron; empty where the mesh names none.
    pub regions: Column<u32>,
}

/// Where a dataset comes from.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Provenance {
    /// Version of this crate.
    pub version: String,
    /// How equation (2) was solved, as the scene names it.
    pub algorithm: String,
    /// Relative residual asked for (1).
    pub tolerance: f64,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Name of the adapter, or of the CPU's architecture (not its threads: their number changes nothing in the data).
    pub adapter: String,
    /// Date of the bake, ISO 8601, UTC.
    pub date: String,
    /// Notices of the run, such as a GPU that was lost and the grid point from which the CPU solved instead.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notices: Vec<String>,
    /// The error that the bake measured; absent where that was left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<MeasuredError>,
    /// How much a contact point feels the mesh; absent where nothing was solved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh_ripple: Option<MeshRipple>,
    /// How the measured object relaxes, where that was identified.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relaxation: Option<IdentifiedRelaxation>,
    /// Its friction, likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<IdentifiedFriction>,
    /// Where the grid was chosen for an error, that error: rms, over the rms of the torque (1).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aim: Option<f64>,
}

impl Dataset {
    /// Torque and status at every point of `grid`, and nothing else: no energy, no contacts, no surface, no scene.
    #[must_use]
    pub fn bare(grid: Grid, torque: impl Into<Column<f64>>, status: impl Into<Column<u8>>) -> Self {
        Self {
            grid,
            torque: torque.into(),
            energy: None,
            gap: None,
            status: status.into(),
            residual: None,
            iterations: None,
            tangent: None,
            contacts: None,
            slip: None,
            surface: None,
            refinement: None,
            scene: String::new(),
            provenance: Provenance::default(),
        }
    }

    /// Status of grid point `point`.
    #[must_use]
    pub fn status(&self, point: usize) -> Status {
        Status::from_number(self.status[point]).unwrap_or(Status::Outside)
    }

    /// tau of grid point `point` (N m).
    #[must_use]
    pub fn torque(&self, point: usize) -> &[f64] {
        let joints = self.grid.joints();
        &self.torque[point * joints..(point + 1) * joints]
    }

    /// Contact forces of grid point `point`, ascending by node; none where they are not stored (N).
    pub fn forces(&self, point: usize) -> impl ExactSizeIterator<Item = NodeForce> {
        let (nodes, forces) = self.contacts.as_ref().map_or((&[][..], &[][..]), |contacts| contacts.row(point));
        nodes.iter().zip(forces.chunks_exact(3)).map(|(&node, force)| NodeForce {
            node,
            force: DVec3::new(force[0].into(), force[1].into(), force[2].into()),
        })
    }
}

impl Contacts {
    /// Nodes and forces (three numbers each) of grid point `point`.
    #[must_use]
    pub fn row(&self, point: usize) -> (&[u32], &[f32]) {
        let (start, end) = (self.offsets[point] as usize, self.offsets[point + 1] as usize);
        (&self.nodes[start..end], &self.forces[3 * start..3 * end])
    }
}
