//! A sparse store of C-space: nodes at several levels, solved where they carry information.
//!
//! | file | subject |
//! |---|---|
//! | `space` | where nodes and blocks of each level lie, and their keys |
//! | `block` | what a block holds |
//! | `record` | the numbers of a node |
//! | `kernel` | the interpolant of one cell |
//! | `levels` | the sum of the levels' cells |
//! | `file` | a store on disk |
//!
//! *Hierarchy.* The interpolated function is a sum over the levels, each the interpolant of what the level's nodes have
//! more than the levels below give there (their *surplus*): `w(q) = sum_l sum_n B_n(q) s_n`. The basis functions B of a
//! node are tensor products with support in the cells around it: C1 cubic Hermite polynomials of value, slopes and
//! mixed second derivatives. A node that was not solved has no surplus: there the function is what the coarser levels
//! say. So w is C1, whichever nodes there are, and exact at all of them, value, gradient and mixed derivatives.
//! (Bungartz and Griebel 2004, Sparse grids, section 3, for hats; here with Hermite data and without the sparse grid's
//! choice of levels.)
//!
//! *Order of publication.* A surplus is final only if nothing below it can change: a block is published after the
//! blocks of the level below that hold the corners of its cells. Within a published block a node that was not solved
//! stays so. Then the same nodes give the same store, to the bit, in whatever order they came.
//!
//! Design, bounds and figures: docs/store.md.

mod block;
pub(super) mod file;
mod kernel;
mod levels;
pub mod record;
pub mod space;

pub use block::{Block, Nodes, StoredNode};
pub(crate) use space::{Cell, weights};
pub use space::{Place, Space};

use crate::{Error, MAX_AXES, dataset::Grid, error};
use block::Numbers;
pub(crate) use block::beyond;
pub use levels::Root;
use levels::linear;
pub(crate) use levels::{Gathered, Levels, added, root, with_joints};
use record::{MAX_WIDTH, mixed, sets, slope, width};
use space::MOST_BLOCK_JOINTS;
use std::{
    collections::HashMap,
    hash::{BuildHasherDefault, Hasher},
};

/// Blocks of C-space at several levels.
pub struct Store {
    space: Space,
    blocks: HashMap<u64, Block, BuildHasherDefault<KeyHasher>>,
}

/// Scatters keys, which are neither many to one nor chosen by anybody: Fibonacci hashing, 2^64 over the golden ratio
/// (Knuth, The Art of Computer Programming 3, section 6.4).
#[derive(Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(self.0 ^ u64::from(byte)));
    }

    fn write_u64(&mut self, key: u64) {
        // Tables take the low bits, and the highest.
        self.0 = key.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(u64::BITS / 2);
    }
}

impl Store {
    /// An empty store over `space`.
    #[must_use]
    pub fn new(space: Space) -> Self {
        Self { space, blocks: HashMap::default() }
    }

    /// Returns where its nodes lie.
    #[must_use]
    pub fn space(&self) -> &Space {
        &self.space
    }

    /// A published block.
    #[must_use]
    pub fn get(&self, level: u32, block: &Place) -> Option<&Block> {
        self.blocks.get(&self.space.key(level, block))
    }

    /// All blocks, ascending by key: those of the base first.
    #[must_use]
    pub fn blocks(&self) -> Vec<(u64, &Block)> {
        let mut blocks: Vec<_> = self.blocks.iter().map(|(key, block)| (*key, block)).collect();
        blocks.sort_unstable_by_key(|(key, _)| *key);
        blocks
    }

    /// All solved nodes, block by block: those of the base first.
    pub fn nodes(&self) -> impl Iterator<Item = StoredNode> {
        let (space, wide) = (&self.space, width(self.space.joints()));
        let blocks = self.blocks().into_iter().filter_map(|(key, block)| Some((space.block(key)?, block.nodes())));
        blocks.flat_map(move |((level, block), nodes)| {
            let own = space.nodes(level, &block).filter(|(place, _)| nodes.present >> place & 1 == 1);
            own.zip(nodes.records.chunks_exact(wide)).enumerate().map(move |(k, ((_, place), record))| {
                let root = f64::from(record[0]).max(0.0);
                let torque = (0..space.joints()).map(|a| -root * f64::from(record[slope(a)])).collect();
                let (q, energy) = (space.configuration(level, &place), 0.5 * root * root);
                StoredNode { level, place, q, torque, energy, gap: nodes.gap[k], status: nodes.status[k] }
            })
        })
    }

