//! A refined dataset's file: a safetensors file like any dataset's (`dataset/file.rs`: page-aligned, checked as a
//! whole, replaced whole or not at all), of format `haptize store 1`. What a dataset has at each point of its grid is
//! taken from the nodes of the base.
//!
//! | tensor | type | shape | |
//! |---|---|---|---|
//! | `block_keys` | u64 | b | level and coordinates of each block (`space.rs`), ascending |
//! | `block_nodes` | u64 | b | bit p: the block has the node at place p |
//! | `node_records` | f32 | n, 1 + d (d + 1) / 2 | numbers of each node, by block and place (`record.rs`) |
//! | `node_slips` | bf16 | n, 1 + d (d + 1) / 2 | how the contacts of each slip ([`super::record::slip_of`]); absent without friction |
//! | `node_gap` | f32 | n | smallest signed distance at rest (m) |
//! | `node_status` | u8 | n | [`crate::contact::Status`] |
//! | `surface_nodes`, `surface_triangles`, ... | | | the object's geometry, as in a dataset's file |
//!
//! Beside grid (the base), provenance and scene the header's metadata has `store`: `{"levels":6,"order":"potential"}`.
//! Nodes are as they were solved: what is in the file depends neither on the order of publication nor on the
//! interpolation.
//!
//! In Python, with `from safetensors import safe_open; f = safe_open("sphere.store", "numpy"); t = f.get_tensor`:
//!
//! ```text
//! keys, nodes, w = t("block_keys"), t("block_nodes"), t("node_records")[:, 0]
//! bits = 60 // d                                     # of a key for each coordinate; the level stands above them
//! side = 2 if d <= 3 else 1                          # nodes of a block, along each axis
//! place = [(b, p) for b, s in enumerate(nodes) for p in range(side**d) if int(s) >> p & 1]
//! level = [int(k) >> bits * d for k in keys]
//! node = lambda b, p: [side * (int(keys[b]) >> bits * (d - 1 - a) & 2**bits - 1) + (p >> a & 1) for a in range(d)]
//! q = lambda b, p: [axis["start"] + i * axis["step"] / 2**level[b] for i, axis in zip(node(b, p), grid["axes"])]
//! energy = 0.5 * w.clip(0)**2                        # row r belongs to (b, p) = place[r]
//! ```

use super::{
    Nodes, Space, Store,
    block::{narrowed, widened},
    record::width,
};
use crate::{
    Error,
    contact::Status,
    dataset::{
        Dataset, Grid, Heading, Provenance, Surface, Tensor, check_place,
        error::{damaged, inconsistent, no_memory},
        read::Container,
        surface_tensors, write_file,
    },
    memory,
};
use serde::{Deserialize, Serialize};
use std::{path::Path, sync::Arc};

/// Value of `format` in files that this code reads and writes.
pub(in crate::dataset) const FORMAT: &str = "haptize store 1";

/// The metadata's `store`.
#[derive(Deserialize, Serialize)]
struct Shape {
    levels: u32,
    /// Always [`ORDER`].
    order: String,
}

/// How nodes are interpolated.
const ORDER: &str = "potential";

impl Store {
    /// Writes the refined dataset over this store, replacing the file at `path` whole or not at all. Arguments as in
    /// [`Dataset::refined`], of which nothing is made at the points of `grid`.
    ///
    /// # Errors
    /// As [`Dataset::save`].
    pub fn save(
        &self,
        grid: &Grid,
        surface: Option<&Surface>,
        scene: &str,
        provenance: &Provenance,
        path: &Path,
    ) -> Result<(), Error> {
        check_place(path)?;
        save(self, Heading { grid, provenance, scene, store: None }, surface, path)
    }
}

impl Dataset {
    /// A dataset over the base of `store`, which refines it: at each point of `grid`, of which the store was made, what
    /// its node there says, and [`Status::Outside`] where there is none. `surface`: the object's geometry; `scene`: the
    /// scene's text.
    #[must_use]
    pub fn refined(
        store: Arc<Store>,
        grid: Grid,
        surface: Option<Surface>,
        scene: String,
        provenance: Provenance,
    ) -> Self {
        let (joints, points) = (grid.joints(), grid.points());
        let mut torque = vec![0.0; points * joints];
        let (mut energy, mut gap) = (vec![0.0; points], vec![0.0_f32; points]);
        let mut status = vec![Status::Outside as u8; points];
        for node in store.nodes().take_while(|node| node.level == 0) {
            let point = grid.point(node.place.map(|k| k as usize));
            torque[point * joints..(point + 1) * joints].copy_from_slice(&node.torque);
            (energy[point], gap[point], status[point]) = (node.energy, node.gap, node.status);
        }
        Self {
            energy: Some(energy.into()),
            gap: Some(gap.into()),
            surface,
            refinement: Some(store),
            scene,
            provenance,
            ..Self::bare(grid, torque, status)
        }
    }
}

