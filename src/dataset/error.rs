//! The errors of dataset files, each with the file's name and the remedy.

use crate::memory::Shortage;
use std::{io, path::PathBuf};

/// A dataset could not be read, written or exported.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file is missing, or may not be read.
    #[error("{path}: cannot be read: {}", crate::input::remedied(source))]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's message.
        source: io::Error,
    },
    /// It is larger than the memory that is left.
    #[error("{path}: does not fit in memory: {shortage}")]
    Memory {
        /// The file.
        path: PathBuf,
        /// Bytes needed and bytes available.
        shortage: Shortage,
    },
    /// The folder is missing or read-only, or the disk is full. Whatever stood at `path` before is still there.
    #[error(
        "{path}: cannot be written: {source}; free some space or choose another folder (an earlier file is untouched)"
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's message.
        source: io::Error,
    },
    /// It would replace a file of another kind.
    #[error("{path}: there is a file already that is not a dataset; nothing is written: name another file")]
    Occupied {
        /// The file.
        path: PathBuf,
    },
    /// Not a file of this program.
    #[error("{path}: not a haptize dataset: {reason}; give a file written by `haptize bake` or `haptize gridize`")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The evidence.
        reason: String,
    },
    /// Another version of the format.
    #[error("{path}: has format {found:?}, this program reads {expected:?}; bake it again with this program")]
    Version {
        /// The file.
        path: PathBuf,
        /// The file's version.
        found: String,
        /// This program's version.
        expected: &'static str,
    },
    /// It holds what earlier versions felt friction and contact damping by.
    #[error(
        "{path}: holds contact forces on the arm's nodes, by which an earlier version felt friction and contact \
         damping; leave contact_damping out of its scene and bake it again"
    )]
    Touches {
        /// The file.
        path: PathBuf,
    },
    /// Cut short, altered, or never right.
    #[error("{path}: is damaged: {reason}; copy it again from its source, or bake it again")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The defect.
        reason: String,
    },
    /// A dataset in memory that contradicts itself and so was not written.
    #[error("{path}: not written, because the dataset contradicts itself: {reason}")]
    Inconsistent {
        /// The file that was to be written.
        path: PathBuf,
        /// The contradiction.
        reason: String,
    },
}
