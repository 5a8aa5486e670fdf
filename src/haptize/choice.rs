//! Which backend solves: one place for `bake`, the demo and programs that use this library.

use super::{Backend, CpuBackend};
use crate::{
    JointVector,
    contact::{Equilibrium, Model},
    gpu::{AdapterChoice, Context, GpuError, GpuSolver},
};
use std::sync::Arc;

/// What may be asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum BackendChoice {
    /// A hardware GPU, else the CPU.
    #[default]
    Auto,
    /// All cores, f64; never touches Vulkan.
    Cpu,
    /// Any adapter, software Vulkan included, or an error.
    Gpu,
}

/// The backend that was chosen.
pub enum ChosenBackend<'a> {
    /// All cores, f64.
    Cpu(CpuBackend<'a>),
    /// Thousands of configurations at a time, f32.
    Gpu(Box<GpuSolver<'a>>),
}

/// No backend could be opened.
#[derive(Debug, thiserror::Error)]
pub enum BackendError {
    /// The system gives no threads.
    #[error("no threads to solve on: {0}; close other programs or raise the limit on processes (ulimit -u)")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// There is no adapter, or it cannot take the scene.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

impl<'a> ChosenBackend<'a> {
    /// Opens the backend that `choice` asks for, to solve `model`.
    ///
    /// # Errors
    /// When there is none such, or it cannot be opened.
    pub fn open(choice: BackendChoice, model: &'a Model<'a>) -> Result<Self, BackendError> {
        match choice {
            BackendChoice::Cpu => Self::cpu(model),
            BackendChoice::Gpu => Ok(Self::gpu(AdapterChoice::Any, model)?),
            // Where the GPU cannot take the scene the CPU can.
            BackendChoice::Auto => Self::gpu(AdapterChoice::Hardware, model).or_else(|_| Self::cpu(model)),
        }
    }

    fn cpu(model: &'a Model<'a>) -> Result<Self, BackendError> {
        Ok(Self::Cpu(CpuBackend::new(model, 0)?))
    }

    fn gpu(choice: AdapterChoice, model: &'a Model<'a>) -> Result<Self, GpuError> {
        let context = Arc::new(Context::open(choice)?);
        Ok(Self::Gpu(Box::new(GpuSolver::new(context, model)?)))
    }

    /// `cpu` or `gpu`, as a dataset's provenance says it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Cpu(_) => "cpu",
            Self::Gpu(_) => "gpu",
        }
    }

    /// What solves, as a dataset's provenance says it.
    #[must_use]
    pub fn adapter(&self) -> String {
        match self {
            Self::Cpu(_) => CpuBackend::adapter(),
            Self::Gpu(gpu) => gpu.adapter().to_string(),
        }
    }

    /// A good [`super::Run::chunk`] for this backend.
    #[must_use]
    pub fn chunk(&self) -> usize {
        match self {
            Self::Cpu(cpu) => cpu.chunk(),
            Self::Gpu(gpu) => gpu.chunk(),
        }
    }
}

impl Backend for ChosenBackend<'_> {
    type Error = GpuError;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Self::Error> {
        match self {
            Self::Cpu(cpu) => cpu.solve(configurations).map_err(|never| match never {}),
            Self::Gpu(gpu) => gpu.solve(configurations),
        }
    }
}
