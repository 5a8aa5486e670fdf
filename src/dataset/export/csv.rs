//! Comma-separated text: one row a grid point, and beside `NAME.csv` a file `NAME.contacts.csv` with one row a contact
//! force. The first row names each column and its unit; all other entries are numbers, with a point, in the shortest
//! form that reads back to the same value.

use super::super::{Axis, Dataset, Error, replace_file};
use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

/// Header of the status column.
const STATUS: &str = "status (0 free; 1 contact; 2 unconverged; 3 overflow; 4 outside)";

/// Returns the file with the contact forces beside the table at `path`.
pub(super) fn contacts_file(path: &Path) -> PathBuf {
    path.with_extension("contacts.csv")
}

pub(super) fn export(dataset: &Dataset, path: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut files = vec![path.to_path_buf()];
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |source| Error::Write { path, source }
    };
    if dataset.contacts.is_some() {
        let contacts = contacts_file(path);
        replace_file(&contacts, |writer| write_contacts(dataset, writer)).map_err(failed(&contacts))?;
        files.push(contacts);
    }
    replace_file(path, |writer| write_points(dataset, writer)).map_err(failed(path))?;
    Ok(files)
}

fn write_points(dataset: &Dataset, writer: &mut impl Write) -> io::Result<()> {
    let axes = &dataset.grid.axes;
    let mut header: Vec<String> = axes.iter().map(|axis| quoted(&format!("{} [{}]", axis.name, axis.unit))).collect();
    header.extend(axes.iter().map(effort));
    let optional = [
        ("energy [J]", dataset.energy.is_some()),
        ("gap [m]", dataset.gap.is_some()),
        (STATUS, true),
        ("residual [1]", dataset.residual.is_some()),
        ("iterations", dataset.iterations.is_some()),
        ("contacts", dataset.contacts.is_some()),
    ];
    header.extend(optional.iter().filter(|(_, present)| *present).map(|(name, _)| (*name).to_string()));
    writeln!(writer, "{}", header.join(","))?;
    for point in 0..dataset.grid.points() {
        for coordinate in dataset.grid.configuration(point).iter().chain(dataset.torque(point)) {
            write!(writer, "{coordinate:?},")?;
        }
        if let Some(energy) = &dataset.energy {
            write!(writer, "{:?},", energy[point])?;
        }
        if let Some(gap) = &dataset.gap {
            write!(writer, "{:?},", gap[point])?;
        }
        write!(writer, "{}", dataset.status[point])?;
        if let Some(residual) = &dataset.residual {
            write!(writer, ",{:?}", residual[point])?;
        }
        if let Some(iterations) = &dataset.iterations {
            write!(writer, ",{}", iterations[point])?;
        }
        if dataset.contacts.is_some() {
            write!(writer, ",{}", dataset.forces(point).len())?;
        }
        writeln!(writer)?;
    }
    Ok(())
}

fn write_contacts(dataset: &Dataset, writer: &mut impl Write) -> io::Result<()> {
    writeln!(writer, "point (row of the other file from 0),node,force x [N],force y [N],force z [N]")?;
    let Some(contacts) = &dataset.contacts else { return Ok(()) };
    for point in 0..dataset.grid.points() {
        let (nodes, forces) = contacts.row(point);
        for (node, force) in nodes.iter().zip(forces.chunks_exact(3)) {
            writeln!(writer, "{point},{node},{:?},{:?},{:?}", force[0], force[1], force[2])?;
        }
    }
    Ok(())
}

/// Header of a joint's torque or, of a prismatic joint, force.
fn effort(axis: &Axis) -> String {
    let unit = axis.effort_unit();
    quoted(&format!("{} {} [{unit}]", if unit == "N" { "force" } else { "torque" }, axis.name))
}

/// A text as one field (RFC 4180): joints may be named anything.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.into() }
}
