//! The contents of a block: the nodes that were solved, and what they add to the interpolation of the levels below.

use super::{record::width, space::Place};
use crate::{JointVector, MAX_AXES, contact::Status};

/// Solved nodes of a block, ascending by their place in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Nodes {
    /// Bit p says that the node at place p was solved.
    pub present: u64,
    /// w, its gradient and mixed derivatives at each (sqrt(J), by rad or m); see [`super::record`].
    pub records: Vec<f32>,
    /// Slip of the contacts at each ([`super::record::slip_of`]), rounded to bfloat16: friction is known to some percent.
    /// Empty where none is asked for.
    pub slips: Vec<f32>,
    /// Smallest signed distance between proxy and object at rest (m).
    pub gap: Vec<f32>,
    /// [`Status`] as its number.
    pub status: Vec<u8>,
}

/// A solved node of a store.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredNode {
    /// Level, 0 for the base.
    pub level: u32,
    /// Its place among the nodes of the level.
    pub place: Place,
    /// Configuration (rad or m).
    pub q: JointVector,
    /// Torque (N m or N).
    pub torque: JointVector,
    /// Stored energy (J).
    pub energy: f64,
    /// Smallest signed distance between proxy and object at rest (m).
    pub gap: f32,
    /// [`Status`] as its number.
    pub status: u8,
}

impl Nodes {
    /// Adds the node at `place`, which is behind those that are there.
    pub fn push(&mut self, place: usize, record: &[f32], slip: &[f32], gap: f32, status: Status) {
        self.present |= 1 << place;
        self.records.extend_from_slice(record);
        self.slips.extend(slip.iter().map(|number| widened(narrowed(*number))));
        self.gap.push(gap);
        self.status.push(status as u8);
    }

    /// Number of nodes.
    #[must_use]
    pub fn count(&self) -> usize {
        self.present.count_ones() as usize
    }

    /// Places of the nodes, ascending.
    pub fn places(&self) -> impl Iterator<Item = usize> + use<> {
        let present = self.present;
        (0..u64::BITS as usize).filter(move |place| present >> place & 1 == 1)
    }

    /// Whether the columns belong together, hold numbers, and the nodes are among `allowed`.
    pub(super) fn is_sound(&self, joints: usize, allowed: u64) -> bool {
        let count = self.count();
        self.present & !allowed == 0
            && self.records.len() == count * width(joints)
            && (self.slips.is_empty() || self.slips.len() == self.records.len())
            && (self.gap.len(), self.status.len()) == (count, count)
            && self.records.iter().chain(&self.slips).chain(&self.gap).all(|number| number.is_finite())
            && self.status.iter().all(|&number| Status::from_number(number).is_some())
    }
}

/// The bfloat16 nearest to `number`, of halves the one away from zero; its bits.
pub(super) fn narrowed(number: f32) -> u16 {
    (number.to_bits().saturating_add(1 << 15) >> 16) as u16
}

/// The number whose bits are a bfloat16's.
pub(super) fn widened(bits: u16) -> f32 {
    f32::from_bits(u32::from(bits) << 16)
}

/// A published block.
pub struct Block {
    pub(super) nodes: Nodes,
    /// Places of nodes whose torque is not to be trusted.
    pub(super) failed: u64,
    /// Numbers of the interpolation at each node less those that the levels below give there, lengths in steps of the
    /// level; and the same of the slips, interpolated multilinearly.
    surplus: [Box<[f32]>; 2],
}

/// Which numbers of a block's nodes are asked for.
#[derive(Clone, Copy)]
pub(super) enum Numbers {
    Root,
    Slip,
}

impl Block {
    /// Returns the solved nodes.
    #[must_use]
    pub fn nodes(&self) -> &Nodes {
        &self.nodes
    }

    pub(super) fn new(nodes: Nodes, surplus: [Box<[f32]>; 2]) -> Self {
        let is_failed = |number: &u8| Status::from_number(*number).is_some_and(Status::is_failed);
        let failed = nodes.places().zip(&nodes.status).filter(|(_, status)| is_failed(status));
        Self { failed: failed.map(|(place, _)| 1 << place).sum(), nodes, surplus }
    }

    /// The surplus of the node at `place`, `kinds` numbers; `None` if it was not solved, or has no slip.
    #[inline]
    pub(super) fn surplus_at(&self, of: Numbers, place: usize, kinds: usize) -> Option<&[f32]> {
        let (numbers, present) = (&self.surplus[of as usize], self.nodes.present);
        let rank = (present & ((1 << place) - 1)).count_ones() as usize;
        if present >> place & 1 == 1 { numbers.get(rank * kinds..(rank + 1) * kinds) } else { None }
    }

    /// Memory of the block (bytes).
    #[must_use]
    pub fn bytes(&self) -> usize {
        let Nodes { records, slips, gap, status, .. } = &self.nodes;
        let surplus: usize = self.surplus.iter().map(|numbers| numbers.len()).sum();
        size_of::<Self>() + 4 * (surplus + records.len() + slips.len() + gap.len()) + status.len()
    }
}

/// The block above, along the axes in `set`, of the one with `place`.
pub(crate) fn beyond(place: &Place, set: usize) -> Place {
    std::array::from_fn::<_, MAX_AXES, _>(|a| place[a] + (set >> a & 1) as u32)
}
