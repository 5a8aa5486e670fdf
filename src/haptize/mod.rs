//! Sweeps: a virtual object haptized over a grid in C-space.

use crate::{JointVector, contact::Equilibrium};

/// What solves equation (2) for many configurations: the CPU on all cores, or a GPU.
pub trait Backend {
    /// Why a batch failed.
    type Error: std::error::Error;

    /// Equilibria of `configurations`, in the same order.
    ///
    /// # Errors
    /// When the device fails; nothing of the batch is returned then.
    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Self::Error>;
}
