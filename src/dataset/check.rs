//! The rules that every dataset keeps, in memory or in a file, before anything uses it.
//!
//! Lengths fit the grid, contact rows are ordered and within, statuses are known, every number is finite. Checked in an
//! order in which no check relies on one that comes later, and without allocating, so that hostile counts cost nothing.

use super::{CONTACTS, Column, Contacts, Dataset, Solid, Surface, TOUCHES};
use crate::{JointMatrix, contact::Status};

/// `Err` says what is wrong.
pub(super) fn check(dataset: &Dataset) -> Result<(), String> {
    let points = dataset.grid.check()?;
    let torques = points.checked_mul(dataset.grid.joints()).ok_or("the grid has too many points")?;
    length("torque", &dataset.torque, torques)?;
    length("status", &dataset.status, points)?;
    if let Some(point) = dataset.status.iter().position(|&number| Status::from_number(number).is_none()) {
        let number = dataset.status[point];
        return Err(format!("status {number} of point {point} is unknown to this version; bake the scene again"));
    }
    finite("torque", &dataset.torque, |x: &f64| x.is_finite())?;
    if let Some(energy) = &dataset.energy {
        length("energy", energy, points)?;
        finite("energy", energy, |x: &f64| x.is_finite())?;
    }
    if let Some(tangent) = &dataset.tangent {
        let entries = points.checked_mul(JointMatrix::entries(dataset.grid.joints()));
        length("tangent", tangent, entries.ok_or("the grid has too many points")?)?;
        finite("tangent", tangent, |x: &f32| x.is_finite())?;
    }
    for (name, column) in [("gap", &dataset.gap), ("residual", &dataset.residual)] {
        if let Some(column) = column {
            length(name, column, points)?;
            finite(name, column, |x: &f32| x.is_finite())?;
        }
    }
    if let Some(iterations) = &dataset.iterations {
        length("iterations", iterations, points)?;
    }
    if let Some(surface) = &dataset.surface {
        check_surface(surface)?;
    }
    match (&dataset.contacts, &dataset.surface) {
        (Some(contacts), Some(surface)) => {
            check_contacts(contacts, points, CONTACTS)?;
            within(CONTACTS[1], &contacts.nodes, surface.nodes.len() / 3)?;
        }
        (Some(_), None) => return Err("contact forces name the nodes of a surface that is not there".into()),
        (None, _) => (),
    }
    // How many nodes the proxy has is for the scene to say.
    dataset.touches.as_ref().map_or(Ok(()), |touches| check_contacts(touches, points, TOUCHES))
}

fn check_surface(surface: &Surface) -> Result<(), String> {
    let Surface { nodes, triangles, solid } = surface;
    if !nodes.len().is_multiple_of(3) || !triangles.len().is_multiple_of(3) {
        return Err("the surface has an incomplete node or triangle".into());
    }
    finite("surface_nodes", nodes, |x: &f64| x.is_finite())?;
    within("surface_triangles", triangles, nodes.len() / 3)?;
    let Some(Solid { inner_nodes, tetrahedra, regions }) = solid else { return Ok(()) };
    if !inner_nodes.len().is_multiple_of(3) || !tetrahedra.len().is_multiple_of(4) {
        return Err("the solid has an incomplete node or tetrahedron".into());
    }
    if !regions.is_empty() && regions.len() != tetrahedra.len() / 4 {
        return Err(format!("the solid has {} tetrahedra, but regions of {}", tetrahedra.len() / 4, regions.len()));
    }
    finite("inner_nodes", inner_nodes, |x: &f64| x.is_finite())?;
    within("tetrahedra", tetrahedra, (nodes.len() + inner_nodes.len()) / 3)
}

fn check_contacts(contacts: &Contacts, points: usize, names: [&str; 3]) -> Result<(), String> {
    let Contacts { offsets, nodes, forces } = contacts;
    length(names[0], offsets, points.checked_add(1).ok_or("the grid has too many points")?)?;
    length(names[2], forces, nodes.len().checked_mul(3).ok_or("there are too many contacts")?)?;
    if offsets[0] != 0 || offsets[points] != nodes.len() as u64 {
        return Err(format!("{} do not run from 0 to the {} contacts", names[0], nodes.len()));
    }
    if let Some(point) = offsets.windows(2).position(|pair| pair[0] > pair[1]) {
        return Err(format!("{} descend at point {point}", names[0]));
    }
    // Ascending offsets that end at nodes.len() are all within.
    let row = |point: usize| &nodes[offsets[point] as usize..offsets[point + 1] as usize];
    if let Some(point) = (0..points).find(|&point| row(point).windows(2).any(|pair| pair[0] >= pair[1])) {
        return Err(format!("{} of point {point} do not ascend", names[1]));
    }
    finite(names[2], forces, |x: &f32| x.is_finite())
}

fn length<T: bytemuck::Pod>(name: &str, column: &Column<T>, expected: usize) -> Result<(), String> {
    match column.len() {
        found if found == expected => Ok(()),
        found => Err(format!("{name} has {found} entries where the grid asks for {expected}")),
    }
}

fn finite<T>(name: &str, column: &[T], is_finite: impl Fn(&T) -> bool) -> Result<(), String> {
    match column.iter().position(|x| !is_finite(x)) {
        None => Ok(()),
        Some(entry) => Err(format!("entry {entry} of {name} is not a finite number")),
    }
}

fn within(name: &str, column: &[u32], nodes: usize) -> Result<(), String> {
    match column.iter().position(|&node| node as usize >= nodes) {
        None => Ok(()),
        Some(entry) => Err(format!("entry {entry} of {name} is node {}, of {nodes}", column[entry])),
    }
}
