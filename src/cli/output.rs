//! The files that a command writes: never over one of its inputs, over what is no regular file, or, without `--force`,
//! over a file of another program. A file that is replaced is reported.

use super::{
    Failure,
    report::{Describe, Text},
    tell,
};
use crate::{
    Error,
    dataset::{may_be_dataset, resolved, rewrite_file},
    names::counted,
    paper::HEADING,
    render::recording::SIGNATURE as SESSION,
    report::{mcap::LIBRARY as SESSION_LIBRARY, page},
    scan::{PLAN, PLAN_LIBRARY, SIGNATURE},
    scene::Scene,
    twin::OBJ,
    vtk,
};
use serde::Serialize;
use std::{
    fs::{self, File},
    io::{self, Read},
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
    time::SystemTime,
};

/// Bytes at the start of a file by which those of haptize are known.
const START: u64 = 1024;

/// Whether the command line has `--force`.
static FORCED: AtomicBool = AtomicBool::new(false);

/// From now on a file is replaced whoever wrote it.
pub fn force() {
    FORCED.store(true, Ordering::Relaxed);
}

/// Whether a file is replaced whoever wrote it.
pub fn is_forced() -> bool {
    FORCED.load(Ordering::Relaxed)
}

/// What a file of haptize holds. One is replaced by its like alone, since not all of them can be made again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// A dataset.
    Dataset,
    /// The log of a scan.
    Scan,
    /// The record of a session.
    Session,
    /// What is made of these again: tables, archives, figures, pages.
    Product,
}

impl Content {
    /// What the file that begins with `start` holds, if haptize wrote it, or it is a table like one of its own.
    fn of(start: &[u8]) -> Option<Self> {
        let holds = |word: &[u8]| start.windows(word.len()).any(|part| part == word);
        let begins = |magic: &[u8]| start.starts_with(magic);
        let mcap = |library: &str| {
            let length = (library.len() as u32).to_le_bytes();
            begins(b"\x89MCAP") && holds(&[&length, library.as_bytes()].concat())
        };
        // Each by the mark that haptize sets: what merely names haptize, or holds torques, may be the work of a person.
        let figure = begins(b"\x89PNG") && holds(b"Software\0haptize")
            || begins(b"<svg") && holds(b">\n<!-- haptize -->\n")
            || begins(b"GIF89a") && holds(b"\x07haptize");
        let page = begins(b".ie ") && holds(b".TH haptize")
            || begins(HEADING.as_bytes())
            || begins(page::OPENING.as_bytes())
            || begins(vtk::OPENING.as_bytes())
            || begins(PLAN.as_bytes())
            || mcap(PLAN_LIBRARY);
        let archive = begins(b"PK") && holds(b"provenance.npy");
        let shape = begins(OBJ.as_bytes());
        let names: [&[u8]; 4] = [b"torque", b"joint_units", b"scene", b"provenance"];
        let hdf5 = begins(b"\x89HDF") && names.into_iter().all(holds);
        match () {
            () if may_be_dataset(start) => Some(Self::Dataset),
            () if begins(SIGNATURE.as_bytes()) => Some(Self::Scan),
            () if begins(SESSION.as_bytes()) || mcap(SESSION_LIBRARY) => Some(Self::Session),
            () if figure || page || archive || shape || hdf5 || is_table(start) => Some(Self::Product),
            () => None,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Dataset => "a dataset",
            Self::Scan => "the log of a scan",
            Self::Session => "the record of a session",
            Self::Product => "a table or figure of haptize",
        }
    }
}

/// Whether a log at `path` is MCAP, by its extension.
pub fn is_mcap(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mcap"))
}

