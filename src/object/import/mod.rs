//! Surfaces and solids from mesh files, whose format is known by the file's extension.
//!
//! | file | subject |
//! |---|---|
//! | `obj.rs`, `stl.rs`, `ply.rs`, `gltf.rs`, `collada.rs` | formats of surfaces alone |
//! | `msh.rs`, `medit.rs`, `tetgen.rs`, `vtk.rs`, `vtk_xml.rs` | formats of nodes and cells |
//! | `elements.rs` | what becomes of these |
//! | `cell.rs` | types of cells, and their division into tetrahedra |
//! | `polygon.rs` | faces of many corners, cut into triangles |
//! | `boundary.rs` | the surface of tetrahedra |
//! | `numbers.rs`, `text.rs` | words, numbers and lines of a file |
//!
//! Polygons are cut into triangles. Nodes of a surface at exactly the same point become one node (an STL file has no
//! others), and faces that are left with fewer than three are dropped. Where a file has tetrahedra, its surface is
//! theirs. Nodes keep the order of the file; in OBJ and STL files they are numbered in the order in which triangles
//! first name them. Nodes that nothing names are dropped, except in PLY files. Coordinates become `scale * coordinate +
//! centre`.

mod boundary;
mod cell;
mod collada;
mod elements;
mod gltf;
mod medit;
mod msh;
mod numbers;
mod obj;
mod ply;
mod polygon;
mod stl;
mod tetgen;
mod text;
mod vtk;
mod vtk_xml;

use super::{Body, out_of_range, topology::place};
use crate::scene::Placement;
use crate::{
    Error, ErrorKind,
    input::{self, GREATEST_INPUT},
    names::counted,
};
use elements::Elements;
use glam::DVec3;
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// Longest object that is meant in metres (m): what is longer was drawn in millimetres.
pub(crate) const MOST_METRES: f64 = 10.0;

/// Nodes and triangles of a surface.
type Surface = (Vec<DVec3>, Vec<[u32; 3]>);

/// Longest mesh file that is read (B): an object whose compliance fits in memory has less than a hundredth of that.
const MAX_BYTES: u64 = 1 << 28;

/// What a reader finds: the triangles of a surface, or the tetrahedra of a solid.
#[derive(Default)]
struct Mesh {
    nodes: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Corners of tetrahedra, of positive or negative volume.
    tetrahedra: Vec<[u32; 4]>,
    /// Nodes in the middles of their edges, in Gmsh's order; empty in first order.
    mid_nodes: Vec<[u32; 6]>,
    /// Region of each tetrahedron, 0 outside all; empty if the file names none.
    regions: Vec<u32>,
}

impl From<Surface> for Mesh {
    fn from((nodes, triangles): Surface) -> Self {
        Self { nodes, triangles, ..Self::default() }
    }
}

/// A file that is read.
struct Input<'a> {
    path: &'a Path,
    stream: BufReader<File>,
    /// Regions that the scene names, in its order.
    wanted: &'a [u32],
}

impl Input<'_> {
    /// All of the file.
    fn bytes(&mut self) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        self.stream.read_to_end(&mut bytes).map_err(|error| error.to_string())?;
        Ok(bytes)
    }

    /// The mesh of a format of nodes and cells.
    fn cells(&mut self, read: fn(&[u8], &mut Elements<'_>) -> Result<(), String>) -> Result<Mesh, String> {
        let mut elements = Elements::new(self.wanted);
        read(&self.bytes()?, &mut elements)?;
        elements.mesh()
    }
}

/// A format of mesh files.
struct Format {
    /// Extensions of its files.
    endings: &'static [&'static str],
    /// Whether its faces or their seams have nodes of their own, which then lie on one another.
    is_soup: bool,
    read: fn(&mut Input<'_>) -> Result<Mesh, String>,
}

/// Every format that is read.
static FORMATS: [Format; 10] = [
    Format { endings: &["obj"], is_soup: false, read: |input| obj::read(&mut input.stream).map(Mesh::from) },
    Format { endings: &["stl"], is_soup: true, read: |input| stl::read(&mut input.stream).map(Mesh::from) },
    Format { endings: &["ply"], is_soup: false, read: |input| ply::read(&mut input.stream).map(Mesh::from) },
    Format { endings: &["glb", "gltf"], is_soup: true, read: gltf::read },
    Format { endings: &["dae"], is_soup: true, read: |input| input.cells(collada::read) },
    Format { endings: &["msh"], is_soup: false, read: |input| input.cells(msh::read) },
    Format { endings: &["vtk"], is_soup: false, read: |input| input.cells(vtk::read) },
    Format { endings: &["vtu", "vtp"], is_soup: false, read: |input| input.cells(vtk_xml::read) },
    Format { endings: &["ele", "node"], is_soup: false, read: tetgen::read },
    Format { endings: &["mesh"], is_soup: false, read: |input| input.cells(medit::read) },
];

