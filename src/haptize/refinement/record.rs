//! What is known of each grid point while a grid is filled: its gap, and its result once it has one.

use super::super::columns::{Columns, Entry, Shape};
use crate::{contact::Status, dataset::StatusCounts};
use std::{collections::TryReserveError, mem::size_of};

/// Stands for a point that has no result.
const NONE: u32 = u32::MAX;

/// Gaps and results of the points of a grid.
pub(super) struct Record {
    shape: Shape,
    /// Of each grid point, or a lower bound of it [m].
    gap: Vec<f32>,
    /// Number of each grid point's result.
    place: Vec<u32>,
    /// In the order in which they were found.
    results: Columns,
    /// Where each result's contacts begin, and where the last one's end.
    starts: Vec<usize>,
    /// Points at which nothing touches.
    free: usize,
    /// Results by what became of them.
    pub statuses: StatusCounts,
}

impl Record {
    /// Of points with these gaps.
    pub fn new(gap: Vec<f32>, shape: Shape) -> Result<Self, TryReserveError> {
        let mut place = Vec::new();
        place.try_reserve_exact(gap.len())?;
        place.resize(gap.len(), NONE);
        let free = gap.iter().filter(|gap| **gap >= 0.0).count();
        let statuses = StatusCounts::default();
        Ok(Self { shape, gap, place, results: Columns::default(), starts: vec![0], free, statuses })
    }

    /// Bytes beside the results, of `points` grid points.
    pub fn bytes(points: usize) -> usize {
        points.saturating_mul(size_of::<f32>() + size_of::<u32>() + size_of::<usize>())
    }

    /// Whether something touches at `point`, or may: what has no gap is left to the solver.
    pub fn touches(&self, point: usize) -> bool {
        self.gap[point] < 0.0 || self.gap[point].is_nan()
    }

    /// Whether something touches at `point`, and it is not known what comes of it.
    pub fn is_open(&self, point: usize) -> bool {
        self.touches(point) && self.place[point] == NONE
    }

    /// Gap of `point`, or a lower bound of it [m].
    pub fn gap(&self, point: usize) -> f32 {
        self.gap[point]
    }

    /// The result of `point`; `None` where nothing touches, or nothing is known yet.
    pub fn result(&self, point: usize) -> Option<Entry<'_>> {
        let place = self.place[point] as usize;
        let contacts = self.starts.get(place).copied()?..*self.starts.get(place + 1)?;
        Some(self.results.entry(place, self.shape.joints, contacts))
    }

    /// What became of `point`.
    pub fn status(&self, point: usize) -> Status {
        self.result(point).map_or(Status::Free, |result| Status::from_number(result.status).unwrap_or(Status::Outside))
    }

    /// Adds the result of `point`; an error where there is no memory for it.
    pub fn put(&mut self, point: usize, result: Entry<'_>) -> Result<(), TryReserveError> {
        self.statuses.add(Status::from_number(result.status).unwrap_or(Status::Outside));
        self.place[point] = (self.starts.len() - 1) as u32;
        self.results.push_entry(result)?;
        self.starts.push(self.results.nodes.len());
        Ok(())
    }

    /// Points that are known by now: those where nothing touches, and those with a result.
    pub fn known(&self) -> usize {
        self.free + self.results.points()
    }

    /// Results that were solved for.
    pub fn solved(&self) -> usize {
        self.results.points() - self.statuses.filled
    }

    /// All points in the order of the grid.
    pub fn columns(&self) -> Result<Columns, TryReserveError> {
        let mut columns = Columns::with_room(self.gap.len(), self.shape.joints)?;
        for (point, &gap) in self.gap.iter().enumerate() {
            match self.result(point) {
                Some(result) => columns.push_entry(result)?,
                None => columns.push_free(gap, self.shape),
            }
        }
        Ok(columns)
    }
}
