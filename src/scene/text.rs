//! Text files that people write: scenes, robots, mappings of columns.

use crate::input;
use std::{io::Read, path::Path};

/// Longest text that is read (bytes): a hundred times as long as the longest robot file in public collections.
const MAX_BYTES: u64 = 1 << 24;

/// Returns the text of the file at `path`.
///
/// # Errors
/// When it cannot be read, is no text, or is longer than [`MAX_BYTES`]: why, and what to do.
pub(crate) fn read(path: &Path) -> Result<String, String> {
    let mut bytes = Vec::new();
    let read = input::open(path).and_then(|stream| stream.take(MAX_BYTES + 1).read_to_end(&mut bytes));
    read.map_err(|error| input::remedied(&error))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(format!("it is longer than {MAX_BYTES} bytes, which no file of this kind is; check the path"));
    }
    if bytes.contains(&0) {
        return Err(
            "it is no text, but a dataset or another binary file; give the text file that it was made from".into()
        );
    }
    String::from_utf8(bytes).map_err(|error| {
        let bytes = error.as_bytes();
        let line = bytes[..error.utf8_error().valid_up_to()].iter().filter(|byte| **byte == b'\n').count() + 1;
        format!("line {line} is not UTF-8: convert it with iconv, if it is Latin-1 `iconv -f ISO-8859-1 -t UTF-8`")
    })
}
