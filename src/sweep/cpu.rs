//! The CPU backend: all cores, f64, one solver a thread.

use super::Backend;
use crate::{
    JointVector,
    contact::{Equilibrium, Model, SHARE, Solvers},
    dataset::Provenance,
    scene::Scene,
};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::{convert::Infallible, time::SystemTime};

/// Shares of each thread in a chunk: progress is reported several times a second, and threads rarely wait at a chunk's
/// end.
const SHARES: usize = 32;

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
    pub fn new(model: &'a Model<'a>, threads: usize) -> Result<Self, rayon::ThreadPoolBuildError> {
        let pool = ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("contact {k}")).build()?;
        let solvers = Solvers::new(model, pool.current_num_threads());
        Ok(Self { pool, solvers })
    }

    /// Number of threads.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.solvers.threads()
    }

    /// A good [`super::Run::chunk`] for this backend.
    #[must_use]
    pub fn chunk(&self) -> usize {
        SHARE * SHARES * self.threads()
    }

    /// Returns the provenance of what this backend solves now of `scene`.
    #[must_use]
    pub fn provenance(scene: &Scene) -> Provenance {
        Provenance {
            version: env!("CARGO_PKG_VERSION").into(),
            algorithm: "energy".into(),
            tolerance: scene.contact.tolerance,
            backend: "cpu".into(),
            adapter: Self::adapter(),
            date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            ..Provenance::default()
        }
    }

    /// Returns the name of this backend in [`crate::dataset::Provenance::adapter`].
    #[must_use]
    pub fn adapter() -> String {
        format!("{} cores, f64", std::env::consts::ARCH)
    }
}

impl Backend for CpuBackend<'_> {
    type Error = Infallible;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Infallible> {
        Ok(self.pool.install(|| self.solvers.map(configurations, |solver, q| solver.solve(q))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{object::Object, proxy::Chain};
    use std::panic::{AssertUnwindSafe, catch_unwind};

    #[test]
    fn a_solver_that_a_panic_has_left_solves_like_a_new_one() {
        let scene = Scene::parse(include_str!("../../tests/scenes/sphere.toml"), "sphere.toml").unwrap();
        let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
        let model = Model::new(&object, &chain, scene.contact);
        let solvers = Solvers::new(&model, 1);
        let configurations: Vec<JointVector> = super::super::sample(&scene).into_iter().step_by(37).take(64).collect();
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
