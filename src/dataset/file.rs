//! The dataset file, its layout and its writer: a safetensors file whose header carries grid, provenance, scene and a
//! checksum.
//!
//! ```text
//! 8 bytes   n, length of the header, little-endian
//! n bytes   {"__metadata__":{"checksum":"xxxxxxxx","format":..,"grid":..,"provenance":..,"scene":..},
//!            "torque":{"dtype":"F64","shape":[n1,..,nd,d],"data_offsets":[..]},..}   padded with spaces
//! the rest  tensors, little-endian, widest type first
//! ```
//!
//! `stored.rs` says which tensors there are.
//!
//! In Python: `safetensors.numpy.load_file("sphere.haptize")["torque"]`.
//!
//! The header ends on a page boundary and wide types come first, so every column of the mapped file is aligned and is
//! read where it lies. The checksum is the CRC-32 of the whole file with the checksum's own digits as zeros: it stands
//! at a fixed place, so every bit of the file is covered and any single flipped bit is found.
//!
//! A mapped file must not be cut short by anyone while it is open: the system then kills the reader (SIGBUS). Programs
//! of this crate never do that, they rename; the haptic loop reads through [`Dataset::load`], which copies.

use super::{
    BUFFER, Dataset, Grid, Provenance, Stored, Surface, check,
    error::{inconsistent, unwritable},
    replace_file, store,
    stored::Description,
};
use crate::{Error, ErrorKind};
use bytemuck::Pod;
use rayon::prelude::*;
use safetensors::{Dtype, tensor::TensorInfo};
use serde::Serialize;
#[cfg(unix)]
use std::os::unix::fs::FileExt;
#[cfg(windows)]
use std::os::windows::fs::FileExt;
use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{self, BufWriter, Read, Seek, SeekFrom, Write},
    path::Path,
};

#[cfg(target_endian = "big")]
compile_error!("dataset columns are read where they lie, which needs a little-endian machine");

/// Value of `format` in files that this code reads and writes.
pub(super) const FORMAT: &str = "haptize dataset 1";
/// How every header begins; the checksum's digits follow.
pub(super) const OPENING: &[u8] = br#"{"__metadata__":{"checksum":""#;
/// Length of the header's length (bytes).
pub(super) const LENGTH: usize = 8;
/// Where the checksum's digits begin.
pub(super) const CHECKSUM: usize = LENGTH + OPENING.len();
/// Digits of the checksum while it is computed.
pub(super) const NO_CHECKSUM: &str = "00000000";
/// Tensors begin at a multiple of this: a page (bytes).
pub(super) const PAGE: usize = 4096;
/// Buffer between a piece of a tensor and the file: what is longer goes there as it is (bytes).
pub(crate) const PIECE_BUFFER: usize = 1 << 16;
/// Longest header that is read or written: bounds what a hostile file can make the parser allocate (bytes).
pub(super) const MAX_HEADER: usize = 16 << 20;

/// The header as text.
#[derive(Serialize)]
struct Header {
    #[serde(rename = "__metadata__")]
    metadata: Metadata,
    #[serde(flatten)]
    tensors: BTreeMap<&'static str, TensorInfo>,
}

/// All values are strings: safetensors allows no others.
#[derive(Serialize)]
struct Metadata {
    checksum: String,
    format: String,
    /// [`super::Grid`] as JSON.
    grid: String,
    /// [`super::Provenance`] as JSON.
    provenance: String,
    scene: String,
    /// Levels and order of a store ([`crate::store`]), as JSON; absent in a dataset.
    #[serde(skip_serializing_if = "Option::is_none")]
    store: Option<String>,
}

/// A number type that a tensor may hold.
pub(crate) trait Element: Pod {
    const DTYPE: Dtype;
}

macro_rules! element {
    ($($number:ty => $dtype:ident),*) => {
        $(impl Element for $number { const DTYPE: Dtype = Dtype::$dtype; })*
    };
}
// The upper half of an f32 is a bfloat16.
element!(f64 => F64, u64 => U64, f32 => F32, u32 => U32, u16 => BF16, u8 => U8);

/// A tensor about to be written.
pub(crate) struct Tensor<C> {
    pub(super) name: &'static str,
    pub(super) dtype: Dtype,
    pub(super) shape: Vec<usize>,
    pub(super) contents: C,
}

