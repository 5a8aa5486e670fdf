//! Lines of text files of meshes, as many programs write them.

use std::borrow::Cow;
use std::io::Read;

/// Reads a text to its end. Bytes that are no UTF-8, which only names and remarks hold, become replacement characters,
/// and a byte-order mark is left out.
pub(super) fn read(stream: &mut impl Read) -> Result<String, String> {
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    Ok(decode(&bytes).into_owned())
}

/// As [`read`], of bytes that are read already.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
}

/// Lines and their numbers, from 1. They end with a line feed, or with carriage returns alone where there is none.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    text.split(end).enumerate().map(|(number, line)| (number + 1, line.trim()))
}
