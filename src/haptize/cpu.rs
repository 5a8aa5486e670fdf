//! The CPU backend: all cores, f64, one solver a thread.

use super::Backend;
use crate::{
    JointVector,
    contact::{Equilibrium, Model, Solver},
};
use rayon::{ThreadPool, ThreadPoolBuilder, prelude::*};
use std::{
    convert::Infallible,
    sync::{Mutex, PoisonError},
};

/// Configurations that one thread takes at a time: enough that sharing them out costs nothing, few enough that no thread
/// waits long for the last.
const SHARE: usize = 8;

/// Shares of each thread in a chunk: progress is told several times a second, and threads rarely wait at a chunk's end.
const SHARES: usize = 32;

/// Solves configurations on all cores.
pub struct CpuBackend<'a> {
    pool: ThreadPool,
    /// One a thread, by the thread's number: the lock is never contended.
    solvers: Vec<Mutex<Solver<'a>>>,
}

impl<'a> CpuBackend<'a> {
    /// Solvers for `model` on `threads` threads; 0 takes one for each core.
    ///
    /// # Errors
    /// When the system gives no threads.
    pub fn new(model: &'a Model<'a>, threads: usize) -> Result<Self, rayon::ThreadPoolBuildError> {
        let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("contact {k}")).build()?;
        let solvers = (0..pool.current_num_threads()).map(|_| Mutex::new(Solver::new(model))).collect();
        Ok(Self { pool, solvers })
    }

    /// Number of threads.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.solvers.len()
    }

    /// A good [`super::Run::chunk`] for this backend.
    #[must_use]
    pub fn chunk(&self) -> usize {
        SHARE * SHARES * self.threads()
    }

    /// What [`crate::dataset::Provenance::adapter`] says of this backend.
    #[must_use]
    pub fn adapter() -> String {
        format!("{} cores, f64", std::env::consts::ARCH)
    }
}

impl Backend for CpuBackend<'_> {
    type Error = Infallible;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Infallible> {
        let solvers = &self.solvers;
        Ok(self.pool.install(|| {
            configurations
                .par_iter()
                .with_min_len(SHARE)
                .map(|q| {
                    let solver = &solvers[rayon::current_thread_index().unwrap_or(0) % solvers.len()];
                    // A solver keeps nothing from one configuration to the next that a panic could have spoilt.
                    solver.lock().unwrap_or_else(PoisonError::into_inner).solve(q)
                })
                .collect()
        }))
    }
}
