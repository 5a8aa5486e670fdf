//! The part: an unfinished sweep on disk, so that killing the process loses one chunk at most.
//!
//! ```text
//! "haptize part 5\n", then frames:  u64 length of the body, u32 CRC-32 of the body, body
//! ```
//!
//! The first body is the [`Binding`] as JSON, every other one a block of [`Columns`], or [`NOTICE`] and a text. Frames
//! are only ever appended. What a crash leaves at the end (half a frame, or a wrong checksum) is cut off and computed
//! again: a part never adds a wrong number to a dataset, and the finished file is the same, bit for bit, as without the
//! interruption.

use super::{
    Shard, SweepError,
    columns::{Columns, Opening, Width},
    shard,
    table::{Block, Table},
    tally::Tally,
};
use crate::dataset::{Grid, Provenance, resolved};
use memmap2::Mmap;
use serde::{Deserialize, Serialize};
use std::{
    fs::{File, OpenOptions, TryLockError},
    io::{self, BufReader, Read, Seek, SeekFrom, Write},
    ops::Range,
    path::{Path, PathBuf},
};

const MAGIC: &[u8] = b"haptize part 5\n";
/// Length and checksum before each body (bytes).
const FRAME: usize = 8 + 4;

/// How the body of a notice begins: as no block of columns does, whose first point has no such number.
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
    /// Whether tangents are stored.
    pub with_tangent: bool,
    /// Whether contact forces on the proxy are stored.
    pub with_touches: bool,
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

    /// Numbers that each point has.
    pub fn width(&self) -> Width {
        Width { joints: self.grid.joints(), tangent: self.with_tangent, touches: self.with_touches }
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
            ("another object, such as a mesh that changed meanwhile", self.object != other.object),
            ("another interpolation, for which tangents are stored or not", self.with_tangent != other.with_tangent),
            ("other effects, for which contact forces are stored or not", self.with_touches != other.with_touches),
        ];
        differences.into_iter().find(|(_, differs)| *differs).map(|(what, _)| what)
    }
}

/// An open part, locked against other processes.
pub(super) struct Part {
    path: PathBuf,
    file: File,
    /// Where the frame behind the binding begins (bytes).
    results: u64,
}

impl Part {
    /// Begins a part at `path`, or with `resume` continues the one that is there, and counts its points; `binding` then
    /// takes its date and notices. Results that are there are never thrown away: without `resume` they are an error.
    pub fn open(path: &Path, resume: bool, binding: &mut Binding) -> Result<(Self, Tally), SweepError> {
        let failed = |source| SweepError::Part { path: path.into(), source };
        // A pipe would be waited for, and a device has no end.
        resolved(path).map_err(|why| SweepError::ForeignPart { path: path.into(), reason: why.to_string() })?;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(|source| SweepError::Folder { path: path.into(), source })?;
        match file.try_lock() {
            Ok(()) => (),
            Err(TryLockError::WouldBlock) => return Err(SweepError::Busy { path: path.into() }),
            // Some network file systems have no locks; only the second of two bakes at once would notice.
            Err(TryLockError::Error(_)) => (),
        }
        let mut part = Self { path: path.into(), file, results: 0 };
        if !resume && part.holds_results()? {
            return Err(SweepError::Unfinished { path: path.into() });
        }
        let found = if resume { part.read(binding)? } else { None };
        match found {
            Some(tally) => Ok((part, tally)),
            None => part.begin(binding).map(|()| (part, Tally::default())).map_err(failed),
        }
    }

    /// Adds a chunk whose first point has number `first`.
    pub fn append(&mut self, first: usize, chunk: &Columns) -> Result<(), SweepError> {
        let opening = chunk.opening(first);
        let mut body = vec![opening.as_flattened()];
        body.extend(chunk.bytes());
        self.write(&body).map_err(|source| SweepError::Part { path: self.path.clone(), source })
    }

    /// Adds something that provenance will tell.
    pub fn note(&mut self, notice: &str) -> Result<(), SweepError> {
        self.write(&[&NOTICE, notice.as_bytes()]).map_err(|source| SweepError::Part { path: self.path.clone(), source })
    }

