//! The CPU backend: all cores, f64, one solver a thread.

use super::{Backend, grid_sweep::provenance};
use crate::{
    Error, JointVector,
    contact::{Equilibrium, Model, SHARE, Solvers, Work},
    dataset::Provenance,
    scene::Scene,
    threads,
};
use rayon::{Scope, ThreadPool, ThreadPoolBuilder};
use std::{
    collections::VecDeque,
    convert::Infallible,
    sync::mpsc::{Receiver, channel},
    time::SystemTime,
};

/// Shares of each thread in a chunk: progress is reported several times a second, and threads rarely wait at a chunk's
/// end.
const SHARES: usize = 32;

/// Chunks that are shared out at once: threads go on with the next where nothing is left of one, and nobody waits for
/// the thread that hands chunks out and takes them back.
const SHARED_OUT: usize = 2;

/// Solves configurations on all cores.
pub struct CpuBackend<'a> {
    pool: ThreadPool,
    solvers: Solvers<'a>,
}

impl<'a> CpuBackend<'a> {
    /// Solvers for `model` on `threads` threads; 0 takes one for each core.
    ///
    /// # Errors
    /// When the system gives no threads.
    pub fn new(model: &'a Model<'a>, threads: usize) -> Result<Self, Error> {
        let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("contact {k}")).build();
        let pool = pool.map_err(threads::refused)?;
        let solvers = Solvers::new(model, pool.current_num_threads());
        Ok(Self { pool, solvers })
    }

    /// A good [`super::Run::chunk`] for this backend.
    #[must_use]
    pub fn chunk(&self) -> usize {
        SHARE * SHARES * self.threads()
    }

    /// Returns the provenance of what this backend solves now of `scene`.
    #[must_use]
    pub fn provenance(scene: &Scene) -> Provenance {
        let date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
        provenance(scene, ["cpu", &Self::adapter(), &date])
    }

    /// Returns the name of this backend in [`crate::dataset::Provenance::adapter`].
    #[must_use]
    pub fn adapter() -> String {
        format!("{} cores, f64", std::env::consts::ARCH)
    }
}

impl Backend for CpuBackend<'_> {
    type Error = Infallible;

    fn threads(&self) -> usize {
        self.solvers.threads()
    }

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Infallible> {
        Ok(self.pool.install(|| self.solvers.map(configurations, |solver, q| solver.solve(q))))
    }

    fn stream(&mut self, work: &mut dyn Work) -> Result<(), Infallible> {
        self.pool.in_place_scope(|scope| {
            let (mut shared_out, mut solved) = (VecDeque::new(), None);
            loop {
                while shared_out.len() < SHARED_OUT
                    && let Some(configurations) = work.next()
                {
                    shared_out.push_back(share_out(scope, &self.solvers, configurations));
                }
                // Others are shared out first: there is time to take these while they are solved.
                if let Some(equilibria) = solved.take() {
                    work.take(equilibria);
                }
                let Some((count, shares)) = shared_out.pop_front() else { return };
                let mut shares: Vec<(usize, Vec<Equilibrium>)> = shares.into_iter().collect();
                // Nothing comes of a share whose thread has panicked, which the scope passes on.
                if shares.len() < count {
                    return;
                }
                shares.sort_unstable_by_key(|(number, _)| *number);
                solved = Some(shares.into_iter().flat_map(|(_, equilibria)| equilibria).collect());
            }
        });
        Ok(())
    }
}

