//! Results of consecutive grid points as columns, and their form as one block of bytes.
//!
//! ```text
//! u64 first point, u64 points, u64 contacts of the object's nodes, u64 touches of the proxy's
//! the columns, in the order of `RESULTS`; those of offsets hold the end of each point's row within the block
//! ```

use crate::contact::{Equilibrium, NodeForce, Status};
use crate::dataset::{Axes, RESULTS, Stored};
use crate::joint_matrix;
use bytemuck::Pod;
use std::collections::{BTreeMap, TryReserveError};

/// Columns of a sweep.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    pub joints: usize,
    pub surface_nodes: usize,
    /// Whether contact forces on the object's nodes are stored.
    pub with_forces: bool,
    /// Whether those on the proxy's nodes are.
    pub with_touches: bool,
    /// Whether tangents are stored.
    pub with_tangent: bool,
}

impl Shape {
    /// Whether a column is stored; of rows, their ends say so.
    pub fn has(self, array: Stored) -> bool {
        match array {
            Stored::Tangent => self.with_tangent,
            Stored::ContactOffsets => self.with_forces,
            Stored::TouchOffsets => self.with_touches,
            _ => true,
        }
    }

    /// Returns the number of entries in each column of fixed width.
    pub fn width(self) -> Width {
        Width { joints: self.joints, tangent: self.with_tangent, touches: self.with_touches }
    }
}

/// Numbers that each point has in the columns that do not have one a point.
#[derive(Clone, Copy)]
pub(super) struct Width {
    /// Torques.
    pub joints: usize,
    /// Whether tangents are stored.
    pub tangent: bool,
    /// Whether touches are stored.
    pub touches: bool,
}

impl Width {
    /// Numbers of an entry of a column: of a point, a contact or a touch. 0 where it is not stored.
    pub fn numbers(self, array: Stored) -> usize {
        match array.description().axes {
            Axes::Joints(_) => self.joints,
            Axes::Triangle(_) => usize::from(self.tangent) * joint_matrix::entries(self.joints),
            Axes::Grid => 1,
            Axes::Own(_) if array == Stored::TouchOffsets => self.touches.into(),
            Axes::Own(axes) => axes.iter().skip(1).map(|(_, length)| length).product(),
        }
    }

    /// Bytes of an entry of a column.
    pub fn bytes(self, array: Stored) -> usize {
        self.numbers(array) * array.description().dtype.bitsize() / 8
    }
}

/// Number of columns.
pub(super) const COLUMNS: usize = RESULTS.len();

/// Results of consecutive grid points. Field by field as in [`crate::dataset::Dataset`].
#[derive(Default)]
pub(super) struct Columns {
    pub torque: Vec<f64>,
    pub energy: Vec<f64>,
    /// Lower triangles; empty where tangents are not stored.
    pub tangent: Vec<f32>,
    pub gap: Vec<f32>,
    pub residual: Vec<f32>,
    pub iterations: Vec<u32>,
    pub status: Vec<u8>,
    /// Contact forces on the object's nodes.
    pub contacts: Rows,
    /// The same on the proxy's nodes; without rows where they are not stored.
    pub touches: Rows,
}

/// Forces on nodes, a row a point.
#[derive(Clone, Default)]
pub(super) struct Rows {
    /// End of each row in `nodes`; it begins where the one before ends.
    pub ends: Vec<u64>,
    pub nodes: Vec<u32>,
    /// Three numbers a node (N).
    pub forces: Vec<f32>,
}

impl Rows {
    /// Adds the row of the next point.
    fn push(&mut self, row: &[NodeForce]) {
        self.nodes.extend(row.iter().map(|on| on.node));
        self.forces.extend(row.iter().flat_map(|on| on.force.as_vec3().to_array()));
        self.ends.push(self.nodes.len() as u64);
    }

    fn append(&mut self, other: &Self) -> Result<(), TryReserveError> {
        let before = self.nodes.len() as u64;
        self.nodes.try_reserve(other.nodes.len())?;
        self.forces.try_reserve(other.forces.len())?;
        self.ends.extend(other.ends.iter().map(|end| before + end));
        self.nodes.extend_from_slice(&other.nodes);
        self.forces.extend_from_slice(&other.forces);
        Ok(())
    }

