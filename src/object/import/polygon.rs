//! Faces of more than three corners, cut into triangles.

use glam::DVec3;
use spade::handles::{FixedFaceHandle, FixedUndirectedEdgeHandle, InnerTag};
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};
use std::collections::{HashMap, HashSet};

/// Triangles of `face`, whose corners are numbers of `nodes` and are counter-clockwise: the constrained Delaunay
/// triangulation (Chew, 1989) in the plane of the face's area vector (Newell's). The outline may be concave, and have
/// straight corners or holes that a bridge joins to it. It does not matter with which corner the face begins.
///
/// # Errors
/// Why the face has no triangles, and what to do.
pub(super) fn cut(face: &[u32], nodes: &[DVec3]) -> Result<Vec<[u32; 3]>, String> {
    if let Some(node) = face.iter().find(|node| **node as usize >= nodes.len()) {
        return Err(format!("a face names node {node}, counted from 0, of {}: export the mesh again", nodes.len()));
    }
    let place = |corner: u32| nodes[corner as usize];
    match face {
        [] | [_] | [_, _] => Err(format!("a face has {} corners, and needs three: export the mesh again", face.len())),
        [a, b, c] => Ok(vec![[*a, *b, *c]]),
        _ => {
            let mut corners = face.to_vec();
            corners.dedup_by_key(|corner| place(*corner).to_array());
            if corners.len() > 1 && place(corners[0]) == place(corners[corners.len() - 1]) {
                corners.pop();
            }
            if corners.len() < 3 {
                // Left out with other faces of two corners in one place.
                return Ok(vec![[face[0], face[1], face[2]]]);
            }
            outline(corners, place).ok_or_else(|| {
                "a face whose outline crosses itself or has no area cannot be cut into triangles: triangulate on export"
                    .to_owned()
            })
        }
    }
}

/// Triangles inside an outline of three corners or more, no two that follow each other in one place.
fn outline(mut corners: Vec<u32>, place: impl Fn(u32) -> DVec3) -> Option<Vec<[u32; 3]>> {
    let order = |a: &u32, b: &u32| {
        let [a, b] = [*a, *b].map(|corner| place(corner).to_array());
        a.iter().zip(&b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
    };
    let first = (0..corners.len()).min_by(|a, b| order(&corners[*a], &corners[*b]))?;
    corners.rotate_left(first);
    let arms: Vec<DVec3> = corners.iter().map(|corner| place(*corner) - place(corners[0])).collect();
    let next = |k: usize| (k + 1) % corners.len();
    let size = arms.iter().map(|arm| arm.length()).fold(0.0, f64::max);
    let area: DVec3 = (0..arms.len()).map(|k| (arms[k] / size).cross(arms[next(k)] / size)).sum();
    let (x, y) = area.try_normalize()?.any_orthonormal_pair();
    // The triangulation refuses denormal numbers, which are zero beside the outline's size of one.
    let clear = |x: f64| if x.abs() < f64::EPSILON * f64::EPSILON { 0.0 } else { x };
    let mut triangulation = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut numbers = HashMap::new();
    let mut vertices = Vec::with_capacity(corners.len());
    for (corner, arm) in corners.iter().zip(&arms) {
        let vertex = triangulation.insert(Point2::new(clear(x.dot(*arm) / size), clear(y.dot(*arm) / size))).ok()?;
        numbers.entry(vertex).or_insert(*corner);
        vertices.push(vertex);
    }
    // An edge that the outline passes twice, as the bridge to a hole, has the inside on both its sides or on none.
    let mut outline: HashSet<FixedUndirectedEdgeHandle> = HashSet::new();
    for k in 0..vertices.len() {
        let edges = triangulation.try_add_constraint(vertices[k], vertices[next(k)]);
        if edges.is_empty() {
            return None;
        }
        for edge in edges.into_iter().map(|edge| edge.as_undirected()) {
            if !outline.remove(&edge) {
                outline.insert(edge);
            }
        }
    }
    let mut inside: HashMap<FixedFaceHandle<InnerTag>, bool> = HashMap::new();
    let mut open: Vec<_> = triangulation.convex_hull().map(|edge| (edge, false)).collect();
    while let Some((edge, beyond)) = open.pop() {
        // `edge` comes from a face that is inside where `beyond` says so; its other side is looked at.
        let Some(face) = edge.rev().face().as_inner() else { continue };
        let is_inside = beyond != outline.contains(&edge.as_undirected().fix());
        if inside.insert(face.fix(), is_inside).is_none() {
            open.extend(face.adjacent_edges().map(|edge| (edge, is_inside)));
        }
    }
    let triangles: Vec<[u32; 3]> = triangulation
        .inner_faces()
        .filter(|face| inside.get(&face.fix()) == Some(&true))
        .map(|face| face.vertices().map(|vertex| numbers[&vertex.fix()]))
        .collect();
    // So many has every outline that does not cross itself.
    (triangles.len() + 2 == corners.len()).then_some(triangles)
}
