//! Why an object is refused, and what to do about it.

use crate::{Error, memory::Shortage};
use glam::DVec3;
use std::path::PathBuf;

/// Why no object can be made of a specification.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ObjectError {
    /// The mesh file cannot be read.
    #[error("{}: cannot read the mesh: {reason}", .file.display())]
    File {
        /// The file that the scene names.
        file: PathBuf,
        /// Message of the system or the reader.
        reason: String,
    },
    /// The mesh file's extension names no known format.
    #[error("{}: not a known mesh format: give a file that ends in .obj, .stl or .ply", .file.display())]
    Format {
        /// The file that the scene names.
        file: PathBuf,
    },
    /// The surface is not what contact can be computed on.
    #[error("{surface}: {defect}")]
    Surface {
        /// The mesh file, or `sphere`.
        surface: String,
        /// Its defect.
        defect: SurfaceDefect,
    },
    /// A number is out of range.
    #[error("{name} is {value}: it must be {range}")]
    Parameter {
        /// Which number.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Its valid range.
        range: &'static str,
    },
    /// The dense compliance would not fit in memory.
    #[error(
        "the proxy reaches {nodes} surface nodes, which need {} MB of compliance, more than the {} MB of memory \
         that it may take: use a coarser surface or a smaller grid, close other programs, or raise the limit \
         (ulimit -v)",
        .bytes.div_ceil(1_000_000), .limit / 1_000_000
    )]
    TooLarge {
        /// Surface nodes that the proxy reaches.
        nodes: usize,
        /// Memory of the compliance (B).
        bytes: usize,
        /// Memory that it may take (B).
        limit: usize,
    },
    /// The stiffness would not fit in memory.
    #[error("an object of {nodes} nodes: {shortage}, or use a coarser surface")]
    Memory {
        /// Nodes of the object.
        nodes: usize,
        /// Memory that is needed, and that is left.
        shortage: Shortage,
    },
    /// More nodes than the stiffness is made for.
    #[error("an object of {nodes} nodes is more than the {limit} that are taken: use a coarser surface")]
    TooManyNodes {
        /// Nodes of the object.
        nodes: usize,
        /// Nodes that are taken.
        limit: usize,
    },
    /// A tetrahedron without volume.
    #[error("tetrahedron {number} (nodes {corners:?}, surface nodes counted first) has no volume: mesh the solid anew")]
    FlatTetrahedron {
        /// Its number in the file.
        number: usize,
        /// Its corners.
        corners: [u32; 4],
    },
    /// A tetrahedron names a node that is not there.
    #[error("a tetrahedron has the nodes {corners:?}, of {count}: build the object again from its scene")]
    TetrahedronNode {
        /// Its corners.
        corners: [u32; 4],
        /// Number of nodes.
        count: usize,
    },
    /// Nodes in the middles of edges that are not there, or for another number of tetrahedra.
    #[error(
        "the nodes in the middles of edges do not fit {tetrahedra} tetrahedra and {count} nodes: build the object \
         again from its scene"
    )]
    MidNodes {
        /// Number of tetrahedra.
        tetrahedra: usize,
        /// Number of nodes.
        count: usize,
    },
    /// More surface nodes than nodes.
    #[error("{surface} of {count} nodes are on the surface: build the object again from its scene")]
    SurfaceNodes {
        /// Surface nodes.
        surface: usize,
        /// Number of nodes.
        count: usize,
    },
    /// A body without the tetrahedra that the scene names, or with some that it does not.
    #[error(
        "the tetrahedra of the scene's object and those that are stored do not agree, as in datasets of earlier \
         versions, which held none: bake the scene again"
    )]
    OtherTetrahedra,
    /// The lattice that fills the surface would be too fine.
    #[error(
        "cells of {cell} m make {cubes:.0} cubes of an object that is {length:.3} m long, more than {limit:.0}: make \
         object.elasticity.cell larger, or scale a mesh that was drawn in millimetres"
    )]
    TooManyCubes {
        /// Size of a cube (m).
        cell: f64,
        /// Greatest extent of the surface along an axis (m).
        length: f64,
        /// Cubes over the box around the surface.
        cubes: f64,
        /// Cubes that are taken.
        limit: f64,
    },
    /// A ground for which the object has no material.
    #[error("a ground per volume, or one that clamps, needs an elastic solid: give a stiffness per node or per area")]
    GroundWithoutSolid,
    /// Springs along tetrahedra with nodes in the middles of their edges.
    #[error("springs run along tetrahedra of four nodes: save the mesh in first order (gmsh -order 1)")]
    CurvedSprings,
    /// An inclusion holds no part of the solid.
    #[error("no part of the solid is in the inclusion ({inclusion}): correct its place, or remove it")]
    EmptyInclusion {
        /// Its description.
        inclusion: String,
    },
    /// Regions for another number of tetrahedra.
    #[error("there are {regions} regions for {tetrahedra} tetrahedra: build the object again from its scene")]
    Regions {
        /// Number of regions.
        regions: usize,
        /// Number of tetrahedra.
        tetrahedra: usize,
    },
    /// The ground names a node that is not there.
    #[error("ground names node {node}, but the object has nodes 0 to {}: correct the list", .count - 1)]
    GroundNode {
        /// The node named.
        node: u32,
        /// Number of nodes.
        count: usize,
    },
    /// The ground holds no node at all.
    #[error("no node lies below z = {height} m, the lowest is at z = {lowest} m: raise the ground's height")]
    NothingBelow {
        /// Height below which nodes are grounded (m).
        height: f64,
        /// Height of the lowest node (m).
        lowest: f64,
    },
    /// A connected part of the object floats.
    #[error(
        "the ground holds no node of the part of {nodes} nodes around node {node}, which would float away: \
         ground at least one of its nodes, or give the skin a foundation"
    )]
    Ungrounded {
        /// A node of the part.
        node: u32,
        /// Number of nodes in it.
        nodes: usize,
    },
    /// The stiffness is singular, though every part is grounded: springs and ground leave a motion free.
    #[error(
        "the stiffness is not positive definite (reciprocal condition {reciprocal_condition:.0e}): node {node} can \
         move along ({:.2}, {:.2}, {:.2}) almost without force; axial springs leave such mechanisms, and a skin on \
         sliver triangles comes near them: ground more nodes, stiffen the ground, use isotropic springs, or mesh \
         evenly",
        .direction.x, .direction.y, .direction.z
    )]
    Mechanism {
        /// The node that moves most.
        node: u32,
        /// Unit vector along which it moves.
        direction: DVec3,
        /// Smallest over largest eigenvalue, estimated.
        reciprocal_condition: f64,
    },
    /// The factorisation failed for a reason other than the object's.
    #[error(transparent)]
    Factor(#[from] Error),
}

