//! Contact solved ahead of a motion, while it is felt: blocks of a store around the proxy and along its way, coarse
//! before fine.
//!
//! *What is wanted.* The proxy at q moves with v. Of each level l the cells are wanted through which q + v t passes
//! within a time that halves from level to level, as the cells do: all levels look ahead over as many cells. Levels are
//! filled from the base up, each from the proxy outwards. When all that is there the cells beside the proxy's follow,
//! the nearest first: the hand may turn.
//!
//! *What is left out.* Above the base, a node around which nothing can touch, by a bound of how far the proxy moves
//! within its cells, is not solved if the levels below say that it is free.
//!
//! Several threads share the work: each claims some blocks, solves and publishes them. A node depends on its own
//! configuration, the base's spacing and the nodes on which it rests. So the store is the same, to the bit, whoever
//! solved it and in whatever order.

mod follow;

pub use follow::{Follower, Solution, follow};

use super::node::{self, Scale};
use crate::{
    JointVector,
    contact::{Model, Solver},
    store::{Nodes, Place, PublishError, Store},
};
use std::{
    collections::HashSet,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

/// How far ahead the base is solved (s). Longer: more is solved that is never felt. Shorter: a hand that speeds up is
/// not kept up with.
const AHEAD: f64 = 0.4;

/// Places along the way at which cells are looked up at most, a level.
const MOST_PLACES: usize = 32;

/// Blocks that a thread claims at once. More: the next ones are found for a motion that has gone on. Fewer: more time
/// goes into finding them.
const BATCH: usize = 8;

/// How long a thread sleeps that has nothing to do.
const IDLE: Duration = Duration::from_micros(500);

/// Where the proxy is and goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Whereabouts {
    /// At the next tick (rad or m).
    pub position: JointVector,
    /// (rad/s or m/s)
    pub velocity: JointVector,
    /// Number of that tick.
    pub tick: u64,
}

impl Whereabouts {
    /// At rest, before the first tick.
    #[must_use]
    pub fn at_rest(position: &JointVector) -> Self {
        Self { position: *position, velocity: JointVector::zeros(position.len()), tick: 0 }
    }
}

/// How much was solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Solved {
    /// Nodes published.
    pub nodes: u64,
    /// Equilibria solved in contact for them.
    pub equilibria: u64,
}

/// Fills a store where it is wanted. Threads share it.
pub struct Ahead<'a> {
    model: &'a Model<'a>,
    store: Arc<Store>,
    scale: Scale,
    /// Keys of blocks that a thread is about to publish.
    claimed: Mutex<HashSet<u64>>,
    nodes: AtomicU64,
    equilibria: AtomicU64,
    full: AtomicBool,
}

impl<'a> Ahead<'a> {
    /// Fills `store` with equilibria of `model`, which has tangents ([`Model::with_tangent`]).
    #[must_use]
    pub fn new(model: &'a Model<'a>, store: Arc<Store>) -> Self {
        let scale = Scale::new(model, store.space());
        let (nodes, equilibria) = (AtomicU64::new(0), AtomicU64::new(0));
        Self { model, store, scale, claimed: Mutex::default(), nodes, equilibria, full: AtomicBool::new(false) }
    }

