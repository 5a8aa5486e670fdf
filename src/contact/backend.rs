//! What solves many configurations.

use super::Equilibrium;
use crate::JointVector;

/// Solver of equation (2) for many configurations: the CPU on all cores, or a GPU.
///
/// The result for a configuration depends on nothing else: not on the others of its batch, nor on earlier batches.
pub trait Backend {
    /// Why a batch failed.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Equilibria of `configurations`, in the same order.
    ///
    /// # Errors
    /// When the device fails; nothing of the batch is returned then.
    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Self::Error>;

    /// Returns what a user of the results should know of the time since the last call, each a sentence without its full
    /// stop. It holds from the first configuration of the last batch on, and goes into the dataset's provenance.
    fn notices(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// Returns the number of configurations so far that the device left to the CPU, for want of precision or room.
    fn left_to_cpu(&self) -> usize {
        0
    }
}
