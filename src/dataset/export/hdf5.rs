//! HDF5: every tensor of the file under its own name, with its unit as the attribute `units` and its axes as dimension
//! labels.
//!
//! `q1` .. `qd` are the grid lines of each axis; they are dimension scales, attached to every array over the grid, so
//! that h5py, xarray and MATLAB know the coordinates. Every other axis has a scale of its own name, whose entries are
//! counted from 0: readers of netCDF-4, xarray among them, take an axis without a scale for a wrong one. `joint_names` and `joint_units` are texts, and so are `scene` and
//! `provenance`, datasets of their own because an attribute holds 64 KiB at most. Nothing is compressed: numbers of a
//! smooth field hardly are.
//!
//! The writer puts the file together in memory, which takes three times the size of the dataset; [`super::npz`]
//! streams.

use super::{
    super::{Dataset, file},
    lines, lines_name, replaced,
};
use crate::{Error, memory};
use hdf5_writer::{AttributeBuilder, ByteOrder, DatasetBuilder, Datatype, Hdf5Builder, Hdf5WritePlan, WriteOptions};
use safetensors::Dtype;
use std::{
    collections::BTreeMap,
    io::{self, Write},
    path::Path,
};

pub(super) fn export(dataset: &Dataset, path: &Path) -> Result<(), Error> {
    let bytes: usize = file::arrays(dataset).map(|(_, tensor)| tensor.contents.len()).sum();
    // The dataset itself is there already.
    memory::check(bytes.saturating_mul(2)).map_err(|shortage| {
        Error::at(path, format_args!("{shortage}; or export with --format npz, which takes no memory"))
    })?;
    replaced(path, |writer| {
        let options = WriteOptions { byte_order: ByteOrder::LittleEndian, ..WriteOptions::default() };
        let bytes = plan(dataset).and_then(|plan| plan.encode(options)).map_err(io::Error::other)?;
        writer.write_all(&bytes)
    })
}

fn plan(dataset: &Dataset) -> hdf5_writer::Result<Hdf5WritePlan> {
    let grid = &dataset.grid;
    let mut builder = Hdf5Builder::new();
    // By name, the arrays that an axis belongs to, with its number there.
    let mut attached = BTreeMap::<String, (u64, Vec<(String, u32)>)>::new();
    for (array, tensor) in file::arrays(dataset) {
        let (axes, of_grid) = array.axes(grid);
        let shape: Vec<u64> = tensor.shape.iter().map(|&count| count as u64).collect();
        let scales: Vec<String> =
            axes.iter().enumerate().map(|(k, axis)| if k < of_grid { lines_name(k) } else { axis.clone() }).collect();
        for ((k, scale), &length) in (0..).zip(&scales).zip(&shape) {
            attached.entry(scale.clone()).or_insert((length, Vec::new())).1.push((tensor.name.into(), k));
        }
        let scales = scales.into_iter().map(|scale| vec![scale]).collect();
        let described = DatasetBuilder::new(tensor.name, datatype(tensor.dtype)?, shape)
            .raw_data(tensor.contents)
            .attribute(AttributeBuilder::fixed_string("units", array.unit(grid)))
            .attribute(AttributeBuilder::vlen_strings("DIMENSION_LABELS", &axes)?)
            .attribute(AttributeBuilder::vlen_object_references("DIMENSION_LIST", scales));
        builder = builder.dataset(described);
    }
    for (k, axis) in grid.axes.iter().enumerate() {
        let (_, arrays) = attached.remove(&lines_name(k)).unwrap_or_default();
        let coordinates: Vec<f64> = lines(axis).collect();
        let lines = DatasetBuilder::typed_data(lines_name(k), vec![axis.count as u64], &coordinates)?;
        builder = builder.dataset(scale(lines, &axis.name, &axis.unit, arrays));
    }
    for (name, (length, arrays)) in attached {
        let entries: Vec<u64> = (0..length).collect();
        builder =
            builder.dataset(scale(DatasetBuilder::typed_data(&name, vec![length], &entries)?, &name, "1", arrays));
    }
    let texts = |name, texts: Vec<&str>| DatasetBuilder::vlen_string_data(name, vec![texts.len() as u64], &texts);
    let text = |name, text: &str| DatasetBuilder::vlen_string_data(name, vec![], &[text]);
    let provenance = serde_json::to_string(&dataset.provenance).map_err(io::Error::other)?;
    builder
        .dataset(texts("joint_names", grid.axes.iter().map(|axis| axis.name.as_str()).collect())?)
        .dataset(texts("joint_units", grid.axes.iter().map(|axis| axis.unit.as_str()).collect())?)
        .dataset(text("scene", &dataset.scene)?)
        .dataset(text("provenance", &provenance)?)
        .into_plan()
}

/// Makes `coordinates` a dimension scale, called `name`, of `arrays`: each with the number of the axis there.
fn scale(coordinates: DatasetBuilder, name: &str, unit: &str, arrays: Vec<(String, u32)>) -> DatasetBuilder {
    coordinates
        .attribute(AttributeBuilder::fixed_string("CLASS", "DIMENSION_SCALE"))
        .attribute(AttributeBuilder::fixed_string("NAME", name))
        .attribute(AttributeBuilder::fixed_string("units", unit))
        .attribute(AttributeBuilder::object_reference_list("REFERENCE_LIST", arrays))
}

fn datatype(dtype: Dtype) -> hdf5_writer::Result<Datatype> {
    let byte_order = ByteOrder::LittleEndian;
    let unsigned = |size| Datatype::FixedPoint { size, signed: false, byte_order };
    match dtype {
        Dtype::F64 => Ok(Datatype::FloatingPoint { size: 8, byte_order }),
        Dtype::F32 => Ok(Datatype::FloatingPoint { size: 4, byte_order }),
        Dtype::U64 => Ok(unsigned(8)),
        Dtype::U32 => Ok(unsigned(4)),
        Dtype::U8 => Ok(unsigned(1)),
        other => Err(hdf5_writer::Error::UnsupportedFeature(format!("numbers of the type {other:?}"))),
    }
}
