//! Results of consecutive grid points, as they are solved, and as they lie in a part.
//!
//! ```text
//! u64 first point, u64 points, u64 contacts of the object's nodes
//! the columns, in the order of `RESULTS`; those of offsets hold the end of each point's row within the tile
//! ```

use crate::{
    JointVector,
    contact::{Equilibrium, NodeForce, Status},
    dataset::{Extras, RESULTS, Stored},
    joint_matrix::{self, JointMatrix},
};
use bytemuck::{NoUninit, Pod};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::{borrow::Cow, ops::Range};

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

    /// Bytes of the columns of `points` points with `contacts` in all.
    pub fn size(self, points: usize, contacts: usize) -> usize {
        self.lengths(points, contacts).into_iter().fold(0, usize::saturating_add)
    }

    /// The same, column by column.
    fn lengths(self, points: usize, contacts: usize) -> [usize; COLUMNS] {
        RESULTS.map(|array| {
            let entries = if array.is_of_contacts() { contacts } else { points };
            entries.saturating_mul(self.bytes(array))
        })
    }
}

/// Number of columns.
const COLUMNS: usize = RESULTS.len();

/// Numbers before the columns.
const OPENING: usize = 3;

/// Columns of consecutive points as bytes, by [`Stored`]; they need not be aligned. Those of offsets hold the end of
/// each point's row of forces.
#[derive(Default)]
pub(super) struct Tile<'a> {
    /// Number of the first point.
    pub first: usize,
    columns: [Cow<'a, [u8]>; COLUMNS],
}

/// The result of one point.
#[derive(Clone, Copy)]
pub(super) struct PointResult {
    pub status: Status,
    /// tau (N m or N).
    pub torque: JointVector,
    /// U (J).
    pub energy: f64,
    /// (m)
    pub gap: f32,
    /// Relative residual (1).
    pub residual: f32,
    pub iterations: u32,
}

impl PointResult {
    /// The result that `equilibrium` is.
    pub fn of(equilibrium: &Equilibrium) -> Self {
        let Equilibrium { status, iterations, residual, energy, gap, torque, .. } = *equilibrium;
        Self { status, torque, energy, gap: gap as f32, residual: residual as f32, iterations }
    }
}

