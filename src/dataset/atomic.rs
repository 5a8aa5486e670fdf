//! Files that appear whole or not at all.
//!
//! The contents go to a temporary file in the same folder, are flushed to the disk, and take the name in one rename:
//! a crash, a full disk or a killed process leaves the old file or the new one, never a half.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};
use tempfile::{NamedTempFile, TempPath};

/// Buffer between the writer and the file [bytes].
pub(crate) const BUFFER: usize = 1 << 20;

/// A file that is to appear.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    path: &'a Path,
    growing: Option<&'a Path>,
}

impl<'a, P: AsRef<Path> + ?Sized> From<&'a P> for Target<'a> {
    fn from(path: &'a P) -> Self {
        Self { path: path.as_ref(), growing: None }
    }
}

impl<'a> Target<'a> {
    /// The file is called `growing` until it is whole. Nobody else may write there meanwhile; what a killed process has left there
    /// is overwritten.
    #[must_use]
    pub fn growing(path: &'a Path, growing: &'a Path) -> Self {
        Self { path, growing: Some(growing) }
    }

    /// The file's path.
    #[must_use]
    pub fn path(&self) -> &'a Path {
        self.path
    }
}

/// The regular file that `path` leads to, through symbolic links, or where it is to appear.
fn resolved(path: &Path) -> io::Result<PathBuf> {
    match path.canonicalize() {
        Ok(found) if found.is_file() => Ok(found),
        Ok(_) => Err(io::Error::new(io::ErrorKind::InvalidInput, "this is a folder, a device or a pipe: name a file")),
        Err(_) if path.is_symlink() => {
            Err(io::Error::new(io::ErrorKind::NotFound, "this is a link to a file that is not there: remove it"))
        }
        Err(_) => Ok(path.to_owned()),
    }
}

/// Replaces the file `target` by what `write` writes. Unless the target says otherwise, it grows under a name that no other file has.
///
/// # Errors
/// What `write` or the system says; then the old file is untouched and the temporary one is gone.
pub fn replace_file<'a>(
    target: impl Into<Target<'a>>,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> io::Result<()> {
    let Target { path, growing } = target.into();
    let path = &resolved(path)?;
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let temporary = match growing {
        Some(growing) => NamedTempFile::from_parts(File::create(growing)?, TempPath::try_from_path(growing)?),
        None => {
            let mut builder = tempfile::Builder::new();
            builder.prefix(".haptize-").suffix(".tmp");
            // Like any other new file: readable by whom the umask allows, not by the owner alone.
            #[cfg(unix)]
            builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
            builder.tempfile_in(folder)?
        }
    };
    let mut writer = BufWriter::with_capacity(BUFFER, temporary.as_file());
    write(&mut writer)?;
    writer.flush()?;
    drop(writer);
    temporary.as_file().sync_all()?;
    temporary.persist(path).map_err(|error| error.error)?;
    // The new name must survive a power cut too.
    #[cfg(unix)]
    File::open(folder)?.sync_all()?;
    Ok(())
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
    fn links_are_followed_and_what_is_no_file_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link, lost] = ["a.bin", "link", "lost"].map(|name| folder.path().join(name));
        std::fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink("a.bin", &link).unwrap();
        replace_file(&link, |w| w.write_all(b"new")).unwrap();
        assert!(link.is_symlink());
        assert_eq!(std::fs::read(&file).unwrap(), b"new");
        std::os::unix::fs::symlink("nowhere", &lost).unwrap();
        for path in [&lost, Path::new("/dev/null"), folder.path()] {
            assert!(replace_file(path, |w| w.write_all(b"new")).is_err(), "{}", path.display());
        }
        assert!(lost.is_symlink() && !Path::new("/dev/null").is_file());
    }

    #[test]
    fn a_file_that_grows_under_a_given_name_overwrites_what_is_left_there() {
        let folder = tempfile::tempdir().unwrap();
        let (path, growing) = (folder.path().join("a.bin"), folder.path().join("a.bin.new"));
        std::fs::write(&growing, b"left by a killed process").unwrap();
        let target = Target::growing(&path, &growing);
        let full = replace_file(target, |_| Err(io::Error::from(io::ErrorKind::StorageFull)));
        assert_eq!(full.unwrap_err().kind(), io::ErrorKind::StorageFull);
        assert!(names(folder.path()).is_empty());
        std::fs::write(&growing, b"left by a killed process").unwrap();
        replace_file(target, |w| {
            assert_eq!(names(folder.path()), ["a.bin.new"]);
            w.write_all(b"new")
        })
        .unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.bin"]);
    }

    #[test]
    fn a_missing_folder_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        assert!(replace_file(&folder.path().join("none").join("a.bin"), |w| w.write_all(b"x")).is_err());
    }
}
