//! The rules that every dataset keeps, in memory or in a file, before anything uses it.
//!
//! Lengths fit the grid, contact rows are ordered and within, statuses are known, every number is finite. Checked in an
//! order in which no check relies on one that comes later, and without allocating, so that hostile counts cost nothing.

use super::{Contacts, Dataset, Grid, Solid, Stored, Surface};
use crate::contact::Status;
use safetensors::Dtype;

const TOO_MANY_POINTS: &str = "the grid has too many points";

/// Checks the grid, and that all columns are as long as it asks for; `Err` says what is wrong.
pub(crate) fn lengths(dataset: &Dataset) -> Result<(), String> {
    let points = dataset.grid.check()?;
    let mut arrays = Stored::all().filter_map(|array| Some((array, dataset.stored(array)?)));
    arrays.try_for_each(|(array, bytes)| length(array, bytes, &dataset.grid))?;
    let offsets = dataset.contacts.as_ref().map(|contacts| contacts.offsets.len());
    offsets
        .map_or(Ok(()), |found| exactly(Stored::ContactOffsets, found, points.checked_add(1).ok_or(TOO_MANY_POINTS)?))
}

/// `Err` says what is wrong.
pub(super) fn check(dataset: &Dataset) -> Result<(), String> {
    lengths(dataset)?;
    let points = dataset.grid.points();
    for (array, bytes) in Stored::all().filter_map(|array| Some((array, dataset.stored(array)?))) {
        match array.description().dtype {
            Dtype::F64 => finite(array, bytemuck::cast_slice(bytes), |x: &f64| x.is_finite())?,
            Dtype::F32 => finite(array, bytemuck::cast_slice(bytes), |x: &f32| x.is_finite())?,
            _ => (),
        }
    }
    if let Some(point) = dataset.status.iter().position(|&number| Status::from_number(number).is_none()) {
        let number = dataset.status[point];
        return Err(format!("status {number} of point {point} is unknown to this version; bake the scene again"));
    }
    if let Some(surface) = &dataset.surface {
        check_surface(surface)?;
    }
    match (&dataset.contacts, &dataset.surface) {
        (Some(contacts), Some(surface)) => {
            check_contacts(contacts, points)?;
            within(Stored::ContactNodes, &contacts.nodes, surface.nodes.len() / 3)
        }
        (Some(_), None) => Err("contact forces name the nodes of a surface that is not there".into()),
        (None, _) => Ok(()),
    }
}

fn check_surface(surface: &Surface) -> Result<(), String> {
    let Surface { nodes, triangles, solid } = surface;
    within(Stored::SurfaceTriangles, triangles, nodes.len() / 3)?;
    let Some(Solid { inner_nodes, tetrahedra, mid_nodes, regions }) = solid else { return Ok(()) };
    if !regions.is_empty() && regions.len() != tetrahedra.len() / 4 {
        return Err(format!("the solid has {} tetrahedra, but regions of {}", tetrahedra.len() / 4, regions.len()));
    }
    if !mid_nodes.is_empty() && mid_nodes.len() / 6 != tetrahedra.len() / 4 {
        let (edges, all) = (mid_nodes.len() / 6, tetrahedra.len() / 4);
        return Err(format!("the solid has {all} tetrahedra, but nodes in the middles of the edges of {edges}"));
    }
    within(Stored::MidNodes, mid_nodes, (nodes.len() + inner_nodes.len()) / 3)?;
    within(Stored::Tetrahedra, tetrahedra, (nodes.len() + inner_nodes.len()) / 3)
}

fn check_contacts(contacts: &Contacts, points: usize) -> Result<(), String> {
    let Contacts { offsets, nodes, forces } = contacts;
    exactly(Stored::ContactForces, forces.len(), nodes.len().checked_mul(3).ok_or("there are too many contacts")?)?;
    let (ends, at) = (Stored::ContactOffsets.name(), Stored::ContactNodes.name());
    if offsets[0] != 0 || offsets[points] != nodes.len() as u64 {
        return Err(format!("{ends} do not run from 0 to the {} contacts", nodes.len()));
    }
    if let Some(point) = offsets.windows(2).position(|pair| pair[0] > pair[1]) {
        return Err(format!("{ends} descend at point {point}"));
    }
    // Ascending offsets that end at nodes.len() are all within.
    let row = |point: usize| &nodes[offsets[point] as usize..offsets[point + 1] as usize];
    match (0..points).find(|&point| row(point).windows(2).any(|pair| pair[0] >= pair[1])) {
        Some(point) => Err(format!("{at} of point {point} do not ascend")),
        None => Ok(()),
    }
}

/// Whether an array of these bytes has the numbers that `grid` asks for or, where its first axis is free, whole rows.
fn length(array: Stored, bytes: &[u8], grid: &Grid) -> Result<(), String> {
    let lengths = array.shape(grid);
    let given = lengths.iter().flatten().try_fold(1, |product: usize, &length| product.checked_mul(length));
    let (given, found) = (given.ok_or(TOO_MANY_POINTS)?, 8 * bytes.len() / array.description().dtype.bitsize());
    if lengths.contains(&None) {
        let is_whole = found.is_multiple_of(given);
        return is_whole.then_some(()).ok_or_else(|| format!("the last row of {} is incomplete", array.name()));
    }
    exactly(array, found, given)
}

fn exactly(array: Stored, found: usize, expected: usize) -> Result<(), String> {
    match found {
        found if found == expected => Ok(()),
        found => Err(format!("{} has {found} entries where the grid asks for {expected}", array.name())),
    }
}

fn finite<T>(array: Stored, numbers: &[T], is_finite: impl Fn(&T) -> bool) -> Result<(), String> {
    match numbers.iter().position(|x| !is_finite(x)) {
        None => Ok(()),
        Some(entry) => Err(format!("entry {entry} of {} is not a finite number", array.name())),
    }
}

fn within(array: Stored, numbers: &[u32], nodes: usize) -> Result<(), String> {
    match numbers.iter().position(|&node| node as usize >= nodes) {
        None => Ok(()),
        Some(entry) => Err(format!("entry {entry} of {} is node {}, of {nodes}", array.name(), numbers[entry])),
    }
}
