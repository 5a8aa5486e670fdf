//! Grid points that need no solve, because nothing can touch there: proven block by block.
//!
//! Along any path of q each proxy node moves by at most `sum_j |J_ij| |dq_j|`, and its signed distance to the surface
//! changes by no more than it moves. So over a block of grid points around its centre c, with half-widths h,
//!
//! ```text
//! gap(q) >= min_i ( clearance_i(c) - sum_j m_ij |q_j - c_j| ),     |J_ij| <= m_ij over the block,
//! m_ij = min( r_ij, |J_ij(c)| + sum_k r_i,max(j,k) h_k )
//! ```
//!
//! r_ij is the greatest distance that node i can have from the origin of joint j, by the lengths of the links between
//! (1 for a prismatic joint): it bounds |J_ij| everywhere, and the derivative of J_ij in q_k is a cross product of a
//! unit axis with column max(j, k). Blocks that are not proven free are halved along the joint that moves the proxy
//! most, down to some points, which are left to the solver.
//!
//! A block counts as free only if it stays so when widened by [`FreeSpace::MARGIN`] grid steps all round. So every
//! point within as many steps of a point in contact is solved for and has its exact gap; a skipped point has a positive
//! lower bound of its gap. And so a block whose middle touches spares looking at those that are as near to it. Blocks
//! are cut from the grid alone, so that a point is skipped or not whatever chunks, threads and backend there are.

use crate::{
    JointVector, MAX_AXES,
    contact::{Model, Proximity},
    dataset::{Axis, Grid},
    proxy::{Chain, ChainLink},
};
use rayon::prelude::*;
use std::{
    collections::TryReserveError,
    ops::Range,
    sync::atomic::{AtomicU32, Ordering},
};

/// Rounding error of a gap and of the motion it is held against, relative to the lengths of chain and object (1): a
/// pose is a product of at most seven rotations, a distance a difference of coordinates, each good to some ten eps of
/// those lengths.
const FREE_SPACE_ROUNDING: f64 = 1e-12;

/// Blocks that threads take one after the other have at most as many points: many more blocks than threads, and far
/// fewer than points.
const SHARE: usize = 4096;

/// Blocks of as many points are not cut any further, and not looked at: of so few, too few are free to save what that
/// takes.
const SMALLEST: usize = 8;

/// Most points for which bounds are kept at a time: four megabytes.
const SLAB: usize = 1 << 20;

/// Finds grid points that need no solve.
pub struct FreeSpace<'a> {
    model: &'a Model<'a>,
    grid: &'a Grid,
    jacobians: JacobianBounds,
    /// Most points of a slab.
    most: usize,
}

/// Bounds on the gaps of some grid points, known before anything is solved.
pub struct FreeGaps {
    first: usize,
    /// Bits of a positive lower bound of the gap (m); of NaN where the point is to be solved.
    bounds: Vec<AtomicU32>,
}

/// Grid points `low..high` along each axis.
#[derive(Clone, Copy)]
struct Block {
    low: [usize; MAX_AXES],
    high: [usize; MAX_AXES],
}

/// A place on or between grid points, in steps from the first along each axis.
type Place = [f64; MAX_AXES];

/// The arm in the middle of a block.
struct Placed {
    centre: JointVector,
    /// Half-widths of the block with its margin (rad or m).
    wide: JointVector,
    /// Clearance of the node that is nearest to the object, and what rounding may add to it (m).
    least: f64,
    rounding: f64,
    /// Whether the block is proven free.
    is_free: bool,
}

/// State of a block.
enum Found {
    /// It is skipped.
    Free,
    /// Something touches here.
    Touching(Place),
    /// Neither.
    Unknown,
}

impl<'a> FreeSpace<'a> {
    /// Grid steps around contact within which gaps are exact: the cells that touch contact, and their neighbours.
    pub const MARGIN: usize = 2;

    /// For `grid`, which has an axis for each joint of the chain of `model`.
    #[must_use]
    pub fn new(model: &'a Model<'a>, grid: &'a Grid) -> Self {
        Self { model, grid, jacobians: JacobianBounds::new(model.chain, grid), most: SLAB }
    }

