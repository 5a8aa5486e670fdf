//! Results of consecutive grid points, as they are solved.

use super::table::PointResult;
use crate::contact::{Equilibrium, NodeForce, Status};
use crate::dataset::{Extras, RESULTS, Stored};
use crate::joint_matrix::{self, JointMatrix};
use bytemuck::NoUninit;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Columns of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Shape {
    pub joints: usize,
    pub surface_nodes: usize,
    pub extras: Extras,
}

impl Shape {
    /// Bytes of an entry of a column, of a point or a contact; 0 where it is not stored.
    pub fn bytes(self, array: Stored) -> usize {
        if self.extras.store(array) { array.bytes(self.joints) } else { 0 }
    }
}

/// Number of columns.
pub(super) const COLUMNS: usize = RESULTS.len();

/// Results of consecutive grid points: the bytes of each array of [`RESULTS`], in their order. Those of offsets hold the
/// end of each point's row of forces.
#[derive(Default)]
pub(super) struct Columns([Vec<u8>; COLUMNS]);

/// New results of single points, by number of the grid point: columns of one point each.
pub(super) type Replaced = BTreeMap<usize, Columns>;

/// Bytes of the columns of `points` points of `shape` with `contacts` in all.
pub(super) fn size(points: usize, shape: Shape, contacts: usize) -> usize {
    lengths(points, shape, contacts).into_iter().fold(0, usize::saturating_add)
}

/// The same, column by column.
pub(super) fn lengths(points: usize, shape: Shape, contacts: usize) -> [usize; COLUMNS] {
    RESULTS.map(|array| {
        let entries = if array.is_of_contacts() { contacts } else { points };
        entries.saturating_mul(shape.bytes(array))
    })
}

impl Columns {
    /// The columns, in the order of [`RESULTS`].
    pub fn bytes(&self) -> [&[u8]; COLUMNS] {
        self.0.each_ref().map(Vec::as_slice)
    }

    /// No points, in the room there is.
    pub fn clear(&mut self) {
        self.0.iter_mut().for_each(Vec::clear);
    }

    /// Adds the equilibrium of the next point.
    ///
    /// A result that no file may hold (a number that is not finite, torques of another chain, nodes that the surface
    /// does not have or out of order, a slip that is asked for and not there) becomes an unconverged point without
    /// torque and forces, of residual 1: the empty answer, which balances nothing.
    pub fn push(&mut self, equilibrium: &Equilibrium, shape: Shape) {
        let result = PointResult::of(equilibrium);
        let are_sound = |forces: &[NodeForce]| {
            forces.is_sorted_by(|a, b| a.node < b.node) && forces.iter().all(|on| on.force.as_vec3().is_finite())
        };
        let is_sound = result.torque.len() == shape.joints
            && result.torque.is_finite()
            && result.energy.is_finite()
            && result.gap.is_finite()
            && result.residual.is_finite()
            && are_sound(&equilibrium.forces)
            && equilibrium.forces.last().is_none_or(|last| (last.node as usize) < shape.surface_nodes)
            && equilibrium.slip.map_or(!shape.extras.slip || equilibrium.touches.is_empty(), |slip| slip.is_finite());
        if !is_sound {
            let gap = if result.gap.is_finite() { result.gap } else { 0.0 };
            let empty =
                PointResult { status: Status::Unconverged, residual: 1.0, ..PointResult::free(shape.joints, gap) };
            let empty = PointResult { iterations: result.iterations, ..empty };
            return self.add_point(&empty, None, shape);
        }
        self.add_point(&result, Some(equilibrium), shape);
    }

    /// Adds a point at which nothing touches and nothing was solved, with a lower bound of its gap (m).
    pub fn push_free(&mut self, gap: f32, shape: Shape) {
        self.add_point(&PointResult::free(shape.joints, gap), None, shape);
    }

    /// Adds a point, which was solved as `equilibrium` where it was.
    fn add_point(&mut self, result: &PointResult, equilibrium: Option<&Equilibrium>, shape: Shape) {
        let tangent = equilibrium.and_then(|found| found.tangent);
        let tangent = tangent.filter(|tangent| tangent.as_flattened().iter().all(|entry| entry.is_finite()));
        let slip = equilibrium.and_then(|found| found.slip).unwrap_or_default();
        let forces = equilibrium.map_or(&[][..], |found| &found.forces);
        let triangle = |matrix: &JointMatrix| -> Vec<f32> {
            joint_matrix::lower(matrix, shape.joints).map(|entry| entry as f32).collect()
        };
        for array in RESULTS.into_iter().filter(|array| shape.extras.store(*array)) {
            match array {
                Stored::Torque => self.add(array, &result.torque),
                Stored::Energy => self.add(array, &[result.energy]),
                Stored::Tangent => self.add(array, &triangle(&tangent.unwrap_or_default())),
                Stored::NormalForce => self.add(array, &[slip.normal_force as f32]),
                Stored::SlipJacobian => self.add(array, &triangle(&slip.jacobian)),
                Stored::Gap => self.add(array, &[result.gap]),
                Stored::Status => self.add(array, &[result.status as u8]),
                Stored::Residual => self.add(array, &[result.residual]),
                Stored::Iterations => self.add(array, &[result.iterations]),
                Stored::ContactOffsets => {
                    let before = self.0[Stored::ContactNodes as usize].len() / size_of::<u32>();
                    self.add(array, &[(before + forces.len()) as u64]);
                }
                Stored::ContactNodes => forces.iter().for_each(|on| self.add(array, &[on.node])),
                Stored::ContactForces => forces.iter().for_each(|on| self.add(array, &on.force.as_vec3().to_array())),
                Stored::SurfaceNodes
                | Stored::SurfaceTriangles
                | Stored::InnerNodes
                | Stored::Tetrahedra
                | Stored::MidNodes
                | Stored::Regions => {}
            }
        }
    }

    /// Adds numbers to a column.
    fn add<T: NoUninit>(&mut self, array: Stored, numbers: &[T]) {
        self.0[array as usize].extend_from_slice(bytemuck::cast_slice(numbers));
    }
}