/// Lets the threads of `scope` solve shares of `configurations`. Returns how many there are, and where the equilibria of
/// each come, with its number.
fn share_out<'s>(
    scope: &Scope<'s>,
    solvers: &'s Solvers<'_>,
    configurations: Vec<JointVector>,
) -> (usize, Receiver<(usize, Vec<Equilibrium>)>) {
    let (count, (sender, shares)) = (configurations.len().div_ceil(SHARE), channel());
    // In the pool, whose threads take shares from the one that has them without a queue that all wait for.
    scope.spawn(move |scope| {
        for (number, share) in configurations.chunks(SHARE).enumerate() {
            let (share, sender) = (share.to_vec(), sender.clone());
            scope.spawn(move |_| {
                let mut solver = solvers.own();
                let equilibria = share.iter().map(|q| solver.solve(q)).collect();
                // Where nobody waits for them any more nobody needs them.
                let _ = sender.send((number, equilibria));
            });
        }
    });
    (count, shares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{object::Object, proxy::Chain};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    /// Chunks, what came back of them, and how many others were out at each time.
    struct Noted {
        chunks: VecDeque<Vec<JointVector>>,
        out: usize,
        others: Vec<usize>,
        torques: Vec<JointVector>,
    }

    impl Noted {
        /// `configurations` in chunks of so many.
        fn of(configurations: &[JointVector], sizes: &[usize]) -> Self {
            let mut rest = configurations;
            let chunks = sizes.iter().map(|&size| rest.split_off(..size).unwrap().to_vec()).collect();
            Self { chunks, out: 0, others: Vec::new(), torques: Vec::new() }
        }
    }

    impl Work for Noted {
        fn next(&mut self) -> Option<Vec<JointVector>> {
            let chunk = self.chunks.pop_front();
            self.out += usize::from(chunk.is_some());
            chunk
        }

        fn take(&mut self, equilibria: Vec<Equilibrium>) {
            self.out -= 1;
            self.others.push(self.out);
            self.torques.extend(equilibria.into_iter().map(|equilibrium| equilibrium.torque));
        }

        fn rewind(&mut self) {}

        fn note(&mut self, _: String) {}
    }

    #[test]
    fn chunks_come_back_in_order_while_the_next_is_shared_out() {
        let scene = Scene::parse(include_str!("../../tests/scenes/sphere.toml"), "sphere.toml").unwrap();
        let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
        let model = Model::new(&object, &chain, scene.contact);
        let configurations: Vec<JointVector> =
            super::super::sample(&scene, &model).into_iter().step_by(37).take(101).collect();
        let mut backend = CpuBackend::new(&model, 3).unwrap();
        let at_once = backend.solve(&configurations).unwrap();
        assert!(at_once.iter().any(|equilibrium| equilibrium.torque.norm() > 0.0), "some are in contact");
        // The last of a chunk is not solved last, and some chunks have fewer shares than there are threads.
        let mut work = Noted::of(&configurations, &[50, 1, 0, 8, 42]);
        backend.stream(&mut work).unwrap();
        assert_eq!(work.torques, at_once.into_iter().map(|equilibrium| equilibrium.torque).collect::<Vec<_>>());
        assert_eq!(work.others, [2, 2, 2, 1, 0], "while one is taken two others are solved");
    }

    #[test]
    fn provenance_names_the_algorithm_of_the_scene() {
        use clap::ValueEnum;
        let mut scene = Scene::parse(include_str!("../../tests/scenes/sphere.toml"), "sphere.toml").unwrap();
        for algorithm in crate::scene::ContactLaw::value_variants() {
            scene.contact.law = *algorithm;
            let named = algorithm.to_possible_value().unwrap();
            assert_eq!(CpuBackend::provenance(&scene).algorithm, named.get_name());
        }
    }

    #[test]
    fn a_solver_that_a_panic_has_left_solves_like_a_new_one() {
        let scene = Scene::parse(include_str!("../../tests/scenes/sphere.toml"), "sphere.toml").unwrap();
        let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
        let model = Model::new(&object, &chain, scene.contact);
        let solvers = Solvers::new(&model, 1);
        let configurations: Vec<JointVector> =
            super::super::sample(&scene, &model).into_iter().step_by(37).take(64).collect();
        let pool = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let torques = || -> Vec<JointVector> {
            pool.install(|| solvers.map(&configurations, |solver, q| solver.solve(q).torque))
        };
        let before = torques();
        assert!(before.iter().any(|torque| torque.norm() > 0.0), "some are in contact");
        let broken = catch_unwind(AssertUnwindSafe(|| {
            pool.install(|| {
                solvers.map(&configurations, |solver, q| {
                    assert!(solver.solve(q).torque.norm() == 0.0, "a panic in the middle of the work, on purpose");
                })
            })
        }));
        assert!(broken.is_err());
        assert_eq!(torques(), before);
    }
}