    /// The blocks on which a block of `level` rests, by level and place: those that hold the corners of the cells of
    /// the level below around its nodes. Blocks of one node rest on blocks of any level below, those to which these
    /// corners belong.
    pub fn foundation(&self, level: u32, block: &Place) -> impl Iterator<Item = (u32, Place)> + use<> {
        let space = self.space.clone();
        let (joints, is_one) = (space.joints(), space.block_nodes() == 1);
        let (below, block) = (level.checked_sub(1), *block);
        let last = below.map_or([0; MAX_AXES], |below| space.last(below));
        // A block of 2^d nodes: node `block` of the level below, and those one farther; at most twice as many blocks
        // are listed as there are. One node: those around it, along the axes along which it lies between two.
        let (first, axes) = if is_one { (block.map(|i| i >> 1), block.map(|i| i & 1)) } else { (block, [1; MAX_AXES]) };
        let between = (0..joints).map(|a| (axes[a] as usize) << a).sum::<usize>();
        let sets = (0..1_usize << joints).filter(move |set| below.is_some() && set & !between == 0);
        let inside =
            sets.map(move |set| beyond(&first, set)).filter(move |node| (0..joints).all(|a| node[a] <= last[a]));
        inside.map(move |node| {
            let below = below.unwrap_or(0);
            if is_one { space.owner(below, node) } else { (below, space.block_of(&node)) }
        })
    }

    /// Publishes a block: its nodes, of those that [`Space::nodes`] names.
    ///
    /// # Errors
    /// When the block lies outside the space, its columns do not belong together, a block of the level below is missing,
    /// or it is there already.
    pub fn publish(&mut self, level: u32, place: &Place, nodes: Nodes) -> Result<(), Error> {
        let key = self.space.key(level, place);
        if self.space.block(key) != Some((level, *place)) {
            return Err(error!("block {key:#x} of the store is not sound"));
        }
        let all: Vec<(usize, Place)> = self.space.nodes(level, place).collect();
        let allowed = all.iter().fold(0, |set, (place, _)| set | 1 << place);
        if !nodes.is_sound(self.space.joints(), allowed) {
            return Err(error!("block {key:#x} of the store is not sound"));
        }
        for (at, below) in self.foundation(level, place) {
            if self.get(at, &below).is_none() {
                let missing = self.space.key(at, &below);
                return Err(error!("block {key:#x} of the store comes before block {missing:#x}, on which it rests"));
            }
        }
        if self.blocks.contains_key(&key) {
            return Err(error!("block {key:#x} of the store is there twice"));
        }
        let surplus = [self.surplus(level, &all, &nodes), self.slip_surplus(level, &all, &nodes)];
        self.blocks.insert(key, Block::new(nodes, surplus));
        Ok(())
    }

    /// Surplus of the `nodes` of a block of `level`, all of whose nodes are `all`.
    fn surplus(&self, level: u32, all: &[(usize, Place)], nodes: &Nodes) -> Box<[f32]> {
        let joints = self.space.joints();
        let wide = width(joints);
        let mut surplus = vec![0.0; wide * nodes.count()].into_boxed_slice();
        let solved =
            all.iter().filter(|(place, _)| nodes.present >> place & 1 == 1).zip(surplus.chunks_exact_mut(wide));
        for (((_, node), surplus), record) in solved.zip(nodes.records.chunks_exact(wide)) {
            let below = self.record(level, node);
            for (kind, set) in sets(joints).enumerate() {
                let derivatives = (0..joints).filter(|a| set >> a & 1 == 1);
                let step: f64 = derivatives.map(|a| self.space.step(0, a)).product();
                let scale = 0.5_f64.powi((level * set.count_ones()) as i32);
                surplus[kind] = ((f64::from(record[kind]) * step - below[kind]) * scale) as f32;
            }
        }
        surplus
    }

