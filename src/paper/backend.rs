//! The paper's iteration as a backend of sweeps: on the CPU, on all cores, from the rest state at each configuration.

use super::iteration::PaperIteration;
use crate::{
    Error, JointVector,
    contact::{
        Backend, Equilibrium, MINIMUM_SQUARE, Model, Status, Touch, detection::Detection, linear::support::dot, reach,
        reactions::Reactions,
    },
    dataset::Dataset,
    proxy::{Chain, Pose},
    scene::Scene,
    sweep::{BackendChoice, Bake, CpuBackend, Run, Sweep, SweepReport, build_object, model_within},
};
use glam::DVec3;
use rayon::prelude::*;
use std::{convert::Infallible, sync::atomic::AtomicBool};

/// What the provenance of a dataset calls the iteration.
const NAME: &str = "paper";

/// Configurations that are solved at once, between two reports of progress.
const CHUNK: usize = 1024;

/// Solves configurations by the paper's iteration, one after another; one per thread. The model's law does not matter.
pub struct PaperSolver<'a> {
    model: &'a Model<'a>,
    pose: Pose,
    detection: Detection,
    iteration: PaperIteration,
    reactions: Reactions,
}

impl<'a> PaperSolver<'a> {
    /// A solver for `model`, whose surface is that of the facets.
    #[must_use]
    pub fn new(model: &'a Model<'a>) -> Self {
        Self {
            model,
            pose: model.chain.new_pose(),
            detection: Detection::new(model),
            iteration: PaperIteration::new(model),
            reactions: Reactions::new(model),
        }
    }

    /// What the iteration comes to at the joint coordinates `q`, one per joint (rad or m), as
    /// [`Solver::solve`](crate::contact::Solver::solve) has it.
    #[must_use]
    pub fn solve(&mut self, q: &[f64]) -> Equilibrium {
        let model = self.model;
        let joints = model.chain.joints.len();
        if q.len() != joints || !q.iter().all(|x| x.is_finite()) {
            return Equilibrium::unknown(joints);
        }
        model.chain.pose(q, &mut self.pose);
        let gap = self.detection.set_configuration(model, &self.pose.nodes);
        if !gap.is_finite() {
            return Equilibrium::unknown(joints);
        }
        let mut equilibrium = Equilibrium::free(gap, joints);
        if gap >= 0.0 {
            return equilibrium;
        }
        let outcome = self.iteration.iterate(model, &mut self.detection);
        (equilibrium.iterations, equilibrium.residual) = (outcome.iterations, outcome.residual);
        equilibrium.status = if outcome.converged { Status::Contact } else { Status::Unconverged };
        self.take(&mut equilibrium);
        self.reactions.account(model, &self.pose, &mut equilibrium);
        if !equilibrium.is_finite() {
            return Equilibrium { gap, iterations: outcome.iterations, ..Equilibrium::unknown(joints) };
        }
        if !self.is_covered(&equilibrium) {
            equilibrium.status = Status::Overflow;
        }
        equilibrium
    }

    /// Touches and U. The three forces on the nodes of a tie need not be parallel; the weights of a touch are their
    /// shares along the whole.
    fn take(&mut self, equilibrium: &mut Equilibrium) {
        let Self { model, iteration, reactions, .. } = self;
        for (slot, &node) in iteration.support.nodes().iter().enumerate() {
            let at = 3 * node as usize;
            let forces = &iteration.forces[3 * slot..3 * slot + 3];
            equilibrium.energy += 0.5 * dot(forces, &iteration.displacement[at..at + 3]);
        }
        for tie in &iteration.ties {
            let force = -(tie.forces[0] + tie.forces[1] + tie.forces[2]);
            if force == DVec3::ZERO {
                continue;
            }
            let square = force.length_squared().max(MINIMUM_SQUARE);
            let weights = tie.forces.map(|part| -part.dot(force) / square);
            let carriers = tie.nodes.into_iter().zip(weights).collect();
            equilibrium.touches.push(Touch { proxy_node: tie.proxy_node, carriers, force });
            for (part, node) in tie.forces.into_iter().zip(tie.nodes) {
                // A spring Kc stretched to this force stores |f|^2 / (2 Kc).
                equilibrium.energy += part.length_squared() / (2.0 * model.contact.stiffness);
                if part != DVec3::ZERO {
                    reactions.push(node, part);
                }
            }
        }
    }

    /// Whether the compliance covers all that `equilibrium` depends on.
    fn is_covered(&self, equilibrium: &Equilibrium) -> bool {
        let displacement = self.iteration.displacement.as_chunks().0;
        let moved = displacement.iter().map(|u| DVec3::from_array(*u).length()).fold(0.0, f64::max);
        let loaded = equilibrium.forces.iter().map(|force| force.node);
        let touching = equilibrium.touches.iter().map(|touch| touch.proxy_node as usize);
        reach::covers(self.model, &self.detection, loaded, touching, moved)
    }
}

/// Solves configurations by the paper's iteration on all cores.
pub struct PaperBackend<'a>(&'a Model<'a>);

impl<'a> PaperBackend<'a> {
    /// A backend for `model`, whose surface is that of the facets.
    #[must_use]
    pub fn new(model: &'a Model<'a>) -> Self {
        Self(model)
    }
}

impl Backend for PaperBackend<'_> {
    type Error = Infallible;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Infallible> {
        let solve = |solver: &mut PaperSolver<'_>, q: &JointVector| solver.solve(q);
        Ok(configurations.par_iter().map_init(|| PaperSolver::new(self.0), solve).collect())
    }
}

/// Haptizes in memory as `bake` says, by the paper's iteration on the CPU. The scene's law is what the error at random
/// configurations is measured against.
///
/// # Errors
/// As [`Bake::in_memory`].
pub fn haptize(bake: Bake<'_>) -> Result<(Dataset, SweepReport), Error> {
    let Bake { scene, measured, date, stop, progress, .. } = bake;
    let object = build_object(scene)?;
    let chain = Chain::new(&scene.proxy);
    let model = model_within(scene, &object, &chain)?;
    let mut backend = PaperBackend::new(&model);
    let mut sweep = Sweep::new(scene, &object, "cpu", &CpuBackend::adapter(), date)?;
    sweep.diagnose(&model);
    sweep.skip_free_space(&model)?;
    sweep.measure_error(&model, &scene.haptics, measured)?;
    let Ok(_) = sweep.predict(&mut backend, true);
    let (mut dataset, report) = sweep.run(&mut backend, Run { chunk: CHUNK, stop, progress })?;
    dataset.provenance.algorithm = NAME.into();
    Ok((dataset, report))
}

/// Haptizes `scene` in memory by the paper's iteration; its error is not measured, and it bears no date.
///
/// # Errors
/// As [`haptize`].
pub fn baked(scene: &Scene) -> Result<(Dataset, SweepReport), Error> {
    let (backend, stop) = (BackendChoice::Cpu, AtomicBool::new(false));
    haptize(Bake { scene, backend, measured: Some(0), aim: None, date: "", stop: &stop, progress: &mut |_| () })
}
