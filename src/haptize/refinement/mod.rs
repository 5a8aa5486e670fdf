//! A grid that is solved only where coarser grids do not foretell it.
//!
//! Every fourth line of the grid is solved first. Then, twice, the points halfway between known ones are foretold by the C1
//! potential of what is known (`field/potential.rs`), and checked against a tolerance:
//!
//! 1. At points halfway, the potential and linear interpolation are compared. Where they agree, in all of a cell, that is taken
//!    for proof enough: a smooth field makes them differ by far more than the potential errs, a kink or jump by about as much.
//! 2. Where they differ by more, the cell's centre is solved. If it was foretold, so is the cell.
//! 3. Else, and wherever a corner did not converge, all points of the cell are solved; and of all cells that share one of them
//!    that was not foretold, and so on, along the kink.
//!
//! All other points are *filled*: torque, energy and contact forces as foretold, status [`Status::Filled`](crate::contact::Status). What was solved
//! is never changed, converged or not. The dataset is a uniform grid like any other, with as fast a look-up.
//!
//! Where nothing touches is found by distances alone, at every point: no free point is solved, or filled.
//!
//! Which points are solved follows from the results alone, whatever chunks and threads there are. The part keeps the results in
//! their order; resumed, they are taken from it instead of solved, until there are none.

mod forecast;
mod level;
mod record;

use super::{
    Backend, Footprint, FreeSpace, Progress, Run, Sweep, SweepError, SweepReport,
    chunks::{Begun, Store},
    columns::Columns,
    footprint::{self, Bounds},
    report::RunFacts,
    tally::Tally,
};
use crate::{
    contact::{Model, Solver, Status},
    dataset::{Grid, Provenance},
};
use forecast::Forecast;
use level::Level;
use rayon::prelude::*;
use record::Record;
use std::{
    collections::BTreeSet,
    ops::Range,
    sync::atomic::{AtomicBool, Ordering},
    time::Instant,
};

/// Lines between those that are solved whatever comes: with two levels of halving, at most one point in 4^d must be solved.
pub(super) const COARSEST: usize = 4;

/// Points whose gaps a thread measures at a time: enough to be worth its solver.
const SHARE: usize = 256;

/// How a grid is filled.
#[derive(Clone, Copy)]
pub(super) struct Filling<'a> {
    /// By which contact is found.
    pub model: &'a Model<'a>,
    /// How far a torque may be from what was foretold [N m].
    pub tolerance: f64,
}

/// Whether `grid` has lines that can be left out, twice. The scene is read with the same check.
pub(super) fn check(grid: &Grid) -> Result<(), String> {
    match grid.axes.iter().find(|axis| !(axis.count - 1).is_multiple_of(COARSEST) || axis.count == 1) {
        Some(axis) => Err(format!(
            "axis {} has {} steps: filling needs a multiple of {COARSEST} along each axis",
            axis.name,
            axis.count - 1
        )),
        None => Ok(()),
    }
}

/// What filling takes up, in memory: gaps, results in the order of solving and in that of the grid, the forecast, a chunk.
pub(super) fn footprint(sweep: &Sweep<'_>, chunk: usize, in_memory: bool) -> Footprint {
    let (grid, shape) = (&sweep.grid, sweep.shape);
    let (points, joints) = (grid.points(), grid.joints());
    let halves = grid.axes.iter().map(|axis| axis.count / 2 + 1).fold(1, usize::saturating_mul);
    // What fills takes the contacts of all points around.
    let spread = |touching: usize| touching.saturating_mul(1 << joints);
    let results = |touching| footprint::results(points, spread(touching), shape);
    let memory = |touching| {
        let solved = footprint::chunk(chunk.clamp(1, points), chunk.clamp(1, points), touching, shape);
        // Lists grow by doubling.
        let both = 3_usize.saturating_mul(results(touching));
        let known = Record::bytes(points).saturating_add(Forecast::bytes(halves, joints)).saturating_add(points);
        both.saturating_add(known).saturating_add(solved)
    };
    let disk = |touching| if in_memory { 0 } else { results(touching) };
    Footprint { memory: Bounds::of(sweep.proxy_nodes, memory), disk: Bounds::of(sweep.proxy_nodes, disk) }
}

