//! The dataset file, its layout and its writer: a safetensors file whose header carries grid, provenance, scene and a checksum.
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
//! | `gap` | f32 | n1 .. nd | smallest signed distance at rest, or farther than two grid steps from contact a positive lower bound of it [m] |
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

use super::{Column, Contacts, Dataset, Error, Surface, check, replace_file};
use bytemuck::Pod;
use safetensors::{Dtype, tensor::TensorInfo};
use serde::Serialize;
use std::{collections::BTreeMap, io::Write, path::Path};

#[cfg(target_endian = "big")]
compile_error!("dataset columns are read where they lie, which needs a little-endian machine");

/// What `format` says in files that this code reads and writes.
pub(super) const FORMAT: &str = "haptize dataset 1";
/// How every header begins; the checksum's digits follow.
pub(super) const OPENING: &[u8] = br#"{"__metadata__":{"checksum":""#;
/// Length of the header's length [bytes].
pub(super) const LENGTH: usize = 8;
/// Where the checksum's digits begin.
pub(super) const CHECKSUM: usize = LENGTH + OPENING.len();
/// Digits of the checksum while it is computed.
pub(super) const NO_CHECKSUM: &str = "00000000";
/// Tensors begin at a multiple of this: a page [bytes].
pub(super) const PAGE: usize = 4096;
/// Longest header that is read or written: bounds what a hostile file can make the parser allocate [bytes].
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
}

/// A number type that a tensor may hold.
pub(super) trait Element: Pod {
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

pub(super) fn digits(hasher: crc32fast::Hasher) -> String {
    format!("{:08x}", hasher.finalize())
}