/// Where a tensor's numbers come from: pieces that follow one another, which all cores write.
pub(crate) trait Contents: Sync {
    /// Where each piece begins in the tensor (bytes).
    fn pieces(&self) -> Vec<usize>;
    /// Writes the numbers of a piece, little-endian.
    fn write(&self, piece: usize, writer: &mut impl Write) -> io::Result<()>;
}

/// Numbers in memory, aligned to their type.
impl Contents for &[u8] {
    fn pieces(&self) -> Vec<usize> {
        (0..self.len()).step_by(BUFFER).collect()
    }

    fn write(&self, piece: usize, writer: &mut impl Write) -> io::Result<()> {
        self.chunks(BUFFER).nth(piece).map_or(Ok(()), |bytes| writer.write_all(bytes))
    }
}

impl<C> Tensor<C> {
    /// A tensor of `T`.
    pub(crate) fn new<T: Element>(name: &'static str, shape: Vec<usize>, contents: C) -> Self {
        Self { name, dtype: T::DTYPE, shape, contents }
    }

    /// An array of a dataset over `grid`, of so many bytes.
    pub(crate) fn stored(array: Stored, grid: &Grid, bytes: usize, contents: C) -> Self {
        let Description { name, dtype, .. } = *array.description();
        let lengths = array.shape(grid);
        let given: usize = lengths.iter().flatten().product();
        let free = 8 * bytes / (dtype.bitsize() * given).max(1);
        Self { name, dtype, shape: lengths.into_iter().map(|length| length.unwrap_or(free)).collect(), contents }
    }

    /// The same tensor, its contents handed over in another form.
    pub(crate) fn map<D>(self, convert: impl FnOnce(C) -> D) -> Tensor<D> {
        let Self { name, dtype, shape, contents } = self;
        Tensor { name, dtype, shape, contents: convert(contents) }
    }

    fn bytes(&self) -> usize {
        self.shape.iter().product::<usize>() * self.dtype.bitsize() / 8
    }
}

/// The arrays that a dataset has.
pub(super) fn arrays(dataset: &Dataset) -> impl Iterator<Item = (Stored, Tensor<&[u8]>)> {
    Stored::all().filter_map(|array| {
        let bytes = dataset.stored(array)?;
        Some((array, Tensor::stored(array, &dataset.grid, bytes.len(), bytes)))
    })
}

/// The tensors of an object's geometry, in a file of a dataset over `grid`.
pub(crate) fn surface_tensors<'a>(grid: &Grid, surface: &'a Surface) -> Vec<Tensor<&'a [u8]>> {
    let tensor = |array| surface.stored(array).map(|bytes| Tensor::stored(array, grid, bytes.len(), bytes));
    Stored::all().filter_map(tensor).collect()
}

/// Memory of all columns (bytes).
pub(super) fn bytes(dataset: &Dataset) -> usize {
    arrays(dataset).map(|(_, tensor)| tensor.bytes()).sum()
}

/// Whether a file that begins with `start` may be a dataset: it begins with the length of its header, a JSON object.
pub(crate) fn may_be_dataset(start: &[u8]) -> bool {
    start.len() > LENGTH && start[LENGTH] == b'{' && start[..LENGTH].ends_with(&[0, 0, 0])
}

/// Checks that a dataset written to `path` replaces a dataset, an empty file, or none.
///
/// # Errors
/// When a file of another kind is there, or it cannot be read.
pub(crate) fn check_place(path: &Path) -> Result<(), Error> {
    let mut start = Vec::new();
    if fs::metadata(path).is_ok_and(|there| there.is_file()) {
        // What cannot be read may be anything.
        File::open(path)
            .and_then(|file| file.take(PAGE as u64).read_to_end(&mut start))
            .map_err(|source| unwritable(path, &source))?;
    }
    if !start.is_empty() && !may_be_dataset(&start) {
        let what = "there is a file already that is not a dataset; nothing is written: name another file";
        return Err(Error::at(path, what).of(ErrorKind::Foreign));
    }
    Ok(())
}

impl Dataset {
    /// Writes the dataset, replacing the file at `path` whole or not at all.
    ///
    /// # Errors
    /// When it would be refused on reading, a file of another kind is there, or the system refuses.
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        check_place(path)?;
        check::check(self).map_err(|reason| inconsistent(path, reason))?;
        let heading = Heading { grid: &self.grid, provenance: &self.provenance, scene: &self.scene, store: None };
        if let Some(store) = &self.refinement {
            return store::file::save(store, heading, self.surface.as_ref(), path);
        }
        write_file(path, heading, arrays(self).map(|(_, tensor)| tensor).collect())
    }
}

