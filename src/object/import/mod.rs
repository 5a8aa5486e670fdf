//! Surfaces from mesh files (OBJ, STL and PLY, chosen by the file's extension), and tetrahedra from Gmsh files.
//!
//! Polygons are cut into triangle fans. Nodes at exactly the same point become one node (an STL file has no others),
//! and faces that are left with fewer than three are dropped. Nodes keep the order of a PLY file; in OBJ and STL files
//! they are numbered in the order in which triangles first name them, and nodes that no triangle names are dropped.
//! Coordinates become `scale * coordinate + centre`.

mod boundary;
mod msh;
mod obj;
mod ply;

use super::{Body, ObjectError, topology::place};
use crate::input;
use glam::DVec3;
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

/// Nodes and triangles as a reader finds them.
type Surface = (Vec<DVec3>, Vec<[u32; 3]>);

/// Longest mesh file that is read [B]: an object whose compliance fits in memory has less than a hundredth of that.
const MAX_BYTES: u64 = 1 << 28;

/// Reads the surface in `file`; merged nodes are reported in `warnings`.
pub(crate) fn read(file: &Path, scale: f64, centre: DVec3, warnings: &mut Vec<String>) -> Result<Surface, ObjectError> {
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(ObjectError::Parameter { name: "scale", value: scale, range: "positive and finite" });
    }
    let unreadable = |reason: String| ObjectError::File { file: file.to_owned(), reason };
    let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let reader = match extension.as_str() {
        "obj" => obj::read,
        "stl" => read_stl,
        "ply" => ply::read,
        _ => return Err(ObjectError::Format { file: file.to_owned() }),
    };
    let (nodes, mut triangles) = reader(&mut BufReader::new(open(file)?)).map_err(unreadable)?;
    let count = nodes.len();
    let mut nodes = weld(nodes, &mut triangles);
    if nodes.len() < count && extension != "stl" {
        let (file, merged) = (file.display(), count - nodes.len());
        warnings.push(format!("{file}: {merged} of {count} nodes lay exactly on another and were merged with it"));
    }
    let faces = triangles.len();
    triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    if triangles.len() < faces {
        let (file, dropped) = (file.display(), faces - triangles.len());
        warnings.push(format!("{file}: {dropped} of {faces} faces had two corners in one place and were left out"));
    }
    nodes.iter_mut().for_each(|node| *node = scale * *node + centre);
    Ok((nodes, triangles))
}

/// Reads the tetrahedra in a Gmsh file.
pub(super) fn read_tetrahedra(
    file: &Path,
    scale: f64,
    centre: DVec3,
    warnings: &mut Vec<String>,
) -> Result<Body, ObjectError> {
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(ObjectError::Parameter { name: "scale", value: scale, range: "positive and finite" });
    }
    let unreadable = |reason: String| ObjectError::File { file: file.to_owned(), reason };
    let mesh = msh::read(&mut BufReader::new(open(file)?)).map_err(unreadable)?;
    let nodes: Vec<DVec3> = mesh.nodes.iter().map(|node| scale * *node + centre).collect();
    let (ordered, turned) = boundary::order(&nodes, mesh.tetrahedra);
    let ordered = Body { regions: mesh.regions, ..ordered };
    if turned > 0 {
        let (file, all) = (file.display(), ordered.tetrahedra.len());
        warnings.push(format!("{file}: {turned} of {all} tetrahedra were numbered inside out and were turned"));
    }
    Ok(ordered)
}

/// Opens a file of bounded length.
fn open(file: &Path) -> Result<File, ObjectError> {
    let unreadable = |reason: String| ObjectError::File { file: file.to_owned(), reason };
    let stream = input::open(file).map_err(|error| unreadable(error.to_string()))?;
    let attributes = stream.metadata().map_err(|error| unreadable(error.to_string()))?;
    if attributes.len() > MAX_BYTES {
        return Err(unreadable(format!("it has more than {MAX_BYTES} bytes")));
    }
    Ok(stream)
}

fn read_stl(stream: &mut (impl Read + Seek)) -> Result<Surface, String> {
    let mesh = stl_io::read_stl(stream).map_err(|error| error.to_string())?;
    node_number(mesh.vertices.len())?;
    let nodes = mesh.vertices.iter().map(|v| DVec3::from_array(v.0.map(f64::from))).collect();
    let triangles = mesh.faces.iter().map(|face| face.vertices.map(|node| node as u32)).collect();
    Ok((nodes, triangles))
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
