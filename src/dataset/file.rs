//! The dataset file: a safetensors file whose header carries grid, provenance, scene and a checksum.
//!
//! ```text
//! 8 bytes   n, length of the header, little-endian
//! n bytes   {"__metadata__":{"checksum":"xxxxxxxx","format":..,"grid":..,"provenance":..,"scene":..},
//!            "torque":{"dtype":"F64","shape":[n1,..,nd,d],"data_offsets":[..]},..}   padded with spaces
//! the rest  tensors, little-endian, widest type first
//! ```
//!
//! | tensor | type | shape | |
//! |---|---|---|---|
//! | `torque` | f64 | n1 .. nd, d | tau [N m; N at prismatic joints] |
//! | `energy` | f64 | n1 .. nd | U [J] |
//! | `gap` | f32 | n1 .. nd | smallest signed distance at rest [m] |
//! | `residual`, `iterations` | f32, u32 | n1 .. nd | of the contact solver |
//! | `status` | u8 | n1 .. nd | [`crate::contact::Status`] |
//! | `contact_offsets` | u64 | points + 1 | rows of the next two |
//! | `contact_nodes`, `contact_forces` | u32, f32 | c and c, 3 | object node, force on it [N] |
//! | `surface_nodes`, `surface_triangles` | f64, u32 | S, 3 and T, 3 | at rest [m] |
//!
//! In Python: `safetensors.numpy.load_file("sphere.haptize")["torque"]`.
//!
//! The header ends on a page boundary and wide types come first, so every column of the mapped file is aligned and is
//! read where it lies. The checksum is the CRC-32 of the whole file with the checksum's own digits as zeros: it stands
//! at a fixed place, so every bit of the file is covered and any single flipped bit is found.
//!
//! A mapped file must not be cut short by anyone while it is open: the system then kills the reader (SIGBUS). Programs
//! of this crate never do that, they rename; the haptic loop reads through [`Dataset::load`], which copies.

use super::{Column, Contacts, Dataset, Error, Grid, Provenance, Surface, check, replace_file};
use bytemuck::Pod;
use memmap2::{Mmap, MmapMut};
use safetensors::{
    Dtype,
    tensor::{Metadata as Tensors, TensorInfo},
};
use serde::Serialize;
use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, Read, Write},
    path::Path,
    sync::Arc,
};

#[cfg(target_endian = "big")]
compile_error!("dataset columns are read where they lie, which needs a little-endian machine");

/// What `format` says in files that this code reads and writes.
const FORMAT: &str = "haptize dataset 1";
/// How every header begins; the checksum's digits follow.
const OPENING: &[u8] = br#"{"__metadata__":{"checksum":""#;
/// Length of the header's length [bytes].
const LENGTH: usize = 8;
/// Where the checksum's digits begin.
const CHECKSUM: usize = LENGTH + OPENING.len();
/// Digits of the checksum while it is computed.
const NO_CHECKSUM: &str = "00000000";
/// Tensors begin at a multiple of this: a page [bytes].
const PAGE: usize = 4096;
/// Longest header that is read or written: bounds what a hostile file can make the parser allocate [bytes].
const MAX_HEADER: usize = 16 << 20;

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
    /// [`Grid`] as JSON.
    grid: String,
    /// [`Provenance`] as JSON.
    provenance: String,
    scene: String,
}

/// A number type that a tensor may hold.
trait Element: Pod {
    const DTYPE: Dtype;
}

macro_rules! element {
    ($($number:ty => $dtype:ident),*) => {
        $(impl Element for $number { const DTYPE: Dtype = Dtype::$dtype; })*
    };
}
element!(f64 => F64, u64 => U64, f32 => F32, u32 => U32, u8 => U8);

/// A tensor about to be written; `bytes` is aligned to its type.
pub(super) struct Tensor<'a> {
    pub(super) name: &'static str,
    pub(super) dtype: Dtype,
    pub(super) shape: Vec<usize>,
    pub(super) bytes: &'a [u8],
}

impl<'a> Tensor<'a> {
    fn new<T: Element>(name: &'static str, shape: Vec<usize>, column: &'a Column<T>) -> Self {
        Self { name, dtype: T::DTYPE, shape, bytes: bytemuck::cast_slice(column) }
    }
}

