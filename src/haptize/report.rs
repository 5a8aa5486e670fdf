//! What a sweep did, in numbers.

use super::Memory;
use crate::{contact::Status, dataset::Dataset};
use serde::Serialize;
use std::time::Duration;

/// What a sweep did. Serialises to the object that `bake --json` prints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepReport {
    /// Grid points.
    pub points: usize,
    /// Points in contact, converged or not.
    pub contact_points: usize,
    /// Of these, not converged.
    pub unconverged: usize,
    /// Of these, with more contacts than the solver has room for.
    pub overflowed: usize,
    /// Greatest relative residual of a converged point [1].
    pub max_residual: f64,
    /// Iterations of the points in contact.
    pub iterations: Iterations,
    /// Points that were proven free of contact without being solved.
    pub skipped_points: usize,
    /// Points that were taken over from an interrupted sweep.
    pub resumed_points: usize,
    /// Wall time of this run [s].
    pub seconds: f64,
    /// Points solved by this run, over its wall time [1/s].
    pub configurations_per_second: f64,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Name of the adapter.
    pub adapter: String,
    /// `energy`, `paper` or `linearised`.
    pub algorithm: String,
    /// Memory of the results, as it was stated before the sweep.
    pub memory: Memory,
    /// What was noticed about the object while it was built, and what happened on the way.
    pub warnings: Vec<String>,
}

/// Iterations of the points in contact.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Iterations {
    /// Mean; 0 where nothing touches.
    pub mean: f64,
    /// Greatest.
    pub max: u32,
}

impl SweepReport {
    pub(super) fn of(
        dataset: &Dataset,
        memory: Memory,
        skipped_points: usize,
        resumed_points: usize,
        time: Duration,
        warnings: Vec<String>,
    ) -> Self {
        let points = dataset.grid.points();
        let counts = dataset.status_counts();
        let contact_points = counts.contact + counts.unconverged + counts.overflow;
        let iterations = dataset.iterations.as_deref().unwrap_or_default();
        let in_contact = iterations.iter().zip(0..).filter(|&(_, point)| {
            matches!(dataset.status(point), Status::Contact | Status::Unconverged | Status::Overflow)
        });
        let (sum, max) = in_contact.fold((0, 0), |(sum, max), (&count, _)| (sum + u64::from(count), count.max(max)));
        let seconds = time.as_secs_f64();
        Self {
            points,
            contact_points,
            unconverged: counts.unconverged,
            overflowed: counts.overflow,
            max_residual: dataset.max_residual().unwrap_or(0.0),
            iterations: Iterations { mean: sum as f64 / contact_points.max(1) as f64, max },
            skipped_points,
            resumed_points,
            seconds,
            // A clock that did not move is taken for its own resolution.
            configurations_per_second: (points - resumed_points) as f64
                / time.max(Duration::from_nanos(1)).as_secs_f64(),
            backend: dataset.provenance.backend.clone(),
            adapter: dataset.provenance.adapter.clone(),
            algorithm: dataset.provenance.algorithm.clone(),
            memory,
            warnings,
        }
    }
}