    /// These rows, those of the points that `new` has replaced by its own.
    fn replaced<'a>(&self, mut new: impl FnMut(usize) -> Option<&'a Self>) -> Result<Self, TryReserveError> {
        let mut rows = Self::default();
        rows.ends.try_reserve_exact(self.ends.len())?;
        rows.nodes.try_reserve(self.nodes.len())?;
        rows.forces.try_reserve(self.forces.len())?;
        let mut start = 0;
        for (point, &end) in self.ends.iter().enumerate() {
            let end = end as usize;
            let (nodes, forces) = match new(point) {
                Some(row) => (&row.nodes[..], &row.forces[..]),
                None => (&self.nodes[start..end], &self.forces[3 * start..3 * end]),
            };
            rows.nodes.extend_from_slice(nodes);
            rows.forces.extend_from_slice(forces);
            rows.ends.push(rows.nodes.len() as u64);
            start = end;
        }
        Ok(rows)
    }

    fn fit(&self) -> bool {
        self.ends.is_sorted() && self.ends.last().copied().unwrap_or(0) == self.nodes.len() as u64
    }
}

/// New results of single points, by number of the grid point: one row of columns each.
pub(super) type Replaced = BTreeMap<usize, Columns>;

/// How a block begins.
#[derive(Clone, Copy)]
pub(super) struct Opening {
    /// Number of the first point.
    pub first: usize,
    pub points: usize,
    pub contacts: usize,
    pub touches: usize,
}

impl Opening {
    /// Length (bytes).
    pub const BYTES: usize = 4 * 8;

    /// Reads it; `None` where its numbers cannot be counted to.
    pub fn of(bytes: [u8; Self::BYTES]) -> Option<Self> {
        let numbers: [[u8; 8]; 4] = bytemuck::cast(bytes);
        let [first, points, contacts, touches] = numbers.map(|number| usize::try_from(u64::from_le_bytes(number)).ok());
        Some(Self { first: first?, points: points?, contacts: contacts?, touches: touches? })
    }

    fn bytes(self) -> [[u8; 8]; 4] {
        [self.first, self.points, self.contacts, self.touches].map(|count| (count as u64).to_le_bytes())
    }

    /// Lengths of the columns behind it (bytes).
    fn lengths(self, width: Width) -> [usize; COLUMNS] {
        let Self { points, contacts, touches, .. } = self;
        RESULTS.map(|array| {
            let entries = match array.ends() {
                None => points,
                Some(Stored::ContactOffsets) => contacts,
                Some(_) => touches,
            };
            entries.saturating_mul(width.bytes(array))
        })
    }

    /// The columns behind it, `bytes` being all of them.
    pub fn columns(self, bytes: &[u8], width: Width) -> [&[u8]; COLUMNS] {
        let mut rest = bytes;
        self.lengths(width).map(|length| {
            let (column, behind) = rest.split_at(length);
            rest = behind;
            column
        })
    }

    /// Length of all columns behind it (bytes).
    pub fn length(self, width: Width) -> usize {
        self.lengths(width).into_iter().fold(0, usize::saturating_add)
    }
}

/// A column of numbers, whatever their type.
trait Numbers {
    fn empty(&mut self);
    /// Makes room for so many more; an error where there is no such memory.
    fn make_room(&mut self, more: usize) -> Result<(), TryReserveError>;
    /// Adds the numbers in `bytes`, which need not be aligned.
    fn add(&mut self, bytes: &[u8]);
    /// Takes the numbers in `bytes` in the place of those from number `first` on.
    fn put(&mut self, first: usize, bytes: &[u8]);
}

impl<T: Pod> Numbers for Vec<T> {
    fn empty(&mut self) {
        self.clear();
    }

    fn make_room(&mut self, more: usize) -> Result<(), TryReserveError> {
        self.try_reserve_exact(more)
    }

    fn add(&mut self, bytes: &[u8]) {
        self.extend(bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned::<T>));
    }

    fn put(&mut self, first: usize, bytes: &[u8]) {
        let numbers = bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned);
        self[first..].iter_mut().zip(numbers).for_each(|(number, new)| *number = new);
    }
}

