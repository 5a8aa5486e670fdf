//! Results that are kept from one run of the program to the next, because they take long.
//!
//! A result is found by its key: all that it is made of, byte for byte, the program included. Its file begins with the
//! key and ends with a checksum, so that none can be taken for another, and what is damaged is known. Files are written
//! beside their place and renamed: two processes may keep the same result at once. Nothing depends on a cache: what
//! cannot be written is not kept.

use crate::Error;
use std::{
    fs::{self, File},
    hash::{DefaultHasher, Hash, Hasher},
    io::{self, Read, Write},
    path::PathBuf,
    sync::OnceLock,
    time::SystemTime,
};

/// Most that all files of a cache take together (B): some bodies of 2,000 nodes, of 0.3 GB each.
const MOST_BYTES: u64 = 2 << 30;

/// How files begin; the last number is that of their layout.
const MAGIC: &[u8; 16] = b"haptize cache 1\n";

/// Extension of the files.
const EXTENSION: &str = "kept";

/// The cache of this process, if it has one.
static USED: OnceLock<Cache> = OnceLock::new();

/// Results in a folder.
#[derive(Debug)]
pub struct Cache {
    folder: PathBuf,
    /// What every key begins with: another program may compute something else.
    program: Vec<u8>,
    /// Most that all files take together (B).
    most: u64,
    /// Told where a file is damaged.
    note: fn(&Error),
}

impl Cache {
    /// The cache of this user, for results of the program that runs; none where there is no such folder, or the program
    /// cannot tell which it is. `note` is told where a file is damaged.
    #[must_use]
    pub fn of_user(note: fn(&Error)) -> Option<Self> {
        use etcetera::BaseStrategy;
        let folder = etcetera::base_strategy::choose_native_strategy().ok()?.cache_dir().join("haptize");
        // A program that was compiled again bears the same version, and may compute something else.
        let file = fs::metadata(std::env::current_exe().ok()?).ok()?;
        let written = file.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
        let program = format!("{} {} {}", env!("CARGO_PKG_VERSION"), file.len(), written.as_nanos()).into();
        Some(Self { folder, program, most: MOST_BYTES, note })
    }

    /// Lets this process keep its results here, from now on.
    pub fn begin(self) {
        // One that was begun before stays.
        let _ = USED.set(self);
    }

    /// The cache of this process, if it has one.
    pub(crate) fn used() -> Option<&'static Self> {
        USED.get()
    }

    /// The numbers that the cache of this process keeps under `key`; else those of `form`, which it keeps from now on.
    ///
    /// # Errors
    /// Those of `form`.
    pub(crate) fn numbers<E>(key: &[u8], form: impl FnOnce() -> Result<Vec<f64>, E>) -> Result<Vec<f64>, E> {
        let Some(cache) = Self::used() else { return form() };
        if let Some(kept) = cache.find(key) {
            return Ok(bytemuck::pod_collect_to_vec(&kept));
        }
        let formed = form()?;
        cache.keep(key, bytemuck::cast_slice(&formed));
        Ok(formed)
    }

    /// Whether something is kept under `key`, sound or damaged.
    pub(crate) fn holds(&self, key: &[u8]) -> bool {
        self.place(key).exists()
    }

    /// What is kept under `key`.
    pub(crate) fn find(&self, key: &[u8]) -> Option<Vec<u8>> {
        let path = self.place(key);
        let mut file = File::open(&path).ok()?;
        let (start, mut bytes) = (self.start(key), Vec::new());
        let mut found = vec![0; start.len()];
        if file.read_exact(&mut found).is_ok() && found != start {
            // Another key's, whose name is the same.
            return None;
        }
        let length = usize::try_from(file.metadata().ok()?.len()).ok()?;
        bytes.try_reserve_exact(length.saturating_sub(start.len())).ok()?;
        file.read_to_end(&mut bytes).ok()?;
        let value = bytes.len().saturating_sub(size_of::<u32>());
        if found != start || checksum(&start, &bytes[..value]) != bytes[value..] {
            (self.note)(&Error::at(&path, "what is kept here is damaged; it is computed and written again"));
            return None;
        }
        bytes.truncate(value);
        // So that what is used is not what is removed first.
        let _ = file.set_modified(SystemTime::now());
        Some(bytes)
    }

    /// Keeps `value` under `key`, and removes what has not been used for longest where that makes too much.
    pub(crate) fn keep(&self, key: &[u8], value: &[u8]) {
        // Without room or permission there is no cache, and nothing else is lost.
        let _ = self.write(key, value).and_then(|()| self.prune());
    }

    fn write(&self, key: &[u8], value: &[u8]) -> io::Result<()> {
        let start = self.start(key);
        if (start.len() + value.len()) as u64 > self.most {
            return Ok(());
        }
        fs::create_dir_all(&self.folder)?;
        let mut file = tempfile::Builder::new().suffix(&format!(".{EXTENSION}")).tempfile_in(&self.folder)?;
        for part in [&start, value, &checksum(&start, value)] {
            file.write_all(part)?;
        }
        file.persist(self.place(key))?;
        Ok(())
    }

    fn prune(&self) -> io::Result<()> {
        let mut files = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let (path, found) = entry.and_then(|entry| Ok((entry.path(), entry.metadata()?)))?;
            if path.extension().is_some_and(|extension| extension == EXTENSION) && found.is_file() {
                files.push((found.modified()?, found.len(), path));
            }
        }
        files.sort();
        let mut sum: u64 = files.iter().map(|(_, length, _)| length).sum();
        for (_, length, path) in files {
            if sum <= self.most {
                break;
            }
            fs::remove_file(path)?;
            sum -= length;
        }
        Ok(())
    }

    /// The file of `key`.
    fn place(&self, key: &[u8]) -> PathBuf {
        let mut hasher = DefaultHasher::new();
        (&self.program, key).hash(&mut hasher);
        self.folder.join(format!("{:016x}.{EXTENSION}", hasher.finish()))
    }

    /// How the file of `key` begins.
    fn start(&self, key: &[u8]) -> Vec<u8> {
        let lengths = [self.program.len() as u64, key.len() as u64].map(u64::to_le_bytes);
        [MAGIC, lengths.as_flattened(), &self.program, key].concat()
    }
}

