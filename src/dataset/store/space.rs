//! Where nodes and blocks lie: a base grid, and levels above it whose spacing halves from one to the next.
//!
//! Node `i` of level l is at `start + i step / 2^l` along each axis, so that node 2 i of level l + 1 is node i of level
//! l. Block `k` of a level holds the nodes `2 k` and `2 k + 1` along each axis, 2^d in all: bit a of a node's place in
//! its block is its parity along axis a. Beyond [`MOST_BLOCK_JOINTS`] joints a block is one node: a cell that lies
//! across blocks takes all of their nodes, with blocks of 2^d nodes 1.5^d times as many as it has corners on average. A
//! key packs a level and the coordinates of a block into 64 bits, ascending with the level.

use crate::{Error, MAX_AXES, dataset::Grid, error};

/// Coordinates of a node or a block, one for each joint; the others are zero.
pub type Place = [u32; MAX_AXES];

/// Bits of a key for the level.
const LEVEL_BITS: u32 = 4;

/// Most levels.
pub const MAX_LEVELS: u32 = 1 << LEVEL_BITS;

/// Most joints with blocks of 2^d nodes (1). More: blocks of which a cell uses few nodes. Fewer: more look-ups in the
/// directory for a cell.
pub const MOST_BLOCK_JOINTS: usize = 3;

/// The lattice of all levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    base: Grid,
    levels: u32,
    /// Bits of a key for each coordinate.
    bits: u32,
    /// Logarithm of the nodes of a block along each axis: 1 or 0.
    shift: u32,
}

/// The cell around a configuration at one level.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    /// Its first corner.
    pub low: Place,
    /// Fractions of the cell along each axis, 0 to 1.
    pub fractions: [f64; MAX_AXES],
}

impl Space {
    /// The space over `base` with `levels` levels, the base included.
    ///
    /// # Errors
    /// When the base is no grid, or cannot be halved so often.
    pub fn new(base: &Grid, levels: u32) -> Result<Self, Error> {
        base.check()?;
        let joints = base.joints();
        let bits = (u64::BITS - LEVEL_BITS) / joints as u32;
        let shift = u32::from(joints <= MOST_BLOCK_JOINTS);
        for axis in &base.axes {
            let name = &axis.name;
            if axis.count < 2 {
                return Err(error!("axis {name} has one grid line: refinement needs two or more along each axis"));
            }
            // Coordinates of nodes are below 2^31 and those of blocks below 2^bits.
            let limit = 1_u64 << (bits + shift).min(31);
            let fits = |levels: &u32| (axis.count as u64 - 1) < limit >> (levels - 1);
            let most = (1..=MAX_LEVELS).take_while(fits).last().unwrap_or(0);
            if levels > most {
                return Err(error!(
                    "{levels} levels above axis {name} are more than can be numbered: at most {most} are possible"
                ));
            }
        }
        Ok(Self { base: base.clone(), levels: levels.max(1), bits, shift })
    }