    /// A solver for one thread.
    #[must_use]
    pub fn solver(&self) -> Solver<'a> {
        Solver::new(self.model)
    }

    /// Work done so far.
    #[must_use]
    pub fn solved(&self) -> Solved {
        let [nodes, equilibria] = [&self.nodes, &self.equilibria].map(|count| count.load(Ordering::Relaxed));
        Solved { nodes, equilibria }
    }

    /// Whether the store had no room for a block.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.full.load(Ordering::Relaxed)
    }

    /// Solves for the proxy in `whereabouts`, until `over` is raised.
    pub fn serve(&self, mut whereabouts: triple_buffer::Output<Whereabouts>, over: &AtomicBool) {
        let mut solver = self.solver();
        while !over.load(Ordering::Acquire) {
            if !self.advance_until(&mut solver, whereabouts.read(), true, over) {
                thread::sleep(IDLE);
            }
        }
    }

    /// Solves all levels of the cell around `position` on `threads` threads, this one among them, for no longer than
    /// `most`.
    pub fn prepare(&self, position: &JointVector, threads: usize, most: Duration) {
        let (at, began) = (Whereabouts::at_rest(position), Instant::now());
        let work = || {
            let mut solver = self.solver();
            while began.elapsed() < most && !self.is_full() {
                // What others have claimed is on its way.
                if !self.advance(&mut solver, &at, false) {
                    if self.store.sample(position).whole == self.store.space().levels() {
                        break;
                    }
                    thread::sleep(IDLE);
                }
            }
        };
        thread::scope(|scope| {
            for _ in 1..threads {
                // A thread that cannot be had leaves its share to the others.
                let _ = thread::Builder::new().name("ahead".into()).spawn_scoped(scope, work);
            }
            work();
        });
    }

    /// Solves the blocks that a proxy `at` wants most, some at most; with `beside` those beside its way, too. False
    /// where none is wanted that nobody has claimed.
    pub fn advance(&self, solver: &mut Solver<'_>, at: &Whereabouts, beside: bool) -> bool {
        self.advance_until(solver, at, beside, &AtomicBool::new(false))
    }

    /// The same; once `over` is raised what was claimed is given back unsolved.
    fn advance_until(&self, solver: &mut Solver<'_>, at: &Whereabouts, beside: bool, over: &AtomicBool) -> bool {
        let blocks = self.claim(at, beside);
        for (level, block) in &blocks {
            if !over.load(Ordering::Acquire) {
                self.full.fetch_or(!self.solve(solver, *level, block), Ordering::Relaxed);
            }
            self.claims().remove(&self.store.space().key(*level, block));
        }
        !blocks.is_empty()
    }

    fn claims(&self) -> std::sync::MutexGuard<'_, HashSet<u64>> {
        self.claimed.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Claims the blocks that are wanted most.
    fn claim(&self, at: &Whereabouts, beside: bool) -> Vec<(u32, Place)> {
        let mut blocks = Vec::new();
        if self.is_full() {
            return blocks;
        }
        let space = self.store.space();
        let mut claimed = self.claims();
        let mut of_cell = |level: u32, low: &Place| {
            for block in self.store.corners(level, low) {
                self.want(level, &block, &mut claimed, &mut blocks);
                if blocks.len() >= BATCH {
                    return false;
                }
            }
            true
        };
        for level in 0..space.levels() {
            let mut before = None;
            for q in self.way(level, at) {
                let low = space.cell(level, &q);
                if before.replace(low) != Some(low) && !of_cell(level, &low) {
                    return blocks;
                }
            }
        }
        for level in (0..space.levels()).filter(|_| beside) {
            for low in self.beside(level, &at.position) {
                if !of_cell(level, &low) {
                    return blocks;
                }
            }
        }
        blocks
    }

    /// Claims a block that is not there; where that on which it rests is not all there, first that.
    fn want(&self, level: u32, block: &Place, claimed: &mut HashSet<u64>, blocks: &mut Vec<(u32, Place)>) {
        if self.store.get(level, block).is_some() {
            return;
        }
        let mut rests = true;
        for (below, place) in self.store.foundation(level, block) {
            if self.store.get(below, &place).is_none() {
                rests = false;
                self.want(below, &place, claimed, blocks);
            }
        }
        if rests && claimed.insert(self.store.space().key(level, block)) {
            blocks.push((level, *block));
        }
    }

    /// Places along the way, so close that no cell of `level` is left out along an axis.
    fn way(&self, level: u32, at: &Whereabouts) -> impl Iterator<Item = JointVector> + use<> {
        let space = self.store.space();
        let cells = at.velocity.iter().enumerate().map(|(a, v)| v.abs() / space.step(level, a));
        let fastest = cells.fold(0.0, f64::max);
        let (position, velocity) = (at.position, at.velocity);
        let time = AHEAD * 0.5_f64.powi(level as i32);
        // Two places a cell.
        let places = ((2.0 * fastest * time).ceil() as usize).min(MOST_PLACES);
        (0..=places).map(move |k| {
            let t = if places > 0 { time * k as f64 / places as f64 } else { 0.0 };
            let mut q = position;
            q.iter_mut().zip(velocity.iter()).for_each(|(q, v)| *q += t * v);
            q
        })
    }

    /// The cells of `level` that share a face with the one around `q`, the nearest first.
    fn beside(&self, level: u32, q: &JointVector) -> Vec<Place> {
        let space = self.store.space();
        let (low, last) = (space.cell(level, q), space.last(level));
        let first = space.configuration(level, &low);
        let mut cells = Vec::new();
        for a in 0..q.len() {
            let fraction = (q[a] - first[a]) / space.step(level, a);
            if low[a] > 0 {
                let mut cell = low;
                cell[a] -= 1;
                cells.push((fraction, cell));
            }
            if low[a] + 1 < last[a] {
                let mut cell = low;
                cell[a] += 1;
                cells.push((1.0 - fraction, cell));
            }
        }
        cells.sort_by(|a, b| a.0.total_cmp(&b.0));
        cells.into_iter().map(|(_, cell)| cell).collect()
    }

    /// Solves and publishes a block whose foundation is there. False where there is no room for it.
    pub fn solve(&self, solver: &mut Solver<'_>, level: u32, block: &Place) -> bool {
        let space = self.store.space();
        let mut nodes = Nodes::default();
        let mut equilibria = 0;
        for (place, node) in space.nodes(level, block) {
            let q = space.configuration(level, &node);
            let is_free = level > 0 && solver.gap(&q) > self.scale.reach(level) && self.store.sample(&q).value <= 0.0;
            if !is_free {
                let solved = node::solve(solver, &q, &self.scale);
                nodes.push(place, &solved.record, solved.result.gap, solved.result.status);
                equilibria += u64::from(solved.equilibria);
            }
        }
        let count = nodes.count() as u64;
        match self.store.publish(level, block, nodes) {
            Ok(()) => {
                self.nodes.fetch_add(count, Ordering::Relaxed);
                self.equilibria.fetch_add(equilibria, Ordering::Relaxed);
                true
            }
            Err(PublishError::Full(_)) => false,
            // Another thread was quicker.
            Err(_) => true,
        }
    }
}
