//! Comma-separated text: one row a grid point, and beside `NAME.csv` a file `NAME.contacts.csv` with one row a contact
//! force. The first row names each column and its unit; all other entries are numbers, with a point, in the shortest
//! form that reads back to the same value.

use super::{
    super::{
        Axis, Dataset, Grid, Stored,
        stored::{Axes, Description},
    },
    replaced,
};
use crate::{
    Error,
    csv::{Table, quoted},
};
use safetensors::Dtype;
use std::{
    fmt::{self, Debug, Display},
    io::{self, Write},
    path::{Path, PathBuf},
};

/// Header of the status column.
const STATUS: &str = "status (0 free; 1 contact; 2 unconverged; 3 overflow; 4 outside)";

/// Returns the file with the contact forces beside the table at `path`.
pub(super) fn contacts_file(path: &Path) -> PathBuf {
    path.with_extension("contacts.csv")
}

pub(super) fn export(dataset: &Dataset, path: &Path) -> Result<(), Error> {
    if dataset.contacts.is_some() {
        replaced(&contacts_file(path), |writer| write_contacts(dataset, writer))?;
    }
    replaced(path, |writer| write_points(dataset, writer))
}

fn write_points(dataset: &Dataset, writer: &mut impl Write) -> io::Result<()> {
    let grid = &dataset.grid;
    // Columns of one number a point.
    let one = |array: &Stored| matches!(array.description().axes, Axes::Grid);
    let columns: Vec<_> = Stored::all().filter(one).filter_map(|array| Some((array, dataset.stored(array)?))).collect();
    let mut table = Table::new(writer);
    table.fields(grid.axes.iter().map(|axis| quoted(&format!("{} [{}]", axis.name, axis.unit))))?;
    table.fields(grid.axes.iter().map(effort))?;
    table.fields(columns.iter().map(|(array, _)| heading(*array, grid)))?;
    table.fields(dataset.contacts.as_ref().map(|_| "contacts"))?.end()?;
    for point in 0..grid.points() {
        table.fields(grid.configuration(point).iter().chain(dataset.torque(point)).map(Shortest))?;
        for (array, bytes) in &columns {
            match array.description().dtype {
                Dtype::F64 => table.field(Shortest(&bytemuck::cast_slice::<u8, f64>(bytes)[point]))?,
                Dtype::F32 => table.field(Shortest(&bytemuck::cast_slice::<u8, f32>(bytes)[point]))?,
                Dtype::U32 => table.field(bytemuck::cast_slice::<u8, u32>(bytes)[point])?,
                _ => table.field(bytes[point])?,
            };
        }
        table.fields(dataset.contacts.as_ref().map(|_| dataset.forces(point).len()))?.end()?;
    }
    Ok(())
}

/// Heading of a column: its name, and the unit of what is measured.
fn heading(array: Stored, grid: &Grid) -> String {
    match array.description() {
        _ if array == Stored::Status => STATUS.to_owned(),
        Description { name, dtype: Dtype::F64 | Dtype::F32, .. } => format!("{name} [{}]", array.unit(grid)),
        Description { name, .. } => (*name).to_owned(),
    }
}

fn write_contacts(dataset: &Dataset, writer: &mut impl Write) -> io::Result<()> {
    let mut table = Table::new(writer);
    let forces = ["force x [N]", "force y [N]", "force z [N]"];
    table.fields(["point (row of the other file from 0)", "node"])?.fields(forces)?.end()?;
    let Some(contacts) = &dataset.contacts else { return Ok(()) };
    for point in 0..dataset.grid.points() {
        let (nodes, forces) = contacts.row(point);
        for (node, force) in nodes.iter().zip(forces.chunks_exact(3)) {
            table.field(point)?.field(node)?.fields(force.iter().map(Shortest))?.end()?;
        }
    }
    Ok(())
}

/// A number in the shortest form, with an exponent where it is very large or small.
struct Shortest<T>(T);

impl<T: Debug> Display for Shortest<T> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(formatter)
    }
}

/// Header of a joint's torque or, of a prismatic joint, force.
fn effort(axis: &Axis) -> String {
    let unit = axis.effort_unit();
    quoted(&format!("{} {} [{unit}]", if unit == "N" { "force" } else { "torque" }, axis.name))
}
