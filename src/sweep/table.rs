//! The results of all grid points, read point by point in any order: in memory, or in the part on the disk.

use super::columns::{COLUMNS, Columns, Replaced, Width};
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
    width: Width,
    /// In the order of the points.
    blocks: Vec<Block<'a>>,
    pub replaced: Replaced,
}

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
}

impl<'a> Block<'a> {
    /// The block of `columns`, the first of whose points has number `first`.
    pub fn of(columns: &'a Columns, first: usize) -> Self {
        Self { first, columns: columns.bytes() }
    }

    fn number<T: Pod>(&self, array: Stored, index: usize) -> T {
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

    fn status(&self, row: usize) -> Status {
        Status::from_number(self.columns[Stored::Status as usize][row]).unwrap_or(Status::Outside)
    }

    /// The column `array` of points, an entry of which takes `size` bytes.
    pub fn bytes(&self, array: Stored, points: Range<usize>, size: usize) -> &'a [u8] {
        let entries = match array.ends() {
            Some(ends) => self.rows(ends, points),
            None => points,
        };
        &self.columns[array as usize][size * entries.start..size * entries.end]
    }

    fn points(&self) -> usize {
        self.columns[Stored::Status as usize].len()
    }

    fn forces(&self, row: usize) -> Vec<NodeForce> {
        let force = |contact: usize| NodeForce {
            node: self.number(Stored::ContactNodes, contact),
            force: DVec3::from_array(
                [0, 1, 2].map(|k| self.number::<f32>(Stored::ContactForces, 3 * contact + k).into()),
            ),
        };
        self.rows(Stored::ContactOffsets, row..row + 1).map(force).collect()
    }

    /// Which contacts, or touches, are those of points; `ends` are their ends.
    pub fn rows(&self, ends: Stored, points: Range<usize>) -> Range<usize> {
        let before = |point: usize| point.checked_sub(1).map_or(0, |row| self.number::<u64>(ends, row) as usize);
        before(points.start)..before(points.end)
    }
}

impl<'a> Table<'a> {
    /// The points of `blocks`, which follow one another from point 0 on.
    pub fn new(width: Width, blocks: Vec<Block<'a>>) -> Self {
        Self { width, blocks, replaced: Replaced::new() }
    }

    /// Status of a point.
    pub fn status(&self, point: usize) -> Status {
        self.read(point, |block, row| block.status(row))
    }

    /// Result of a point.
    pub fn result(&self, point: usize) -> PointResult {
        self.read(point, |block, row| block.result(row, self.width.joints))
    }

    /// Forces on the object's nodes at a point, ascending by node (N).
    pub fn forces(&self, point: usize) -> Vec<NodeForce> {
        self.read(point, |block, row| block.forces(row))
    }

    /// Result of a point as it was before it was replaced.
    pub fn before(&self, point: usize) -> PointResult {
        let block = self.block(point);
        block.result(point - block.first, self.width.joints)
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
