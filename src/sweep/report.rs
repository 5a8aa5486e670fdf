//! The report of a sweep, in numbers.

use super::{Footprint, Forecast, Lowered, Sweep, tally::Tally};
use crate::contact::MeshRipple;
use crate::dataset::{MeasuredError, Provenance};
use crate::object::{LatticeError, Skin};
use serde::Serialize;
use std::time::Duration;

/// Report of a sweep. Serialises to the object that `bake --json` prints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepReport {
    /// Grid points.
    pub points: usize,
    /// Points in contact, converged or not.
    pub contact_points: usize,
    /// Points among them that did not converge.
    pub unconverged: usize,
    /// Points among them with more contacts than the solver has room for.
    pub overflowed: usize,
    /// Greatest relative residual of a converged point (1).
    pub max_residual: f64,
    /// Iterations of the points in contact.
    pub iterations: Iterations,
    /// Points that this run found free of contact without solving them.
    pub skipped_points: usize,
    /// Points that were taken over from an interrupted sweep.
    pub resumed_points: usize,
    /// Points that this run's GPU left to the CPU, because its precision or room did not decide them.
    pub left_to_cpu: usize,
    /// Result of the search for lower equilibria; absent if there was none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lowered: Option<Lowered>,
    /// Error of the dataset; absent where it was not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<MeasuredError>,
    /// Wall time of this run (s).
    pub seconds: f64,
    /// Part of it spent on solving the points from rest (s).
    pub solving_seconds: f64,
    /// Points solved by this run, over its wall time (1/s).
    pub configurations_per_second: f64,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// Name of the adapter.
    pub adapter: String,
    /// `following`, `rest` or `paper`.
    pub algorithm: String,
    /// Memory and disk, as they were stated before the sweep.
    pub footprint: Footprint,
    /// Cost expected before the sweep, from a sample of its points; absent if the grid was too small to be sampled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forecast: Option<Forecast>,
    /// The object's skin beside its mesh; absent where it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skin: Option<Skin>,
    /// The error that the cubes of the object's lattice make; absent where it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lattice: Option<LatticeError>,
    /// How much a contact point feels the mesh; absent where that was not looked at.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh_ripple: Option<MeshRipple>,
    /// Warnings about the object, then notices of the run.
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

/// Facts about a run beside its results.
#[derive(Default)]
pub(super) struct RunFacts {
    pub footprint: Footprint,
    pub skipped_points: usize,
    pub resumed_points: usize,
    /// By the backend.
    pub left_to_cpu: usize,
    pub lowered: Option<Lowered>,
    /// Part of `time` spent on solving from rest.
    pub solving: Duration,
    pub time: Duration,
}

impl SweepReport {
    /// Of a run of `sweep`.
    pub(super) fn of(sweep: &Sweep<'_>, tally: &Tally, run: RunFacts, provenance: &Provenance) -> Self {
        let contact_points = tally.statuses.in_contact();
        let seconds = run.time.as_secs_f64();
        Self {
            points: tally.points,
            contact_points,
            unconverged: tally.statuses.unconverged,
            overflowed: tally.statuses.overflow,
            max_residual: tally.max_residual.into(),
            iterations: Iterations {
                mean: tally.iterations as f64 / contact_points.max(1) as f64,
                max: tally.max_iterations,
            },
            skipped_points: run.skipped_points,
            resumed_points: run.resumed_points,
            left_to_cpu: run.left_to_cpu,
            lowered: run.lowered,
            error: provenance.error.clone(),
            seconds,
            solving_seconds: run.solving.as_secs_f64(),
            // A clock that did not move is taken for its own resolution; skipped points count as solved.
            configurations_per_second: (tally.points - run.resumed_points) as f64
                / run.time.max(Duration::from_nanos(1)).as_secs_f64(),
            backend: provenance.backend.clone(),
            adapter: provenance.adapter.clone(),
            algorithm: provenance.algorithm.clone(),
            footprint: run.footprint,
            forecast: sweep.forecast,
            skin: sweep.skin,
            lattice: sweep.lattice,
            mesh_ripple: provenance.mesh_ripple,
            warnings: sweep.warnings.iter().chain(&provenance.notices).cloned().collect(),
        }
    }
}