/// Where results go on the way, and what there is of them already.
pub(super) struct Kept<'s> {
    pub store: &'s mut dyn Store,
    /// Results of an interrupted run, in the order of solving.
    pub resumed: Columns,
}

/// Fills `sweep` as `filling` says: all points in the order of the grid; what they are like, and where they come from.
pub(super) fn fill<B: Backend>(
    sweep: &Sweep<'_>,
    filling: Filling<'_>,
    backend: &mut B,
    run: Run<'_>,
    begun: Begun,
    kept: Kept<'_>,
) -> Result<(Columns, SweepReport, Provenance), SweepError> {
    let (start, left_before) = (Instant::now(), backend.left_to_cpu());
    let footprint = footprint(sweep, run.chunk, kept.store.path().is_none());
    let points = sweep.grid.points();
    let bytes = footprint.memory.least;
    let memory = move |source| SweepError::Memory { points, bytes, source };
    (run.progress)(Progress { points, footprint, ..Progress::default() });
    let stopped = |record: Option<&Record>, store: &dyn Store| SweepError::Stopped {
        done: record.map_or(0, Record::known),
        points,
        part: store.path().map(Into::into),
    };
    let Some(gaps) = gaps(sweep, filling.model, run.stop)? else { return Err(stopped(None, &*kept.store)) };
    let Kept { store, resumed } = kept;
    let (resumed_points, mut next, mut resumed_contacts) = (resumed.points(), 0, 0);
    let mut record = Record::new(gaps, sweep.shape).map_err(memory)?;
    let mut provenance = begun.provenance;
    let mut solve = |wanted: &[usize], record: &mut Record| -> Result<(), SweepError> {
        let (known, fresh) = wanted.split_at(wanted.len().min(resumed_points - next));
        for &point in known {
            let contacts = resumed_contacts..resumed_contacts + resumed.contacts[next] as usize;
            resumed_contacts = contacts.end;
            record.put(point, resumed.entry(next, sweep.shape.joints, contacts)).map_err(memory)?;
            next += 1;
        }
        let mut columns = Columns::default();
        for chunk in fresh.chunks(run.chunk.max(1)) {
            if run.stop.load(Ordering::Relaxed) {
                return Err(stopped(Some(record), &*store));
            }
            let first = record.solved();
            let configurations: Vec<_> = chunk.iter().map(|&point| sweep.grid.configuration(point)).collect();
            let (low, high) = (chunk[0], chunk[chunk.len() - 1]);
            let equilibria = super::chunks::solved(backend, &configurations, low..high + 1)?;
            for notice in backend.notices() {
                let notice = format!("from solved point {first} on: {notice}");
                store.note(&notice)?;
                provenance.notices.push(notice);
            }
            columns.clear();
            equilibria.iter().for_each(|equilibrium| columns.push(equilibrium, sweep.shape));
            store.append(first, &columns)?;
            let mut start_of = 0;
            for (k, &point) in chunk.iter().enumerate() {
                let contacts = start_of..start_of + columns.contacts[k] as usize;
                start_of = contacts.end;
                record.put(point, columns.entry(k, sweep.shape.joints, contacts)).map_err(memory)?;
            }
            let rate = (record.solved() - resumed_points) as f64 / start.elapsed().as_secs_f64().max(f64::MIN_POSITIVE);
            let contact_points = record.statuses.in_contact();
            (run.progress)(Progress { done: record.known(), points, contact_points, rate, footprint });
        }
        Ok(())
    };
    let level = Level::new(&sweep.grid, COARSEST);
    let wanted: Vec<usize> = level.points().filter(|&point| record.touches(point)).collect();
    solve(&wanted, &mut record)?;
    let mut stride = COARSEST;
    while stride > 1 {
        let level = Level::new(&sweep.grid, stride);
        let forecast = Forecast::new(&level, &record)?;
        let doubtful = doubtful_cells(&level, &forecast, &record, filling.tolerance);
        let probed: Vec<usize> =
            doubtful.iter().map(|&cell| level.centre(cell)).filter(|&p| record.is_open(p)).collect();
        solve(&probed, &mut record)?;
        let foretold = |point: usize, record: &Record| {
            let result = record.result(point).filter(|_| record.status(point) == Status::Contact);
            result.is_some_and(|result| forecast.error(point, result.torque) <= filling.tolerance)
        };
        let is_refined = |cell: &usize| {
            let sound = level.corners(*cell).all(|corner| !record.status(corner).is_failed());
            !sound || !foretold(level.centre(*cell), &record)
        };
        let mut refined: BTreeSet<usize> = doubtful.into_iter().filter(is_refined).collect();
        let mut frontier: Vec<usize> = refined.iter().copied().collect();
        while !frontier.is_empty() {
            let open = frontier.iter().flat_map(|&cell| level.halfway(cell)).filter(|&point| record.is_open(point));
            let wanted: Vec<usize> = open.collect::<BTreeSet<usize>>().into_iter().collect();
            solve(&wanted, &mut record)?;
            let missed = wanted.into_iter().filter(|&point| !foretold(point, &record));
            let beside: BTreeSet<usize> = missed.flat_map(|point| level.cells_at(point)).collect();
            frontier = beside.into_iter().filter(|&cell| refined.insert(cell)).collect();
        }
        for point in level.cells().flat_map(|cell| level.halfway(cell)) {
            if record.is_open(point) {
                let foretold = forecast.foretell(point, &record);
                record.put(point, foretold.entry()).map_err(memory)?;
            }
        }
        stride /= 2;
    }
    let columns = record.columns().map_err(memory)?;
    let mut tally = Tally::default();
    tally.add(&columns);
    let free = points - record.statuses.in_contact();
    let facts = RunFacts {
        footprint,
        skipped_points: free,
        resumed_points,
        solved_points: record.solved() - resumed_points,
        left_to_cpu: backend.left_to_cpu() - left_before,
        time: start.elapsed(),
    };
    Ok((columns, SweepReport::of(&tally, facts, &provenance, &sweep.warnings), provenance))
}