impl Columns {
    /// The columns as bytes, in the order of [`RESULTS`].
    pub fn bytes(&self) -> [&[u8]; COLUMNS] {
        let Self { contacts, touches, .. } = self;
        [
            bytemuck::cast_slice(&self.torque),
            bytemuck::cast_slice(&self.energy),
            bytemuck::cast_slice(&self.tangent),
            bytemuck::cast_slice(&self.gap),
            &self.status,
            bytemuck::cast_slice(&self.residual),
            bytemuck::cast_slice(&self.iterations),
            bytemuck::cast_slice(&contacts.ends),
            bytemuck::cast_slice(&contacts.nodes),
            bytemuck::cast_slice(&contacts.forces),
            bytemuck::cast_slice(&touches.ends),
            bytemuck::cast_slice(&touches.nodes),
            bytemuck::cast_slice(&touches.forces),
        ]
    }

    /// The same, to be changed.
    fn all(&mut self) -> [(Stored, &mut dyn Numbers); COLUMNS] {
        let Self { contacts, touches, .. } = self;
        let columns: [&mut dyn Numbers; COLUMNS] = [
            &mut self.torque,
            &mut self.energy,
            &mut self.tangent,
            &mut self.gap,
            &mut self.status,
            &mut self.residual,
            &mut self.iterations,
            &mut contacts.ends,
            &mut contacts.nodes,
            &mut contacts.forces,
            &mut touches.ends,
            &mut touches.nodes,
            &mut touches.forces,
        ];
        let mut arrays = RESULTS.into_iter();
        columns.map(|column| (arrays.next().unwrap_or(Stored::Status), column))
    }

    /// Room for `points` points of `width`, contacts aside; an error where there is no such memory.
    pub fn with_room(points: usize, width: Width) -> Result<Self, TryReserveError> {
        let mut columns = Self::default();
        for (array, column) in columns.all().into_iter().filter(|(array, _)| array.ends().is_none()) {
            column.make_room(points.saturating_mul(width.numbers(array)))?;
        }
        Ok(columns)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.status.len()
    }

    /// Bytes of `points` points of `width` with `contacts` and `touches` in all.
    pub fn size(points: usize, width: Width, contacts: usize, touches: usize) -> usize {
        Opening { first: 0, points, contacts, touches }.length(width)
    }

    /// No points, in the room there is.
    pub fn clear(&mut self) {
        self.all().into_iter().for_each(|(_, column)| column.empty());
    }

    /// Adds the equilibrium of the next point.
    ///
    /// A result that no file may hold (a number that is not finite, torques of another chain, nodes that the surface
    /// does not have or out of order) becomes an unconverged point without torque and forces, of residual 1: the empty
    /// answer, which balances nothing.
    pub fn push(&mut self, equilibrium: &Equilibrium, shape: Shape) {
        let Equilibrium { status, iterations, residual, energy, gap, torque, forces, tangent, .. } = equilibrium;
        let sound = torque.len() == shape.joints
            && torque.is_finite()
            && energy.is_finite()
            && (*gap as f32).is_finite()
            && (*residual as f32).is_finite()
            && forces.iter().all(|contact| contact.force.as_vec3().is_finite())
            && forces.is_sorted_by(|a, b| a.node < b.node)
            && forces.last().is_none_or(|last| (last.node as usize) < shape.surface_nodes);
        let on_proxy = if shape.with_touches { equilibrium.on_proxy() } else { Vec::new() };
        let sound = sound
            && on_proxy.is_sorted_by(|a, b| a.node < b.node)
            && on_proxy.iter().all(|contact| contact.force.as_vec3().is_finite());
        self.iterations.push(*iterations);
        let tangent = tangent.filter(|tangent| sound && tangent.as_flattened().iter().all(|entry| entry.is_finite()));
        let entries = self.tangent.len() + shape.width().numbers(Stored::Tangent);
        self.tangent.extend(
            tangent.iter().flat_map(|tangent| joint_matrix::lower(tangent, shape.joints)).map(|entry| entry as f32),
        );
        self.tangent.resize(entries, 0.0);
        if sound {
            self.torque.extend_from_slice(torque);
            self.energy.push(*energy);
            self.gap.push(*gap as f32);
            self.residual.push(*residual as f32);
            self.status.push(*status as u8);
        } else {
            self.torque.resize(self.torque.len() + shape.joints, 0.0);
            self.energy.push(0.0);
            self.gap.push(if (*gap as f32).is_finite() { *gap as f32 } else { 0.0 });
            self.residual.push(1.0);
            self.status.push(Status::Unconverged as u8);
        }
        self.contacts.push(if sound && shape.with_forces { forces } else { &[] });
        if shape.with_touches {
            self.touches.push(if sound { &on_proxy } else { &[] });
        }
    }