    /// The slab with `point`: whole lines of the grid that follow each other, cut from the grid alone, so that bounds
    /// can be found slab by slab in bounded memory.
    #[must_use]
    pub fn slab(&self, point: usize) -> Range<usize> {
        // Trailing axes whose lines all fit, and the axis before them, of whose lines some fit.
        let (mut line, mut count) = (1, 1);
        for axis in self.grid.axes.iter().rev() {
            if line * axis.count > self.most {
                count = axis.count;
                break;
            }
            line *= axis.count;
        }
        let sheet = line * count;
        // Slabs of equally many lines, as nearly as can be.
        let fitting = (self.most / line).max(1);
        let lines = line * count.div_ceil(count.div_ceil(fitting));
        let start = point / sheet * sheet;
        let first = start + (point - start) / lines * lines;
        first..(first + lines).min(start + sheet)
    }

    /// Most points of a slab.
    pub(super) fn largest_slab(&self) -> usize {
        self.slab(0).len()
    }

    /// Searches `points`, whole lines of the grid as in a slab, for those at which nothing touches.
    ///
    /// # Errors
    /// When there is no memory for four bytes a point.
    pub fn find(&self, points: Range<usize>) -> Result<FreeGaps, TryReserveError> {
        let mut bounds = Vec::new();
        bounds.try_reserve_exact(points.len())?;
        bounds.resize_with(points.len(), || AtomicU32::new(f32::NAN.to_bits()));
        let gaps = FreeGaps { first: points.start, bounds };
        let Some(whole) = Block::of(self.grid, &points) else { return Ok(gaps) };
        let mut blocks = vec![whole];
        let mut shares = Vec::new();
        while let Some(block) = blocks.pop() {
            if block.points() <= SHARE {
                shares.push(block);
            } else {
                blocks.extend(block.halves(self.grid, &self.jacobians));
            }
        }
        shares
            .par_iter()
            .for_each_init(|| self.proximity(), |proximity, block| self.search(proximity, *block, None, &gaps));
        Ok(gaps)
    }
}

impl FreeGaps {
    /// A positive lower bound of the gap at `point`, within `f32` rounding; `None` where the point is to be solved (m).
    #[must_use]
    pub fn gap(&self, point: usize) -> Option<f32> {
        let bits = self.bounds.get(point.checked_sub(self.first)?)?.load(Ordering::Relaxed);
        Some(f32::from_bits(bits)).filter(|gap| !gap.is_nan())
    }

    /// The points that were looked at.
    #[must_use]
    pub fn points(&self) -> Range<usize> {
        self.first..self.first + self.bounds.len()
    }
}

impl Block {
    /// The block of the points `points`, if they make one.
    fn of(grid: &Grid, points: &Range<usize>) -> Option<Self> {
        let last = points.end.checked_sub(1).filter(|&last| last < grid.points())?;
        let (low, high) = (grid.lines(points.start), grid.lines(last).map(|line| line + 1));
        let ascends = low.iter().zip(&high).all(|(low, high)| low < high);
        Some(Self { low, high }).filter(|block| ascends && block.points() == points.len())
    }

    /// The middle, which lies between points where their number is even.
    fn middle(&self) -> Place {
        std::array::from_fn(|j| 0.5 * (self.low[j] + self.high[j] - 1) as f64)
    }

    /// Whether the block contains `place` when widened by the margin.
    fn is_near(&self, place: &Place) -> bool {
        let margin = FreeSpace::MARGIN as f64;
        (0..MAX_AXES).all(|j| self.low[j] as f64 - margin <= place[j] && place[j] <= (self.high[j] - 1) as f64 + margin)
    }

    /// Whether all its points are within the margin of `place`.
    fn is_all_near(&self, place: &Place) -> bool {
        let margin = FreeSpace::MARGIN as f64;
        (0..MAX_AXES).all(|j| place[j] - margin <= self.low[j] as f64 && (self.high[j] - 1) as f64 <= place[j] + margin)
    }

