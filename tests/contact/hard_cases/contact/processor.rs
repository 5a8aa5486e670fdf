//! Who solves a case's configurations: the CPU, before the deformed surface, and the GPU, before the surface at rest.

use crate::hard_cases::Setting;
use haptize::{
    JointVector,
    contact::{Equilibrium, Model, Solver},
    gpu::{Context, GpuError, GpuSolver},
    scene::{ContactLaw, ContactSpec},
    sweep::Backend,
};
use rayon::prelude::*;
use std::sync::Arc;

/// Agreement of results in f32 (1): the arm is placed to some 5e-8 m, of depths of half a millimetre, and energies go
/// with their square.
pub const IN_F32: f64 = 3e-4;

/// One of them, and what it has done.
pub struct Processor<'a> {
    /// The GPU; absent: the CPU.
    gpu: Option<&'a Arc<Context>>,
    law: ContactLaw,
    solved: usize,
    left_to_cpu: usize,
}

/// The CPU, and the GPU of `setting`.
pub fn processors(setting: &Setting) -> Vec<Processor<'_>> {
    let mut processors = vec![Processor::cpu()];
    processors.push(Processor::gpu(&setting.gpu));
    processors
}

impl<'a> Processor<'a> {
    /// All cores.
    pub fn cpu() -> Self {
        Self { gpu: None, law: ContactLaw::Following, solved: 0, left_to_cpu: 0 }
    }

    /// An adapter.
    pub fn gpu(context: &'a Arc<Context>) -> Self {
        Self { gpu: Some(context), law: ContactLaw::Rest, ..Self::cpu() }
    }

    /// The CPU by the same law.
    pub fn reference(&self) -> Self {
        Self { law: self.law, ..Self::cpu() }
    }

    /// One figure for the CPU, one for the GPU.
    pub fn choose<T>(&self, cpu: T, gpu: T) -> T {
        if self.gpu.is_some() { gpu } else { cpu }
    }

    /// Largest relative residual of what is called converged (1).
    pub fn residual(&self) -> f64 {
        self.choose(1e-6, 1e-4)
    }

    /// Equilibria of `configurations`, in the same order.
    ///
    /// # Errors
    /// Those of the GPU.
    pub fn solve(&mut self, model: &Model<'_>, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, GpuError> {
        self.solved += configurations.len();
        let model = &model.with_contact(ContactSpec { law: self.law, ..model.contact });
        let Some(context) = self.gpu else {
            let solve = |solver: &mut Solver<'_>, q: &JointVector| solver.solve(q);
            return Ok(configurations.par_iter().map_init(|| Solver::new(model), solve).collect());
        };
        let mut solver = GpuSolver::new(Arc::clone(context), model)?;
        let results = solver.solve(configurations)?;
        self.left_to_cpu += solver.left_to_cpu();
        Ok(results)
    }

    /// Configurations that the GPU left to the CPU.
    pub fn left_to_cpu(&self) -> usize {
        self.left_to_cpu
    }

    /// Describes what was varied, and where unless on the CPU.
    pub fn name(&self, varied: &str) -> String {
        format!("{varied}{}", self.choose("", ", GPU"))
    }

    /// A note; on the GPU also how many configurations it left to the CPU.
    pub fn note(&self, note: String) -> String {
        if self.gpu.is_none() {
            return note;
        }
        let comma = if note.is_empty() { "" } else { ", " };
        format!("{note}{comma}{} of {} by the CPU", self.left_to_cpu, self.solved)
    }
}
