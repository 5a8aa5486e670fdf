//! The counts that a sweep keeps on the way, so that it need not keep its results to sum them up.

use super::table::{Block, PointResult, Table};
use crate::{
    contact::Status,
    dataset::{StatusCounts, Stored},
};
use rayon::prelude::*;

/// Points that one thread counts at a time.
const SHARE: usize = 1 << 12;

/// Sums over the points done.
#[derive(Clone, Copy, Default)]
pub(super) struct Tally {
    pub points: usize,
    pub statuses: StatusCounts,
    /// Greatest residual of a converged point (1).
    pub max_residual: f32,
    /// Iterations, summed over the points in contact.
    pub iterations: u64,
    pub max_iterations: u32,
}

impl Tally {
    /// Counts the `points` points of `table`, on all cores.
    pub fn of(table: &Table<'_>, points: usize) -> Self {
        let count = |mut tally: Self, point| {
            let PointResult { status, iterations, residual, .. } = table.result(point);
            tally.count(status, iterations, residual);
            tally
        };
        let shares = (0..points).into_par_iter().with_min_len(SHARE).fold(Self::default, count);
        Self { points, ..shares.reduce(Self::default, Self::merged) }
    }

    fn merged(mut self, other: Self) -> Self {
        self.points += other.points;
        self.statuses.merge(other.statuses);
        self.max_residual = self.max_residual.max(other.max_residual);
        self.iterations += other.iterations;
        self.max_iterations = self.max_iterations.max(other.max_iterations);
        self
    }

    /// Counts the points of `block`.
    pub fn add(&mut self, block: &Block<'_>) {
        self.points += block.points();
        for row in 0..block.points() {
            let (iterations, residual) = (block.number(Stored::Iterations, row), block.number(Stored::Residual, row));
            self.count(block.status(row), iterations, residual);
        }
    }

    fn count(&mut self, status: Status, iterations: u32, residual: f32) {
        self.statuses.add(status);
        if !matches!(status, Status::Free | Status::Outside) {
            self.iterations += u64::from(iterations);
            self.max_iterations = self.max_iterations.max(iterations);
        }
        if status == Status::Contact {
            self.max_residual = self.max_residual.max(residual);
        }
    }
}