impl Tile<'_> {
    /// No points, the next of which has number `first`, in the room there is.
    pub fn clear(&mut self, first: usize) {
        self.first = first;
        self.columns.iter_mut().for_each(|column| column.to_mut().clear());
    }

    /// Adds the equilibrium of the next point.
    ///
    /// A result that no file may hold (a number that is not finite, torques of another chain, nodes that the surface
    /// does not have or out of order, a slip that is asked for and not there) becomes an unconverged point without
    /// torque and forces, of residual 1: the empty answer, which balances nothing.
    pub fn push(&mut self, equilibrium: &Equilibrium, shape: Shape) {
        let PointResult { torque, energy, gap, residual, iterations, .. } = PointResult::of(equilibrium);
        let are_sound = |forces: &[NodeForce]| {
            forces.is_sorted_by(|a, b| a.node < b.node) && forces.iter().all(|on| on.force.as_vec3().is_finite())
        };
        let is_sound = torque.len() == shape.joints
            && torque.is_finite()
            && energy.is_finite()
            && gap.is_finite()
            && residual.is_finite()
            && are_sound(&equilibrium.forces)
            && equilibrium.forces.last().is_none_or(|last| (last.node as usize) < shape.surface_nodes)
            && equilibrium.slip.map_or(!shape.extras.slip || equilibrium.touches.is_empty(), |slip| slip.is_finite());
        if is_sound {
            return self.add_point(equilibrium, shape);
        }
        let empty = Equilibrium::free(if gap.is_finite() { gap.into() } else { 0.0 }, shape.joints);
        self.add_point(&Equilibrium { status: Status::Unconverged, residual: 1.0, iterations, ..empty }, shape);
    }

    /// Adds a point at which nothing touches and nothing was solved, with a lower bound of its gap (m).
    pub fn push_free(&mut self, gap: f32, shape: Shape) {
        self.add_point(&Equilibrium::free(gap.into(), shape.joints), shape);
    }

    fn add_point(&mut self, solved: &Equilibrium, shape: Shape) {
        let PointResult { status, torque, energy, gap, residual, iterations } = PointResult::of(solved);
        let tangent = solved.tangent.filter(|tangent| tangent.as_flattened().iter().all(|entry| entry.is_finite()));
        let slip = solved.slip.unwrap_or_default();
        let triangle = |matrix: &JointMatrix| -> Vec<f32> {
            joint_matrix::lower(matrix, shape.joints).map(|entry| entry as f32).collect()
        };
        for array in RESULTS.into_iter().filter(|array| shape.extras.store(*array)) {
            match array {
                Stored::Torque => self.add(array, &torque),
                Stored::Energy => self.add(array, &[energy]),
                Stored::Tangent => self.add(array, &triangle(&tangent.unwrap_or_default())),
                Stored::NormalForce => self.add(array, &[slip.normal_force as f32]),
                Stored::SlipJacobian => self.add(array, &triangle(&slip.jacobian)),
                Stored::Gap => self.add(array, &[gap]),
                Stored::Status => self.add(array, &[status as u8]),
                Stored::Residual => self.add(array, &[residual]),
                Stored::Iterations => self.add(array, &[iterations]),
                Stored::ContactOffsets => self.add(array, &[(self.contacts() + solved.forces.len()) as u64]),
                Stored::ContactNodes => solved.forces.iter().for_each(|on| self.add(array, &[on.node])),
                Stored::ContactForces => {
                    solved.forces.iter().for_each(|on| self.add(array, &on.force.as_vec3().to_array()));
                }
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
        self.columns[array as usize].to_mut().extend_from_slice(bytemuck::cast_slice(numbers));
    }

    /// How it begins, and its columns, as they are written.
    pub fn bytes(&self) -> ([u8; 8 * OPENING], impl Iterator<Item = &[u8]>) {
        let numbers = [self.first, self.points(), self.contacts()];
        let opening = bytemuck::cast(numbers.map(|number| (number as u64).to_le_bytes()));
        (opening, self.columns.iter().map(Cow::as_ref))
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.columns[Stored::Status as usize].len()
    }

    fn contacts(&self) -> usize {
        self.columns[Stored::ContactNodes as usize].len() / size_of::<u32>()
    }

    /// Whether the rows of contacts follow one another up to `count`.
    fn rows_fit(&self, count: usize) -> bool {
        let ends = self.columns[Stored::ContactOffsets as usize].chunks_exact(size_of::<u64>());
        let ends: Vec<u64> = ends.map(bytemuck::pod_read_unaligned).collect();
        ends.is_sorted() && ends.last().copied().unwrap_or(0) == count as u64
    }

    /// A number of a column.
    pub fn number<T: Pod>(&self, array: Stored, index: usize) -> T {
        let size = size_of::<T>();
        bytemuck::pod_read_unaligned(&self.columns[array as usize][index * size..(index + 1) * size])
    }

    /// Result of a point.
    pub fn result(&self, row: usize, joints: usize) -> PointResult {
        PointResult {
            status: self.status(row),
            torque: (row * joints..(row + 1) * joints).map(|index| self.number(Stored::Torque, index)).collect(),
            energy: self.number(Stored::Energy, row),
            gap: self.number(Stored::Gap, row),
            residual: self.number(Stored::Residual, row),
            iterations: self.number(Stored::Iterations, row),
        }
    }

    /// Status of a point.
    pub fn status(&self, row: usize) -> Status {
        Status::from_number(self.columns[Stored::Status as usize][row]).unwrap_or(Status::Outside)
    }

    /// The column `array` of points, an entry of which takes `size` bytes.
    pub fn column(&self, array: Stored, points: Range<usize>, size: usize) -> &[u8] {
        let entries = if array.is_of_contacts() { self.rows(points) } else { points };
        &self.columns[array as usize][size * entries.start..size * entries.end]
    }

    /// Forces on the object's nodes at a point, ascending by node (N).
    pub fn forces(&self, row: usize) -> Vec<NodeForce> {
        let force = |contact: usize| NodeForce {
            node: self.number(Stored::ContactNodes, contact),
            force: DVec3::from_array(
                [0, 1, 2].map(|k| self.number::<f32>(Stored::ContactForces, 3 * contact + k).into()),
            ),
        };
        self.rows(row..row + 1).map(force).collect()
    }

    /// Which contacts are those of points.
    pub fn rows(&self, points: Range<usize>) -> Range<usize> {
        let end = |row: usize| self.number::<u64>(Stored::ContactOffsets, row) as usize;
        let before = |point: usize| point.checked_sub(1).map_or(0, end);
        before(points.start)..before(points.end)
    }
}

impl<'a> Tile<'a> {
    /// Reads a tile of points of `shape`; `None` when it is none.
    pub fn read(bytes: &'a [u8], shape: Shape) -> Option<Self> {
        let (opening, mut rest) = bytes.split_first_chunk::<{ 8 * OPENING }>()?;
        let numbers: [[u8; 8]; OPENING] = bytemuck::cast(*opening);
        let mut numbers = numbers.into_iter().map(|number| usize::try_from(u64::from_le_bytes(number)).ok());
        let mut next = || numbers.next().flatten();
        let (first, points, contacts) = (next()?, next()?, next()?);
        let mut tile = Self { first, ..Self::default() };
        for (column, length) in tile.columns.iter_mut().zip(shape.lengths(points, contacts)) {
            let bytes;
            (bytes, rest) = rest.split_at_checked(length)?;
            *column = bytes.into();
        }
        (rest.is_empty() && tile.rows_fit(contacts)).then_some(tile)
    }
}