    fn points(&self) -> usize {
        self.low.iter().zip(&self.high).map(|(low, high)| high - low).product()
    }

    /// The two halves across the axis along which the block is widest in terms of the proxy's motion.
    fn halves(self, grid: &Grid, jacobians: &JacobianBounds) -> [Self; 2] {
        let width = |j: usize| (self.high[j] - self.low[j] - 1) as f64 * grid.axes[j].step * jacobians.greatest[j];
        let wide = (0..grid.joints()).filter(|&j| self.high[j] - self.low[j] > 1);
        let axis = wide.max_by(|&i, &j| width(i).total_cmp(&width(j))).unwrap_or(0);
        let (mut left, mut right) = (self, self);
        let middle = self.low[axis].midpoint(self.high[axis]);
        left.high[axis] = middle;
        right.low[axis] = middle;
        [left, right]
    }
}

/// Bounds on how far joints move nodes.
struct JacobianBounds {
    /// r_ij of every link, link fastest (m/rad, or 1).
    bounds: Vec<JointVector>,
    /// Greatest of each joint.
    greatest: JointVector,
    /// Sum of all lengths: no node is farther from the base (m).
    length: f64,
}

impl JacobianBounds {
    fn new(chain: &Chain, grid: &Grid) -> Self {
        // The margin reaches beyond the grid.
        let range = |axis: &Axis| {
            let far = FreeSpace::MARGIN as f64 * axis.step;
            [axis.coordinate(0) - far, axis.last() + far]
        };
        let ranges: Vec<[f64; 2]> = grid.axes.iter().map(range).collect();
        let mut greatest = JointVector::zeros(chain.joints.len());
        for bound in &chain.jacobian_bounds(&ranges) {
            greatest.iter_mut().zip(bound.iter()).for_each(|(greatest, r)| *greatest = greatest.max(*r));
        }
        let length = |link: &ChainLink| link.spec.origin.length() + link.slide(&ranges);
        let farthest = chain.nodes.iter().map(|node| node.position.length()).fold(0.0, f64::max);
        let length = chain.links.iter().map(length).sum::<f64>() + farthest;
        Self { bounds: chain.link_bounds(&ranges), greatest, length }
    }
}

