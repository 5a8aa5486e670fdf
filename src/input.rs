//! Files that are read.

use std::{fs::File, io, path::Path};

/// Opens the file at `path`. A folder holds no bytes, a pipe would be waited for, and a device may have no end.
///
/// # Errors
/// When it is one of these, with the remedy, or the system's.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let found = std::fs::metadata(path)?;
    if found.is_file() {
        return File::open(path);
    }
    let what = if found.is_dir() {
        "this is a folder: give a file in it"
    } else {
        "this is a pipe or a device: save what it gives in a file, and give that"
    };
    Err(io::Error::new(io::ErrorKind::InvalidInput, what))
}