/// Whether the first line is that of a table that a command writes: of a session, a dataset or a study. One of times and
/// positions alone may be a motion that a person has recorded.
fn is_table(start: &[u8]) -> bool {
    let line =
        str::from_utf8(start.split(|byte| *byte == b'\n').next().unwrap_or_default()).unwrap_or_default().trim_end();
    let openings = [
        "time [s],node,x [m],y [m],z [m]",
        "point (row of the other file from 0),node,",
        "study,series,setting,value,points,solved,size [B],cost [1],",
    ];
    let is_trace = line.starts_with("time [s],hand ") && line.contains("],device ") && line.contains("],proxy ");
    let is_dataset = line.contains(",status (0 free; 1 contact; ");
    is_trace || is_dataset || openings.iter().any(|opening| line.starts_with(opening))
}

/// A file that is replaced.
#[derive(Serialize)]
pub struct Replaced {
    replaced: Earlier,
    #[serde(skip)]
    written: SystemTime,
}

/// A file that was written.
#[derive(Serialize)]
pub struct Written {
    /// Its name.
    pub file: String,
    /// What it has replaced.
    #[serde(flatten)]
    pub replaced: Option<Replaced>,
}

#[derive(Serialize)]
struct Earlier {
    bytes: u64,
    /// When it was written, ISO 8601, UTC.
    date: String,
}

impl Describe for Replaced {
    fn describe(&self, text: &mut Text) {
        let Earlier { bytes, date } = &self.replaced;
        text.row("replaced", format_args!("an earlier file of {} from {date}", counted(*bytes, ["byte", "bytes"])));
    }
}

/// Checks that a file which holds `content` may be written to `output` by a command that reads `inputs`, and
/// returns the file that is replaced, if there is one.
///
/// # Errors
/// When `output` is one of the inputs, by whatever name, is there and no regular file, may not be read or written to,
/// holds something else (but with `--force`), or lies in a folder that cannot be written to.
pub fn check<'a>(
    output: &Path,
    content: Content,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<Option<Replaced>, Failure> {
    let refused = |why: &str| format!("{}: {why}; nothing is written: name another file", output.display());
    let Some((file, there)) = replaceable(output)? else { return Ok(None) };
    if inputs.into_iter().any(|input| is_same(output, input)) {
        return Err(refused("this is also an input, which would be lost").into());
    }
    let mut start = Vec::new();
    File::open(&file)
        .and_then(|file| file.take(START).read_to_end(&mut start))
        .map_err(|error| refused(&format!("there is a file already that cannot be read ({error})")))?;
    if !start.is_empty() && Content::of(&start) != Some(content) && !FORCED.load(Ordering::Relaxed) {
        let what = content.name();
        return Err(refused(&format!("there is a file already that is not {what} (--force replaces it)")).into());
    }
    let time = there.modified().unwrap_or(SystemTime::UNIX_EPOCH);
    let date = humantime::format_rfc3339_seconds(time).to_string();
    Ok(Some(Replaced { replaced: Earlier { bytes: there.len(), date }, written: time }))
}

/// Returns where to write what cannot be made again and was to go to `output`, where a check found `earlier`: there, or,
/// where another command has written there since, to the first free name beside it.
pub fn untaken(output: &Path, earlier: Option<&Replaced>) -> PathBuf {
    let now = fs::metadata(output).and_then(|there| there.modified()).ok();
    if now.is_none() || now == earlier.map(|earlier| earlier.written) {
        return output.to_owned();
    }
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let ending = output.extension().map_or(String::new(), |ending| format!(".{}", ending.to_string_lossy()));
    let name = |number: u32| output.with_file_name(format!("{stem}-{number}{ending}"));
    let free = (2..=u32::MAX).map(name).find(|name| fs::symlink_metadata(name).is_err());
    let free = free.unwrap_or_else(|| output.to_owned());
    tell(format_args!(
        "haptize: note: {} was written by another command meanwhile: {} is written instead",
        output.display(),
        free.display()
    ));
    free
}

