//! The part: an unfinished sweep on disk, so that killing the process loses one chunk at most.
//!
//! ```text
//! "haptize part 7\n", then frames:  u64 length of the body, u32 CRC-32 of the body, body
//! ```
//!
//! The first body is the [`Binding`] as JSON, every other one a [`Tile`] of results, or [`NOTICE`] and a text. Frames
//! are only ever appended. What a crash leaves at the end (half a frame, or a wrong checksum) is cut off and computed
//! again: a part never adds a wrong number to a dataset, and the finished file is the same, bit for bit, as without the
//! interruption.

use super::{
    Shard,
    error::{busy, foreign, in_part, other_part, unwritable},
    shard,
    table::Table,
    tally::Tally,
    tile::{Shape, Tile},
};
use crate::{
    Error,
    dataset::{Grid, Provenance, resolved},
};
use memmap2::Mmap;
use serde::{Deserialize, Serialize};
use std::{
    fs::{File, OpenOptions, TryLockError},
    io::{self, Seek, SeekFrom, Write},
    ops::Range,
    path::{Path, PathBuf},
};

const MAGIC: &[u8] = b"haptize part 7\n";
/// How the body of a notice begins: as no tile does, whose first point has no such number.
const NOTICE: [u8; 8] = [u8::MAX; 8];

/// Everything that a sweep's numbers depend on: a part may only be continued by the sweep that began it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Binding {
    pub grid: Grid,
    /// Which of the grid's points it is to hold.
    pub shard: Shard,
    pub scene: String,
    /// Where the scene was read from, absolute: what it names lies beside it.
    pub scene_path: String,
    /// CRC-32 of the object: all its nodes at rest, its surface and its stiffness. It may come from a mesh file, whose
    /// contents the scene does not hold.
    pub object: u32,
    pub shape: Shape,
    pub provenance: Provenance,
}

impl Binding {
    /// Name of its file, where it is a shard: the same for all shards of a bake but for their numbers.
    pub fn file_name(&self) -> String {
        let Provenance { version, algorithm, tolerance, .. } = &self.provenance;
        let grid: Vec<_> = self.grid.axes.iter().map(|axis| (axis.start, axis.step, axis.count)).collect();
        let identity = format!("{version} {algorithm} {tolerance:?} {grid:?} {:08x} {}", self.object, self.scene);
        let stem = Path::new(&self.scene_path).file_stem().unwrap_or_default().to_string_lossy();
        let (hash, Shard { index, count }) = (crc32fast::hash(identity.as_bytes()), self.shard);
        let digits = count.to_string().len();
        format!("{stem}-{hash:08x}.{index:0digits$}-of-{count}.{}", shard::EXTENSION)
    }

    /// Number of points that it is to hold.
    pub fn points(&self) -> usize {
        self.shard.points(self.grid.points())
    }

    /// Returns the first difference from `other` that forbids to continue it; the date may differ.
    fn difference(&self, other: &Self) -> Option<&'static str> {
        let (mine, its) = (&self.provenance, &other.provenance);
        let differences = [
            ("another backend", mine.backend != its.backend),
            ("another adapter", mine.adapter != its.adapter),
            ("another shard", self.shard != other.shard),
        ];
        let different = differences.into_iter().find(|(_, differs)| *differs).map(|(what, _)| what);
        self.other_sweep(other).or(different)
    }

    /// Returns the first difference from `other` that makes them parts of different datasets, whatever solves them and
    /// whichever points they hold.
    pub fn other_sweep(&self, other: &Self) -> Option<&'static str> {
        let (mine, its) = (&self.provenance, &other.provenance);
        let differences = [
            ("another version of this program", mine.version != its.version),
            ("another algorithm", mine.algorithm != its.algorithm),
            ("another tolerance", mine.tolerance != its.tolerance),
            ("another grid", self.grid != other.grid),
            ("another text of the scene", self.scene != other.scene),
            ("another object, such as a mesh that has changed since", self.object != other.object),
            ("another interpolation or other effects, for which other columns are stored", self.shape != other.shape),
        ];
        differences.into_iter().find(|(_, differs)| *differs).map(|(what, _)| what)
    }
}

