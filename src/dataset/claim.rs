//! Files that a process writes again and again: no other takes them meanwhile.
//!
//! A file that is replaced whole cannot itself be locked. A second one beside it is, empty, with a name of its own; the
//! system unlocks it however the process ends, and the next one to write in that folder removes what a killed process
//! has left, as it does with temporary files.

use super::atomic::{PREFIX, SUFFIX, folder, resolved};
use std::{
    collections::BTreeSet,
    fs::{self, File, TryLockError},
    io,
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
    thread,
    time::Duration,
};

/// How often a lock that is taken is tried again, and the pause before: who removes abandoned files takes each for a
/// moment.
const TRIES: u32 = 5;
const PAUSE: Duration = Duration::from_millis(20);

/// A file that is this process's to write as long as this lives.
pub struct Claim {
    lock: PathBuf,
    _file: File,
}

/// Locked files of claims that live.
static CLAIMED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn claimed() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A set of paths is whole after every call.
    CLAIMED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the locked files of all claims: for who ends the process at once.
pub(super) fn discard() {
    for lock in std::mem::take(&mut *claimed()) {
        let _ = fs::remove_file(lock);
    }
}

impl Claim {
    /// Claims the file at `path`, which need not be there; `None` where another process, or this one, has done so.
    ///
    /// # Errors
    /// When `path` leads to no file, or its folder cannot be written to.
    pub fn new(path: &Path) -> io::Result<Option<Self>> {
        let path = resolved(path)?;
        let name = path.file_name().unwrap_or_default();
        // Short, however long the file's name is.
        let name = format!("{PREFIX}lock-{:08x}{SUFFIX}", crc32fast::hash(name.as_encoded_bytes()));
        let lock = folder(&path).join(name);
        for _ in 0..TRIES {
            let file = File::options().write(true).create(true).truncate(false).open(&lock)?;
            match file.try_lock() {
                // Another process may have removed it before it was locked: then it locks nobody out.
                Ok(()) if !is_at(&file, &lock) => continue,
                // Some network file systems have no locks; only the second of two sessions at once would notice.
                Ok(()) | Err(TryLockError::Error(_)) => {
                    claimed().insert(lock.clone());
                    return Ok(Some(Self { lock, _file: file }));
                }
                Err(TryLockError::WouldBlock) => thread::sleep(PAUSE),
            }
        }
        Ok(None)
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // While it is locked, so that it is nobody else's.
        if claimed().remove(&self.lock) {
            let _ = fs::remove_file(&self.lock);
        }
    }
}

/// Whether `file` is what lies at `path`.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let (Ok(opened), Ok(there)) = (file.metadata(), fs::symlink_metadata(path)) else { return false };
    (opened.dev(), opened.ino()) == (there.dev(), there.ino())
}

/// Whether there is something at `path`.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::replace_file;
    use std::io::Write;

    fn names(folder: &Path) -> Vec<String> {
        let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.collect()
    }

    #[test]
    fn a_file_is_claimed_once_and_free_again_afterwards() {
        let folder = tempfile::tempdir().unwrap();
        let [file, other] = ["a.bin", "b.bin"].map(|name| folder.path().join(name));
        let claim = Claim::new(&file).unwrap().unwrap();
        assert!(Claim::new(&file).unwrap().is_none());
        assert!(Claim::new(&other).unwrap().is_some());
        // The file is written meanwhile, by which what is abandoned is removed.
        replace_file(&file, |w| w.write_all(b"new")).unwrap();
        assert!(Claim::new(&file).unwrap().is_none());
        drop(claim);
        assert_eq!(names(folder.path()), ["a.bin"]);
        assert!(Claim::new(&file).unwrap().is_some());
    }

    #[test]
    fn what_a_killed_process_left_is_claimed_or_removed() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.bin");
        let claim = Claim::new(&file).unwrap().unwrap();
        let left = claim.lock.clone();
        drop(claim);
        for claims in [true, false] {
            fs::write(&left, b"").unwrap();
            if claims {
                assert!(Claim::new(&file).unwrap().is_some());
            } else {
                replace_file(&file, |w| w.write_all(b"new")).unwrap();
            }
            assert!(!left.exists());
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_and_its_file_are_one() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["a.bin", "link"].map(|name| folder.path().join(name));
        fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink("a.bin", &link).unwrap();
        let _claim = Claim::new(&link).unwrap().unwrap();
        assert!(Claim::new(&file).unwrap().is_none());
        assert!(Claim::new(&folder.path().join("none/a.bin")).is_err());
    }
}
