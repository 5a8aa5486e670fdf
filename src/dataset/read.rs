//! Dataset files, read: mapped or copied, checked as a whole, and cut into columns where they lie.

use super::{
    Column, Dataset, Grid, Provenance, Source, Stored, Surface, check,
    error::{damaged, foreign, no_memory},
    file::{CHECKSUM, Element, FORMAT, LENGTH, MAX_HEADER, NO_CHECKSUM, OPENING, PAGE, digits},
    store,
};
use crate::{
    Error, ErrorKind, input,
    memory::{self, Shortage},
};
use memmap2::{Mmap, MmapMut};
use safetensors::tensor::{Metadata as Tensors, TensorInfo};
use std::{
    collections::{BTreeMap, HashMap},
    fs::File,
    io::{self, Read},
    path::Path,
    sync::Arc,
};

impl Dataset {
    /// Maps the file at `path` and checks all of it. The columns are read where they lie in the file; its pages count
    /// as this process's memory only once they are looked at after the check.
    ///
    /// # Errors
    /// Missing, foreign, of another version, cut short, or altered in any bit.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let read = |source| Error::unreadable(path, &source);
        let file = input::open(path).map_err(read)?;
        // SAFETY: the map is read-only and private to this process; what changing the file meanwhile does is said in
        // `file.rs`.
        let map = unsafe { Mmap::map(&file) }.map_err(|source| match source.kind() {
            io::ErrorKind::OutOfMemory => no_room(path, &file),
            _ => read(source),
        })?;
        let dataset = decode(path, map)?;
        dataset.torque.release();
        Ok(dataset)
    }

    /// Like [`Dataset::open`], but copies the file into memory: nothing that happens to the file can reach the reader.
    ///
    /// # Errors
    /// As [`Dataset::open`]; also when it does not fit in memory.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let read = |source| Error::unreadable(path, &source);
        let mut file = input::open(path).map_err(read)?;
        let length = file.metadata().map_err(read)?.len();
        // A map of no bytes is refused by some systems; one zero byte is refused by the checks.
        let bytes = usize::try_from(length).map_err(|error| read(io::Error::other(error)))?;
        memory::check(bytes).map_err(|shortage| no_memory(path, shortage))?;
        let mut map = MmapMut::map_anon(bytes.max(1)).map_err(|_| no_room(path, &file))?;
        file.read_exact(&mut map[..bytes]).map_err(read)?;
        decode(path, map.make_read_only().map_err(read)?)
    }
}

/// The error of a file that does not fit in memory.
fn no_room(path: &Path, file: &File) -> Error {
    let needed = file.metadata().map_or(0, |file| usize::try_from(file.len()).unwrap_or(usize::MAX));
    no_memory(path, Shortage { needed, left: memory::left().unwrap_or(0) })
}

/// A tensor that earlier versions stored for friction.
const TOUCHES: &str = "touch_offsets";

/// Checks a whole file and makes a dataset of windows into it.
fn decode(path: &Path, map: Mmap) -> Result<Dataset, Error> {
    let damaged = |reason: String| damaged(path, reason);
    let mut container = Container::check(path, map)?;
    if container.text("format").is_ok_and(|format| format == store::file::FORMAT) {
        let dataset = store::file::decode(path, container)?;
        check::check(&dataset).map_err(damaged)?;
        return Ok(dataset);
    }
    let (grid, provenance) = container.heading().map_err(damaged)?;
    let scene = container.text("scene").map_err(damaged)?.to_string();
    if container.tensors.contains_key(TOUCHES) {
        let what = "holds contact forces on the arm's nodes, by which an earlier version felt friction and contact \
                    damping; leave contact_damping out of its scene and bake it again";
        return Err(Error::at(path, what).of(ErrorKind::Dataset));
    }
    let mut arrays = Arrays { file: &mut container, grid: &grid };
    let dataset = Dataset { scene, provenance, ..Dataset::of(&mut arrays, grid.clone()).map_err(damaged)? };
    container.finish().map_err(damaged)?;
    check::check(&dataset).map_err(damaged)?;
    Ok(dataset)
}

/// A file whose header and checksum are sound.
pub(crate) struct Container {
    texts: HashMap<String, String>,
    /// Those that have not been taken.
    tensors: BTreeMap<String, TensorInfo>,
    map: Arc<Mmap>,
    /// Where the tensors begin.
    start: usize,
}

