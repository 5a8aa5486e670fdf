//! Why a sweep ended early, what was kept of it, and what to do.

use super::measured::MOST_CONFIGURATIONS;
use crate::{dataset, memory::Shortage};
use std::{
    collections::TryReserveError,
    io,
    path::{Path, PathBuf},
};

/// A sweep failed, or was stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// The scene has no grid.
    #[error("the scene leaves the grid out; `haptize reach SCENE --write` finds one and writes it there")]
    NoGrid,
    /// Invalid grid.
    #[error("the scene's grid: {0}; correct `axes` of [grid] in the scene")]
    Grid(String),
    /// The error cannot be measured at so many configurations.
    #[error("the error cannot be measured at {asked} configurations: {MOST_CONFIGURATIONS} are the most")]
    Configurations {
        /// Configurations asked for.
        asked: usize,
    },
    /// The columns do not fit in memory.
    #[error("the grid's {points} points need {} MB of memory ({source}); take a coarser grid, or haptize into a file \
             (`haptize bake`), which takes little memory whatever the grid", bytes / 1_000_000)]
    Memory {
        /// Grid points.
        points: usize,
        /// Memory of their columns (bytes).
        bytes: usize,
        /// Error of the allocator.
        source: TryReserveError,
    },
    /// The columns need more memory than is left.
    #[error(
        "the grid's {points} points do not fit in memory: {shortage}; or haptize into a file (`haptize bake`), which \
         takes little memory whatever the grid"
    )]
    Shortage {
        /// Grid points.
        points: usize,
        /// Bytes needed and bytes available.
        shortage: Shortage,
    },
    /// The backend failed; what was solved before is in the part, where there is one.
    #[error("the backend failed at grid points {first} to {last}: {source}")]
    Backend {
        /// First point of the chunk.
        first: usize,
        /// Last point of the chunk.
        last: usize,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The backend returned another number of results than it was asked for.
    #[error("the backend returned {found} results for {asked} configurations; please report this as a defect")]
    Miscount {
        /// Results asked for.
        asked: usize,
        /// Results returned.
        found: usize,
    },
    /// Stopped from outside.
    #[error("stopped after {done} of {points} grid points; {}", remedy(part.as_deref()))]
    Stopped {
        /// Points done.
        done: usize,
        /// Points asked for.
        points: usize,
        /// Where they are kept.
        part: Option<PathBuf>,
    },
    /// The part cannot be begun.
    #[error(
        "{path}: cannot be written: {source}; make the folder, or choose another output (-o) in one where you may write"
    )]
    Folder {
        /// The part.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The system gives no thread.
    #[error(
        "no thread can be had that keeps the results: {0}; close other programs, or raise the limits on processes and \
         memory (ulimit -u, ulimit -v)"
    )]
    Threads(io::Error),
    /// There is a folder of the output's name.
    #[error("{path}: is a folder; name a file in it (-o)")]
    IsFolder {
        /// The output.
        path: PathBuf,
    },
    /// There is a file of another kind in the output's place.
    #[error(transparent)]
    Output(dataset::Error),
    /// The part cannot be read or written.
    #[error(
        "{path}: {source}; free some space (memory, if that is what is missing), then continue with the same command, \
         a bake with --resume"
    )]
    Part {
        /// The part.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Another process writes the part.
    #[error(
        "{path}: another process is writing this file: wait for it, then continue a bake by --resume, or choose another output"
    )]
    Busy {
        /// The part.
        path: PathBuf,
    },
    /// A part is there already, and was not to be continued.
    #[error(
        "{path}: holds what an unfinished bake has solved; add --resume to go on with it, or delete it to start again"
    )]
    Unfinished {
        /// The part.
        path: PathBuf,
    },
    /// A file in the part's place that is none.
    #[error(
        "{path}: is in the way of the bake and cannot be continued: {reason}; move it away, or choose another output"
    )]
    ForeignPart {
        /// The part.
        path: PathBuf,
        /// Evidence of the damage, in words.
        reason: String,
    },
    /// The part of another sweep.
    #[error("{path}: cannot be continued, it was begun with {difference}; restore that, or delete it to start again")]
    OtherPart {
        /// The part.
        path: PathBuf,
        /// Difference, in words.
        difference: &'static str,
    },
    /// The finished dataset could not be written; its points are in the part.
    #[error("{source}; all points are kept in {part}: afterwards give the same command, a bake with --resume")]
    Dataset {
        /// Where the points are.
        part: PathBuf,
        /// Why it could not be written.
        source: dataset::Error,
    },
}

fn remedy(part: Option<&Path>) -> String {
    match part {
        Some(part) => format!("they are kept in {}: continue with the same command and --resume", part.display()),
        None => "nothing was kept".into(),
    }
}