/// All tensors of a dataset, widest type first.
pub(super) fn tensors(dataset: &Dataset) -> Vec<Tensor<'_>> {
    let grid = dataset.grid.counts();
    let mut torque_shape = grid.clone();
    torque_shape.push(dataset.grid.joints());
    let mut tensors = vec![
        Tensor::new("torque", torque_shape, &dataset.torque),
        Tensor::new("status", grid.clone(), &dataset.status),
    ];
    tensors.extend(dataset.energy.as_ref().map(|column| Tensor::new("energy", grid.clone(), column)));
    tensors.extend(dataset.gap.as_ref().map(|column| Tensor::new("gap", grid.clone(), column)));
    tensors.extend(dataset.residual.as_ref().map(|column| Tensor::new("residual", grid.clone(), column)));
    tensors.extend(dataset.iterations.as_ref().map(|column| Tensor::new("iterations", grid.clone(), column)));
    if let Some(Contacts { offsets, nodes, forces }) = &dataset.contacts {
        tensors.push(Tensor::new("contact_offsets", vec![offsets.len()], offsets));
        tensors.push(Tensor::new("contact_nodes", vec![nodes.len()], nodes));
        tensors.push(Tensor::new("contact_forces", vec![nodes.len(), 3], forces));
    }
    if let Some(Surface { nodes, triangles }) = &dataset.surface {
        tensors.push(Tensor::new("surface_nodes", vec![nodes.len() / 3, 3], nodes));
        tensors.push(Tensor::new("surface_triangles", vec![triangles.len() / 3, 3], triangles));
    }
    tensors.sort_by_key(|tensor| std::cmp::Reverse(tensor.dtype.bitsize()));
    tensors
}

/// Memory of all columns [bytes].
pub(super) fn bytes(dataset: &Dataset) -> usize {
    tensors(dataset).iter().map(|tensor| tensor.bytes.len()).sum()
}

impl Dataset {
    /// Writes the dataset, replacing the file at `path` whole or not at all.
    ///
    /// # Errors
    /// [`Error::Inconsistent`] when it would be refused on reading, [`Error::Write`] from the system.
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        let inconsistent = |reason| Error::Inconsistent { path: path.into(), reason };
        check::check(self).map_err(inconsistent)?;
        let tensors = tensors(self);
        let mut text = header(self, &tensors).map_err(|error| inconsistent(error.to_string()))?;
        text.resize((LENGTH + text.len()).next_multiple_of(PAGE) - LENGTH, b' ');
        if text.len() > MAX_HEADER {
            return Err(inconsistent(format!("its header, scene included, is longer than {MAX_HEADER} bytes")));
        }
        let mut opening = [(text.len() as u64).to_le_bytes().as_slice(), &text].concat();
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(&opening);
        tensors.iter().for_each(|tensor| hasher.update(tensor.bytes));
        opening[CHECKSUM..CHECKSUM + NO_CHECKSUM.len()].copy_from_slice(digits(hasher).as_bytes());
        replace_file(path, |writer| {
            writer.write_all(&opening)?;
            tensors.iter().try_for_each(|tensor| writer.write_all(tensor.bytes))
        })
        .map_err(|source| Error::Write { path: path.into(), source })
    }

    /// Maps the file at `path` and checks all of it. The columns are read where they lie in the file.
    ///
    /// # Errors
    /// Missing, foreign, of another version, cut short, or altered in any bit.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let read = |source| Error::Read { path: path.into(), source };
        let file = regular_file(path).map_err(read)?;
        // SAFETY: the map is read-only and private to this process; what changing the file meanwhile does is said above.
        let map = unsafe { Mmap::map(&file) }.map_err(read)?;
        decode(path, map)
    }

    /// Like [`Dataset::open`], but copies the file into memory: nothing that happens to the file can reach the reader.
    ///
    /// # Errors
    /// As [`Dataset::open`]; also when it does not fit in memory.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let read = |source| Error::Read { path: path.into(), source };
        let mut file = regular_file(path).map_err(read)?;
        let length = file.metadata().map_err(read)?.len();
        // A map of no bytes is refused by some systems; one zero byte is refused by the checks.
        let bytes = usize::try_from(length).map_err(|error| read(io::Error::other(error)))?;
        let mut map = MmapMut::map_anon(bytes.max(1)).map_err(read)?;
        file.read_exact(&mut map[..bytes]).map_err(read)?;
        decode(path, map.make_read_only().map_err(read)?)
    }
}

/// Opens `path` unless it is a folder, a pipe or a device, which cannot be mapped or might never end.
fn regular_file(path: &Path) -> io::Result<File> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
    }
    File::open(path)
}