impl Container {
    /// Checks the whole file.
    fn check(path: &Path, map: Mmap) -> Result<Self, Error> {
        let damaged = |reason: String| damaged(path, reason);

        if map.get(LENGTH..CHECKSUM) != Some(OPENING) {
            return Err(foreign(path, "it begins otherwise"));
        }
        let length = map.first_chunk::<LENGTH>().map_or(0, |bytes| u64::from_le_bytes(*bytes));
        let header = usize::try_from(length).unwrap_or(usize::MAX);
        let start = header.saturating_add(LENGTH);
        if header > MAX_HEADER || start > map.len() || !start.is_multiple_of(PAGE) {
            return Err(damaged(format!("its header would be {length} bytes long, in a file of {}", map.len())));
        }
        let metadata: Tensors =
            serde_json::from_slice(&map[LENGTH..start]).map_err(|error| damaged(format!("header: {error}")))?;
        if metadata.data_len() != map.len() - start {
            let (found, expected) = (map.len() - start, metadata.data_len());
            return Err(damaged(format!("it holds {found} bytes of data where its header promises {expected}")));
        }

        // The digits are compared as text: a hexadecimal number would read the same in capitals.
        let written = &map[CHECKSUM..CHECKSUM + NO_CHECKSUM.len()];
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(&map[..CHECKSUM]);
        hasher.update(NO_CHECKSUM.as_bytes());
        hasher.update(&map[CHECKSUM + NO_CHECKSUM.len()..]);
        let found = digits(hasher);
        if written != found.as_bytes() {
            let written = String::from_utf8_lossy(written);
            return Err(damaged(format!("its contents have checksum {found}, its header says {written}")));
        }

        let container = Self {
            texts: metadata.metadata().clone().unwrap_or_default(),
            tensors: metadata.tensors().into_iter().map(|(name, info)| (name, info.clone())).collect(),
            map: Arc::new(map),
            start,
        };
        let found = container.text("format").map_err(damaged)?;
        if ![FORMAT, store::file::FORMAT].contains(&found) {
            let what = format!("has format {found:?}, this program reads {FORMAT:?}; bake it again with this program");
            return Err(Error::at(path, what).of(ErrorKind::Dataset));
        }
        Ok(container)
    }

    /// A text of the header; `Err` says that it is missing.
    pub(crate) fn text(&self, key: &str) -> Result<&str, String> {
        self.texts.get(key).map(String::as_str).ok_or_else(|| format!("{key} is missing"))
    }

    /// Grid and provenance; `Err` says what is wrong.
    pub(crate) fn heading(&self) -> Result<(Grid, Provenance), String> {
        let grid: Grid = serde_json::from_str(self.text("grid")?).map_err(|error| format!("grid: {error}"))?;
        let provenance: Provenance =
            serde_json::from_str(self.text("provenance")?).map_err(|error| format!("provenance: {error}"))?;
        grid.check()?;
        Ok((grid, provenance))
    }

    /// Takes the tensor `name`; `shape` leaves free lengths as `None`. `Err` says what is wrong, or that it is missing.
    pub(crate) fn take<T: Element>(&mut self, name: &str, shape: &[Option<usize>]) -> Result<Column<T>, String> {
        self.optional(name, shape)?.ok_or_else(|| format!("tensor {name} is missing"))
    }

    /// The same; `None` where it is missing.
    pub(crate) fn optional<T: Element>(
        &mut self,
        name: &str,
        shape: &[Option<usize>],
    ) -> Result<Option<Column<T>>, String> {
        let Some(info) = self.tensors.remove(name) else { return Ok(None) };
        let fits = info.shape.len() == shape.len()
            && info.shape.iter().zip(shape).all(|(found, expected)| expected.is_none_or(|expected| expected == *found));
        if info.dtype != T::DTYPE || !fits {
            return Err(format!("tensor {name} has type {:?} and shape {:?}", info.dtype, info.shape));
        }
        let (start, end) = info.data_offsets;
        Column::mapped(self.map.clone(), self.start + start..self.start + end)
            .map(Some)
            .ok_or_else(|| format!("tensor {name} lies outside the file or is misaligned"))
    }

    /// Takes the object's geometry; `None` where it is absent. `Err` says what is wrong.
    pub(super) fn surface(&mut self, grid: &Grid) -> Result<Option<Surface>, String> {
        Surface::of_arrays(&mut Arrays { file: self, grid })
    }

    /// `Err` names a tensor that has not been taken.
    pub(crate) fn finish(&self) -> Result<(), String> {
        let extra = self.tensors.first_key_value();
        extra.map_or(Ok(()), |(name, _)| Err(format!("tensor {name} does not belong here")))
    }
}

/// The arrays of a file of a dataset over a grid, of which each is taken once.
struct Arrays<'a> {
    file: &'a mut Container,
    grid: &'a Grid,
}

impl Source for Arrays<'_> {
    fn take<T: Element>(&mut self, array: Stored) -> Result<Option<Column<T>>, String> {
        self.file.optional(array.name(), &array.shape(self.grid))
    }
}