/// An open part, locked against other processes.
pub(super) struct Part {
    path: PathBuf,
    file: File,
}

/// What the bytes of a part hold, as far as they are whole.
pub(super) struct Found {
    pub binding: Binding,
    /// Where the tiles lie, in the order of the points (bytes).
    tiles: Vec<Range<usize>>,
    pub notices: Vec<String>,
    pub tally: Tally,
    /// Where the frame behind the binding begins, and where the last whole frame ends (bytes).
    results: usize,
    end: usize,
}

impl Found {
    /// Reads the part in `bytes`; `None` where it ends before its binding does. `Err` says why it is none.
    pub fn read(bytes: &[u8]) -> Result<Option<Self>, String> {
        if !bytes.starts_with(MAGIC) {
            // Killed while it wrote its first line.
            return if MAGIC.starts_with(bytes) {
                Ok(None)
            } else {
                Err("it is no part of a bake by this version".into())
            };
        }
        let Some(body) = frame(bytes, MAGIC.len()) else { return Ok(None) };
        let (results, tiles) = (body.end, Vec::new());
        let binding: Binding = serde_json::from_slice(&bytes[body]).map_err(|error| error.to_string())?;
        binding.grid.check()?;
        binding.shard.check()?;
        let (points, shape) = (binding.grid.points(), binding.shape);
        let (notices, tally) = (Vec::new(), Tally::default());
        let mut found = Self { binding, tiles, notices, tally, results, end: results };
        while let Some(body) = frame(bytes, found.end) {
            let contents = &bytes[body.clone()];
            found.end = if let Some(notice) = contents.strip_prefix(&NOTICE) {
                found.notices.push(String::from_utf8_lossy(notice).into_owned());
                body.end
            } else {
                let next = found.binding.shard.rest(points, found.tally.points);
                let is_next = |tile: &Tile<'_>| tile.first == next.start && tile.points() <= next.len();
                let Some(tile) = Tile::read(contents, shape).filter(is_next) else { break };
                found.tally.add(&tile, 0..tile.points());
                found.tiles.push(body.clone());
                body.end
            };
        }
        Ok(Some(found))
    }

    /// The tiles in `bytes`, from which this was read.
    pub fn tiles<'m>(&self, bytes: &'m [u8]) -> impl Iterator<Item = Tile<'m>> {
        let shape = self.binding.shape;
        self.tiles.iter().filter_map(move |body| Tile::read(&bytes[body.clone()], shape))
    }

    /// Whether all points are there, and nothing of `bytes` is damaged.
    pub fn is_whole(&self, bytes: &[u8]) -> bool {
        self.end == bytes.len() && self.tally.points == self.binding.points()
    }
}

impl Part {
    /// Begins a part at `path`, or with `resume` continues the one that is there, and counts its points; `binding` then
    /// takes its date and notices. Results that are there are never thrown away: without `resume` they are an error.
    pub fn open(path: &Path, resume: bool, binding: &mut Binding) -> Result<(Self, Tally), Error> {
        let failed = |source| in_part(path, &source);
        if path.is_symlink() {
            // What it leads to is not this program's.
            return Err(foreign(path, "it is a link"));
        }
        // A pipe would be waited for, and a device has no end.
        resolved(path).map_err(|why| foreign(path, why))?;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(|source| unwritable(path, &source))?;
        match file.try_lock() {
            Ok(()) => (),
            Err(TryLockError::WouldBlock) => return Err(busy(path)),
            // Some network file systems have no locks; only the second of two bakes at once would notice.
            Err(TryLockError::Error(_)) => (),
        }
        let mut part = Self { path: path.into(), file };
        let map = part.map().map_err(failed)?;
        let (tally, end) = match part.found(&map)? {
            Some(found) if !resume && found.results < map.len() => {
                let what = "holds what an unfinished bake has solved; add --resume to go on with it, or delete it to start \
                            again";
                return Err(Error::at(path, what));
            }
            Some(found) if resume => {
                if let Some(difference) = found.binding.difference(binding) {
                    return Err(other_part(path, difference));
                }
                binding.provenance.date = found.binding.provenance.date;
                binding.provenance.notices.extend(found.notices);
                (found.tally, Some(found.end))
            }
            _ => (Tally::default(), None),
        };
        drop(map);
        part.stand(end, binding).map_err(failed)?;
        Ok((part, tally))
    }

