//! What a command may write over: never one of its inputs, and no file of another kind.

use super::Failure;
use std::{
    fs::{self, File},
    io::{self, Read},
    path::Path,
};

/// Kind of a file that a command writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A dataset.
    Dataset,
    /// A log, a recording or a table, in CSV.
    Table,
    /// NumPy's archive.
    Archive,
    /// A manual page.
    Page,
}

impl Kind {
    /// Whether the file that begins with `start` is of this kind.
    fn is(self, path: &Path, start: &[u8]) -> bool {
        match self {
            // Safetensors: the length of the header, which is a JSON object.
            Self::Dataset => start.len() > 8 && start[8] == b'{' && start[..8].ends_with(&[0, 0, 0]),
            Self::Archive => start.starts_with(b"PK"),
            Self::Page => start.starts_with(b"."),
            Self::Table => {
                let other = ["toml", "obj", "ply", "stl", "msh"];
                let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
                !start.contains(&0) && !other.iter().any(|other| extension == *other)
            }
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Dataset => "a dataset",
            Self::Table => "a table",
            Self::Archive => "an archive",
            Self::Page => "a manual page",
        }
    }
}

/// Whether a file of `kind` may be written to `output` by a command that reads `inputs`.
///
/// # Errors
/// When `output` is one of the inputs, by whatever name, is there and no regular file, or holds something of another kind.
pub fn check<'a>(output: &Path, kind: Kind, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), Failure> {
    let refused = |why: &str| Err(format!("{}: {why}; nothing is written: name another file", output.display()).into());
    let Ok(there) = fs::metadata(output) else { return Ok(()) };
    if !there.is_file() {
        return refused("this is no regular file");
    }
    if inputs.into_iter().any(|input| is_same(output, input)) {
        return refused("this is also an input, which would be lost");
    }
    let mut start = Vec::new();
    let read = File::open(output).and_then(|file| file.take(512).read_to_end(&mut start));
    if read.is_ok() && !start.is_empty() && !kind.is(output, &start) {
        return refused(&format!("there is a file already that is not {}", kind.name()));
    }
    Ok(())
}

/// Whether two paths lead to one file.
fn is_same(one: &Path, other: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let identity = |path: &Path| -> io::Result<(u64, u64)> {
            let there = fs::metadata(path)?;
            Ok((there.dev(), there.ino()))
        };
        matches!((identity(one), identity(other)), (Ok(one), Ok(other)) if one == other)
    }
    #[cfg(not(unix))]
    {
        let place = |path: &Path| -> io::Result<_> { fs::canonicalize(path) };
        matches!((place(one), place(other)), (Ok(one), Ok(other)) if one == other)
    }
}
