//! The results of all grid points, read point by point in any order: in memory, or in the part on the disk, where they
//! lie in blocks.
//!
//! ```text
//! u64 first point, u64 points, u64 contacts of the object's nodes
//! the columns, in the order of `RESULTS`; those of offsets hold the end of each point's row within the block
//! ```

use super::columns::{COLUMNS, Columns, Replaced, Shape, lengths};
use crate::{
    JointVector,
    contact::{Equilibrium, NodeForce, Status},
    dataset::Stored,
};
use bytemuck::Pod;
use glam::DVec3;
use std::ops::Range;

/// Results of all points of a grid, with the new ones of single points over them.
pub(super) struct Table<'a> {
    shape: Shape,
    /// In the order of the points.
    blocks: Vec<Block<'a>>,
    pub replaced: Replaced,
}

/// Numbers before the columns of a block.
const OPENING: usize = 3;

/// Columns of consecutive points as bytes, by [`Stored`]; they need not be aligned.
#[derive(Clone, Copy)]
pub(super) struct Block<'a> {
    /// Number of the first point.
    pub first: usize,
    pub columns: [&'a [u8]; COLUMNS],
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

    /// The result where nothing touches, `gap` away (m).
    pub fn free(joints: usize, gap: f32) -> Self {
        let torque = JointVector::zeros(joints);
        Self { status: Status::Free, torque, energy: 0.0, gap, residual: 0.0, iterations: 0 }
    }
}

impl<'a> Block<'a> {
    /// The block of `columns`, the first of whose points has number `first`.
    pub fn of(columns: &'a Columns, first: usize) -> Self {
        Self { first, columns: columns.bytes() }
    }

    /// Reads a block of points of `shape`; `None` when it is none.
    pub fn read(bytes: &'a [u8], shape: Shape) -> Option<Self> {
        let (opening, mut rest) = bytes.split_first_chunk::<{ 8 * OPENING }>()?;
        let numbers: [[u8; 8]; OPENING] = bytemuck::cast(*opening);
        let mut numbers = numbers.into_iter().map(|number| usize::try_from(u64::from_le_bytes(number)).ok());
        let mut next = || numbers.next().flatten();
        let (first, points, contacts) = (next()?, next()?, next()?);
        let mut columns = [&[][..]; COLUMNS];
        for (column, length) in columns.iter_mut().zip(lengths(points, shape, contacts)) {
            (*column, rest) = rest.split_at_checked(length)?;
        }
        let block = Self { first, columns };
        (rest.is_empty() && block.rows_fit(contacts)).then_some(block)
    }

    /// How it begins, where it is written.
    pub fn opening(&self) -> [u8; 8 * OPENING] {
        let contacts = self.columns[Stored::ContactNodes as usize].len() / size_of::<u32>();
        let numbers = [self.first, self.points(), contacts];
        bytemuck::cast(numbers.map(|number| (number as u64).to_le_bytes()))
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

    fn result(&self, row: usize, joints: usize) -> PointResult {
        let mut torque = JointVector::zeros(joints);
        for (joint, tau) in torque.iter_mut().enumerate() {
            *tau = self.number(Stored::Torque, row * joints + joint);
        }
        PointResult {
            status: self.status(row),
            torque,
            energy: self.number(Stored::Energy, row),
            gap: self.number(Stored::Gap, row),
            residual: self.number(Stored::Residual, row),
            iterations: self.number(Stored::Iterations, row),
        }
    }

    /// Status of a point of the block.
    pub fn status(&self, row: usize) -> Status {
        Status::from_number(self.columns[Stored::Status as usize][row]).unwrap_or(Status::Outside)
    }

    /// The column `array` of points, an entry of which takes `size` bytes.
    pub fn bytes(&self, array: Stored, points: Range<usize>, size: usize) -> &'a [u8] {
        let entries = if array.is_of_contacts() { self.rows(points) } else { points };
        &self.columns[array as usize][size * entries.start..size * entries.end]
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.columns[Stored::Status as usize].len()
    }

    fn forces(&self, row: usize) -> Vec<NodeForce> {
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

impl<'a> Table<'a> {
    /// The points of `blocks`, which follow one another from point 0 on.
    pub fn new(shape: Shape, blocks: Vec<Block<'a>>) -> Self {
        Self { shape, blocks, replaced: Replaced::new() }
    }

    /// Status of a point.
    pub fn status(&self, point: usize) -> Status {
        self.read(point, |block, row| block.status(row))
    }

    /// Result of a point.
    pub fn result(&self, point: usize) -> PointResult {
        self.read(point, |block, row| block.result(row, self.shape.joints))
    }

    /// Forces on the object's nodes at a point, ascending by node (N).
    pub fn forces(&self, point: usize) -> Vec<NodeForce> {
        self.read(point, |block, row| block.forces(row))
    }

    /// Result of a point as it was before it was replaced.
    pub fn before(&self, point: usize) -> PointResult {
        let block = self.block(point);
        block.result(point - block.first, self.shape.joints)
    }

    /// The blocks that hold `points`, in their order, and which of a block's points those are.
    pub fn runs(&self, points: Range<usize>) -> impl Iterator<Item = (Block<'_>, Range<usize>)> {
        let Range { start: mut point, end } = points;
        std::iter::from_fn(move || {
            let new = self.replaced.range(point..end).next();
            let (block, rows) = match new {
                _ if point >= end => return None,
                Some((&first, row)) if first == point => (Block::of(row, first), 0..1),
                _ => {
                    let (block, end) = (self.block(point), new.map_or(end, |(&first, _)| first));
                    (*block, point - block.first..block.points().min(end - block.first))
                }
            };
            point += rows.len();
            Some((block, rows))
        })
    }

    fn block(&self, point: usize) -> &Block<'a> {
        &self.blocks[self.blocks.partition_point(|block| block.first <= point) - 1]
    }

    fn read<T>(&self, point: usize, read: impl FnOnce(&Block<'_>, usize) -> T) -> T {
        if let Some(row) = self.replaced.get(&point) {
            return read(&Block::of(row, point), 0);
        }
        let block = self.block(point);
        read(block, point - block.first)
    }
}
