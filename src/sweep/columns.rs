//! Results of consecutive grid points as columns, and their form as one block of bytes.
//!
//! ```text
//! u64 first point, u64 points p, u64 contacts c of the object's nodes, u64 touches t of the proxy's
//! f64 torque[p][d], f64 energy[p], u64 end[p] of each point's contacts among those of the block, u64 the same of
//! touches or none, f32 tangent[p][d (d + 1) / 2] or none, f32 gap[p], f32 residual[p], u32 iterations[p], u32 node[c],
//! f32 force[c][3], u32 node[t], f32 force[t][3], u8 status[p]
//! ```

use crate::JointMatrix;
use crate::contact::{Equilibrium, NodeForce, Status};
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
    /// Returns the number of entries in each column of fixed width.
    pub fn width(self) -> Width {
        Width::new(self.joints, self.with_tangent, self.with_touches)
    }
}

/// Numbers that each point has in the columns that do not have one a point.
#[derive(Clone, Copy)]
pub(super) struct Width {
    /// Torques.
    pub joints: usize,
    /// Entries of the tangent; 0 where tangents are not stored.
    pub tangent: usize,
    /// Ends of rows of touches: 1, or 0 where touches are not stored.
    pub touches: usize,
}

impl Width {
    /// Bytes of an entry of each column, by [`Section`]: one a point, a contact or a touch.
    pub fn entries(self) -> [usize; SECTIONS] {
        Opening { first: 0, points: 1, contacts: 1, touches: 1 }.lengths(self)
    }

    /// Creates the widths for `joints` joints.
    pub fn new(joints: usize, with_tangent: bool, with_touches: bool) -> Self {
        let tangent = if with_tangent { JointMatrix::entries(joints) } else { 0 };
        Self { joints, tangent, touches: with_touches.into() }
    }
}

/// Number of columns.
pub(super) const SECTIONS: usize = 13;

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

    fn clear(&mut self) {
        self.ends.clear();
        self.nodes.clear();
        self.forces.clear();
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

/// The columns of a block, in their order there.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Section {
    Torque,
    Energy,
    Ends,
    TouchEnds,
    Tangent,
    Gap,
    Residual,
    Iterations,
    Nodes,
    Forces,
    TouchNodes,
    TouchForces,
    Status,
}

impl Section {
    /// The ends of the rows that the column is of, where it has rows.
    pub fn ends(self) -> Option<Self> {
        match self {
            Self::Nodes | Self::Forces => Some(Self::Ends),
            Self::TouchNodes | Self::TouchForces => Some(Self::TouchEnds),
            _ => None,
        }
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
        let mut rest = &bytes[..];
        let mut number = || usize::try_from(take::<u64>(&mut rest, 1)?[0]).ok();
        Some(Self { first: number()?, points: number()?, contacts: number()?, touches: number()? })
    }

    fn bytes(self) -> [[u8; 8]; 4] {
        [self.first, self.points, self.contacts, self.touches].map(|count| (count as u64).to_le_bytes())
    }

    /// Lengths of the columns behind it, by [`Section`] (bytes).
    fn lengths(self, width: Width) -> [usize; SECTIONS] {
        let Self { points: p, contacts: c, touches: t, .. } = self;
        let wide = [(p, width.joints * 8), (p, 8), (p, 8), (p, width.touches * 8)];
        let narrow = [(p, width.tangent * 4), (p, 4), (p, 4), (p, 4), (c, 4), (c, 12), (t, 4), (t, 12), (p, 1)];
        let mut lengths = [0; SECTIONS];
        for (length, (count, size)) in lengths.iter_mut().zip(wide.into_iter().chain(narrow)) {
            *length = count.saturating_mul(size);
        }
        lengths
    }

    /// The columns behind it, `bytes` being all of them.
    pub fn sections(self, bytes: &[u8], width: Width) -> [&[u8]; SECTIONS] {
        let mut rest = bytes;
        self.lengths(width).map(|length| {
            let (section, behind) = rest.split_at(length);
            rest = behind;
            section
        })
    }

    /// Length of all columns behind it (bytes).
    pub fn columns(self, width: Width) -> usize {
        self.lengths(width).into_iter().fold(0, usize::saturating_add)
    }
}

impl Columns {
    /// Room for `points` points of `width`, contacts aside; an error where there is no such memory.
    pub fn with_room(points: usize, width: Width) -> Result<Self, TryReserveError> {
        let mut columns = Self::default();
        columns.torque.try_reserve_exact(points.saturating_mul(width.joints))?;
        columns.tangent.try_reserve_exact(points.saturating_mul(width.tangent))?;
        columns.energy.try_reserve_exact(points)?;
        columns.gap.try_reserve_exact(points)?;
        columns.residual.try_reserve_exact(points)?;
        columns.iterations.try_reserve_exact(points)?;
        columns.status.try_reserve_exact(points)?;
        columns.contacts.ends.try_reserve_exact(points)?;
        columns.touches.ends.try_reserve_exact(points.saturating_mul(width.touches))?;
        Ok(columns)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.status.len()
    }

