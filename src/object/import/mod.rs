//! Surfaces from mesh files (OBJ, STL and PLY, chosen by the file's extension), and tetrahedra from Gmsh files.
//!
//! Polygons are cut into triangles. Nodes at exactly the same point become one node (an STL file has no others),
//! and faces that are left with fewer than three are dropped. Nodes keep the order of a PLY file; in OBJ and STL files
//! they are numbered in the order in which triangles first name them, and nodes that no triangle names are dropped.
//! Coordinates become `scale * coordinate + centre`.

mod boundary;
mod division;
mod msh;
mod obj;
mod ply;
mod polygon;
mod stl;
mod text;

use super::{Body, out_of_range, topology::place};
use crate::scene::Placement;
use crate::{
    Error, ErrorKind,
    input::{self, GREATEST_INPUT},
    names::counted,
};
use glam::DVec3;
use std::collections::HashMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Longest object that is meant in metres (m): what is longer was drawn in millimetres.
pub(crate) const MOST_METRES: f64 = 10.0;

/// Nodes and triangles as a reader finds them.
type Surface = (Vec<DVec3>, Vec<[u32; 3]>);

/// Longest mesh file that is read (B): an object whose compliance fits in memory has less than a hundredth of that.
const MAX_BYTES: u64 = 1 << 28;

/// Reads the surface in `file`; merged nodes are reported in `warnings`, and a scale that seems to be forgotten.
pub(crate) fn read(file: &Path, placement: &Placement, warnings: &mut Vec<String>) -> Result<Surface, Error> {
    let surface = read_of_any_size(file, placement, warnings)?;
    warnings.extend(oversize(file, placement, &surface.0));
    Ok(surface)
}

/// As [`read`], of a file whose unit is not known.
pub(super) fn read_of_any_size(
    file: &Path,
    placement: &Placement,
    warnings: &mut Vec<String>,
) -> Result<Surface, Error> {
    check_scale(placement)?;
    let unreadable = |reason: String| unreadable(file, &reason);
    let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let reader = match extension.as_str() {
        "obj" => obj::read,
        "stl" => stl::read,
        "ply" => ply::read,
        _ => {
            return Err(Error::at(file, "not a known mesh format: give a file that ends in .obj, .stl or .ply"));
        }
    };
    let (nodes, mut triangles) = reader(&mut BufReader::new(open(file)?)).map_err(unreadable)?;
    let count = nodes.len();
    let nodes = weld(nodes, &mut triangles);
    if nodes.len() < count && extension != "stl" {
        let (file, merged) = (file.display(), count - nodes.len());
        warnings.push(format!(
            "{file}: of {count} nodes {} merged with another in exactly the same place",
            counted(merged, ["was", "were"])
        ));
    }
    let faces = triangles.len();
    triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    if triangles.len() < faces {
        let (file, dropped) = (file.display(), faces - triangles.len());
        warnings.push(format!(
            "{file}: of {faces} faces {} left out, with two corners in one place",
            counted(dropped, ["was", "were"])
        ));
    }
    Ok((placement.place(nodes), triangles))
}

/// Reads the tetrahedra in a Gmsh file. `wanted`: the physical volumes that the scene names, in its order.
pub(super) fn read_tetrahedra(
    file: &Path,
    placement: &Placement,
    wanted: &[u32],
    warnings: &mut Vec<String>,
) -> Result<Body, Error> {
    check_scale(placement)?;
    let unreadable = |reason: String| unreadable(file, &reason);
    let mesh = msh::read(&mut BufReader::new(open(file)?), wanted).map_err(unreadable)?;
    check_coordinates(&mesh.nodes).map_err(unreadable)?;
    let nodes = placement.place(mesh.nodes);
    let (ordered, turned) = boundary::order(&nodes, mesh.tetrahedra, mesh.mid_nodes);
    let ordered = Body { regions: mesh.regions, ..ordered };
    if turned > 0 {
        let (file, all) = (file.display(), ordered.tetrahedra.len());
        warnings.push(format!(
            "{file}: of {all} tetrahedra {} turned, numbered inside out",
            counted(turned, ["was", "were"])
        ));
    }
    Ok(ordered)
}

/// Least and greatest coordinates of `nodes` (m).
pub(crate) fn corners(nodes: &[DVec3]) -> [DVec3; 2] {
    [DVec3::min, DVec3::max].map(|pick| nodes.iter().copied().reduce(pick).unwrap_or_default())
}

/// Greatest extent of `nodes` along an axis (m).
pub(crate) fn length(nodes: &[DVec3]) -> f64 {
    let [low, high] = corners(nodes);
    (high - low).max_element()
}

/// Refuses a scale that a specification made in code may have.
fn check_scale(placement: &Placement) -> Result<(), Error> {
    let value = placement.scale;
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(out_of_range("scale", value, "positive and finite")) }
}

/// Refuses coordinates that are no lengths in any unit.
fn check_coordinates(nodes: &[DVec3]) -> Result<(), String> {
    let is_length = |node: &DVec3| node.to_array().iter().all(|x| x.abs() <= GREATEST_INPUT);
    match nodes.iter().position(|node| !is_length(node)) {
        Some(node) => Err(format!(
            "node {node}, counted from 0, has a coordinate that is not a number between -{GREATEST_INPUT:e} and \
             {GREATEST_INPUT:e}: export the mesh again"
        )),
        None => Ok(()),
    }
}

/// A warning where the scale was forgotten.
pub(super) fn oversize(file: &Path, Placement { scale, .. }: &Placement, nodes: &[DVec3]) -> Option<String> {
    let length = length(nodes);
    (length > MOST_METRES).then(|| {
        format!(
            "{}: the object is {length:.0} m long with scale = {scale}: if its coordinates are millimetres, give \
             scale = 0.001",
            file.display()
        )
    })
}

/// The error of a mesh file that cannot be read.
fn unreadable(file: &Path, reason: &str) -> Error {
    Error::at(file, format_args!("cannot read the mesh: {reason}")).of(ErrorKind::File)
}

/// Opens a file of bounded length.
fn open(file: &Path) -> Result<File, Error> {
    let unreadable = |reason: String| unreadable(file, &reason);
    let stream = input::open(file).map_err(|error| unreadable(error.to_string()))?;
    let attributes = stream.metadata().map_err(|error| unreadable(error.to_string()))?;
    if attributes.len() > MAX_BYTES {
        return Err(unreadable(format!("it has more than {MAX_BYTES} bytes")));
    }
    Ok(stream)
}

/// `count` as a node number: files with more nodes than that are refused.
fn node_number(count: usize) -> Result<u32, String> {
    u32::try_from(count).map_err(|_| format!("{count} nodes are more than can be numbered"))
}

/// Merges nodes at exactly the same point. Triangles that name nodes out of range are left for the surface's check.
fn weld(nodes: Vec<DVec3>, triangles: &mut [[u32; 3]]) -> Vec<DVec3> {
    let mut places = HashMap::with_capacity(nodes.len());
    let mut kept = Vec::with_capacity(nodes.len());
    let numbers: Vec<u32> = nodes
        .iter()
        .map(|&node| {
            *places.entry(place(node)).or_insert_with(|| {
                kept.push(node);
                kept.len() as u32 - 1
            })
        })
        .collect();
    for corner in triangles.as_flattened_mut() {
        *corner = numbers.get(*corner as usize).copied().unwrap_or(u32::MAX);
    }
    kept
}
