//! Results of consecutive grid points as columns, and their form as one block of bytes.
//!
//! ```text
//! u64 first point, u64 points p, u64 contacts c
//! f64 torque[p][d], f64 energy[p], u64 end[p] of each point's contacts among those of the block,
//! f32 tangent[p][d (d + 1) / 2] or none, f32 gap[p], f32 residual[p], u32 iterations[p], u32 node[c], f32 force[c][3], u8 status[p]
//! ```

use crate::JointMatrix;
use crate::contact::{Equilibrium, Status};
use bytemuck::Pod;
use std::collections::{BTreeMap, TryReserveError};

/// What every point of a sweep has.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    pub joints: usize,
    pub surface_nodes: usize,
    /// Whether contact forces are stored.
    pub with_forces: bool,
    /// Whether tangents are stored.
    pub with_tangent: bool,
}

impl Shape {
    /// What every point has a fixed number of.
    pub fn width(self) -> Width {
        Width::new(self.joints, self.with_tangent)
    }
}

/// Numbers that each point has in the columns that do not have one a point.
#[derive(Clone, Copy)]
pub(super) struct Width {
    /// Torques.
    pub joints: usize,
    /// Entries of the tangent; 0 where tangents are not stored.
    pub tangent: usize,
}

impl Width {
    /// Of `joints` joints.
    pub fn new(joints: usize, with_tangent: bool) -> Self {
        Self { joints, tangent: if with_tangent { JointMatrix::entries(joints) } else { 0 } }
    }
}

/// Number of columns.
pub(super) const SECTIONS: usize = 10;

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
    /// End of each point's contacts in `nodes`; they begin where those of the point before end.
    pub ends: Vec<u64>,
    pub nodes: Vec<u32>,
    pub forces: Vec<f32>,
}

/// The columns of a block, in their order there.
#[derive(Clone, Copy)]
pub(super) enum Section {
    Torque,
    Energy,
    Ends,
    Tangent,
    Gap,
    Residual,
    Iterations,
    Nodes,
    Forces,
    Status,
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
}

impl Opening {
    /// Length [bytes].
    pub const BYTES: usize = 3 * 8;

    /// Reads it; `None` where its numbers cannot be counted to.
    pub fn of(bytes: [u8; Self::BYTES]) -> Option<Self> {
        let mut rest = &bytes[..];
        let mut number = || usize::try_from(take::<u64>(&mut rest, 1)?[0]).ok();
        Some(Self { first: number()?, points: number()?, contacts: number()? })
    }

    fn bytes(self) -> [[u8; 8]; 3] {
        [self.first, self.points, self.contacts].map(|count| (count as u64).to_le_bytes())
    }

    /// Lengths of the columns behind it, by [`Section`] [bytes].
    fn lengths(self, width: Width) -> [usize; SECTIONS] {
        let Self { points: p, contacts: c, .. } = self;
        [(p, width.joints * 8), (p, 8), (p, 8), (p, width.tangent * 4), (p, 4), (p, 4), (p, 4), (c, 4), (c, 12), (p, 1)]
            .map(|(count, size)| count.saturating_mul(size))
    }

    /// Where a column begins behind it, and its length [bytes].
    pub fn place(self, section: Section, width: Width) -> (usize, usize) {
        let lengths = self.lengths(width);
        (lengths[..section as usize].iter().sum(), lengths[section as usize])
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

    /// Length of all columns behind it [bytes].
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
        columns.ends.try_reserve_exact(points)?;
        Ok(columns)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.status.len()
    }

    /// Bytes of `points` points of `width` with `contacts` contacts in all.
    pub fn bytes(points: usize, width: Width, contacts: usize) -> usize {
        Opening { first: 0, points, contacts }.columns(width)
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
        self.ends.clear();
        self.nodes.clear();
        self.forces.clear();
    }

    /// Adds the equilibrium of the next point.
    ///
    /// A result that no file may hold (a number that is not finite, torques of another chain, nodes that the surface does not
    /// have or out of order) becomes an unconverged point without torque and forces, of residual 1: the empty answer, which
    /// balances nothing.
    pub fn push(&mut self, equilibrium: &Equilibrium, shape: Shape) {
        let Equilibrium { status, iterations, residual, energy, gap, torque, forces, tangent, touches: _ } =
            equilibrium;
        let sound = torque.len() == shape.joints
            && torque.is_finite()
            && energy.is_finite()
            && (*gap as f32).is_finite()
            && (*residual as f32).is_finite()
            && forces.iter().all(|contact| contact.force.as_vec3().is_finite())
            && forces.is_sorted_by(|a, b| a.node < b.node)
            && forces.last().is_none_or(|last| (last.node as usize) < shape.surface_nodes);
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
        let stored = if sound && shape.with_forces { forces.as_slice() } else { &[] };
        for contact in stored {
            self.nodes.push(contact.node);
            self.forces.extend_from_slice(&contact.force.as_vec3().to_array());
        }
        self.ends.push(self.nodes.len() as u64);
    }

