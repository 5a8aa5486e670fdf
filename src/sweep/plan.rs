//! The cost of each shard of a bake, before anything is baked.
//!
//! Which points are skipped is found out for the whole grid, as each shard does. The time of the others follows from a
//! sample, solved on this machine.

use super::{Backend, BackendChoice, Bake, BakeError, ChosenBackend, Forecast, Run, Shard, Sweep};
use crate::{JointVector, memory, scene::Scene};
use serde::Serialize;
use std::{sync::atomic::AtomicBool, time::Instant};

/// Memory over that of the planning process and of the largest chunk (1): allocators keep some of what was freed.
const MEMORY_MARGIN: f64 = 1.25;

/// Points that are solved to know the time of one, at most (1).
const SAMPLE: usize = 512;

/// Points among them that are solved at once (1).
const PORTION: usize = 64;

/// Time after which no more of them are solved (s).
const LONGEST: f64 = 1.0;

/// Expected cost of a shard.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ShardCost {
    /// From 0.
    pub shard: usize,
    /// Number of its points.
    pub points: usize,
    /// Those that are solved; the others are proven free.
    pub solved: usize,
    /// Time from the start of the process to its end, as on this machine; absent where a GPU solves (s).
    pub seconds: Option<f64>,
    /// Its file (bytes).
    pub bytes: usize,
}

/// Expected cost of a bake in shards.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Grid points.
    pub points: usize,
    /// Points among them that are solved.
    pub solved: usize,
    /// Threads that solved the sample.
    pub threads: usize,
    /// `cpu` or `gpu`.
    pub backend: &'static str,
    /// Setting up, which each shard repeats: object, compliance, and proving points free (s).
    pub setup: f64,
    /// The sample; absent where the grid is too small.
    pub forecast: Option<Forecast>,
    /// Memory of a process, shard or merge (bytes).
    pub memory: usize,
    /// The dataset. Merging takes twice as much disk beside the shards, for a moment (bytes).
    pub dataset: usize,
    /// Shard by shard.
    pub shards: Vec<ShardCost>,
}

impl Plan {
    /// Plans the bake of `scene` by `backend` in `count` shards.
    ///
    /// # Errors
    /// Any [`BakeError`].
    pub fn new(scene: &Scene, backend: BackendChoice, count: usize, stop: &AtomicBool) -> Result<Self, BakeError> {
        let start = Instant::now();
        let bake = Bake { scene, backend, measured: Some(0), aim: None, date: "", stop, progress: &mut |_| () };
        bake.prepared(|sweep, backend, run| {
            sweep.shard = Shard { index: 0, count };
            let (solved, sample) = sweep.solved_of_shards(count, SAMPLE)?;
            let setup = start.elapsed().as_secs_f64();
            // A GPU's time for few points says nothing of many.
            let is_timed = matches!(backend, ChosenBackend::Cpu(_));
            let each = if is_timed { timed(sweep, backend, &sample)? } else { None };
            sweep.shard = Shard::WHOLE;
            sweep.predict(backend, false)?;
            Ok(Self::of(sweep, backend, &run, &solved, (setup, each)))
        })
    }

    /// `setup`: that time, and the time of each solved point where it is known (s).
    fn of(
        sweep: &mut Sweep<'_>,
        backend: &ChosenBackend<'_>,
        run: &Run<'_>,
        solved: &[usize],
        (setup, each): (f64, Option<f64>),
    ) -> Self {
        let points = sweep.grid().points();
        let of_whole = |bytes: usize, part: usize| (bytes as f64 * part as f64 / points as f64).round() as usize;
        let all: usize = solved.iter().sum();
        let forecast = sweep.forecast;
        let dataset = forecast.map_or(sweep.footprint(run.chunk, false).disk.most, |forecast| forecast.disk);
        let stored = forecast.map_or(0, |forecast| forecast.part);
        sweep.shard = Shard { index: 0, count: solved.len() };
        let largest = sweep.footprint(run.chunk, false);
        let shards = solved.iter().enumerate().map(|(index, &solved_points)| {
            let shard = Shard { index, count: solved.len() };
            let own = shard.points(points);
            let seconds = each.map(|each| setup + each * solved_points as f64);
            let bytes = if stored > 0 { of_whole(stored, own) } else { largest.disk.most };
            ShardCost { shard: index, points: own, solved: solved_points, seconds, bytes }
        });
        let shards = shards.collect();
        let own = memory::greatest().unwrap_or(0);
        Self {
            points,
            solved: all,
            threads: rayon::current_num_threads(),
            backend: backend.name(),
            setup,
            forecast,
            memory: (MEMORY_MARGIN * (own + largest.memory.most) as f64) as usize,
            dataset,
            shards,
        }
    }

    /// Total time of all shards, one after the other, where it is known (s).
    #[must_use]
    pub fn seconds(&self) -> Option<f64> {
        self.shards.iter().map(|shard| shard.seconds).sum()
    }

    /// Time of the longest shard, where it is known (s).
    #[must_use]
    pub fn longest(&self) -> Option<f64> {
        self.shards.iter().filter_map(|shard| shard.seconds).max_by(f64::total_cmp)
    }
}

/// Time of each of the points `sample`, solved by `backend`; `None` where there are none (s).
fn timed(sweep: &Sweep<'_>, backend: &mut ChosenBackend<'_>, sample: &[usize]) -> Result<Option<f64>, BakeError> {
    let (start, mut solved) = (Instant::now(), 0);
    for portion in sample.chunks(PORTION) {
        let configurations: Vec<JointVector> = portion.iter().map(|&point| sweep.grid().configuration(point)).collect();
        backend.solve(&configurations)?;
        solved += portion.len();
        if start.elapsed().as_secs_f64() > LONGEST {
            break;
        }
    }
    Ok((solved > 0).then(|| start.elapsed().as_secs_f64() / solved as f64))
}