impl FreeSpace<'_> {
    /// Skips what can be in `block`; `touching` is a place of the grid, in steps, where something touches.
    fn search(&self, proximity: &mut Proximity<'_>, block: Block, touching: Option<Place>, gaps: &FreeGaps) {
        if block.points() <= SMALLEST {
            return;
        }
        // No block with such a place within the margin counts as free.
        let touching = match touching.filter(|place| block.is_near(place)) {
            None => match self.skip_whole(proximity, block, gaps) {
                Found::Free => return,
                Found::Unknown => None,
                Found::Touching(place) => Some(place),
            },
            touching => touching,
        };
        if touching.is_none_or(|place| !block.is_all_near(&place)) {
            for half in block.halves(self.grid, &self.jacobians) {
                self.search(proximity, half, touching, gaps);
            }
        }
    }

    /// The clearances of the arm, by which it looks.
    pub(super) fn proximity(&self) -> Proximity<'_> {
        Proximity::new(self.model)
    }

    /// Whether the points next to `point`, and so itself, are proven free as a block: a sweep does not solve most of
    /// such points.
    pub(super) fn is_surrounded(&self, proximity: &mut Proximity<'_>, point: usize) -> bool {
        let (mut low, mut high) = ([0; MAX_AXES], [1; MAX_AXES]);
        for (j, (axis, line)) in self.grid.axes.iter().zip(self.grid.lines(point)).enumerate() {
            (low[j], high[j]) = (line.saturating_sub(1), (line + 2).min(axis.count));
        }
        self.place(proximity, &Block { low, high }).is_free
    }

    /// Skips `block` if it is proven free.
    fn skip_whole(&self, proximity: &mut Proximity<'_>, block: Block, gaps: &FreeGaps) -> Found {
        let Placed { centre, wide, least, rounding, is_free } = self.place(proximity, &block);
        if is_free {
            self.skip(block, &centre, least - rounding, &self.slopes(proximity, &wide), gaps);
            return Found::Free;
        }
        if least < 0.0 && proximity.gap(&centre) < 0.0 { Found::Touching(block.middle()) } else { Found::Unknown }
    }

    /// Places the arm in the middle of `block`.
    fn place(&self, proximity: &mut Proximity<'_>, block: &Block) -> Placed {
        let joints = self.grid.joints();
        let (mut centre, mut wide) = (JointVector::zeros(joints), JointVector::zeros(joints));
        for (j, axis) in self.grid.axes.iter().enumerate() {
            let steps = 0.5 * (block.high[j] - block.low[j] - 1) as f64;
            centre[j] = axis.coordinate(block.low[j]) + steps * axis.step;
            wide[j] = (steps + FreeSpace::MARGIN as f64) * axis.step;
        }
        let nearest = proximity.place(&centre);
        let rounding = FREE_SPACE_ROUNDING * (self.jacobians.length + self.model.surface.extent);
        let stays = |(i, clearance): (usize, f64)| clearance - self.motion(proximity, i, &wide) > rounding;
        let least = proximity.clearances().nth(nearest).unwrap_or(f64::INFINITY);
        let is_free = stays((nearest, least)) && proximity.clearances().enumerate().all(stays);
        Placed { centre, wide, least, rounding, is_free }
    }

    /// Returns how far a node moves at most, within the block of half-widths `wide` around the configuration placed
    /// last.
    fn motion(&self, proximity: &Proximity<'_>, node: usize, wide: &JointVector) -> f64 {
        (0..wide.len()).map(|j| self.slope(proximity, node, j, wide) * wide[j]).sum()
    }

    /// Greatest slope of any node in each joint.
    fn slopes(&self, proximity: &Proximity<'_>, wide: &JointVector) -> JointVector {
        let mut slopes = JointVector::zeros(wide.len());
        for node in 0..self.model.chain.nodes.len() {
            for (j, slope) in slopes.iter_mut().enumerate() {
                *slope = slope.max(self.slope(proximity, node, j, wide));
            }
        }
        slopes
    }

    /// m_ij over the block of half-widths `wide` around the configuration placed last.
    fn slope(&self, proximity: &Proximity<'_>, node: usize, joint: usize, wide: &JointVector) -> f64 {
        let (bounds, links) = (&self.jacobians.bounds[node], &self.model.chain.links);
        let here = self.model.chain.jacobian_column(proximity.pose(), node, joint).length();
        let (mut most, mut turn) = (0.0, 0.0);
        for (a, link) in links.iter().enumerate().filter(|(_, link)| link.joint == joint) {
            let factor = link.multiplier.abs();
            most += factor * bounds[a];
            let turned =
                links.iter().enumerate().map(|(b, by)| bounds[a.max(b)] * by.multiplier.abs() * wide[by.joint]);
            turn += factor * turned.sum::<f64>();
        }
        most.min(here + turn)
    }

    /// Notes lower bounds of the gaps of a free block, whose centre has the gap `gap`.
    fn skip(&self, block: Block, centre: &JointVector, gap: f64, slopes: &JointVector, gaps: &FreeGaps) {
        let joints = self.grid.joints();
        let mut index = block.low;
        loop {
            let point = self.grid.point(index);
            let off = |(j, axis): (usize, &Axis)| slopes[j] * (axis.coordinate(index[j]) - centre[j]).abs();
            let motion: f64 = self.grid.axes.iter().enumerate().map(off).sum();
            // Rounded towards zero, but not to it: the point is free.
            let bound = ((gap - motion) as f32).next_down().max(f32::MIN_POSITIVE);
            gaps.bounds[point - gaps.first].store(bound.to_bits(), Ordering::Relaxed);
            let Some(axis) = (0..joints).rev().find(|&j| index[j] + 1 < block.high[j]) else { return };
            index[axis] += 1;
            index[axis + 1..].copy_from_slice(&block.low[axis + 1..]);
        }
    }
}

#[cfg(test)]
mod tests;