fn header(dataset: &Dataset, tensors: &[Tensor<'_>]) -> serde_json::Result<Vec<u8>> {
    let mut end = 0;
    let infos = tensors.iter().map(|tensor| {
        let start = end;
        end += tensor.bytes.len();
        (tensor.name, TensorInfo { dtype: tensor.dtype, shape: tensor.shape.clone(), data_offsets: (start, end) })
    });
    serde_json::to_vec(&Header {
        metadata: Metadata {
            checksum: NO_CHECKSUM.into(),
            format: FORMAT.into(),
            grid: serde_json::to_string(&dataset.grid)?,
            provenance: serde_json::to_string(&dataset.provenance)?,
            scene: dataset.scene.clone(),
        },
        tensors: infos.collect(),
    })
}

fn digits(hasher: crc32fast::Hasher) -> String {
    format!("{:08x}", hasher.finalize())
}

/// Checks a whole file and makes a dataset of windows into it.
fn decode(path: &Path, map: Mmap) -> Result<Dataset, Error> {
    let foreign = |reason: &str| Error::Foreign { path: path.into(), reason: reason.into() };
    let damaged = |reason: String| Error::Damaged { path: path.into(), reason };

    if map.get(LENGTH..CHECKSUM) != Some(OPENING) {
        return Err(foreign("it begins otherwise"));
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

    let texts: BTreeMap<_, _> = metadata.metadata().iter().flatten().collect();
    let text = |key: &str| {
        texts.get(&key.to_string()).map(|text| text.as_str()).ok_or_else(|| damaged(format!("{key} is missing")))
    };
    let format = text("format")?;
    if format != FORMAT {
        return Err(Error::Version { path: path.into(), found: format.into(), expected: FORMAT });
    }
    let grid: Grid = serde_json::from_str(text("grid")?).map_err(|error| damaged(format!("grid: {error}")))?;
    let provenance: Provenance =
        serde_json::from_str(text("provenance")?).map_err(|error| damaged(format!("provenance: {error}")))?;
    let scene = text("scene")?.to_string();
    grid.check().map_err(damaged)?;

    let mut tensors: BTreeMap<_, _> = metadata.tensors().into_iter().map(|(name, info)| (name, info.clone())).collect();
    let windows = Windows { map: Arc::new(map), start };
    let dataset = windows.dataset(&mut tensors, grid, scene, provenance).map_err(damaged)?;
    if let Some((name, _)) = tensors.first_key_value() {
        return Err(damaged(format!("tensor {name} does not belong here")));
    }
    check::check(&dataset).map_err(damaged)?;
    Ok(dataset)
}

/// Cuts a mapped file into columns.
struct Windows {
    map: Arc<Mmap>,
    /// Where the tensors begin.
    start: usize,
}

impl Windows {
    fn dataset(
        &self,
        tensors: &mut BTreeMap<String, TensorInfo>,
        grid: Grid,
        scene: String,
        provenance: Provenance,
    ) -> Result<Dataset, String> {
        let counts: Vec<_> = grid.counts().into_iter().map(Some).collect();
        let with_joints: Vec<_> = counts.iter().copied().chain([Some(grid.joints())]).collect();
        let missing = |name: &str| format!("tensor {name} is missing");
        Ok(Dataset {
            torque: self.column(tensors, "torque", &with_joints)?.ok_or_else(|| missing("torque"))?,
            status: self.column(tensors, "status", &counts)?.ok_or_else(|| missing("status"))?,
            energy: self.column(tensors, "energy", &counts)?,
            gap: self.column(tensors, "gap", &counts)?,
            residual: self.column(tensors, "residual", &counts)?,
            iterations: self.column(tensors, "iterations", &counts)?,
            contacts: match self.column(tensors, "contact_offsets", &[None])? {
                None => None,
                Some(offsets) => Some(Contacts {
                    offsets,
                    nodes: self.column(tensors, "contact_nodes", &[None])?.ok_or_else(|| missing("contact_nodes"))?,
                    forces: self
                        .column(tensors, "contact_forces", &[None, Some(3)])?
                        .ok_or_else(|| missing("contact_forces"))?,
                }),
            },
            surface: match self.column(tensors, "surface_nodes", &[None, Some(3)])? {
                None => None,
                Some(nodes) => Some(Surface {
                    nodes,
                    triangles: self
                        .column(tensors, "surface_triangles", &[None, Some(3)])?
                        .ok_or_else(|| missing("surface_triangles"))?,
                }),
            },
            grid,
            scene,
            provenance,
        })
    }

    /// Takes the tensor `name` out of `tensors`; `None` where it is absent. `shape` leaves free lengths as `None`.
    fn column<T: Element>(
        &self,
        tensors: &mut BTreeMap<String, TensorInfo>,
        name: &str,
        shape: &[Option<usize>],
    ) -> Result<Option<Column<T>>, String> {
        let Some(info) = tensors.remove(name) else { return Ok(None) };
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
}