    /// Adds a point at which nothing touches and nothing was solved, with a lower bound of its gap (m).
    pub fn push_free(&mut self, gap: f32, shape: Shape) {
        self.torque.resize(self.torque.len() + shape.joints, 0.0);
        self.energy.push(0.0);
        self.tangent.resize(self.tangent.len() + shape.width().numbers(Stored::Tangent), 0.0);
        self.gap.push(gap);
        self.residual.push(0.0);
        self.iterations.push(0);
        self.status.push(Status::Free as u8);
        self.contacts.push(&[]);
        if shape.with_touches {
            self.touches.push(&[]);
        }
    }

    /// Adds the points of `chunk` behind these; an error where there is no memory for their contacts.
    pub fn append(&mut self, chunk: &Self) -> Result<(), TryReserveError> {
        self.contacts.append(&chunk.contacts)?;
        self.touches.append(&chunk.touches)?;
        for ((_, column), bytes) in self.of_points().zip(chunk.of_points_as_bytes()) {
            column.add(bytes);
        }
        Ok(())
    }

    /// Takes the results of the points that are in `replaced`, the first of these points being number `first`; an error
    /// where there is no memory for their contacts.
    pub fn replace(&mut self, first: usize, replaced: &Replaced) -> Result<(), TryReserveError> {
        let points = self.points();
        let mut rows = replaced.range(first..first + points).peekable();
        if rows.peek().is_none() {
            return Ok(());
        }
        for (number, row) in rows {
            for ((array, column), bytes) in self.of_points().zip(row.of_points_as_bytes()) {
                let numbers = 8 * bytes.len() / array.description().dtype.bitsize();
                column.put((number - first) * numbers, bytes);
            }
        }
        self.contacts = self.contacts.replaced(|point| Some(&replaced.get(&(first + point))?.contacts))?;
        self.touches = self.touches.replaced(|point| Some(&replaced.get(&(first + point))?.touches))?;
        Ok(())
    }

    /// The columns over the points, rows of forces aside.
    fn of_points(&mut self) -> impl Iterator<Item = (Stored, &mut dyn Numbers)> {
        self.all().into_iter().filter(|(array, _)| !matches!(array.description().axes, Axes::Own(_)))
    }

    fn of_points_as_bytes(&self) -> impl Iterator<Item = &[u8]> {
        let columns = RESULTS.into_iter().zip(self.bytes());
        columns.filter(|(array, _)| !matches!(array.description().axes, Axes::Own(_))).map(|(_, bytes)| bytes)
    }

    /// The opening of the block of these points, of which the first has number `first`.
    pub fn opening(&self, first: usize) -> [[u8; 8]; 4] {
        let [contacts, touches] = [&self.contacts, &self.touches].map(|rows| rows.nodes.len());
        Opening { first, points: self.points(), contacts, touches }.bytes()
    }

    /// Reads the block of the points from number `first` on; `None` when it is none.
    pub fn decode(block: &[u8], first: usize, width: Width) -> Option<Self> {
        let (opening, rest) = block.split_first_chunk()?;
        let opening = Opening::of(*opening)?;
        if opening.first != first || rest.len() != opening.length(width) {
            return None;
        }
        let mut columns = Self::default();
        columns.all().into_iter().zip(opening.columns(rest, width)).for_each(|((_, column), bytes)| column.add(bytes));
        (columns.contacts.fit() && columns.touches.fit()).then_some(columns)
    }
}