    /// The same of the slips. A node that knows of no contact takes what the levels below give there.
    fn slip_surplus(&self, level: u32, all: &[(usize, Place)], nodes: &Nodes) -> Box<[f32]> {
        let wide = width(self.space.joints());
        let below = Slips { store: self, levels: level };
        let mut surplus = vec![0.0; nodes.slips.len()].into_boxed_slice();
        let solved =
            all.iter().filter(|(place, _)| nodes.present >> place & 1 == 1).zip(surplus.chunks_exact_mut(wide));
        for (((_, node), surplus), slip) in solved.zip(nodes.slips.chunks_exact(wide)) {
            if slip[0] > 0.0 {
                let below = linear(&below, self.space.around(level, node));
                let rows = surplus.iter_mut().zip(slip).zip(below);
                rows.for_each(|((surplus, slip), below)| *surplus = (f64::from(*slip) - below) as f32);
            }
        }
        surplus
    }

    /// Interpolates the levels below `level` at one of its nodes, lengths in steps of the base.
    fn record(&self, level: u32, node: &Place) -> [f64; MAX_WIDTH] {
        let joints = self.space.joints();
        let (corners, wide) = (1_usize << joints, width(joints));
        let mut sum = [0.0; MAX_WIDTH];
        let mut cell = self.space.around(level, node);
        for below in 0..level {
            if below > 0 {
                cell.halve();
            }
            for side in 0..corners {
                let corner = beyond(&cell.low, side);
                let Some(block) = self.get(below, &self.space.block_of(&corner)) else { continue };
                let Some(surplus) = block.surplus_at(Numbers::Root, self.space.place_of(&corner), wide) else {
                    continue;
                };
                let Some(weights) = kernel::transfer(joints, side, &cell.fractions) else { continue };
                for ((sum, weights), set) in sum.iter_mut().zip(&weights).zip(sets(joints)) {
                    let scale = f64::from(1_u32 << below).powi(set.count_ones() as i32);
                    *sum += scale * surplus.iter().zip(weights).map(|(x, weight)| weight * f64::from(*x)).sum::<f64>();
                }
            }
        }
        sum
    }

    /// The function at `q`, one entry per joint; beyond the grid that at its border. Never allocates.
    #[must_use]
    pub fn sample(&self, q: &[f64]) -> Root {
        levels::root(self, Cell::of(self.base(), q))
    }

    /// Whether its nodes say how contacts slip.
    #[must_use]
    pub fn has_slips(&self) -> bool {
        self.blocks.values().any(|block| !block.nodes.slips.is_empty())
    }

    /// How contacts slip at `q`, as [`record::slip_of`] has it. Never allocates.
    #[must_use]
    pub fn slip(&self, q: &[f64]) -> [f64; MAX_WIDTH] {
        linear(&Slips { store: self, levels: self.space.levels() }, Cell::of(self.base(), q))
    }

    /// Memory and file that `nodes` nodes over `joints` joints take at most, each in a block of its own, with their slips
    /// or without (bytes).
    #[must_use]
    pub fn most_bytes(joints: usize, nodes: usize, with_slips: bool) -> [usize; 2] {
        let record = size_of::<f32>() * width(joints);
        let slip = record * usize::from(with_slips);
        // Numbers of the node and of the interpolation, its gap and status; in the file key and places of the block.
        let memory = size_of::<Block>() + 2 * size_of::<usize>() + 2 * (record + slip) + size_of::<f32>() + 1;
        let file = 2 * size_of::<u64>() + record + slip / 2 + size_of::<f32>() + 1;
        [memory, file].map(|each| nodes.saturating_mul(each))
    }

    /// Memory of all blocks (bytes).
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.blocks.values().map(|block| block.bytes() + 2 * size_of::<usize>()).sum()
    }
}

impl Levels for Store {
    fn base(&self) -> &Grid {
        self.space.base()
    }

    fn count(&self) -> u32 {
        self.space.levels()
    }