    /// Adds a point at which nothing touches and nothing was solved, with a lower bound of its gap [m].
    pub fn push_free(&mut self, gap: f32, shape: Shape) {
        self.torque.resize(self.torque.len() + shape.joints, 0.0);
        self.energy.push(0.0);
        self.tangent.resize(self.tangent.len() + shape.width().tangent, 0.0);
        self.gap.push(gap);
        self.residual.push(0.0);
        self.iterations.push(0);
        self.status.push(Status::Free as u8);
        self.ends.push(self.nodes.len() as u64);
    }

    /// Adds the points of `chunk` behind these; an error where there is no memory for their contacts.
    pub fn append(&mut self, chunk: &Self) -> Result<(), TryReserveError> {
        let before = self.nodes.len() as u64;
        self.nodes.try_reserve(chunk.nodes.len())?;
        self.forces.try_reserve(chunk.forces.len())?;
        self.torque.extend_from_slice(&chunk.torque);
        self.energy.extend_from_slice(&chunk.energy);
        self.tangent.extend_from_slice(&chunk.tangent);
        self.gap.extend_from_slice(&chunk.gap);
        self.residual.extend_from_slice(&chunk.residual);
        self.iterations.extend_from_slice(&chunk.iterations);
        self.status.extend_from_slice(&chunk.status);
        self.ends.extend(chunk.ends.iter().map(|end| before + end));
        self.nodes.extend_from_slice(&chunk.nodes);
        self.forces.extend_from_slice(&chunk.forces);
        Ok(())
    }

    /// Takes the results of the points that are in `replaced`, the first of these points being number `first`; an error where there is
    /// no memory for their contacts.
    pub fn replace(&mut self, first: usize, replaced: &Replaced) -> Result<(), TryReserveError> {
        let mut rows = replaced.range(first..first + self.points()).peekable();
        if rows.peek().is_none() {
            return Ok(());
        }
        let (mut nodes, mut forces) = (Vec::new(), Vec::new());
        nodes.try_reserve(self.nodes.len())?;
        forces.try_reserve(self.forces.len())?;
        let mut start = 0;
        for point in 0..self.points() {
            let end = self.ends[point] as usize;
            match rows.next_if(|(number, _)| **number == first + point) {
                Some((_, row)) => {
                    let joints = row.torque.len();
                    self.torque[point * joints..(point + 1) * joints].copy_from_slice(&row.torque);
                    self.energy[point] = row.energy[0];
                    let entries = row.tangent.len();
                    self.tangent[point * entries..(point + 1) * entries].copy_from_slice(&row.tangent);
                    self.gap[point] = row.gap[0];
                    self.residual[point] = row.residual[0];
                    self.iterations[point] = row.iterations[0];
                    self.status[point] = row.status[0];
                    nodes.extend_from_slice(&row.nodes);
                    forces.extend_from_slice(&row.forces);
                }
                None => {
                    nodes.extend_from_slice(&self.nodes[start..end]);
                    forces.extend_from_slice(&self.forces[3 * start..3 * end]);
                }
            }
            start = end;
            self.ends[point] = nodes.len() as u64;
        }
        (self.nodes, self.forces) = (nodes, forces);
        Ok(())
    }

    /// The opening of the block of these points, of which the first has number `first`, and its columns.
    pub fn block(&self, first: usize) -> ([[u8; 8]; 3], [&[u8]; SECTIONS]) {
        let opening = Opening { first, points: self.points(), contacts: self.nodes.len() };
        let columns = [
            bytemuck::cast_slice(&self.torque),
            bytemuck::cast_slice(&self.energy),
            bytemuck::cast_slice(&self.ends),
            bytemuck::cast_slice(&self.tangent),
            bytemuck::cast_slice(&self.gap),
            bytemuck::cast_slice(&self.residual),
            bytemuck::cast_slice(&self.iterations),
            bytemuck::cast_slice(&self.nodes),
            bytemuck::cast_slice(&self.forces),
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
        let Opening { points, contacts, .. } = opening;
        let columns = Self {
            torque: take(&mut rest, points * width.joints)?,
            energy: take(&mut rest, points)?,
            ends: take(&mut rest, points)?,
            tangent: take(&mut rest, points * width.tangent)?,
            gap: take(&mut rest, points)?,
            residual: take(&mut rest, points)?,
            iterations: take(&mut rest, points)?,
            nodes: take(&mut rest, contacts)?,
            forces: take(&mut rest, 3 * contacts)?,
            status: take(&mut rest, points)?,
        };
        let fits = columns.ends.is_sorted() && columns.ends.last().copied().unwrap_or(0) == contacts as u64;
        fits.then_some(columns)
    }
}

/// Takes `count` numbers off the front of `bytes`, which need not be aligned.
fn take<T: Pod>(bytes: &mut &[u8], count: usize) -> Option<Vec<T>> {
    let (front, rest) = bytes.split_at_checked(count.checked_mul(size_of::<T>())?)?;
    *bytes = rest;
    Some(bytemuck::pod_collect_to_vec(front))
}