/// Cells of `level` in which something is to be found out, ascending: with a corner that did not converge, or a point in contact
/// halfway where linear interpolation and the potential differ by more than `tolerance`.
fn doubtful_cells(level: &Level<'_>, forecast: &Forecast<'_>, record: &Record, tolerance: f64) -> Vec<usize> {
    let cells: Vec<usize> = level.cells().collect();
    let doubtful = |&cell: &usize| {
        let mut open = level.halfway(cell).filter(|&point| record.is_open(point)).peekable();
        open.peek().is_some()
            && (level.corners(cell).any(|corner| record.status(corner).is_failed())
                || open.any(|point| forecast.doubt(point, record) > tolerance))
    };
    cells.into_par_iter().filter(doubtful).collect()
}

/// Gaps of all points; lower bounds of them where free space is proven. `None` when it was stopped.
fn gaps(sweep: &Sweep<'_>, model: &Model<'_>, stop: &AtomicBool) -> Result<Option<Vec<f32>>, SweepError> {
    let (grid, points) = (&sweep.grid, sweep.grid.points());
    let memory = |source| SweepError::Memory { points, bytes: 4 * points, source };
    let mut gaps: Vec<f32> = Vec::new();
    gaps.try_reserve_exact(points).map_err(memory)?;
    let free_space = FreeSpace::new(model, grid);
    while gaps.len() < points {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let slab: Range<usize> = free_space.slab(gaps.len());
        let free = sweep.gaps(&free_space, slab.clone())?;
        let measured = slab.into_par_iter().with_min_len(SHARE).map_init(
            || Solver::new(model),
            |solver, point| free.gap(point).unwrap_or_else(|| solver.gap(&grid.configuration(point)) as f32),
        );
        gaps.par_extend(measured);
    }
    Ok(Some(gaps))
}
