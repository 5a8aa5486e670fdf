//! Smooth refinement of a closed triangle mesh to a target edge length.
//!
//! Each step divides every triangle into four. Nodes stay where they are; those in the middle of edges are placed by
//! the modified butterfly scheme (Zorin, Schröder & Sweldens, Interpolating subdivision for meshes with arbitrary
//! topology, 1996), whose limit has a continuous tangent plane. It interpolates: the refined surface passes through all
//! nodes of the mesh, encloses about the same volume, and sharp edges become round over about the length of the
//! triangles beside them.

use super::{Shell, Topology, check_count, out_of_range, topology};
use crate::Error;
use glam::DVec3;
use std::f64::consts::TAU;

/// Refines a closed surface until the mean length of its edges is at most `edge` (m). Repairs are reported in
/// `warnings`; `refuse` makes the error of a defect.
///
/// # Errors
/// When the surface is not closed, crosses itself, at the first or after a step, or would have too many nodes.
pub(super) fn refine(
    (mut nodes, mut triangles): Shell,
    edge: f64,
    warnings: &mut Vec<String>,
    refuse: impl Fn(String) -> Error,
) -> Result<Shell, Error> {
    if !(edge > 0.0 && edge.is_finite()) {
        return Err(out_of_range("refine", edge, "positive and finite"));
    }
    loop {
        let surface = topology::close(&nodes, &mut triangles).map_err(&refuse)?;
        warnings.extend(surface.warnings);
        let mean_edge = topology::mean_edge(&nodes, &triangles);
        if mean_edge <= edge {
            return Ok((nodes, triangles));
        }
        // Each step makes about four times as many: too many in the end are too many now.
        let steps = (mean_edge / edge).log2().ceil();
        let count = (nodes.len() as f64 * 4.0f64.powf(steps)) as usize;
        check_count(count).map_err(|error| error.about("object.mesh.refine"))?;
        (nodes, triangles) = divide(&nodes, &triangles, &surface.topology);
    }
}

/// Divides every triangle into four.
fn divide(nodes: &[DVec3], triangles: &[[u32; 3]], topology: &Topology) -> Shell {
    let mesh = Mesh { nodes, triangles, topology };
    let mut finer = nodes.to_vec();
    // Node in the middle of edge k of each triangle.
    let mut middle = vec![[u32::MAX; 3]; triangles.len()];
    for t in 0..triangles.len() {
        for k in 0..3 {
            if middle[t][k] == u32::MAX {
                let (across, back) = mesh.across(t, k);
                middle[t][k] = finer.len() as u32;
                middle[across][back] = finer.len() as u32;
                finer.push(mesh.midpoint(t, k));
            }
        }
    }
    let quarters = triangles.iter().zip(&middle);
    let quarters =
        quarters.flat_map(|(&[a, b, c], &[ab, bc, ca])| [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    (finer, quarters.collect())
}

/// A closed mesh whose triangles are turned alike.
struct Mesh<'a> {
    nodes: &'a [DVec3],
    triangles: &'a [[u32; 3]],
    topology: &'a Topology,
}

impl Mesh<'_> {
    /// The triangle across edge `k` of triangle `t`, and which of its edges that is.
    fn across(&self, t: usize, k: usize) -> (usize, usize) {
        let across = self.topology.across[t][k] as usize;
        let end = self.triangles[t][(k + 1) % 3];
        let back = self.triangles[across].iter().position(|corner| *corner == end).unwrap_or(0);
        (across, back)
    }

    /// Position of the corner of triangle `t` across from its edge `k` (m).
    fn opposite(&self, t: usize, k: usize) -> DVec3 {
        self.nodes[self.triangles[t][(k + 2) % 3] as usize]
    }

    /// Returns where the node in the middle of edge `k` of triangle `t` goes (m).
    fn midpoint(&self, t: usize, k: usize) -> DVec3 {
        let (across, back) = self.across(t, k);
        let ends = [(t, k), (across, back)];
        let irregular = ends.map(|(t, k)| self.by_irregular_node(t, k));
        match irregular {
            [Some(a), Some(b)] => a.midpoint(b),
            [Some(one), None] | [None, Some(one)] => one,
            // Both ends have six neighbours: the butterfly.
            [None, None] => {
                let side = |(t, k): (usize, usize)| {
                    let wing = |k: usize| {
                        let (beyond, back) = self.across(t, k);
                        self.opposite(beyond, back)
                    };
                    let end = self.nodes[self.triangles[t][k] as usize];
                    0.5 * end + 0.125 * self.opposite(t, k) - 0.0625 * (wing((k + 1) % 3) + wing((k + 2) % 3))
                };
                side(ends[0]) + side(ends[1])
            }
        }
    }

    /// The same by the node at the start of the edge alone, where it has other than six neighbours.
    fn by_irregular_node(&self, t: usize, k: usize) -> Option<DVec3> {
        let node = self.triangles[t][k];
        let count = self.topology.triangles_around(node as usize).len();
        if count == 6 {
            return None;
        }
        // The neighbours in turn, from the other end of the edge on.
        let (mut t, mut k) = (t, k);
        let mut place = 0.75 * self.nodes[node as usize];
        for j in 0..count {
            place += weight(j, count) * self.nodes[self.triangles[t][(k + 1) % 3] as usize];
            (t, k) = self.across(t, (k + 2) % 3);
        }
        Some(place)
    }
}

/// Weight of neighbour j of a node that has `count`, counted from the edge's other end.
fn weight(j: usize, count: usize) -> f64 {
    match (count, j) {
        (3, 0) => 5.0 / 12.0,
        (3, _) => -1.0 / 12.0,
        (4, 0) => 3.0 / 8.0,
        (4, 2) => -1.0 / 8.0,
        (4, _) => 0.0,
        _ => {
            let angle = TAU * j as f64 / count as f64;
            (0.25 + angle.cos() + 0.5 * (2.0 * angle).cos()) / count as f64
        }
    }
}
