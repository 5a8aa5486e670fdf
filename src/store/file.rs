//! A store's file: a safetensors file like a dataset's (`dataset/file.rs`: page-aligned, checked as a whole, replaced whole or not at
//! all), of format `haptize store 1`.
//!
//! | tensor | type | shape | |
//! |---|---|---|---|
//! | `block_keys` | u64 | b | level and coordinates of each block (`space.rs`), ascending |
//! | `block_nodes` | u64 | b | bit p: the block has the node at place p |
//! | `node_records` | f32 | n, 1 + d (d + 1) / 2 | numbers of each node, in the order of blocks and places (`record.rs`) |
//! | `node_gap` | f32 | n | smallest signed distance at rest [m] |
//! | `node_status` | u8 | n | [`crate::contact::Status`] |
//!
//! Beside grid (the base), provenance and scene the header's metadata has `store`: `{"levels":6,"order":"potential"}`. Nodes are as they
//! were solved: what is in the file depends neither on the order of publication nor on the interpolation.
//!
//! In Python, with `from safetensors import safe_open; f = safe_open("sphere.store", "numpy"); t = f.get_tensor`:
//!
//! ```text
//! keys, nodes, w = t("block_keys"), t("block_nodes"), t("node_records")[:, 0]
//! bits = 60 // d                                     # of a key for each coordinate; the level is above them
//! place = [(b, p) for b, s in enumerate(nodes) for p in range(2**d) if int(s) >> p & 1]
//! level = [int(k) >> bits * d for k in keys]
//! node = lambda b, p: [2 * (int(keys[b]) >> bits * (d - 1 - a) & 2**bits - 1) + (p >> a & 1) for a in range(d)]
//! q = lambda b, p: [axis["start"] + i * axis["step"] / 2**level[b] for i, axis in zip(node(b, p), grid["axes"])]
//! energy = 0.5 * w.clip(0)**2                        # row r belongs to (b, p) = place[r]
//! ```

use super::{Nodes, Order, Space, Store, record::width};
use crate::dataset::{self, Grid, Heading, Kind, Provenance, Target, Tensor, open_container, write_container};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Value of `format` in files that this code reads and writes.
const FORMAT: &str = "haptize store 1";

/// The metadata's `store`.
#[derive(Deserialize, Serialize)]
struct Shape {
    levels: u32,
    order: Order,
}

/// A store and where it comes from.
pub struct StoreFile {
    /// Its blocks.
    pub store: Store,
    /// The base.
    pub grid: Grid,
    /// The scene's text.
    pub scene: String,
    /// Where it comes from.
    pub provenance: Provenance,
}

impl StoreFile {
    /// Writes the file, replacing the file `target` whole or not at all.
    ///
    /// # Errors
    /// [`dataset::Error::Inconsistent`] when its header is too long, [`dataset::Error::Write`] from the system.
    pub fn save<'a>(&self, target: impl Into<Target<'a>>) -> Result<(), dataset::Error> {
        let target = target.into();
        let shape = Shape { levels: self.store.space.levels(), order: self.store.order };
        let shape = serde_json::to_string(&shape)
            .map_err(|error| dataset::Error::Inconsistent { path: target.path().into(), reason: error.to_string() })?;
        let blocks = self.store.blocks();
        let keys: Vec<u64> = blocks.iter().map(|(key, _)| *key).collect();
        let nodes = || blocks.iter().map(|(_, block)| block.nodes());
        let present: Vec<u64> = nodes().map(|nodes| nodes.present).collect();
        let records: Vec<f32> = nodes().flat_map(|nodes| nodes.records.iter().copied()).collect();
        let gap: Vec<f32> = nodes().flat_map(|nodes| nodes.gap.iter().copied()).collect();
        let status: Vec<u8> = nodes().flat_map(|nodes| nodes.status.iter().copied()).collect();
        let wide = width(self.store.space.joints());
        let tensors: Vec<Tensor<&[u8]>> = vec![
            Tensor::new::<u64>("block_keys", vec![keys.len()], bytemuck::cast_slice(&keys)),
            Tensor::new::<u64>("block_nodes", vec![present.len()], bytemuck::cast_slice(&present)),
            Tensor::new::<f32>("node_records", vec![gap.len(), wide], bytemuck::cast_slice(&records)),
            Tensor::new::<f32>("node_gap", vec![gap.len()], bytemuck::cast_slice(&gap)),
            Tensor::new::<u8>("node_status", vec![status.len()], &status),
        ];
        let heading = Heading { grid: &self.grid, provenance: &self.provenance, scene: &self.scene };
        write_container(target, Kind { format: FORMAT, store: Some(&shape) }, heading, tensors)
    }

    /// Opens the file at `path` and checks all of it. The store has room for `more` blocks than are in the file.
    ///
    /// # Errors
    /// Missing, foreign, of another version, cut short, or altered in any bit.
    pub fn open(path: &Path, more: usize) -> Result<Self, dataset::Error> {
        let damaged = |reason: String| dataset::Error::Damaged { path: path.into(), reason };
        let mut file = open_container(path, FORMAT)?;
        let (grid, provenance) = file.heading().map_err(damaged)?;
        let scene = file.text("scene").map_err(damaged)?.to_owned();
        let shape: Shape = file
            .text("store")
            .and_then(|text| serde_json::from_str(text).map_err(|error| format!("store: {error}")))
            .map_err(damaged)?;
        let space = Space::new(&grid, shape.levels).map_err(|error| damaged(error.to_string()))?;
        let (joints, wide) = (space.joints(), width(space.joints()));
        let keys = file.take::<u64>("block_keys", &[None]).map_err(damaged)?;
        let present = file.take::<u64>("block_nodes", &[Some(keys.len())]).map_err(damaged)?;
        let records = file.take::<f32>("node_records", &[None, Some(wide)]).map_err(damaged)?;
        let count = records.len() / wide;
        let gap = file.take::<f32>("node_gap", &[Some(count)]).map_err(damaged)?;
        let status = file.take::<u8>("node_status", &[Some(count)]).map_err(damaged)?;
        file.finish().map_err(damaged)?;
        let found: usize = present.iter().map(|nodes| nodes.count_ones() as usize).sum();
        if found != count {
            return Err(damaged(format!("its blocks have {found} nodes where there are {count}")));
        }
        if let Some(k) = keys.windows(2).position(|pair| pair[0] >= pair[1]) {
            return Err(damaged(format!("block {} is out of order", k + 1)));
        }
        let store = Store::new(space, shape.order, keys.len().saturating_add(more));
        let mut first = 0;
        for (&key, &present) in keys.iter().zip(present.iter()) {
            let Some((level, block)) = store.space.block(key) else {
                return Err(damaged(format!("block {key:#x} lies outside its space of {joints} joints")));
            };
            let rows = first..first + present.count_ones() as usize;
            first = rows.end;
            let nodes = Nodes {
                present,
                records: records[wide * rows.start..wide * rows.end].to_vec(),
                gap: gap[rows.clone()].to_vec(),
                status: status[rows].to_vec(),
            };
            store.publish(level, &block, nodes).map_err(|error| damaged(error.to_string()))?;
        }
        Ok(Self { store, grid, scene, provenance })
    }
}
