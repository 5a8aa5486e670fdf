//! The results of all grid points, read point by point in any order: in memory, or in the part on the disk.

use super::columns::{Columns, Replaced, SECTIONS, Section};
use crate::{
    JointVector,
    contact::{Equilibrium, NodeForce, Status},
};
use bytemuck::Pod;
use glam::DVec3;
use std::ops::Range;

/// Results of all points of a grid, with the new ones of single points over them.
pub(super) struct Table<'a> {
    joints: usize,
    /// In the order of the points.
    blocks: Vec<Block<'a>>,
    pub replaced: Replaced,
}

/// Columns of consecutive points as bytes, by [`Section`]; they need not be aligned.
pub(super) struct Block<'a> {
    /// Number of the first point.
    pub first: usize,
    pub sections: [&'a [u8]; SECTIONS],
}

/// The result of one point.
#[derive(Clone, Copy)]
pub(super) struct PointResult {
    pub status: Status,
    /// tau [N m or N].
    pub torque: JointVector,
    /// U [J].
    pub energy: f64,
    /// [m]
    pub gap: f32,
    /// Relative residual [1].
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
        Self { first, sections: columns.block(first).1 }
    }

    fn number<T: Pod>(&self, section: Section, index: usize) -> T {
        let size = size_of::<T>();
        bytemuck::pod_read_unaligned(&self.sections[section as usize][index * size..(index + 1) * size])
    }

    fn result(&self, row: usize, joints: usize) -> PointResult {
        let mut torque = JointVector::zeros(joints);
        for (joint, tau) in torque.iter_mut().enumerate() {
            *tau = self.number(Section::Torque, row * joints + joint);
        }
        PointResult {
            status: self.status(row),
            torque,
            energy: self.number(Section::Energy, row),
            gap: self.number(Section::Gap, row),
            residual: self.number(Section::Residual, row),
            iterations: self.number(Section::Iterations, row),
        }
    }

    fn status(&self, row: usize) -> Status {
        Status::from_number(self.sections[Section::Status as usize][row]).unwrap_or(Status::Outside)
    }

    fn forces(&self, row: usize) -> Vec<NodeForce> {
        let force = |contact: usize| NodeForce {
            node: self.number(Section::Nodes, contact),
            force: DVec3::from_array([0, 1, 2].map(|k| self.number::<f32>(Section::Forces, 3 * contact + k).into())),
        };
        self.row(Section::Ends, row).map(force).collect()
    }

    /// Which contacts, or touches, are those of a point; `ends` are their ends.
    fn row(&self, ends: Section, row: usize) -> Range<usize> {
        let end = |row: usize| self.number::<u64>(ends, row) as usize;
        (if row == 0 { 0 } else { end(row - 1) })..end(row)
    }
}

impl<'a> Table<'a> {
    /// The points of `blocks`, which follow one another from point 0 on.
    pub fn new(joints: usize, blocks: Vec<Block<'a>>) -> Self {
        Self { joints, blocks, replaced: Replaced::new() }
    }

    /// Status of a point.
    pub fn status(&self, point: usize) -> Status {
        self.read(point, |block, row| block.status(row))
    }

    /// Result of a point.
    pub fn result(&self, point: usize) -> PointResult {
        self.read(point, |block, row| block.result(row, self.joints))
    }

    /// Forces on the object's nodes at a point, ascending by node [N].
    pub fn forces(&self, point: usize) -> Vec<NodeForce> {
        self.read(point, |block, row| block.forces(row))
    }

    /// Result of a point as it was before it was replaced.
    pub fn before(&self, point: usize) -> PointResult {
        let block = self.block(point);
        block.result(point - block.first, self.joints)
    }

    /// Returns by how many contacts and touches the new results exceed those that they replace.
    pub fn more(&self) -> [isize; 2] {
        let mut more = [0; 2];
        for (&point, row) in &self.replaced {
            let block = self.block(point);
            let point = point - block.first;
            more[0] += row.contacts.nodes.len() as isize - block.row(Section::Ends, point).len() as isize;
            if !row.touches.ends.is_empty() {
                more[1] += row.touches.nodes.len() as isize - block.row(Section::TouchEnds, point).len() as isize;
            }
        }
        more
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
