//! Files that appear whole or not at all.
//!
//! The contents go to a temporary file in the same folder, are flushed to the disk, and take the name in one rename: a
//! crash, a full disk or a killed process leaves the old file or the new one, never a half. Who ends the process on
//! purpose removes the temporary files by [`discard_unfinished`]; what a killed process leaves, the next one to write
//! in that folder removes. A temporary file is locked as long as it is written, and the system unlocks it however a
//! process ends.

use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, Once, PoisonError},
};
use tempfile::NamedTempFile;

/// Buffer between the writer and the file (bytes).
pub(crate) const BUFFER: usize = 1 << 20;

/// Temporary files that are being written.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// A temporary file that is listed in [`UNFINISHED`] as long as this lives.
struct Unfinished(PathBuf);

impl Unfinished {
    /// The file that `make` creates. None is created unlisted, so that [`discard_unfinished`] misses none.
    fn begin(make: impl FnOnce() -> io::Result<NamedTempFile>) -> io::Result<(Self, NamedTempFile)> {
        let mut unfinished = unfinished();
        let file = make()?;
        unfinished.insert(file.path().to_owned());
        Ok((Self(file.path().to_owned()), file))
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        unfinished().remove(&self.0);
    }
}

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A set of paths is whole after every call, so a panic elsewhere leaves nothing half-written.
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the files that are being written, and lets no other begin: for who ends the process at once.
pub fn discard_unfinished() {
    static DONE: Once = Once::new();
    DONE.call_once(|| {
        let unfinished = unfinished();
        for path in unfinished.iter() {
            // A file that has just taken its final name is no longer there.
            let _ = fs::remove_file(path);
        }
        std::mem::forget(unfinished);
    });
}

/// Returns the regular file that `path` leads to through symbolic links, or `path` itself where nothing is there yet.
///
/// # Errors
/// When it leads to a folder, a device or a pipe, or is a link to nothing.
pub fn resolved(path: &Path) -> io::Result<PathBuf> {
    match path.canonicalize() {
        Ok(found) if found.is_file() => Ok(if path.is_symlink() { found } else { path.to_owned() }),
        Ok(_) => {
            Err(io::Error::new(io::ErrorKind::InvalidInput, "this is no regular file but a folder, a device or a pipe"))
        }
        Err(_) if path.is_symlink() => {
            Err(io::Error::new(io::ErrorKind::NotFound, "this is a link to a file that is not there"))
        }
        Err(_) => Ok(path.to_owned()),
    }
}

/// Replaces the file at `path` by what `write` writes; until it is whole it has a name that no other file has.
///
/// # Errors
/// Returns the error of `write` or of the system; then the old file is untouched and the temporary one is gone.
pub fn replace_file(path: &Path, write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>) -> io::Result<()> {
    let replacement = Replacement::begin(path)?;
    let mut writer = replacement.writer();
    write(&mut writer)?;
    writer.flush()?;
    drop(writer);
    replacement.finish()
}

/// A file that is being written and has not taken its name yet. Dropped, it leaves nothing.
pub struct Replacement {
    path: PathBuf,
    _unfinished: Unfinished,
    temporary: NamedTempFile,
}

impl Replacement {
    /// Makes the temporary file that is to replace the file at `path`.
    ///
    /// # Errors
    /// Those of the system, here and below; and where the file is there and may not be written to, though the system
    /// lets it be replaced.
    pub fn begin(path: &Path) -> io::Result<Self> {
        let path = resolved(path)?;
        if fs::metadata(&path).is_ok_and(|there| there.permissions().readonly()) {
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file is there and may not be written to"));
        }
        let folder = folder(&path);
        remove_abandoned(folder);
        let (unfinished, temporary) = locked_in(folder)?;
        // Before anything is written: nobody reads it who may not read the file that it replaces.
        #[cfg(unix)]
        take_over(&path, temporary.as_file());
        Ok(Self { _unfinished: unfinished, path, temporary })
    }

    /// A way to write to it; to be flushed before the end.
    #[must_use]
    pub fn writer(&self) -> BufWriter<&File> {
        BufWriter::with_capacity(BUFFER, self.temporary.as_file())
    }

