//! Springs along the edges of the surface and to the ground: K = Kn + Kg of equation (2).
//!
//! A spring of stiffness k between nodes a and b adds B to the blocks (a, a) and (b, b), and -B to (a, b) and (b, a): B
//! = k I for an isotropic spring, B = k e e^T for an axial one, e its direction at rest. A ground spring adds kg I to
//! the diagonal block. Kn and Kg are positive semidefinite by construction, so K is singular only where a rigid motion
//! or a mechanism is left free.

use super::{Object, Stiffness, element::TETRAHEDRON_EDGES, refused, topology::coincident};
use crate::{
    Error,
    scene::{ObjectSpec, SpringKind, SpringSpec},
};
use glam::{DMat3, DVec3};

/// The edges along which the springs of `object` run, each once: those of its tetrahedra, or of its surface.
///
/// # Errors
/// When the tetrahedra have nodes in the middles of their edges.
pub(super) fn edges(object: &Object) -> Result<Vec<[u32; 2]>, Error> {
    if !object.mid_nodes.is_empty() {
        let message = "springs run along tetrahedra of four nodes: save the mesh in first order (gmsh -order 1)";
        return Err(Error::from(message).about("object.springs"));
    }
    let ends = |corners: &[u32; 4]| {
        let corners = *corners;
        TETRAHEDRON_EDGES.map(|[a, b]| [corners[a].min(corners[b]), corners[a].max(corners[b])])
    };
    let sides = |&[a, b, c]: &[u32; 3]| [[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]];
    let mut edges: Vec<[u32; 2]> = match &object.tetrahedra[..] {
        [] => object.triangles.iter().flat_map(sides).collect(),
        tetrahedra => tetrahedra.iter().flat_map(ends).collect(),
    };
    edges.sort_unstable();
    edges.dedup();
    Ok(edges)
}

/// Adds Kn to `stiffness`, whose pattern holds `edges`: each edge once, as its two ends.
pub(super) fn add(
    spec: &ObjectSpec,
    springs: SpringSpec,
    nodes: &[DVec3],
    edges: &[[u32; 2]],
    stiffness: &mut Stiffness,
) -> Result<(), Error> {
    for &[a, b] in edges {
        let (i, j) = (a as usize, b as usize);
        let block = match springs.kind {
            SpringKind::Isotropic => DMat3::from_diagonal(DVec3::splat(springs.stiffness)),
            SpringKind::Axial => {
                let direction = (nodes[j] - nodes[i]).try_normalize();
                let direction = direction.ok_or_else(|| refused(spec, &coincident([a, b], nodes[i])))?;
                springs.stiffness * outer(direction)
            }
        };
        stiffness.add(i, i, block);
        stiffness.add(j, j, block);
        stiffness.add(i, j, -block);
        stiffness.add(j, i, -block);
    }
    Ok(())
}

/// e e^T.
fn outer(e: DVec3) -> DMat3 {
    DMat3::from_cols(e * e.x, e * e.y, e * e.z)
}
