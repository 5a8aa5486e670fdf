//! The deformable virtual object: surface, springs, and the compliance C = K^-1 that contact needs.

use glam::DVec3;

/// A deformable object at rest.
///
/// Nodes `0..surface_nodes` lie on the surface and are the only ones that triangles name; interior nodes follow.
pub struct Object {
    /// Rest positions n0 of all nodes [m].
    pub rest: Vec<DVec3>,
    /// Number S of surface nodes.
    pub surface_nodes: usize,
    /// Outward-oriented closed surface, corner nodes counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    pub topology: Topology,
    /// K = Kn + Kg over all nodes [N/m].
    pub stiffness: Stiffness,
    /// C = K^-1 on the surface nodes, exact static condensation [m/N].
    pub compliance: Compliance,
    /// Mass of each node [kg].
    pub mass: Vec<f64>,
    /// Damping of each node against the ground [N s/m].
    pub damping: Vec<f64>,
}

/// Symmetric sparse matrix of 3 x 3 blocks, both halves stored, rows compressed.
pub struct Stiffness {
    /// Row starts, one more than there are nodes.
    pub offsets: Vec<usize>,
    /// Column (node) of each block, ascending within a row.
    pub columns: Vec<u32>,
    /// The blocks [N/m].
    pub blocks: Vec<glam::DMat3>,
}

/// Dense symmetric matrix over the 3S surface coordinates, row-major: entry (3i + a, 3j + b) [m/N].
pub struct Compliance {
    /// 3S.
    pub order: usize,
    pub entries: Vec<f64>,
}

/// Who touches whom on the surface.
pub struct Topology {
    /// Triangle across edge k of each triangle, edge k joining corners k and (k + 1) % 3.
    pub across: Vec<[u32; 3]>,
    /// Triangles around node j: `around[around_offsets[j]..around_offsets[j + 1]]`.
    pub around_offsets: Vec<u32>,
    pub around: Vec<u32>,
}
