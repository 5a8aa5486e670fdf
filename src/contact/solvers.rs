//! Many configurations on all cores: one solver a thread.

use super::{Model, Solver};
use rayon::prelude::*;
use std::sync::{Mutex, MutexGuard};

/// Items that one thread takes at a time: enough that sharing them out costs nothing, few enough that no thread waits
/// long for the last.
pub(crate) const SHARE: usize = 8;

/// Solvers of one model, one a thread of a pool.
pub(crate) struct Solvers<'a> {
    model: &'a Model<'a>,
    /// By the thread's number: the lock is never contended.
    solvers: Vec<Mutex<Solver<'a>>>,
}

impl<'a> Solvers<'a> {
    /// Solvers of `model` for a pool of `threads` threads.
    pub fn new(model: &'a Model<'a>, threads: usize) -> Self {
        Self { model, solvers: (0..threads).map(|_| Mutex::new(Solver::new(model))).collect() }
    }

    /// Returns how many there are.
    pub fn threads(&self) -> usize {
        self.solvers.len()
    }

    /// Applies `solve` to each item and returns the results in the same order. Runs on the thread pool of the caller,
    /// else on the program's.
    pub fn map<T: Sync, R: Send>(&self, items: &[T], solve: impl Fn(&mut Solver<'a>, &T) -> R + Sync) -> Vec<R> {
        items.par_iter().with_min_len(SHARE).map(|item| solve(&mut self.own(), item)).collect()
    }

    /// The solver of this thread of the pool.
    pub fn own(&self) -> MutexGuard<'_, Solver<'a>> {
        let solver = &self.solvers[rayon::current_thread_index().unwrap_or(0) % self.solvers.len()];
        solver.lock().unwrap_or_else(|poisoned| {
            // A panic may have left it in the middle of its work.
            let mut solver = poisoned.into_inner();
            *solver = Solver::new(self.model);
            solver
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::bodies::{PAPER, contact, floating_bar, pressed, sphere};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    #[test]
    fn a_solver_that_a_panic_left_in_the_middle_of_its_work_is_made_anew() {
        let (object, chain) = (sphere(PAPER).unwrap(), floating_bar(0.0));
        let [model, other] = [500.0, 5.0].map(|stiffness| Model::new(&object, &chain, contact(stiffness)));
        let places = pressed(&model, 1, 3, 0.002, 0.01);
        let solvers = Solvers::new(&model, 1);
        let stopped = catch_unwind(AssertUnwindSafe(|| {
            solvers.map(&places[..1], |solver, _| {
                // As wrong as a solver can be left.
                *solver = Solver::new(&other);
                panic!("in the middle of its work");
            })
        }));
        assert!(stopped.map(|results: Vec<()>| results).is_err());
        let again = solvers.map(&places, |solver, q| solver.solve(q).forces);
        assert_eq!(again, places.iter().map(|q| Solver::new(&model).solve(q).forces).collect::<Vec<_>>());
    }
}
