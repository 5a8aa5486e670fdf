//! The files that a command writes: never over one of its inputs, over a file of another kind, or over what is no
//! regular file. A file that is replaced is reported.

use super::Failure;
use crate::dataset::{may_be_dataset, resolved};
use serde_json::{Value, json};
use std::{
    fmt::Write,
    fs::{self, File},
    io::{self, Read},
    path::{Path, PathBuf},
    time::SystemTime,
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
    /// HDF5.
    Hdf5,
    /// A manual page.
    Page,
    /// A picture, in PNG.
    Picture,
    /// A drawing, in SVG.
    Drawing,
    /// Text for people or programs: Markdown, HTML, JSON.
    Text,
    /// A log of joint states in MCAP.
    Mcap,
}

impl Kind {
    /// Returns whether a log at `path` is MCAP by its extension, or else a table.
    #[must_use]
    pub fn of_log(path: &Path) -> Self {
        let mcap = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"));
        if mcap { Self::Mcap } else { Self::Table }
    }

    /// Kind of the figure or table called `name`, by its extension.
    fn of(name: &Path) -> Self {
        match name.extension().and_then(|extension| extension.to_str()) {
            Some("haptize") => Self::Dataset,
            Some("png") => Self::Picture,
            Some("svg") => Self::Drawing,
            Some("csv") => Self::Table,
            Some("1") => Self::Page,
            _ => Self::Text,
        }
    }

    /// Whether the file at `path` that begins with `start` is of this kind.
    fn is(self, path: &Path, start: &[u8]) -> bool {
        match self {
            Self::Dataset => may_be_dataset(start),
            Self::Archive => start.starts_with(b"PK"),
            Self::Hdf5 => start.starts_with(b"\x89HDF\r\n\x1a\n"),
            Self::Page => start.starts_with(b"."),
            Self::Picture => start.starts_with(b"\x89PNG"),
            Self::Drawing => start.windows(4).any(|word| word == b"<svg"),
            Self::Text => !start.contains(&0),
            Self::Mcap => start.starts_with(b"\x89MCAP"),
            Self::Table => {
                let other = ["toml", "obj", "ply", "stl", "msh", "md", "json"];
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
            Self::Hdf5 => "an HDF5 file",
            Self::Page => "a manual page",
            Self::Picture => "a PNG picture",
            Self::Drawing => "an SVG drawing",
            Self::Text => "text",
            Self::Mcap => "an MCAP file",
        }
    }
}

/// A file that is going to be replaced, where there is one.
pub struct Earlier(Option<(u64, SystemTime)>);

impl Earlier {
    /// Tells what was replaced: its size and its date.
    pub fn tell(&self, text: &mut String, json: &mut Value) {
        let Some((bytes, time)) = self.0 else { return };
        let date = humantime::format_rfc3339_seconds(time).to_string();
        let _ = writeln!(text, "  replaced     an earlier file of {bytes} bytes from {date}");
        json["replaced"] = json!({ "bytes": bytes, "date": date });
    }
}

/// Checks that a file of `kind` may be written to `output` by a command that reads `inputs`.
///
/// # Errors
/// When `output` is one of the inputs, by whatever name, is there and no regular file, may not be read or written to,
/// holds something of another kind, or lies in a folder that cannot be written to.
pub fn check<'a>(output: &Path, kind: Kind, inputs: impl IntoIterator<Item = &'a Path>) -> Result<Earlier, Failure> {
    let refused = |why: &str| format!("{}: {why}; nothing is written: name another file", output.display());
    let file = resolved(output).map_err(|error| refused(&error.to_string()))?;
    probe(output, file.parent().unwrap_or(Path::new("")))?;
    let Ok(there) = fs::metadata(&file) else { return Ok(Earlier(None)) };
    if inputs.into_iter().any(|input| is_same(output, input)) {
        return Err(refused("this is also an input, which would be lost").into());
    }
    if there.permissions().readonly() {
        return Err(
            refused("there is a file already that may not be written to (chmod u+w lets it be replaced)").into()
        );
    }
    let mut start = Vec::new();
    File::open(&file)
        .and_then(|file| file.take(512).read_to_end(&mut start))
        .map_err(|error| refused(&format!("there is a file already that cannot be read ({error})")))?;
    if !start.is_empty() && !kind.is(output, &start) {
        return Err(refused(&format!("there is a file already that is not {}", kind.name())).into());
    }
    Ok(Earlier(Some((there.len(), there.modified().unwrap_or(SystemTime::UNIX_EPOCH)))))
}

