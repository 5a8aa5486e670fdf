//! Text files that people write: scenes, robots, mappings of columns.

use crate::input;
use std::{
    io::{ErrorKind, Read},
    path::Path,
};

/// Longest text that is read [bytes]: a hundred times as long as the longest robot file in public collections.
const MAX_BYTES: u64 = 1 << 24;

/// Returns the text of the file at `path`.
///
/// # Errors
/// When it cannot be read, is no text, or is longer than [`MAX_BYTES`]: why, and what to do.
pub(crate) fn read(path: &Path) -> Result<String, String> {
    let mut text = String::new();
    let read = input::open(path).and_then(|stream| stream.take(MAX_BYTES + 1).read_to_string(&mut text));
    match read {
        Ok(_) if text.len() as u64 > MAX_BYTES => {
            Err(format!("it is longer than {MAX_BYTES} bytes, which no file of this kind is; check the path"))
        }
        Ok(_) => Ok(text),
        Err(error) if error.kind() == ErrorKind::InvalidData => {
            Err("it is no text, but a dataset or another binary file; give the text file that it was made from".into())
        }
        Err(error) => Err(format!("{error}; check the path and its permissions")),
    }
}
