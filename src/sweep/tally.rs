//! The counts that a sweep keeps on the way, so that it need not keep its results to sum them up.

use super::tile::Tile;
use crate::{
    contact::Status,
    dataset::{StatusCounts, Stored},
};
use std::ops::Range;

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
    /// Counts points of `tile`.
    pub fn add(&mut self, tile: &Tile<'_>, points: Range<usize>) {
        self.points += points.len();
        for row in points {
            let status = tile.status(row);
            self.statuses.add(status);
            if !matches!(status, Status::Free | Status::Outside) {
                let iterations = tile.number(Stored::Iterations, row);
                self.iterations += u64::from(iterations);
                self.max_iterations = self.max_iterations.max(iterations);
            }
            if status == Status::Contact {
                self.max_residual = self.max_residual.max(tile.number(Stored::Residual, row));
            }
        }
    }
}