/// The header's entries beside the tensors.
#[derive(Clone, Copy)]
pub(crate) struct Heading<'a> {
    pub(crate) grid: &'a Grid,
    pub(crate) provenance: &'a Provenance,
    pub(crate) scene: &'a str,
    /// See [`Metadata::store`].
    pub(crate) store: Option<&'a str>,
}

/// Writes a dataset's file, replacing the one at `path` whole or not at all. The tensors may be in any order.
pub(crate) fn write_file<C: Contents>(
    path: &Path,
    heading: Heading<'_>,
    mut tensors: Vec<Tensor<C>>,
) -> Result<(), Error> {
    let inconsistent = |reason: String| inconsistent(path, reason);
    tensors.sort_by_key(|tensor| std::cmp::Reverse(tensor.dtype.bitsize()));
    let mut text = header(heading, &tensors).map_err(|error| inconsistent(error.to_string()))?;
    text.resize((LENGTH + text.len()).next_multiple_of(PAGE) - LENGTH, b' ');
    if text.len() > MAX_HEADER {
        return Err(inconsistent(format!("its header, scene included, is longer than {MAX_HEADER} bytes")));
    }
    replace_file(path, |writer| {
        let mut hasher = crc32fast::Hasher::new();
        for bytes in [&(text.len() as u64).to_le_bytes()[..], &text] {
            writer.write_all(bytes)?;
            hasher.update(bytes);
        }
        writer.flush()?;
        let mut place = LENGTH + text.len();
        for tensor in &tensors {
            hasher.combine(&write_tensor(writer.get_ref(), place, tensor)?);
            place += tensor.bytes();
        }
        writer.seek(SeekFrom::Start(CHECKSUM as u64))?;
        writer.write_all(digits(hasher).as_bytes())
    })
    .map_err(|source| unwritable(path, &source))
}

/// Writes `tensor` at `place` of `file`, its pieces on all cores, and returns its checksum.
fn write_tensor<C: Contents>(file: &File, place: usize, tensor: &Tensor<C>) -> io::Result<crc32fast::Hasher> {
    let pieces = tensor.contents.pieces();
    let write = |piece: usize| {
        let at = |piece: usize| place + pieces.get(piece).copied().unwrap_or(tensor.bytes());
        let placed = Placed { file, place: at(piece), hasher: crc32fast::Hasher::new() };
        let mut writer = BufWriter::with_capacity(PIECE_BUFFER, placed);
        tensor.contents.write(piece, &mut writer)?;
        let Placed { place, hasher, .. } = writer.into_inner()?;
        let is_whole = place == at(piece + 1);
        is_whole.then_some(hasher).ok_or_else(|| io::Error::other(format!("{} changed meanwhile", tensor.name)))
    };
    (0..pieces.len()).into_par_iter().map(write).try_reduce(crc32fast::Hasher::new, |mut before, piece| {
        before.combine(&piece);
        Ok(before)
    })
}

/// A place in a file, others of which are written at the same time, and the checksum of what goes there.
struct Placed<'a> {
    file: &'a File,
    /// (bytes)
    place: usize,
    hasher: crc32fast::Hasher,
}

impl Write for Placed<'_> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        #[cfg(unix)]
        let count = self.file.write_at(buffer, self.place as u64)?;
        #[cfg(windows)]
        let count = self.file.seek_write(buffer, self.place as u64)?;
        self.hasher.update(&buffer[..count]);
        self.place += count;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn header<C>(heading: Heading<'_>, tensors: &[Tensor<C>]) -> serde_json::Result<Vec<u8>> {
    let mut end = 0;
    let infos = tensors.iter().map(|tensor| {
        let start = end;
        end += tensor.bytes();
        (tensor.name, TensorInfo { dtype: tensor.dtype, shape: tensor.shape.clone(), data_offsets: (start, end) })
    });
    serde_json::to_vec(&Header {
        metadata: Metadata {
            checksum: NO_CHECKSUM.into(),
            format: if heading.store.is_some() { store::file::FORMAT } else { FORMAT }.into(),
            grid: serde_json::to_string(heading.grid)?,
            provenance: serde_json::to_string(heading.provenance)?,
            scene: heading.scene.into(),
            store: heading.store.map(str::to_owned),
        },
        tensors: infos.collect(),
    })
}

pub(super) fn digits(hasher: crc32fast::Hasher) -> String {
    format!("{:08x}", hasher.finalize())
}