    /// Gives the part, which is whole now, its name, so that it is there after a power cut, too.
    pub fn finish(self, file: &Path) -> Result<(), SweepError> {
        let Self { path, file: part, .. } = self;
        let finished = part.sync_all().and_then(|()| std::fs::rename(&path, file));
        finished.map_err(|source| SweepError::Part { path, source })
    }

    /// Removes the part, whose points are all in a finished file now.
    pub fn remove(self) -> Result<(), SweepError> {
        let Self { path, file, .. } = self;
        drop(file);
        std::fs::remove_file(&path).map_err(|source| SweepError::Part { path, source })
    }

    /// Returns where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn begin(&mut self, binding: &Binding) -> io::Result<()> {
        self.file.set_len(0)?;
        self.file.rewind()?;
        self.file.write_all(MAGIC)?;
        self.write(&[&serde_json::to_vec(binding)?])?;
        self.results = self.file.stream_position()?;
        Ok(())
    }

    /// Appends a frame whose body comes in pieces.
    pub fn write(&mut self, body: &[&[u8]]) -> io::Result<()> {
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

    /// The results in `map`, which is of this part, and all of whose frames are whole.
    pub fn table<'m>(&self, map: &'m Mmap, width: Width) -> io::Result<Table<'m>> {
        let (mut blocks, mut rest) = (Vec::new(), map.get(self.results as usize..).unwrap_or(&[]));
        while !rest.is_empty() {
            let (length, behind) = rest.split_first_chunk().ok_or(io::ErrorKind::UnexpectedEof)?;
            let length = usize::try_from(u64::from_le_bytes(*length)).map_err(io::Error::other)?;
            let (body, behind) = behind[FRAME - 8..].split_at_checked(length).ok_or(io::ErrorKind::UnexpectedEof)?;
            rest = behind;
            if !body.starts_with(&NOTICE) {
                let (opening, columns) = body.split_first_chunk().ok_or(io::ErrorKind::UnexpectedEof)?;
                let opening = Opening::of(*opening).ok_or(io::ErrorKind::InvalidData)?;
                blocks.push(Block { first: opening.first, columns: opening.columns(columns, width) });
            }
        }
        Ok(Table::new(width, blocks))
    }

    /// The binding of the file that is there, which `reader` then stands behind with `left` bytes left; `None` when the
    /// file ends before its binding does.
    fn opening(&self, reader: &mut impl Read, left: &mut u64) -> Result<Option<Binding>, SweepError> {
        let failed = |source| SweepError::Part { path: self.path.clone(), source };
        let mut magic = Vec::new();
        reader.take(MAGIC.len() as u64).read_to_end(&mut magic).map_err(failed)?;
        if magic != MAGIC {
            // Killed while it wrote its first line; anything else is not ours to overwrite.
            return if MAGIC.starts_with(&magic) { Ok(None) } else { Err(self.foreign("it is no part of a bake")) };
        }
        *left -= MAGIC.len() as u64;
        let Some(body) = frame(reader, left).map_err(failed)? else { return Ok(None) };
        serde_json::from_slice(&body).map(Some).map_err(|error| self.foreign(&error.to_string()))
    }

    /// Whether there is anything behind the binding.
    fn holds_results(&self) -> Result<bool, SweepError> {
        let mut left = self.length()?;
        Ok(self.opening(&mut BufReader::new(&self.file), &mut left)?.is_some() && left > 0)
    }

    /// (bytes)
    fn length(&self) -> Result<u64, SweepError> {
        let metadata = self.file.metadata().map_err(|source| SweepError::Part { path: self.path.clone(), source })?;
        Ok(metadata.len())
    }

    /// Reads the part from its start, cuts off what is not whole, and leaves the file there; `None` when nothing is.
    fn read(&mut self, binding: &mut Binding) -> Result<Option<Tally>, SweepError> {
        let failed = |source| SweepError::Part { path: self.path.clone(), source };
        let length = self.length()?;
        let mut left = length;
        let mut reader = BufReader::new(&self.file);
        let Some(found) = self.opening(&mut reader, &mut left)? else { return Ok(None) };
        let mut whole = length - left;
        let mut next = |whole: &mut u64| -> Result<Option<Vec<u8>>, SweepError> {
            let body = frame(&mut reader, &mut left).map_err(failed)?;
            *whole += body.as_ref().map_or(0, |body| (FRAME + body.len()) as u64);
            Ok(body)
        };
        if let Some(difference) = found.difference(binding) {
            return Err(SweepError::OtherPart { path: self.path.clone(), difference });
        }
        let (points, width) = (binding.points(), binding.width());
        let (results, mut tally) = (whole, Tally::default());
        loop {
            let before = whole;
            let Some(body) = next(&mut whole)? else { break };
            if let Some(notice) = body.strip_prefix(&NOTICE) {
                binding.provenance.notices.push(String::from_utf8_lossy(notice).into_owned());
                continue;
            }
            let first = binding.shard.rest(binding.grid.points(), tally.points).start;
            match Columns::decode(&body, first, width) {
                Some(chunk) if chunk.points() <= points - tally.points => {
                    tally.add(&chunk);
                }
                _ => {
                    whole = before;
                    break;
                }
            }
        }
        drop(reader);
        self.file.set_len(whole).map_err(failed)?;
        self.file.seek(SeekFrom::Start(whole)).map_err(failed)?;
        self.results = results;
        binding.provenance.date = found.provenance.date;
        Ok(Some(tally))
    }

    fn foreign(&self, reason: &str) -> SweepError {
        SweepError::ForeignPart { path: self.path.clone(), reason: reason.into() }
    }
}