impl From<ObjectError> for Error {
    fn from(error: ObjectError) -> Self {
        Self::new(error.to_string())
    }
}

/// A defect that keeps triangles from being a closed, orientable surface of proper triangles.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceDefect {
    /// There are no triangles.
    #[error("the surface has no triangles")]
    Empty,
    /// A coordinate is NaN or infinite.
    #[error("node {node} has a coordinate that is not a finite number")]
    NotFinite {
        /// The node.
        node: u32,
    },
    /// A triangle names a node that is not there.
    #[error("triangle {triangle} names node {node}, but there are only {count} nodes")]
    NodeOutOfRange {
        /// The triangle.
        triangle: u32,
        /// The node that it names.
        node: u32,
        /// Number of nodes.
        count: usize,
    },
    /// A triangle without area.
    #[error("triangle {triangle} (nodes {} {} {}) has no area: \
     remove it or merge its nodes", .corners[0], .corners[1], .corners[2])]
    DegenerateTriangle {
        /// The triangle.
        triangle: u32,
        /// Its nodes.
        corners: [u32; 3],
    },
    /// Two triangles on the same three nodes.
    #[error("triangles {first} and {second} have the same three nodes: remove one")]
    RepeatedTriangle {
        /// One of them.
        first: u32,
        /// The other.
        second: u32,
    },
    /// Two nodes at the same place.
    #[error("nodes {first} and {second} lie at the same point: merge them")]
    CoincidentNodes {
        /// One of them.
        first: u32,
        /// The other.
        second: u32,
    },
    /// A node of no triangle.
    #[error("node {node} belongs to no triangle: remove it")]
    UnusedNode {
        /// The node.
        node: u32,
    },
    /// An edge with a triangle on one side only.
    #[error(
        "the surface is open: edge {} to {} has a triangle on one side only ({triangle}); there are {edges} such \
         edges: close the holes, or merge vertices by distance", .nodes[0], .nodes[1]
    )]
    Open {
        /// The two ends of one such edge.
        nodes: [u32; 2],
        /// Its triangle.
        triangle: u32,
        /// Number of such edges.
        edges: usize,
    },
    /// An edge with more than two triangles.
    #[error("the surface is not a manifold: edge {} to {} has {triangles} triangles, not 2", .nodes[0], .nodes[1])]
    NonManifoldEdge {
        /// The two ends of the edge.
        nodes: [u32; 2],
        /// Number of triangles that share it.
        triangles: usize,
    },
    /// A node at which two sheets touch.
    #[error(
        "the surface is not a manifold: separate sheets meet at node {node} only: give each sheet a node of its own"
    )]
    PinchedNode {
        /// The node.
        node: u32,
    },
    /// A one-sided surface, such as a Klein bottle.
    #[error("the surface has no inside: its triangles cannot be oriented alike \
     across edge {} to {}", .nodes[0], .nodes[1])]
    NonOrientable {
        /// The two ends of the edge at which orientation fails.
        nodes: [u32; 2],
    },
    /// Two sheets of the surface cross or touch.
    #[error(
        "the surface crosses or touches itself: triangles {} and {} meet near ({:.4}, {:.4}, {:.4}) m: part the \
         pieces, or join them into one surface (a boolean union in Blender or MeshLab)",
        .triangles[0], .triangles[1], .place.x, .place.y, .place.z
    )]
    Crossing {
        /// The two triangles, ascending.
        triangles: [u32; 2],
        /// Middle of the edge of one that meets the other (m).
        place: DVec3,
    },
    /// A surface that encloses nothing.
    #[error("the part of the surface around node {node} encloses no volume: it is folded flat")]
    NoVolume {
        /// A node of the part.
        node: u32,
    },
}