/// Returns the file that writing to `output` replaces, links followed, if there is one.
///
/// # Errors
/// When it is there and no regular file or may not be written to, or lies in a folder that cannot be written to.
pub fn replaceable(output: &Path) -> Result<Option<(PathBuf, fs::Metadata)>, Failure> {
    let refused = |why: &str| format!("{}: {why}; nothing is written: name another file", output.display());
    let file = resolved(output).map_err(|error| refused(&error.to_string()))?;
    probe(output, file.parent().unwrap_or(Path::new("")))?;
    let Ok(there) = fs::metadata(&file) else { return Ok(None) };
    if there.permissions().readonly() {
        return Err(
            refused("there is a file already that may not be written to (chmod u+w lets it be replaced)").into()
        );
    }
    Ok(Some((file, there)))
}

/// Writes `text` in the place of the scene that was `read` from `path`, and returns the file's name.
///
/// # Errors
/// When that makes no valid scene, or cannot be written, or the file has changed since.
pub fn rewrite(path: &Path, read: &str, text: &str) -> Result<String, Failure> {
    Scene::parse(text, path)?;
    rewrite_file(path, read, text).map_err(|error| Error::at(path, error))?;
    Ok(path.display().to_string())
}

/// A folder that a command fills with files whose names it knows.
pub struct Folder {
    path: PathBuf,
    /// Files that the command may write, here and elsewhere.
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
            let is_dataset = file.extension().is_some_and(|extension| extension == "haptize");
            check(file, if is_dataset { Content::Dataset } else { Content::Product }, inputs.clone())?;
        }
        Ok(Self { path: path.to_owned(), files, earlier })
    }

    /// Checks that `output`, which the same command writes, is neither the folder, nor one of its files, nor an output that
    /// was checked before.
    ///
    /// # Errors
    /// When it is one of them, which would be written over it.
    pub fn keep_apart(&mut self, output: &Path) -> Result<(), Failure> {
        let output = place(output);
        if place(&self.path) == output || self.files.iter().any(|file| place(file) == output) {
            let why = "another output of this command is written there, too; name another file";
            return Err(format!("{}: {why}", output.display()).into());
        }
        self.files.push(output);
        Ok(())
    }

    /// Removes what an earlier run has left and this one has not `written` again, and returns what was replaced and
    /// removed.
    ///
    /// # Errors
    /// When such a file cannot be removed.
    pub fn close(self, written: &[PathBuf]) -> Result<Overwritten, Failure> {
        let (replaced, stale): (Vec<_>, Vec<_>) = self.earlier.into_iter().partition(|file| written.contains(file));
        for file in &stale {
            fs::remove_file(file).map_err(|error| {
                format!("cannot remove {}, which an earlier run has left: {error}; remove it", file.display())
            })?;
        }
        let names = |files: &[PathBuf]| -> Vec<String> {
            files.iter().map(|file| file.strip_prefix(&self.path).unwrap_or(file).display().to_string()).collect()
        };
        Ok(Overwritten { replaced: names(&replaced), removed: names(&stale) })
    }
}

/// Files of an earlier run in a folder, by their names there.
#[derive(Serialize)]
pub struct Overwritten {
    replaced: Vec<String>,
    removed: Vec<String>,
}

impl Describe for Overwritten {
    fn describe(&self, text: &mut Text) {
        let Self { replaced, removed } = self;
        if !replaced.is_empty() {
            text.row("replaced", format_args!("{} of an earlier run", counted(replaced.len(), ["file", "files"])));
        }
        if !removed.is_empty() {
            text.row("removed", format_args!("{}, which an earlier run had left", removed.join(", ")));
        }
    }
}

