//! Files that are read.

use std::{
    fs::File,
    io::{self, Read, Seek},
    path::Path,
};

/// Greatest number in SI units that a device or a dataset may give for a position [rad or m], a torque [N m] or an
/// energy [J]. Nothing that is haptized comes near it, and its square times any gain is still far from overflow, so
/// that no account or torque of the haptic loop can become infinite.
pub(crate) const GREATEST_INPUT: f64 = 1e9;

/// How the text begins that Git LFS leaves in the place of a file that it has not fetched.
const POINTER: &[u8] = b"version https://git-lfs.github.com/spec/";

/// Opens the file at `path`. A folder holds no bytes, a pipe would be waited for, and a device may have no end.
///
/// # Errors
/// When it is one of these, with the remedy, or the system's.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let found = std::fs::metadata(path)?;
    if found.is_file() {
        let mut file = File::open(path)?;
        let mut head = Vec::new();
        file.by_ref().take(POINTER.len() as u64).read_to_end(&mut head)?;
        file.rewind()?;
        let what = "this is a pointer of Git LFS, not the file itself: run `git lfs pull` in its repository";
        return if head == POINTER { Err(io::Error::new(io::ErrorKind::InvalidInput, what)) } else { Ok(file) };
    }
    let what = if found.is_dir() {
        "this is a folder: give a file in it"
    } else {
        "this is a pipe or a device: save what it gives in a file, and give that"
    };
    Err(io::Error::new(io::ErrorKind::InvalidInput, what))
}
