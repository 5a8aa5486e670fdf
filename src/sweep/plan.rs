//! The cost of each shard of a bake, before anything is baked.
//!
//! Which points are skipped is found out for the whole grid, as each shard does. The time of the others is shared out
//! from the forecast of the whole sweep (`forecast.rs`).

use super::{Backend, BackendChoice, Bake, Forecast, Shard};
use crate::{Error, memory, scene::Scene};
use serde::Serialize;
use std::{sync::atomic::AtomicBool, time::Instant};

/// Memory over that of the planning process and of the largest chunk (1): allocators keep some of what was freed.
const MEMORY_MARGIN: f64 = 1.25;

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
    /// The whole sweep, from a sample.
    pub forecast: Forecast,
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
    /// When the object or the grid is refused, or the sample is stopped.
    pub fn new(scene: &Scene, backend: BackendChoice, count: usize, stop: &AtomicBool) -> Result<Self, Error> {
        let start = Instant::now();
        let bake = Bake { scene, backend, measured: Some(0), aim: None, date: "", stop, progress: &mut |_| () };
        bake.prepared(|sweep, backend, run| {
            sweep.binding.shard = Shard { index: 0, count };
            let solved = sweep.solved_of_shards(count)?;
            let setup = start.elapsed().as_secs_f64();
            sweep.binding.shard = Shard::WHOLE;
            // A GPU's time for few points says nothing of many.
            let is_timed = backend.is_cpu_alone();
            let forecast = sweep.forecast.map_or_else(|| sweep.sampled(backend, is_timed), Ok)?;
            sweep.binding.shard = Shard { index: 0, count };
            let largest = sweep.footprint(run.chunk, false);
            let (points, all) = (sweep.grid().points(), solved.iter().sum::<usize>());
            let cost = |(index, &solved): (usize, &usize)| {
                let own = Shard { index, count }.points(points);
                let bytes = (forecast.part as f64 * own as f64 / points as f64).round() as usize;
                let share = solved as f64 / all.max(1) as f64;
                let seconds = forecast.seconds.map(|seconds| setup + seconds * share);
                ShardCost { shard: index, points: own, solved, seconds, bytes }
            };
            Ok(Self {
                points,
                solved: all,
                threads: backend.threads(),
                backend: backend.name(),
                setup,
                forecast,
                memory: (MEMORY_MARGIN * (memory::greatest().unwrap_or(0) + largest.memory.most) as f64) as usize,
                dataset: forecast.disk,
                shards: solved.iter().enumerate().map(cost).collect(),
            })
        })
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
