//! The interface of backends, which solve many configurations.

use super::Equilibrium;
use crate::JointVector;

/// Most chunks of one [`Work`] that a backend has at a time: so many are kept in memory.
pub const CHUNKS_IN_FLIGHT: usize = 4;

/// Solver of equation (2) for many configurations: the CPU on all cores, or GPUs.
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

    /// Solves what `work` gives, chunk by chunk, until it gives no more, and hands the equilibria back in the same
    /// order. The next chunks, [`CHUNKS_IN_FLIGHT`] at most, may be solved while `work` takes those of one.
    ///
    /// # Errors
    /// When the device fails. What was handed back holds; nothing is known of the chunks behind.
    fn stream(&mut self, work: &mut dyn Work) -> Result<(), Self::Error> {
        while let Some(chunk) = work.next() {
            let equilibria = self.solve(&chunk)?;
            self.notices().into_iter().for_each(|notice| work.note(notice));
            work.take(equilibria);
        }
        Ok(())
    }

    /// Returns the number of threads that solve a chunk: one that is to leave none idle has a share for each.
    fn threads(&self) -> usize {
        rayon::current_num_threads()
    }

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

/// Chunks of configurations that a backend solves, and where their equilibria go.
pub trait Work {
    /// The next chunk; `None` when there is none or it is not wanted any more, and from then on.
    fn next(&mut self) -> Option<Vec<JointVector>>;

    /// Gives the chunks that have no equilibria once more, from the earliest on: the backend that had them has failed.
    fn rewind(&mut self);

    /// Takes the equilibria of the earliest chunk that has none.
    fn take(&mut self, equilibria: Vec<Equilibrium>);

    /// Takes a notice that holds from the first configuration without equilibrium on: see [`Backend::notices`].
    fn note(&mut self, notice: String);
}