    /// Stands behind the first `end` bytes, which are whole, and cuts off the others; or begins anew.
    fn stand(&mut self, end: Option<usize>, binding: &Binding) -> io::Result<()> {
        let length = end.unwrap_or(0) as u64;
        self.file.set_len(length)?;
        self.file.seek(SeekFrom::Start(length))?;
        if end.is_none() {
            self.file.write_all(MAGIC)?;
            self.write(&[&serde_json::to_vec(binding)?])?;
        }
        Ok(())
    }

    /// What is in `map`, which is of this part; `None` where it ends before its binding does.
    fn found(&self, map: &Mmap) -> Result<Option<Found>, Error> {
        Found::read(map).map_err(|reason| foreign(&self.path, reason))
    }

    /// Adds the results of the next points.
    pub fn append(&mut self, tile: &Tile<'_>) -> Result<(), Error> {
        let (opening, columns) = tile.bytes();
        let body: Vec<&[u8]> = std::iter::once(&opening[..]).chain(columns).collect();
        self.write(&body).map_err(|source| in_part(&self.path, &source))
    }

    /// Adds something that provenance will tell.
    pub fn note(&mut self, notice: &str) -> Result<(), Error> {
        self.write(&[&NOTICE, notice.as_bytes()]).map_err(|source| in_part(&self.path, &source))
    }

    /// Gives the part, which is whole now, its name, so that it is there after a power cut, too.
    pub fn finish(self, file: &Path) -> Result<(), Error> {
        let Self { path, file: part, .. } = self;
        let finished = part.sync_all().and_then(|()| std::fs::rename(&path, file));
        finished.map_err(|source| in_part(&path, &source))
    }

    /// Removes the part, whose points are all in a finished file now.
    pub fn remove(self) -> Result<(), Error> {
        let Self { path, file, .. } = self;
        drop(file);
        std::fs::remove_file(&path).map_err(|source| in_part(&path, &source))
    }

    /// Returns where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Appends a frame whose body comes in pieces.
    fn write(&mut self, body: &[&[u8]]) -> io::Result<()> {
        let length: usize = body.iter().map(|piece| piece.len()).sum();
        let mut hasher = crc32fast::Hasher::new();
        body.iter().for_each(|piece| hasher.update(piece));
        self.file.write_all(&[&(length as u64).to_le_bytes()[..], &hasher.finalize().to_le_bytes()].concat())?;
        body.iter().try_for_each(|piece| self.file.write_all(piece))
    }

    /// Maps the part's file into memory. The file is locked: no other bake changes it.
    pub fn map(&self) -> io::Result<Mmap> {
        // SAFETY: the mapping is read-only. Another program that truncates the file ends this process, as it would with
        // any mapped file; the part is this bake's own, and no haptic loop reads it.
        unsafe { Mmap::map(&self.file) }
    }

    /// The results in `map`, which is of this part.
    pub fn table<'m>(&self, map: &'m Mmap, shape: Shape) -> Result<Table<'m>, Error> {
        let tiles = self.found(map)?.map_or_else(Vec::new, |found| found.tiles(map).collect());
        Ok(Table::new(shape, tiles))
    }
}

/// Returns where the body of the frame at `place` of `bytes` lies; `None` when there is no whole one.
fn frame(bytes: &[u8], place: usize) -> Option<Range<usize>> {
    let (length, rest) = bytes.get(place..)?.split_first_chunk()?;
    let (checksum, rest) = rest.split_first_chunk()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let begin = bytes.len() - rest.len();
    (crc32fast::hash(rest.get(..length)?) == u32::from_le_bytes(*checksum)).then_some(begin..begin + length)
}