    fn gather<const C: usize, const W: usize>(&self, level: u32, low: &Place, numbers: &mut [[f64; C]; W]) -> Gathered {
        self.gathered(level, low, numbers, Numbers::Root)
    }
}

/// The slips of a store's nodes, up to a level.
struct Slips<'a> {
    store: &'a Store,
    levels: u32,
}

impl Levels for Slips<'_> {
    fn base(&self) -> &Grid {
        self.store.space.base()
    }

    fn count(&self) -> u32 {
        self.levels
    }

    fn gather<const C: usize, const W: usize>(&self, level: u32, low: &Place, numbers: &mut [[f64; C]; W]) -> Gathered {
        self.store.gathered(level, low, numbers, Numbers::Slip)
    }
}

impl Store {
    /// [`Levels::gather`] of the numbers `of` a block's nodes.
    #[inline(always)]
    fn gathered<const C: usize, const W: usize>(
        &self,
        level: u32,
        low: &Place,
        numbers: &mut [[f64; C]; W],
        of: Numbers,
    ) -> Gathered {
        let joints = const { C.ilog2() as usize };
        // Corners of a block have bits that agree along odd axes: along these, block and place change from one side to
        // the other. With blocks of one node they do so along all axes.
        let parity = (0..joints).map(|a| ((low[a] & 1) as usize) << a).sum::<usize>();
        let is_one = joints > MOST_BLOCK_JOINTS;
        let (odd, places) = if is_one { (C - 1, 0) } else { (parity, C - 1) };
        let even = (C - 1) ^ odd;
        // Keys of the block of the first corner, and of those beside it by sets of axes.
        let mut keys = [self.space.key(level, &self.space.block_of(low)); C];
        for a in 0..joints {
            let (near, beyond) = keys.split_at_mut(1 << a);
            beyond.iter_mut().zip(near).for_each(|(beyond, near)| *beyond = near.wrapping_add(self.space.stride(a)));
        }
        let mut gathered = Gathered { found: false, whole: true, any: false, failed: false };
        let mut blocks = [None; C];
        for beside in (0..C).filter(|side| side & even == 0) {
            // The corner whose coordinates are all even belongs to a level below: a block of it alone does not exist.
            let is_below = is_one && level > 0 && beside == parity;
            blocks[beside] = if is_below { None } else { self.blocks.get(&keys[beside]) };
            gathered.found |= blocks[beside].is_some();
            gathered.whole &= is_below || blocks[beside].is_some();
        }
        if !gathered.found {
            return gathered;
        }
        for corner in 0..C {
            let (block, place) = (blocks[corner & odd], (corner ^ odd) & places);
            match block.and_then(|block| block.surplus_at(of, place, W)) {
                Some(surplus) => {
                    gathered.any = true;
                    numbers.iter_mut().zip(surplus).for_each(|(number, &surplus)| number[corner] = surplus.into());
                    gathered.failed |= block.is_some_and(|block| block.failed >> place & 1 == 1);
                }
                None => numbers.iter_mut().for_each(|number| number[corner] = 0.0),
            }
        }
        gathered
    }
}

/// The numbers of a node from its energy U (J), torque (N m) and tangent d tau/d q, lower triangle (N m/rad): `w =
/// sqrt(2 U)`, `w_a = -tau_a / w`, `w_ab = -(d tau_a/d q_b + w_a w_b) / w`. Without a tangent the mixed derivatives are
/// zero.
#[must_use]
pub fn root_of(energy: f64, torque: &[f64], tangent: Option<&[f64]>) -> Vec<f64> {
    let joints = torque.len();
    let mut record = vec![0.0; width(joints)];
    let w = (2.0 * energy).sqrt();
    record[0] = w;
    torque.iter().enumerate().for_each(|(a, tau)| record[slope(a)] = -tau / w);
    for a in 0..joints {
        for b in 0..a {
            let tangent = tangent.map(|tangent| tangent[a * (a + 1) / 2 + b]);
            let product = record[slope(a)] * record[slope(b)];
            record[mixed(a, b)] = tangent.map_or(0.0, |tangent| -(tangent + product) / w);
        }
    }
    record
}