/// The format of the file of this name.
fn format(file: &Path) -> Option<&'static Format> {
    let ending = file.extension()?.to_str()?.to_lowercase();
    FORMATS.iter().find(|format| format.endings.contains(&ending.as_str()))
}

/// Whether the name of `file` is that of a mesh.
pub(super) fn is_mesh(file: &Path) -> bool {
    format(file).is_some()
}

/// The endings of mesh files, as a sentence lists them.
pub(crate) fn endings() -> String {
    let all: Vec<String> =
        FORMATS.iter().flat_map(|format| format.endings).map(|ending| format!(".{ending}")).collect();
    let (last, others) = all.split_last().map_or(("", &[][..]), |(last, others)| (last.as_str(), others));
    format!("{} or {last}", others.join(", "))
}

/// Reads the surface in `file`; merged nodes are reported in `warnings`, and a scale that seems to be forgotten.
pub(crate) fn read(file: &Path, placement: &Placement, warnings: &mut Vec<String>) -> Result<Surface, Error> {
    let Body { mut nodes, surface_nodes, triangles, .. } = read_body(file, placement, &[], warnings)?;
    nodes.truncate(surface_nodes);
    warnings.extend(oversize(file, placement, &nodes));
    Ok((nodes, triangles))
}

/// Reads the tetrahedra in `file`. `wanted`: the regions that the scene names, in its order.
pub(super) fn read_tetrahedra(
    file: &Path,
    placement: &Placement,
    wanted: &[u32],
    warnings: &mut Vec<String>,
) -> Result<Body, Error> {
    let body = read_body(file, placement, wanted, warnings)?;
    if body.tetrahedra.is_empty() {
        let reason = format!(
            "it has no tetrahedra, hexahedra, prisms or pyramids, but {}: mesh the volume (in Gmsh: -3 -order 2), or \
             give the surface as [object.mesh]",
            counted(body.triangles.len(), ["triangle", "triangles"])
        );
        return Err(unreadable(file, &reason));
    }
    warnings.extend(oversize(file, placement, &body.nodes));
    Ok(body)
}

/// Reads what `file` holds, of any size: a solid, or else a surface.
pub(super) fn read_body(
    file: &Path,
    placement: &Placement,
    wanted: &[u32],
    warnings: &mut Vec<String>,
) -> Result<Body, Error> {
    check_scale(placement)?;
    let Some(format) = format(file) else {
        let message = format!("not a known mesh format: give a file that ends in {}", endings());
        return Err(Error::at(file, message));
    };
    let mut input = Input { path: file, stream: BufReader::new(open(file)?), wanted };
    let mesh = (format.read)(&mut input).map_err(|reason| unreadable(file, &reason))?;
    Ok(if mesh.tetrahedra.is_empty() {
        Body::shell(surface(file, placement, mesh, format.is_soup, warnings))
    } else {
        solid(file, placement, mesh, warnings)?
    })
}

/// Merges nodes that lie on one another, and drops faces that are left without area.
fn surface(file: &Path, placement: &Placement, mesh: Mesh, is_soup: bool, warnings: &mut Vec<String>) -> Surface {
    let Mesh { nodes, mut triangles, .. } = mesh;
    let count = nodes.len();
    let nodes = weld(nodes, &mut triangles);
    if nodes.len() < count && !is_soup {
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
    (placement.place(nodes), triangles)
}

/// Orders the nodes of tetrahedra, and finds their surface; refuses those that have none.
fn solid(file: &Path, placement: &Placement, mesh: Mesh, warnings: &mut Vec<String>) -> Result<Body, Error> {
    let nodes = placement.place(mesh.nodes);
    let (ordered, turned) = boundary::order(&nodes, mesh.tetrahedra, mesh.mid_nodes);
    if ordered.triangles.is_empty() {
        let reason =
            "its tetrahedra overlap and have no surface: each face belongs to two of them: mesh the solid anew";
        return Err(unreadable(file, reason));
    }
    if turned > 0 {
        let (file, all) = (file.display(), ordered.tetrahedra.len());
        warnings.push(format!(
            "{file}: of {all} tetrahedra {} turned, numbered inside out",
            counted(turned, ["was", "were"])
        ));
    }
    Ok(Body { regions: mesh.regions, ..ordered })
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
fn oversize(file: &Path, Placement { scale, .. }: &Placement, nodes: &[DVec3]) -> Option<String> {
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