/// Checks that `folder`, in which `output` is to be, can be written to: before an hour's work, not after it.
pub fn probe(output: &Path, folder: &Path) -> Result<(), Failure> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let refused = |why: String| format!("{}: cannot be written: {why}", output.display());
    match fs::symlink_metadata(output) {
        Err(error) if error.kind() == io::ErrorKind::InvalidFilename => {
            return Err(refused(format!("{error}; choose a shorter name")).into());
        }
        _ => {}
    }
    tempfile::tempfile_in(folder).map(drop).map_err(|error| {
        refused(format!("{}: {error}; make the folder, or choose another output (-o)", folder.display())).into()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Axis, Dataset, Format, Grid};
    use std::time::Duration;

    #[test]
    fn what_a_person_wrote_is_never_taken_for_what_haptize_writes() {
        for file in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets")).unwrap() {
            let file = file.unwrap().path();
            let start = fs::read(&file).unwrap();
            assert_eq!(Content::of(&start[..start.len().min(START as usize)]), None, "{}", file.display());
        }
        for mine in [
            "#!/usr/bin/env python\n# makes the man page .TH haptize\n",
            "# The paper's sphere, by me\n",
            "q_a [rad],q_b [rad],tau_a [N m],tau_b [N m]\n",
            "time [s],q_a [rad],tau_a [N m]\n",
            // A motion that was recorded: without the first line of a plan.
            "time [s],a [rad],lift [m]\n",
            "time [s],hand x,hand y,hand z\n",
            "a [rad],torque a [N m],status\n",
            "study,series,setting,mine\n",
            "<svg><!-- drawn over a plot of haptize --></svg>",
            "\x07\0\0\0\0\0\0\0{\"weights\":{\"dtype\":\"F32\"",
            "\x07\0\0\0\0\0\0\0{\"__metadata__\":{\"format\":\"pt\"}",
            "PK\x03\x04 torque.npy",
        ] {
            assert_eq!(Content::of(mine.as_bytes()), None, "{mine}");
        }
        for ours in [
            ".ie \\n(.g .ds Aq \\(aq\n.TH haptize-new 1\n",
            "# The paper's figures and numbers, remade by haptize\n",
            "time [s],hand a [rad],device a [rad],proxy a [rad],\n",
            "time [s],node,x [m],y [m],z [m]\n",
            "point (row of the other file from 0),node,force x [N]\n",
            "study,series,setting,value,points,solved,size [B],cost [1],rms [N],worst [N],relative rms [1]\n",
            "# a plan of haptize\ntime [s],a [rad],lift [m]\n",
        ] {
            assert_eq!(Content::of(ours.as_bytes()), Some(Content::Product), "{ours}");
        }
    }

    #[test]
    fn what_is_exported_is_known_again() {
        let folder = tempfile::tempdir().unwrap();
        let axis = |name: &str| Axis { name: name.into(), unit: "rad".into(), start: 0.0, step: 1.0, count: 2 };
        let grid = Grid { axes: vec![axis("a"), axis("b")] };
        let dataset = Dataset::bare(grid, vec![0.5; 8], vec![1; 4]);
        let known = |file: PathBuf| {
            let start = fs::read(file).unwrap();
            Content::of(&start[..start.len().min(START as usize)])
        };
        for format in [Format::Npz, Format::Hdf5, Format::Csv, Format::Vti] {
            let file = folder.path().join("x").with_extension(format.extension());
            dataset.export(&file, format).unwrap();
            assert_eq!(known(file), Some(Content::Product), "{format:?}");
        }
        let file = folder.path().join("x.haptize");
        dataset.save(&file).unwrap();
        assert_eq!(known(file), Some(Content::Dataset));
    }

    #[test]
    fn what_another_command_has_written_meanwhile_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let [log, second, third] = ["log.csv", "log-2.csv", "log-3.csv"].map(|name| folder.path().join(name));
        let seen = || check(&log, Content::Session, []).ok().flatten();
        assert_eq!(untaken(&log, seen().as_ref()), log);
        let before = seen();
        fs::write(&log, SESSION).unwrap();
        assert_eq!(untaken(&log, before.as_ref()), second);
        fs::write(&second, "").unwrap();
        assert_eq!(untaken(&log, before.as_ref()), third);
        let before = seen();
        assert_eq!(untaken(&log, before.as_ref()), log, "as it was at the beginning");
        let later = before.as_ref().unwrap().written + Duration::from_secs(1);
        File::options().write(true).open(&log).unwrap().set_modified(later).unwrap();
        assert_eq!(untaken(&log, before.as_ref()), third);
    }
}
