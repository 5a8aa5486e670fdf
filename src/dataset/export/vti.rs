//! VTK's image data: torque, energy, gap and status on the grid of two or three joints, whose coordinates are x, y and z.

use super::{super::Dataset, replaced};
use crate::{Error, dataset::Axis, vtk};
use std::{
    io::{self, Write},
    path::Path,
};

/// Joints that an image has room for.
const DIMENSIONS: usize = 3;

pub(super) fn export(dataset: &Dataset, path: &Path) -> Result<(), Error> {
    let joints = dataset.grid.joints();
    if !(2..=DIMENSIONS).contains(&joints) {
        let what = "VTK's image data have two or three axes";
        return Err(Error::at(
            path,
            format_args!("{what}, and the grid has {joints}: export it as HDF5, which has any number (--format hdf5)"),
        ));
    }
    replaced(path, |out| write(dataset, out))
}

fn write(dataset: &Dataset, out: &mut impl Write) -> io::Result<()> {
    let axes = &dataset.grid.axes;
    let names: Vec<String> = axes
        .iter()
        .zip(["x", "y", "z"])
        .map(|(axis, side)| format!("{side} is {} [{}]", axis.name, axis.unit))
        .collect();
    vtk::begin(out, "ImageData", &names.join(", "))?;
    // The axis that is missing has one line.
    let of = |value: &dyn Fn(&Axis) -> String, missing: &str| {
        let values = (0..DIMENSIONS).map(|k| axes.get(k).map_or_else(|| missing.to_owned(), value));
        values.collect::<Vec<_>>().join(" ")
    };
    let extent = of(&|axis| format!("0 {}", axis.count - 1), "0 0");
    let (start, step) = (of(&|axis| axis.start.to_string(), "0"), of(&|axis| axis.step.to_string(), "1"));
    writeln!(out, r#"<ImageData WholeExtent="{extent}" Origin="{start}" Spacing="{step}">"#)?;
    writeln!(out, r#"<Piece Extent="{extent}">"#)?;
    writeln!(out, "<PointData>")?;
    let points = points(dataset);
    let torque: Vec<f64> = points.iter().flat_map(|&point| dataset.torque(point)).copied().collect();
    let joints: Vec<String> = axes.iter().map(|axis| format!("{} [{}]", axis.name, axis.effort_unit())).collect();
    vtk::array(out, "torque", &joints.iter().map(String::as_str).collect::<Vec<_>>(), &torque)?;
    if let Some(energy) = &dataset.energy {
        vtk::array(out, "energy [J]", &[""], &points.iter().map(|&point| energy[point]).collect::<Vec<_>>())?;
    }
    if let Some(gap) = &dataset.gap {
        vtk::array(out, "gap [m]", &[""], &points.iter().map(|&point| gap[point]).collect::<Vec<_>>())?;
    }
    let status: Vec<u8> = points.iter().map(|&point| dataset.status(point) as u8).collect();
    vtk::array(out, "status", &[""], &status)?;
    writeln!(out, "</PointData>\n</Piece></ImageData>\n</VTKFile>")
}

/// Grid points in VTK's order: the first axis fastest.
fn points(dataset: &Dataset) -> Vec<usize> {
    let grid = &dataset.grid;
    let count = |axis: usize| grid.axes.get(axis).map_or(1, |axis| axis.count);
    let lines = (0..count(2)).flat_map(|z| (0..count(1)).flat_map(move |y| (0..count(0)).map(move |x| [x, y, z])));
    lines.map(|lines| grid.point(lines)).collect()
}