/// Contents of a frame.
pub(super) enum Frame {
    /// Results of consecutive points.
    Block,
    /// Something that provenance will tell.
    Notice(String),
}

/// The binding of the part in `bytes`, and where its results begin; or why it has none.
pub(super) fn binding(bytes: &[u8]) -> Result<(Binding, usize), String> {
    let not_ours = "it is no part of a bake by this version";
    let mut place = if bytes.starts_with(MAGIC) { MAGIC.len() } else { return Err(not_ours.into()) };
    let body = body(bytes, &mut place).and_then(|body| bytes.get(body)).ok_or("its beginning is damaged")?;
    let binding = serde_json::from_slice(body).map_err(|error| error.to_string())?;
    Ok((binding, place))
}

/// The frame at `place` in the part `bytes`, behind which `place` then is, and where its body lies; `None` when there
/// is no whole one.
pub(super) fn next(bytes: &[u8], place: &mut usize) -> Option<(Frame, Range<usize>)> {
    let body = body(bytes, place)?;
    let notice = bytes.get(body.clone())?.strip_prefix(&NOTICE);
    let frame = notice.map_or(Frame::Block, |text| Frame::Notice(String::from_utf8_lossy(text).into_owned()));
    Some((frame, body))
}

/// Returns where the body of the frame at `place` lies, if it is whole.
fn body(bytes: &[u8], place: &mut usize) -> Option<Range<usize>> {
    let mut rest = bytes.get(*place..)?;
    let mut left = rest.len() as u64;
    let body = frame(&mut rest, &mut left).ok()??;
    let end = bytes.len() - rest.len();
    *place = end;
    Some(end - body.len()..end)
}

/// The next frame's body, of a file with `left` bytes left; `None` when there is no whole one.
fn frame(reader: &mut impl Read, left: &mut u64) -> io::Result<Option<Vec<u8>>> {
    let Some(room) = left.checked_sub(FRAME as u64) else { return Ok(None) };
    let (mut length, mut checksum) = ([0; 8], [0; 4]);
    reader.read_exact(&mut length)?;
    reader.read_exact(&mut checksum)?;
    let length = u64::from_le_bytes(length);
    // The length is bounded by the file's before anything is allocated for it.
    let Some(after) = room.checked_sub(length) else { return Ok(None) };
    let mut body = vec![0; usize::try_from(length).map_err(io::Error::other)?];
    reader.read_exact(&mut body)?;
    *left = after;
    Ok((crc32fast::hash(&body) == u32::from_le_bytes(checksum)).then_some(body))
}