/// Writes the dataset that `store` refines, replacing the file at `path` whole or not at all.
pub(in crate::dataset) fn save(
    store: &Store,
    heading: Heading<'_>,
    surface: Option<&Surface>,
    path: &Path,
) -> Result<(), Error> {
    let shape = Shape { levels: store.space.levels(), order: ORDER.to_owned() };
    let shape = serde_json::to_string(&shape).map_err(|error| inconsistent(path, error))?;
    let blocks = store.blocks();
    let keys: Vec<u64> = blocks.iter().map(|(key, _)| *key).collect();
    let nodes = || blocks.iter().map(|(_, block)| block.nodes());
    let present: Vec<u64> = nodes().map(|nodes| nodes.present).collect();
    let records: Vec<f32> = nodes().flat_map(|nodes| nodes.records.iter().copied()).collect();
    let slips: Vec<u16> = nodes().flat_map(|nodes| nodes.slips.iter().map(|number| narrowed(*number))).collect();
    let gap: Vec<f32> = nodes().flat_map(|nodes| nodes.gap.iter().copied()).collect();
    let status: Vec<u8> = nodes().flat_map(|nodes| nodes.status.iter().copied()).collect();
    let wide = width(store.space.joints());
    let mut tensors: Vec<Tensor<&[u8]>> = vec![
        Tensor::new::<u64>("block_keys", vec![keys.len()], bytemuck::cast_slice(&keys)),
        Tensor::new::<u64>("block_nodes", vec![present.len()], bytemuck::cast_slice(&present)),
        Tensor::new::<f32>("node_records", vec![gap.len(), wide], bytemuck::cast_slice(&records)),
        Tensor::new::<f32>("node_gap", vec![gap.len()], bytemuck::cast_slice(&gap)),
        Tensor::new::<u8>("node_status", vec![status.len()], &status),
    ];
    if !slips.is_empty() {
        tensors.push(Tensor::new::<u16>("node_slips", vec![gap.len(), wide], bytemuck::cast_slice(&slips)));
    }
    tensors.extend(surface.into_iter().flat_map(|surface| surface_tensors(heading.grid, surface)));
    write_file(path, Heading { store: Some(&shape), ..heading }, tensors)
}

/// Makes a dataset of a file whose header and checksum are sound.
pub(in crate::dataset) fn decode(path: &Path, file: Container) -> Result<Dataset, Error> {
    let damaged = |reason: String| damaged(path, reason);
    let (grid, provenance) = file.heading().map_err(damaged)?;
    // A file of some kilobytes may have a base of gigabytes, of which a dataset has torque, energy, gap and status.
    let row = grid.joints() * size_of::<f64>() + size_of::<f64>() + size_of::<f32>() + size_of::<u8>();
    let needed = grid.points().saturating_mul(row);
    if needed > memory::SMALL {
        memory::check(needed).map_err(|shortage| no_memory(path, shortage))?;
    }
    read(file, grid, provenance).map_err(damaged)
}

/// `Err` says what is wrong.
fn read(mut file: Container, grid: Grid, provenance: Provenance) -> Result<Dataset, String> {
    let scene = file.text("scene")?.to_owned();
    let shape: Shape = serde_json::from_str(file.text("store")?).map_err(|error| format!("store: {error}"))?;
    if shape.order != ORDER {
        return Err(format!(
            "its nodes are to be interpolated by {:?}, which no longer exists: bake it again",
            shape.order
        ));
    }
    let space = Space::new(&grid, shape.levels).map_err(|error| error.to_string())?;
    let (joints, wide) = (space.joints(), width(space.joints()));
    let keys = file.take::<u64>("block_keys", &[None])?;
    let present = file.take::<u64>("block_nodes", &[Some(keys.len())])?;
    let records = file.take::<f32>("node_records", &[None, Some(wide)])?;
    let count = records.len() / wide;
    let slips = file.optional::<u16>("node_slips", &[Some(count), Some(wide)])?;
    let gap = file.take::<f32>("node_gap", &[Some(count)])?;
    let status = file.take::<u8>("node_status", &[Some(count)])?;
    let surface = file.surface(&grid)?;
    file.finish()?;
    let found: usize = present.iter().map(|nodes| nodes.count_ones() as usize).sum();
    if found != count {
        return Err(format!("its blocks have {found} nodes where there are {count}"));
    }
    if let Some(k) = keys.windows(2).position(|pair| pair[0] >= pair[1]) {
        return Err(format!("block {} is out of order", k + 1));
    }
    let mut store = Store::new(space);
    let mut first = 0;
    for (&key, &present) in keys.iter().zip(present.iter()) {
        let Some((level, block)) = store.space.block(key) else {
            return Err(format!("block {key:#x} lies outside its space of {joints} joints"));
        };
        let rows = first..first + present.count_ones() as usize;
        first = rows.end;
        let nodes = Nodes {
            present,
            records: records[wide * rows.start..wide * rows.end].to_vec(),
            slips: slips.as_ref().map_or(Vec::new(), |slips| {
                slips[wide * rows.start..wide * rows.end].iter().map(|bits| widened(*bits)).collect()
            }),
            gap: gap[rows.clone()].to_vec(),
            status: status[rows].to_vec(),
        };
        store.publish(level, &block, nodes).map_err(|error| error.to_string())?;
    }
    Ok(Dataset::refined(Arc::new(store), grid, surface, scene, provenance))
}
