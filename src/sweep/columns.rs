//! Results of consecutive grid points, as they are solved.

use super::table::PointResult;
use crate::contact::{Equilibrium, NodeForce, Status};
use crate::dataset::{Axes, CONTACTS, RESULTS, Stored};
use crate::joint_matrix::{self, JointMatrix};
use bytemuck::NoUninit;
use std::collections::BTreeMap;

/// Columns of a sweep.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    pub joints: usize,
    pub surface_nodes: usize,
    /// Whether contact forces on the object's nodes are stored.
    pub with_forces: bool,
    /// Whether tangents are stored.
    pub with_tangent: bool,
    /// Whether slips are stored.
    pub with_slip: bool,
}

impl Shape {
    /// Whether a column is stored.
    pub fn has(self, array: Stored) -> bool {
        match array {
            Stored::Tangent => self.with_tangent,
            Stored::NormalForce | Stored::SlipJacobian => self.with_slip,
            Stored::ContactOffsets | Stored::ContactNodes | Stored::ContactForces => self.with_forces,
            _ => true,
        }
    }

    /// Returns the number of entries in each column of fixed width.
    pub fn width(self) -> Width {
        Width { joints: self.joints, tangent: self.with_tangent, slip: self.with_slip }
    }
}

/// Numbers that each point has in the columns that do not have one a point.
#[derive(Clone, Copy)]
pub(super) struct Width {
    /// Torques.
    pub joints: usize,
    /// Whether tangents are stored.
    pub tangent: bool,
    /// Whether slips are stored.
    pub slip: bool,
}

impl Width {
    /// Numbers of an entry of a column, of a point or a contact. 0 where it is not stored.
    pub fn numbers(self, array: Stored) -> usize {
        match array.description().axes {
            Axes::Joints(_) => self.joints,
            Axes::Triangle(_) if array == Stored::Tangent => usize::from(self.tangent) * self.entries(),
            Axes::Triangle(_) => usize::from(self.slip) * self.entries(),
            Axes::Grid if array == Stored::NormalForce => self.slip.into(),
            Axes::Grid => 1,
            Axes::Own(axes) => axes.iter().skip(1).map(|(_, length)| length).product(),
        }
    }

    /// Entries of a symmetric matrix over the joints.
    fn entries(self) -> usize {
        joint_matrix::entries(self.joints)
    }

    /// Bytes of an entry of a column.
    pub fn bytes(self, array: Stored) -> usize {
        self.numbers(array) * array.description().dtype.bitsize() / 8
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

/// Bytes of the columns of `points` points of `width` with `contacts` in all.
pub(super) fn size(points: usize, width: Width, contacts: usize) -> usize {
    lengths(points, width, contacts).into_iter().fold(0, usize::saturating_add)
}

/// The same, column by column.
pub(super) fn lengths(points: usize, width: Width, contacts: usize) -> [usize; COLUMNS] {
    RESULTS.map(|array| {
        let entries = if array.is_of_contacts() { contacts } else { points };
        entries.saturating_mul(width.bytes(array))
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
        let on_object = if shape.with_forces { &equilibrium.forces[..] } else { &[] };
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
            && equilibrium.slip.map_or(!shape.with_slip || equilibrium.touches.is_empty(), |slip| slip.is_finite());
        if !is_sound {
            let gap = if result.gap.is_finite() { result.gap } else { 0.0 };
            let empty =
                PointResult { status: Status::Unconverged, residual: 1.0, ..PointResult::free(shape.joints, gap) };
            let empty = PointResult { iterations: result.iterations, ..empty };
            return self.add_point(&empty, [None, None], 0.0, &[], shape);
        }
        let tangent =
            equilibrium.tangent.filter(|tangent| tangent.as_flattened().iter().all(|entry| entry.is_finite()));
        let slip = equilibrium.slip.unwrap_or_default();
        self.add_point(&result, [tangent, Some(slip.jacobian)], slip.normal_force, on_object, shape);
    }

    /// Adds a point at which nothing touches and nothing was solved, with a lower bound of its gap (m).
    pub fn push_free(&mut self, gap: f32, shape: Shape) {
        self.add_point(&PointResult::free(shape.joints, gap), [None, None], 0.0, &[], shape);
    }

    /// Adds a point with its tangent and its slip Jacobian, zeros where there is none, its normal force and the forces
    /// on the object's nodes.
    fn add_point(
        &mut self,
        result: &PointResult,
        [tangent, slip_jacobian]: [Option<JointMatrix>; 2],
        normal_force: f64,
        forces: &[NodeForce],
        shape: Shape,
    ) {
        self.add(Stored::Torque, &result.torque);
        self.add(Stored::Energy, &[result.energy]);
        if shape.with_tangent {
            self.add_triangle(Stored::Tangent, tangent, shape);
        }
        if shape.with_slip {
            self.add(Stored::NormalForce, &[normal_force as f32]);
            self.add_triangle(Stored::SlipJacobian, slip_jacobian, shape);
        }
        self.add(Stored::Gap, &[result.gap]);
        self.add(Stored::Status, &[result.status as u8]);
        self.add(Stored::Residual, &[result.residual]);
        self.add(Stored::Iterations, &[result.iterations]);
        self.add_row(CONTACTS, forces);
    }

    /// Adds the lower triangle of a matrix over the joints, zeros where there is none.
    fn add_triangle(&mut self, array: Stored, matrix: Option<JointMatrix>, shape: Shape) {
        let matrix = matrix.unwrap_or_default();
        let entries: Vec<f32> = joint_matrix::lower(&matrix, shape.joints).map(|entry| entry as f32).collect();
        self.add(array, &entries);
    }

    /// Adds numbers to a column.
    fn add<T: NoUninit>(&mut self, array: Stored, numbers: &[T]) {
        self.0[array as usize].extend_from_slice(bytemuck::cast_slice(numbers));
    }

    /// Adds the row of forces of the next point.
    fn add_row(&mut self, [ends, nodes, forces]: [Stored; 3], row: &[NodeForce]) {
        for on in row {
            self.add(nodes, &[on.node]);
            self.add(forces, &on.force.as_vec3().to_array());
        }
        let end = self.0[nodes as usize].len() / size_of::<u32>();
        self.add(ends, &[end as u64]);
    }
}
