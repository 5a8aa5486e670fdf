//! Sweeps: a virtual object haptized over a grid in C-space.

pub mod ahead;
mod assembly;
mod bake;
mod choice;
mod chunks;
mod columns;
mod cpu;
mod direct;
mod error;
mod fallback;
mod footprint;
mod forecast;
mod free_space;
pub mod gridize;
pub mod import;
mod inspection;
mod lowest;
mod measured;
mod merge;
mod node;
mod part;
mod pilot;
mod plan;
mod reach;
pub(crate) mod reference;
pub mod refine;
mod report;
pub mod scan;
mod shard;
pub(crate) mod spacing;
mod sweep;
mod table;
mod tally;

pub use bake::{Bake, BakeError, SceneObjectError, build_object, sample};
pub use choice::{BackendChoice, BackendError, ChosenBackend, OTHER_ADAPTER, remedied};
pub use cpu::CpuBackend;
pub use direct::{Direct, DirectError};
pub use error::SweepError;
pub use fallback::WithFallback;
pub use footprint::{Bounds, Footprint};
pub use forecast::Forecast;
pub use free_space::{FreeGaps, FreeSpace};
pub use inspection::{Contact, Inspection, ObjectNode, ProxyNode};
pub use lowest::Lowered;
pub use merge::{Merge, MergeError, Merged};
pub use pilot::{Aim, Choice, Cost, Pilot, PilotError, Prospect, Trial};
pub use plan::{Plan, ShardCost};
pub use reach::{DepthShare, JointReach, Reach, ReachError};
pub use reference::ReferenceError;
pub use report::{Iterations, SweepReport};
pub use shard::{EXTENSION as SHARD_EXTENSION, Shard, ranges};
pub use sweep::{Progress, Run, Sweep, grid_of};

use crate::{JointVector, contact::Equilibrium};

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
