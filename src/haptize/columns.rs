//! Columns that grow as a sweep goes on, and their form as one block of bytes.
//!
//! A block is a chunk of consecutive grid points:
//!
//! ```text
//! u64 first point, u64 points p, u64 contacts c
//! f64 torque[p][d], f64 energy[p], u64 contacts[p] of each point,
//! f32 gap[p], f32 residual[p], u32 iterations[p], u32 node[c], f32 force[c][3], u8 status[p]
//! ```

use crate::contact::{Equilibrium, Status};
use bytemuck::Pod;

/// Bytes of a point without torque and contacts: energy, contacts, gap, residual, iterations, status.
const POINT: usize = 8 + 8 + 4 + 4 + 4 + 1;
/// Bytes of a contact: node and force.
const CONTACT: usize = 4 + 12;

/// Results of consecutive grid points. Field by field as in [`crate::dataset::Dataset`].
#[derive(Default)]
pub(super) struct Columns {
    pub torque: Vec<f64>,
    pub energy: Vec<f64>,
    pub gap: Vec<f32>,
    pub residual: Vec<f32>,
    pub iterations: Vec<u32>,
    pub status: Vec<u8>,
    /// Number of contacts of each point.
    pub contacts: Vec<u64>,
    pub nodes: Vec<u32>,
    pub forces: Vec<f32>,
}

impl Columns {
    /// Room for `points` points of `joints` joints, contacts aside; an error where there is no such memory.
    pub fn with_room(points: usize, joints: usize) -> Result<Self, std::collections::TryReserveError> {
        let mut columns = Self::default();
        columns.torque.try_reserve_exact(points.saturating_mul(joints))?;
        columns.energy.try_reserve_exact(points)?;
        columns.gap.try_reserve_exact(points)?;
        columns.residual.try_reserve_exact(points)?;
        columns.iterations.try_reserve_exact(points)?;
        columns.status.try_reserve_exact(points)?;
        columns.contacts.try_reserve_exact(points)?;
        Ok(columns)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.status.len()
    }

    /// Bytes of `points` points of `joints` joints with `contacts` contacts in all.
    pub fn bytes(points: usize, joints: usize, contacts: usize) -> usize {
        let point = joints.saturating_mul(8).saturating_add(POINT);
        points.saturating_mul(point).saturating_add(contacts.saturating_mul(CONTACT))
    }

    /// Adds the equilibrium of the next point, its forces too if `with_forces`.
    ///
    /// A result that no file may hold (a number that is not finite, torques of another chain) becomes an unconverged
    /// point without torque and forces, of residual 1: the empty answer, which balances nothing.
    pub fn push(&mut self, equilibrium: &Equilibrium, joints: usize, with_forces: bool) {
        let Equilibrium { status, iterations, residual, energy, gap, torque, forces, touches: _ } = equilibrium;
        let sound = torque.len() == joints
            && torque.is_finite()
            && energy.is_finite()
            && (*gap as f32).is_finite()
            && (*residual as f32).is_finite()
            && forces.iter().all(|contact| contact.force.as_vec3().is_finite());
        self.iterations.push(*iterations);
        if sound {
            self.torque.extend_from_slice(torque);
            self.energy.push(*energy);
            self.gap.push(*gap as f32);
            self.residual.push(*residual as f32);
            self.status.push(*status as u8);
        } else {
            self.torque.resize(self.torque.len() + joints, 0.0);
            self.energy.push(0.0);
            self.gap.push(if (*gap as f32).is_finite() { *gap as f32 } else { 0.0 });
            self.residual.push(1.0);
            self.status.push(Status::Unconverged as u8);
        }
        let stored = if sound && with_forces { forces.as_slice() } else { &[] };
        self.contacts.push(stored.len() as u64);
        for contact in stored {
            self.nodes.push(contact.node);
            self.forces.extend_from_slice(&contact.force.as_vec3().to_array());
        }
    }

    /// Adds a point at which nothing touches and nothing was solved, with a lower bound of its gap [m].
    pub fn push_free(&mut self, gap: f32, joints: usize) {
        self.torque.resize(self.torque.len() + joints, 0.0);
        self.energy.push(0.0);
        self.gap.push(gap);
        self.residual.push(0.0);
        self.iterations.push(0);
        self.status.push(Status::Free as u8);
        self.contacts.push(0);
    }

    /// Adds the points of `chunk` behind these; an error where there is no memory for their contacts.
    pub fn append(&mut self, chunk: &Self) -> Result<(), std::collections::TryReserveError> {
        self.nodes.try_reserve(chunk.nodes.len())?;
        self.forces.try_reserve(chunk.forces.len())?;
        self.torque.extend_from_slice(&chunk.torque);
        self.energy.extend_from_slice(&chunk.energy);
        self.gap.extend_from_slice(&chunk.gap);
        self.residual.extend_from_slice(&chunk.residual);
        self.iterations.extend_from_slice(&chunk.iterations);
        self.status.extend_from_slice(&chunk.status);
        self.contacts.extend_from_slice(&chunk.contacts);
        self.nodes.extend_from_slice(&chunk.nodes);
        self.forces.extend_from_slice(&chunk.forces);
        Ok(())
    }

    /// The block of these points, of which the first has number `first`.
    pub fn encode(&self, first: usize) -> Vec<u8> {
        let opening = [first, self.points(), self.nodes.len()].map(|count| (count as u64).to_le_bytes());
        let columns: [&[u8]; 9] = [
            bytemuck::cast_slice(&self.torque),
            bytemuck::cast_slice(&self.energy),
            bytemuck::cast_slice(&self.contacts),
            bytemuck::cast_slice(&self.gap),
            bytemuck::cast_slice(&self.residual),
            bytemuck::cast_slice(&self.iterations),
            bytemuck::cast_slice(&self.nodes),
            bytemuck::cast_slice(&self.forces),
            &self.status,
        ];
        [opening.as_flattened(), &columns.concat()].concat()
    }

    /// Reads the block of the points from number `first` on; `None` when it is none.
    pub fn decode(block: &[u8], first: usize, joints: usize) -> Option<Self> {
        let mut rest = block;
        let mut number = || usize::try_from(take::<u64>(&mut rest, 1)?[0]).ok();
        let (found, points, contacts) = (number()?, number()?, number()?);
        if found != first || rest.len() != Self::bytes(points, joints, contacts) {
            return None;
        }
        let columns = Self {
            torque: take(&mut rest, points * joints)?,
            energy: take(&mut rest, points)?,
            contacts: take(&mut rest, points)?,
            gap: take(&mut rest, points)?,
            residual: take(&mut rest, points)?,
            iterations: take(&mut rest, points)?,
            nodes: take(&mut rest, contacts)?,
            forces: take(&mut rest, 3 * contacts)?,
            status: take(&mut rest, points)?,
        };
        let total = columns.contacts.iter().try_fold(0_u64, |sum, &count| sum.checked_add(count))?;
        (total == contacts as u64).then_some(columns)
    }
}

/// Takes `count` numbers off the front of `bytes`, which need not be aligned.
fn take<T: Pod>(bytes: &mut &[u8], count: usize) -> Option<Vec<T>> {
    let (front, rest) = bytes.split_at_checked(count.checked_mul(size_of::<T>())?)?;
    *bytes = rest;
    Some(bytemuck::pod_collect_to_vec(front))
}
