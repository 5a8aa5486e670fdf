//! Why a sweep ended early, what was kept of it, and what to do.

use crate::{Error, ErrorKind, MAX_AXES, error};
use std::{fmt::Display, io, path::Path};

/// The scene's grid cannot be swept.
pub(super) fn in_grid(what: impl Display) -> Error {
    error!("the scene's grid: {what}; correct `axes` of [grid] in the scene")
}

/// An arm has more joints than a grid has axes.
pub(super) fn too_many_joints(joints: usize) -> Error {
    error!(
        "an arm of {joints} joints is too many for a grid, which has at most {MAX_AXES} axes; `haptize play SCENE` and \
         `haptize view SCENE` solve its contact in every tick"
    )
}

/// The columns of `points` grid points, of so many `bytes`, do not fit in memory.
pub(super) fn no_memory(points: usize, bytes: usize, why: impl Display) -> Error {
    let megabytes = bytes / 1_000_000;
    error!(
        "the grid's {points} points need {megabytes} MB of memory ({why}); take a coarser grid, or haptize into a file \
         (`haptize bake`), which takes little memory whatever the grid"
    )
}

/// The backend returned another number of results than it was asked for.
pub(super) fn miscounted(asked: usize, found: usize) -> Error {
    error!("the backend returned {found} results for {asked} configurations; please report this as a defect")
}

/// The sweep was stopped from outside after `done` of its points, which are in `part`, where there is one.
pub(super) fn stopped(done: usize, points: usize, part: Option<&Path>) -> Error {
    let kept = part.map_or("nothing was kept".into(), |part| {
        format!("they are kept in {}: continue with the same command and --resume", part.display())
    });
    error!("stopped after {done} of {points} grid points; {kept}").of(ErrorKind::Stopped)
}

/// The file or folder at `path` cannot be begun.
pub(super) fn unwritable(path: &Path, source: &io::Error) -> Error {
    let remedy = match source.kind() {
        io::ErrorKind::NotFound => "make the folder, or choose another output (-o)",
        io::ErrorKind::InvalidFilename => "choose an output with a shorter name (-o)",
        _ => "choose another output (-o), in a folder where you may write",
    };
    Error::at(path, format_args!("cannot be written: {source}; {remedy}")).of(ErrorKind::File)
}

/// The part at `path` cannot be read or written.
pub(super) fn in_part(path: &Path, source: &io::Error) -> Error {
    let remedy = "free some space (memory, if that is what is missing), then continue with the same command, a bake \
                  with --resume";
    Error::at(path, format_args!("{source}; {remedy}")).of(ErrorKind::File)
}

/// Another process writes the part at `path`.
pub(super) fn busy(path: &Path) -> Error {
    let what = "another process is writing this file: wait for it, then continue a bake by --resume, or choose another \
                output";
    Error::at(path, what)
}

/// The file at `path` is no part of a sweep.
pub(super) fn foreign(path: &Path, reason: impl Display) -> Error {
    let remedy = "move it away, or choose another output";
    Error::at(path, format_args!("is in the way of the bake and cannot be continued: {reason}; {remedy}"))
}

/// The part at `path` is of another sweep, which differs by `difference`.
pub(super) fn other_part(path: &Path, difference: &str) -> Error {
    let remedy = "restore that, or delete it to start again";
    Error::at(path, format_args!("cannot be continued, it was begun with {difference}; {remedy}"))
}