    /// The grid of the base.
    pub(super) fn base(&self) -> &Grid {
        &self.base
    }

    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.base.joints()
    }

    /// Number of levels, the base included.
    #[must_use]
    pub fn levels(&self) -> u32 {
        self.levels
    }

    /// Spacing of `level` along `axis` (rad or m).
    #[must_use]
    pub fn step(&self, level: u32, axis: usize) -> f64 {
        self.base.axes[axis].step / f64::from(1_u32 << level)
    }

    /// The block of a node of the same level.
    #[must_use]
    #[inline]
    pub fn block_of(&self, node: &Place) -> Place {
        node.map(|i| i >> self.shift)
    }

    /// Place of a node in its block.
    #[inline]
    pub(super) fn place_of(&self, node: &Place) -> usize {
        if self.shift == 0 { 0 } else { (0..self.joints()).map(|a| ((node[a] & 1) as usize) << a).sum() }
    }

    /// Nodes that a block has.
    #[must_use]
    pub fn block_nodes(&self) -> usize {
        1 << (self.joints() as u32 * self.shift)
    }

    /// The level to which a node of `level` belongs, that of the coarsest grid on which it lies, and its place there.
    #[must_use]
    pub fn owner(&self, mut level: u32, mut node: Place) -> (u32, Place) {
        while level > 0 && node.iter().all(|i| i & 1 == 0) {
            level -= 1;
            node = node.map(|i| i >> 1);
        }
        (level, node)
    }

    /// Last node of `level` along each axis.
    #[must_use]
    pub fn last(&self, level: u32) -> Place {
        let mut last = [0; MAX_AXES];
        last.iter_mut().zip(&self.base.axes).for_each(|(last, axis)| *last = (axis.count as u32 - 1) << level);
        last
    }

    /// The nodes of the base, last axis fastest.
    pub fn base_nodes(&self) -> impl Iterator<Item = Place> {
        (0..self.base.points()).map(|point| self.base.lines(point).map(|line| line as u32))
    }

    /// The first corners of the cells of the base, last axis fastest.
    pub fn base_cells(&self) -> impl Iterator<Item = Place> {
        (0..self.base.points()).filter_map(|point| self.base.cell_from(point))
    }

    /// Configuration of a node (rad or m).
    #[must_use]
    pub fn configuration(&self, level: u32, node: &Place) -> crate::JointVector {
        // Steps of the base, which are exact: the same node has the same configuration at every level.
        let steps = node.map(|node| f64::from(node) / f64::from(1_u32 << level));
        self.base.axes.iter().zip(steps).map(|(axis, steps)| axis.start + steps * axis.step).collect()
    }

    /// Key of a block.
    #[must_use]
    pub fn key(&self, level: u32, block: &Place) -> u64 {
        block[..self.joints()].iter().fold(u64::from(level), |key, &k| key << self.bits | u64::from(k))
    }

    /// Returns the difference of keys between a block and its neighbour along `axis`.
    #[inline]
    pub(super) fn stride(&self, axis: usize) -> u64 {
        1 << (self.bits * (self.joints() - 1 - axis) as u32)
    }

    /// Level and block of a key; `None` if no block of this space has it.
    #[must_use]
    pub fn block(&self, key: u64) -> Option<(u32, Place)> {
        let (mut rest, mut block) = (key, [0; MAX_AXES]);
        for k in block[..self.joints()].iter_mut().rev() {
            *k = u32::try_from(rest & ((1 << self.bits) - 1)).ok()?;
            rest >>= self.bits;
        }
        let level = u32::try_from(rest).ok().filter(|level| *level < self.levels)?;
        let last = self.last(level);
        (0..self.joints()).all(|a| u64::from(block[a]) << self.shift <= u64::from(last[a])).then_some((level, block))
    }

    /// The nodes of a block that lie in the grid and belong to its level, those of the base or not all even: place and
    /// node.
    pub fn nodes(&self, level: u32, block: &Place) -> impl Iterator<Item = (usize, Place)> + use<> {
        let (joints, shift, last, block) = (self.joints(), self.shift, self.last(level), *block);
        (0..self.block_nodes()).filter_map(move |place| {
            let mut node = [0; MAX_AXES];
            for a in 0..joints {
                node[a] = (block[a] << shift) + (place >> a & 1) as u32;
            }
            let is_own = level == 0 || node.iter().any(|i| i & 1 == 1);
            (is_own && (0..joints).all(|a| node[a] <= last[a])).then_some((place, node))
        })
    }

    /// The first corner of the cell of `level` around `q`, which has one entry per joint, at the grid's border beyond
    /// it.
    #[must_use]
    pub fn cell(&self, level: u32, q: &[f64]) -> Place {
        let mut cell = Cell::of(&self.base, q);
        (0..level).for_each(|_| cell.halve());
        cell.low
    }

    /// The cell of the base around a node of `level`.
    pub(super) fn around(&self, level: u32, node: &Place) -> Cell {
        let mut cell = Cell { low: [0; MAX_AXES], fractions: [0.0; MAX_AXES] };
        for (a, (axis, i)) in self.base.axes.iter().zip(node).enumerate() {
            cell.low[a] = (i >> level).min(axis.count as u32 - 2);
            cell.fractions[a] = f64::from(i - (cell.low[a] << level)) / f64::from(1_u32 << level);
        }
        cell
    }
}

/// Multilinear weights of the `C = 2^d` corners of a cell, at the first d of `fractions`.
#[inline]
pub(crate) fn weights<const C: usize>(fractions: &[f64]) -> [f64; C] {
    let mut weights = [1.0; C];
    for (a, &fraction) in fractions.iter().enumerate().take(const { C.ilog2() as usize }) {
        let (near, far) = weights.split_at_mut(1 << a);
        for (near, far) in near.iter_mut().zip(far) {
            (*near, *far) = (*near * (1.0 - fraction), *near * fraction);
        }
    }
    weights
}

impl Cell {
    /// The cell of `grid` around `q`, which has one entry per joint, at the grid's border beyond it.
    pub fn of(grid: &Grid, q: &[f64]) -> Self {
        let mut cell = Self { low: [0; MAX_AXES], fractions: [0.0; MAX_AXES] };
        for (a, (axis, &q)) in grid.axes.iter().zip(q).enumerate() {
            let (low, fraction) = axis.cell(q);
            (cell.low[a], cell.fractions[a]) = (low as u32, fraction);
        }
        cell
    }

    /// The cell of the level above, finer by half, around the same configuration. Halving is exact.
    pub fn halve(&mut self) {
        for (low, fraction) in self.low.iter_mut().zip(&mut self.fractions) {
            let twice = 2.0 * *fraction;
            let upper = twice >= 1.0;
            *low = 2 * *low + u32::from(upper);
            *fraction = twice - f64::from(u8::from(upper));
        }
    }
}
