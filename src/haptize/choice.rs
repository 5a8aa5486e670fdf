//! Which backend solves: one place for `bake`, the demo and programs that use this library.

use super::{Backend, CpuBackend};
use crate::{
    JointVector,
    contact::{Equilibrium, Model},
};
use std::convert::Infallible;

/// What may be asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum BackendChoice {
    /// A hardware GPU, else the CPU.
    #[default]
    Auto,
    /// All cores, f64; never touches Vulkan.
    Cpu,
}

/// The backend that was chosen.
pub enum ChosenBackend<'a> {
    /// All cores, f64.
    Cpu(CpuBackend<'a>),
}

/// No backend could be opened.
#[derive(Debug, thiserror::Error)]
pub enum BackendError {
    /// The system gives no threads.
    #[error("no threads to solve on: {0}; close other programs or raise the limit on processes (ulimit -u)")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

impl<'a> ChosenBackend<'a> {
    /// Opens the backend that `choice` asks for, to solve `model`.
    ///
    /// # Errors
    /// When there is none such, or it cannot be opened.
    pub fn open(choice: BackendChoice, model: &'a Model<'a>) -> Result<Self, BackendError> {
        match choice {
            BackendChoice::Auto | BackendChoice::Cpu => Ok(Self::Cpu(CpuBackend::new(model, 0)?)),
        }
    }

    /// `cpu` or `gpu`, as a dataset's provenance says it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Cpu(_) => "cpu",
        }
    }

    /// What solves, as a dataset's provenance says it.
    #[must_use]
    pub fn adapter(&self) -> String {
        match self {
            Self::Cpu(_) => CpuBackend::adapter(),
        }
    }

    /// A good [`super::Run::chunk`] for this backend.
    #[must_use]
    pub fn chunk(&self) -> usize {
        match self {
            Self::Cpu(cpu) => cpu.chunk(),
        }
    }
}

impl Backend for ChosenBackend<'_> {
    type Error = Infallible;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Self::Error> {
        match self {
            Self::Cpu(cpu) => cpu.solve(configurations),
        }
    }
}
