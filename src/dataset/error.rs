//! The errors of dataset files, each with the file's name and the remedy.

use crate::{Error, ErrorKind, memory::Shortage};
use std::{fmt::Display, io, path::Path};

/// The file at `path` is larger than the memory that is left.
pub(super) fn no_memory(path: &Path, shortage: Shortage) -> Error {
    Error::at(path, format_args!("does not fit in memory: {shortage}")).of(ErrorKind::Dataset)
}

/// The folder of the file at `path` is missing or read-only, or the disk is full. Whatever stood at `path` before is
/// still there.
pub(super) fn unwritable(path: &Path, source: &io::Error) -> Error {
    let remedy = "free some space or choose another folder (an earlier file is untouched)";
    Error::at(path, format_args!("cannot be written: {source}; {remedy}")).of(ErrorKind::File)
}

/// The file at `path` is not of this program, as `reason` shows.
pub(super) fn foreign(path: &Path, reason: &str) -> Error {
    let remedy = "give a file written by `haptize bake` or `haptize gridize`";
    Error::at(path, format_args!("not a haptize dataset: {reason}; {remedy}")).of(ErrorKind::Foreign)
}

/// The file at `path` is cut short, altered, or was never right.
pub(super) fn damaged(path: &Path, reason: impl Display) -> Error {
    let remedy = "copy it again from its source, or bake it again";
    Error::at(path, format_args!("is damaged: {reason}; {remedy}")).of(ErrorKind::Dataset)
}

/// The dataset in memory that was to be written to `path` contradicts itself.
pub(super) fn inconsistent(path: &Path, reason: impl Display) -> Error {
    Error::at(path, format_args!("not written, because the dataset contradicts itself: {reason}"))
        .of(ErrorKind::Dataset)
}