    /// Bytes of `points` points of `width` with `contacts` and `touches` in all.
    pub fn bytes(points: usize, width: Width, contacts: usize, touches: usize) -> usize {
        Opening { first: 0, points, contacts, touches }.columns(width)
    }

    /// No points, in the room there is.
    pub fn clear(&mut self) {
        self.torque.clear();
        self.energy.clear();
        self.tangent.clear();
        self.gap.clear();
        self.residual.clear();
        self.iterations.clear();
        self.status.clear();
        self.contacts.clear();
        self.touches.clear();
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
        let tangent = tangent.filter(|tangent| sound && tangent.is_finite());
        let entries = self.tangent.len() + shape.width().tangent;
        self.tangent.extend(tangent.iter().flat_map(JointMatrix::lower).map(|entry| entry as f32));
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
        self.tangent.resize(self.tangent.len() + shape.width().tangent, 0.0);
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
        self.torque.extend_from_slice(&chunk.torque);
        self.energy.extend_from_slice(&chunk.energy);
        self.tangent.extend_from_slice(&chunk.tangent);
        self.gap.extend_from_slice(&chunk.gap);
        self.residual.extend_from_slice(&chunk.residual);
        self.iterations.extend_from_slice(&chunk.iterations);
        self.status.extend_from_slice(&chunk.status);
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
            let (point, joints, entries) = (number - first, row.torque.len(), row.tangent.len());
            self.torque[point * joints..(point + 1) * joints].copy_from_slice(&row.torque);
            self.energy[point] = row.energy[0];
            self.tangent[point * entries..(point + 1) * entries].copy_from_slice(&row.tangent);
            self.gap[point] = row.gap[0];
            self.residual[point] = row.residual[0];
            self.iterations[point] = row.iterations[0];
            self.status[point] = row.status[0];
        }
        self.contacts = self.contacts.replaced(|point| Some(&replaced.get(&(first + point))?.contacts))?;
        self.touches = self.touches.replaced(|point| Some(&replaced.get(&(first + point))?.touches))?;
        Ok(())
    }

    /// The opening of the block of these points, of which the first has number `first`, and its columns.
    pub fn block(&self, first: usize) -> ([[u8; 8]; 4], [&[u8]; SECTIONS]) {
        let Self { contacts, touches, .. } = self;
        let opening =
            Opening { first, points: self.points(), contacts: contacts.nodes.len(), touches: touches.nodes.len() };
        let columns = [
            bytemuck::cast_slice(&self.torque),
            bytemuck::cast_slice(&self.energy),
            bytemuck::cast_slice(&contacts.ends),
            bytemuck::cast_slice(&touches.ends),
            bytemuck::cast_slice(&self.tangent),
            bytemuck::cast_slice(&self.gap),
            bytemuck::cast_slice(&self.residual),
            bytemuck::cast_slice(&self.iterations),
            bytemuck::cast_slice(&contacts.nodes),
            bytemuck::cast_slice(&contacts.forces),
            bytemuck::cast_slice(&touches.nodes),
            bytemuck::cast_slice(&touches.forces),
            &self.status,
        ];
        (opening.bytes(), columns)
    }

    /// Reads the block of the points from number `first` on; `None` when it is none.
    pub fn decode(block: &[u8], first: usize, width: Width) -> Option<Self> {
        let (opening, mut rest) = block.split_first_chunk()?;
        let opening = Opening::of(*opening)?;
        if opening.first != first || rest.len() != opening.columns(width) {
            return None;
        }
        let Opening { points, contacts, touches, .. } = opening;
        let mut columns = Self {
            torque: take(&mut rest, points * width.joints)?,
            energy: take(&mut rest, points)?,
            ..Self::default()
        };
        columns.contacts.ends = take(&mut rest, points)?;
        columns.touches.ends = take(&mut rest, points * width.touches)?;
        columns.tangent = take(&mut rest, points * width.tangent)?;
        columns.gap = take(&mut rest, points)?;
        columns.residual = take(&mut rest, points)?;
        columns.iterations = take(&mut rest, points)?;
        for (rows, count) in [(&mut columns.contacts, contacts), (&mut columns.touches, touches)] {
            rows.nodes = take(&mut rest, count)?;
            rows.forces = take(&mut rest, 3 * count)?;
        }
        columns.status = take(&mut rest, points)?;
        (columns.contacts.fit() && columns.touches.fit()).then_some(columns)
    }
}

/// Takes `count` numbers off the front of `bytes`, which need not be aligned.
fn take<T: Pod>(bytes: &mut &[u8], count: usize) -> Option<Vec<T>> {
    let (front, rest) = bytes.split_at_checked(count.checked_mul(size_of::<T>())?)?;
    *bytes = rest;
    Some(bytemuck::pod_collect_to_vec(front))
}