/// A folder that a command fills with files whose names it knows.
pub struct Folder {
    path: PathBuf,
    /// Files that the command may write.
    files: Vec<PathBuf>,
    /// Those of them that are there.
    earlier: Vec<PathBuf>,
}

impl Folder {
    /// Checks that a command which reads `inputs` may write files called `names` into the folder at `path`. The folder
    /// need not be there yet.
    ///
    /// # Errors
    /// When the folder cannot be written to, or one of the files may not be replaced; see [`check`].
    pub fn check<'a>(
        path: &Path,
        names: impl IntoIterator<Item = &'a str>,
        inputs: impl IntoIterator<Item = &'a Path> + Clone,
    ) -> Result<Self, Failure> {
        probe(path, path.ancestors().find(|folder| folder.exists()).unwrap_or(Path::new("")))?;
        let files: Vec<PathBuf> = names.into_iter().map(|name| path.join(name)).collect();
        let earlier: Vec<PathBuf> = files.iter().filter(|file| fs::symlink_metadata(file).is_ok()).cloned().collect();
        for file in &earlier {
            check(file, Kind::of(file), inputs.clone())?;
        }
        Ok(Self { path: path.to_owned(), files, earlier })
    }

    /// Checks that `output`, which the same command writes, is none of the folder's files.
    ///
    /// # Errors
    /// When it is one of them, which would be written over it.
    pub fn keep_apart(&self, output: &Path) -> Result<(), Failure> {
        let output_place = place(output);
        if self.files.iter().any(|file| place(file) == output_place) {
            let why = "a file of this name is written into the folder, too; name another file";
            return Err(format!("{}: {why}", output.display()).into());
        }
        Ok(())
    }

    /// Removes what an earlier run has left and this one has not `written` again, and reports what was replaced and
    /// removed.
    ///
    /// # Errors
    /// When such a file cannot be removed.
    pub fn close(self, written: &[PathBuf], text: &mut String, json: &mut Value) -> Result<(), Failure> {
        let (replaced, stale): (Vec<_>, Vec<_>) = self.earlier.into_iter().partition(|file| written.contains(file));
        for file in &stale {
            fs::remove_file(file).map_err(|error| {
                format!("cannot remove {}, which an earlier run has left: {error}; remove it", file.display())
            })?;
        }
        let names = |files: &[PathBuf]| -> Vec<String> {
            files.iter().map(|file| file.strip_prefix(&self.path).unwrap_or(file).display().to_string()).collect()
        };
        if !replaced.is_empty() {
            let _ = writeln!(text, "  replaced     {} files of an earlier run", replaced.len());
        }
        if !stale.is_empty() {
            let _ = writeln!(text, "  removed      {}, which an earlier run had left", names(&stale).join(", "));
        }
        json["replaced"] = names(&replaced).into();
        json["removed"] = names(&stale).into();
        Ok(())
    }
}

/// Checks that `folder`, in which `output` is to be, can be written to: before an hour's work, not after it.
fn probe(output: &Path, folder: &Path) -> Result<(), Failure> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    tempfile::tempfile_in(folder).map(drop).map_err(|error| {
        let (output, folder) = (output.display(), folder.display());
        format!("{output}: cannot be written: {folder}: {error}; make the folder, or choose another output (-o)").into()
    })
}

/// Returns where a file is or is to be, by one name.
fn place(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder =
        fs::canonicalize(folder).or_else(|_| std::path::absolute(folder)).unwrap_or_else(|_| folder.to_owned());
    file.file_name().map_or_else(|| folder.clone(), |name| folder.join(name))
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