/// CRC-32 of a file without its end.
fn checksum(start: &[u8], value: &[u8]) -> [u8; 4] {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(start);
    hasher.update(value);
    hasher.finalize().to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn cache(folder: &tempfile::TempDir, most: u64) -> Cache {
        Cache { folder: folder.path().join("cache"), program: b"one".into(), most, note: |_| () }
    }

    #[test]
    fn what_is_kept_is_found_by_its_key_and_program_alone() {
        let folder = tempfile::tempdir().unwrap();
        let one = cache(&folder, MOST_BYTES);
        assert_eq!(one.find(b"key"), None);
        one.keep(b"key", b"value");
        one.keep(b"empty", b"");
        assert_eq!(one.find(b"key").unwrap(), b"value");
        assert_eq!(one.find(b"empty").unwrap(), b"");
        one.keep(b"key", b"other");
        assert_eq!(one.find(b"key").unwrap(), b"other");
        // The same bytes, otherwise divided.
        let another = Cache { program: b"onek".into(), ..cache(&folder, MOST_BYTES) };
        assert_eq!(another.find(b"ey"), None);
        assert_eq!(another.find(b"key"), None);
        // The file of another key under this one's name.
        fs::copy(one.place(b"key"), one.place(b"kez")).unwrap();
        assert_eq!(one.find(b"kez"), None);
    }

    #[test]
    fn any_damage_is_told_and_mended() {
        static TOLD: AtomicUsize = AtomicUsize::new(0);
        let folder = tempfile::tempdir().unwrap();
        let note = |error: &Error| {
            assert!(error.to_string().contains("damaged"), "{error}");
            TOLD.fetch_add(1, Ordering::Relaxed);
        };
        let cache = Cache { note, ..cache(&folder, MOST_BYTES) };
        cache.keep(b"key", b"value");
        let path = cache.place(b"key");
        let whole = fs::read(&path).unwrap();
        let start = cache.start(b"key").len();
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            assert_eq!(cache.find(b"key"), None, "{length} bytes");
        }
        assert_eq!(TOLD.load(Ordering::Relaxed), whole.len());
        for place in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[place] ^= 1;
            fs::write(&path, bytes).unwrap();
            assert_eq!(cache.find(b"key"), None, "byte {place}");
        }
        assert_eq!(TOLD.load(Ordering::Relaxed), 2 * whole.len() - start);
        cache.keep(b"key", b"value");
        assert_eq!(fs::read(path).unwrap(), whole);
    }

    #[test]
    fn what_was_not_used_for_longest_makes_room() {
        let folder = tempfile::tempdir().unwrap();
        let cache = cache(&folder, 900);
        let at = |seconds| SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(seconds);
        for (key, time) in [(b"a", 1), (b"b", 2), (b"c", 3)] {
            cache.keep(key, &[0; 200]);
            File::options().write(true).open(cache.place(key)).unwrap().set_modified(at(time)).unwrap();
        }
        assert!(cache.find(b"a").is_some());
        cache.keep(b"d", &[0; 200]);
        cache.keep(b"e", &[0; 1000]);
        let found = [b"a", b"b", b"c", b"d", b"e"].map(|key| cache.find(key).is_some());
        assert_eq!(found, [true, false, true, true, false]);
    }

    #[test]
    fn a_folder_that_cannot_be_written_to_does_no_harm() {
        let folder = tempfile::tempdir().unwrap();
        let cache = cache(&folder, MOST_BYTES);
        fs::write(&cache.folder, "no folder").unwrap();
        cache.keep(b"key", b"value");
        assert_eq!(cache.find(b"key"), None);
        assert_eq!(fs::read(&cache.folder).unwrap(), b"no folder");
    }

    #[test]
    fn threads_that_keep_and_find_the_same_result_never_see_a_part_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache { note: |error| panic!("{error}"), ..cache(&folder, MOST_BYTES) };
        let value: Vec<u8> = (0..100_000_u32).map(|k| (k % 251) as u8).collect();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..50 {
                        cache.keep(b"key", &value);
                        assert!(cache.find(b"key").is_some_and(|found| found == value));
                    }
                });
            }
        });
        assert_eq!(fs::read_dir(&cache.folder).unwrap().count(), 1);
    }
}