    /// Lets it take its name.
    pub fn finish(self) -> io::Result<()> {
        self.temporary.as_file().sync_all()?;
        self.temporary.persist(&self.path).map_err(|error| error.error)?;
        // The new name is to survive a power cut, too. The file is in its place by now, so that a folder that may not
        // be read or cannot be flushed is no failure: the system then flushes it in its own time.
        #[cfg(unix)]
        let _ = File::open(folder(&self.path)).and_then(|folder| folder.sync_all());
        Ok(())
    }
}

/// Gives `file` the permissions of the file at `path`, where there is one, and its owner and group, as far as the
/// system lets: not every file system has such, and who may replace a file need not be its owner.
#[cfg(unix)]
fn take_over(path: &Path, file: &File) {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, fchown};
    let (Ok(earlier), Ok(made)) = (fs::metadata(path), file.metadata()) else { return };
    if (made.uid(), made.gid()) != (earlier.uid(), earlier.gid()) {
        let _ = fchown(file, Some(earlier.uid()), Some(earlier.gid()));
    }
    // Reading, writing and running alone: with another owner the other bits would mean something else.
    let _ = file.set_permissions(fs::Permissions::from_mode(earlier.mode() & 0o777));
}

/// The folder of the file at `path`.
fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// How names of temporary files begin and end.
const PREFIX: &str = ".haptize-";
const SUFFIX: &str = ".tmp";

/// Makes a temporary file in `folder`, locked so that no other process takes it for abandoned.
fn locked_in(folder: &Path) -> io::Result<(Unfinished, NamedTempFile)> {
    loop {
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX).suffix(SUFFIX);
        // Like any other new file: readable by whom the umask allows, not by the owner alone.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let (unfinished, file) = Unfinished::begin(|| builder.tempfile_in(folder))?;
        // A file system without locks has no abandoned files that can be recognised.
        if file.as_file().lock().is_err() || file.path().exists() {
            return Ok((unfinished, file));
        }
        // Another process has found it before it was locked, and removed it.
    }
}

/// Removes the temporary files in `folder` that nobody writes any more. What cannot be removed stays.
fn remove_abandoned(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let is_ours = name.to_str().is_some_and(|name| name.starts_with(PREFIX) && name.ends_with(SUFFIX));
        if is_ours && entry.file_type().is_ok_and(|kind| kind.is_file()) {
            // Only a lock that is taken at once says that the writer is gone.
            let unlocked = File::options().write(true).open(entry.path()).ok().filter(|file| file.try_lock().is_ok());
            if let Some(_locked) = unlocked {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        replace_file(&path, |w| w.write_all(b"old")).unwrap();
        let full = replace_file(&path, |w| {
            w.write_all(&[7; 3 << 20])?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        });
        assert_eq!(full.unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["a.bin"]);
        replace_file(&path, |w| w.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.bin"]);
    }

    #[cfg(unix)]
    #[test]
    fn what_replaces_a_private_file_is_private_from_its_first_byte_on() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        std::fs::write(&path, b"old").unwrap();
        // A set-user-ID bit is not taken over.
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o4600)).unwrap();
        let mode = |file: &File| file.metadata().unwrap().permissions().mode() & 0o7777;
        replace_file(&path, |w| {
            assert_eq!(mode(w.get_ref()), 0o600);
            w.write_all(b"new")
        })
        .unwrap();
        assert_eq!(mode(&File::open(&path).unwrap()), 0o600);
    }

    #[test]
    fn what_a_killed_process_left_is_removed_and_what_another_writes_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("a.bin"), folder.path().join("b.bin"));
        for name in [".haptize-left.tmp", ".haptize-mine", "haptize-mine.tmp"] {
            std::fs::write(folder.path().join(name), b"half").unwrap();
        }
        replace_file(&path, |w| {
            w.write_all(b"new")?;
            let before = names(folder.path());
            assert!(!before.contains(&".haptize-left.tmp".into()) && before.len() == 3, "{before:?}");
            // Another writer in the same folder meanwhile.
            replace_file(&other, |w| w.write_all(b"other"))
        })
        .unwrap();
        assert_eq!(names(folder.path()), [".haptize-mine", "a.bin", "b.bin", "haptize-mine.tmp"]);
    }
}
