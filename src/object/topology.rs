//! Is the surface closed, and who touches whom on it?
//!
//! Contact needs an inside: every edge must have exactly two triangles that run along it in opposite senses, the
//! triangles around a node must form one fan, and every connected part must enclose a positive volume. A surface whose
//! triangles merely point the wrong way is turned, with a warning; anything else is refused with the reason.
//!
//! A part inside another is the wall of a cavity, and faces into it; one inside a cavity is a body again, and so on:
//! outward is away from the material, of which a point is part when an odd number of shells surround it. Parts that
//! cross or touch are refused (see [`super::crossing`]), so one node decides for a whole part which others surround it.

use super::crossing;
use crate::names::counted;
use glam::DVec3;
use std::{collections::HashMap, f64::consts::PI};

/// Smallest height of a triangle over its longest edge, and of a closed surface's volume over its area times its extent
/// (1). Coordinates in single precision, as STL files and the GPU hold them, round at 6e-8 of their size: below this
/// bound the triangle's normal would be uncertain by more than about 6 %, and its side a matter of luck.
const MIN_TRIANGLE_ASPECT: f64 = 1e-6;

/// Who touches whom on the surface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topology {
    /// Triangle across edge k of each triangle, edge k joining corners k and (k + 1) % 3.
    pub across: Vec<[u32; 3]>,
    /// Triangles around node j: `around[around_offsets[j]..around_offsets[j + 1]]`.
    pub around_offsets: Vec<u32>,
    /// See `around_offsets`; ascending for each node.
    pub around: Vec<u32>,
}

impl Topology {
    /// Triangles around `node`, ascending.
    #[must_use]
    pub fn triangles_around(&self, node: usize) -> &[u32] {
        &self.around[self.around_offsets[node] as usize..self.around_offsets[node + 1] as usize]
    }

    /// Returns that of the closed surfaces that `triangles` form, and turns them outward.
    #[cfg(test)]
    pub(crate) fn of(nodes: &[DVec3], triangles: &mut [[u32; 3]]) -> Self {
        close(nodes, triangles).unwrap().topology
    }
}

/// The findings of [`close`].
pub(super) struct ClosedSurface {
    pub topology: Topology,
    /// Nodes of each connected part, ascending.
    pub components: Vec<Vec<u32>>,
    pub warnings: Vec<String>,
}

/// Checks that `triangles` form closed, orientable surfaces of proper triangles, and turns them outward.
///
/// # Errors
/// Says, here and below, which defect keeps them from it, and the remedy.
pub(super) fn close(nodes: &[DVec3], triangles: &mut [[u32; 3]]) -> Result<ClosedSurface, String> {
    check_nodes(nodes)?;
    check_triangles(nodes, triangles)?;
    let (around_offsets, around) = triangles_around(nodes.len(), triangles);
    if let Some(node) = (0..nodes.len()).find(|&j| around_offsets[j] == around_offsets[j + 1]) {
        return Err(format!("{} belongs to no triangle: remove it", at(nodes, node as u32)));
    }
    let across = pair_edges(nodes, triangles)?;
    // First of all: a closed surface with one side has no place in space without crossing itself.
    let parts = orient(nodes, triangles, &across)?;
    crossing::check(nodes, triangles)?;
    let mut warnings = Vec::new();
    turn_outward(nodes, triangles, &parts, &mut warnings)?;
    // Turning a triangle renumbers its edges, so the neighbours are found again.
    let across = pair_edges(nodes, triangles)?;
    let topology = Topology { across, around_offsets, around };
    check_fans(nodes, &topology, triangles)?;
    let components = parts.iter().map(|part| nodes_of(&part.triangles, triangles)).collect();
    Ok(ClosedSurface { topology, components, warnings })
}

/// Mean length of the triangles' edges (m).
pub(super) fn mean_edge(nodes: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let ends = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let sum: f64 = ends.map(|ends| ends.map(|node| nodes[node as usize])).map(|[a, b]| a.distance(b)).sum();
    sum / (3 * triangles.len()).max(1) as f64
}

fn check_nodes(nodes: &[DVec3]) -> Result<(), String> {
    let mut places = HashMap::with_capacity(nodes.len());
    for (node, position) in nodes.iter().enumerate() {
        let node = node as u32;
        if !position.is_finite() {
            return Err(format!("node {node} has a coordinate that is not a finite number"));
        }
        if let Some(first) = places.insert(place(*position), node) {
            return Err(coincident([first, node], *position));
        }
    }
    Ok(())
}

/// The defect of two nodes at one place (m).
pub(super) fn coincident([first, second]: [u32; 2], place: DVec3) -> String {
    format!("nodes {first} and {second} lie at the same point {}: merge them", point(place))
}

/// A node as a message names it: by its number, from 0 and after nodes were merged, and by its place, which every
/// program finds.
pub(super) fn at(nodes: &[DVec3], node: u32) -> String {
    format!("node {node} at {}", point(nodes[node as usize]))
}

/// An edge, likewise.
fn between(nodes: &[DVec3], ends: [u32; 2]) -> String {
    let [a, b] = ends.map(|end| coordinates(nodes[end as usize]));
    format!("the edge from {a} to {b} m")
}

/// A point as a message gives it.
pub(super) fn point(place: DVec3) -> String {
    format!("{} m", coordinates(place))
}

/// The same without its unit.
fn coordinates(place: DVec3) -> String {
    let [x, y, z] = place.to_array();
    format!("({x:.4}, {y:.4}, {z:.4})")
}

/// The bits of a point: equal for equal points. Adding zero makes -0 into 0.
pub(super) fn place(position: DVec3) -> [u64; 3] {
    position.to_array().map(|x| (x + 0.0).to_bits())
}

fn check_triangles(nodes: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), String> {
    if triangles.is_empty() {
        return Err("the surface has no triangles: export its faces, not points or lines alone".into());
    }
    let mut seen = HashMap::with_capacity(triangles.len());
    for (triangle, corners) in triangles.iter().enumerate() {
        let triangle = triangle as u32;
        if let Some(&node) = corners.iter().find(|&&node| node as usize >= nodes.len()) {
            let count = nodes.len();
            return Err(format!("triangle {triangle} names node {node}, but there are only {count} nodes"));
        }
        let [a, b, c] = corners.map(|node| nodes[node as usize]);
        let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        let double_area = (b - a).cross(c - a).length();
        // Not `<=`, so that an overflow to infinity or NaN is refused as well.
        let proper = double_area > MIN_TRIANGLE_ASPECT * longest;
        if !proper {
            let place = point(a);
            return Err(format!("triangle {triangle} at {place} has no area: remove it or merge its nodes"));
        }
        let mut sorted = *corners;
        sorted.sort_unstable();
        if let Some(first) = seen.insert(sorted, triangle) {
            let place = point(a);
            return Err(format!("triangles {first} and {triangle} at {place} have the same three nodes: remove one"));
        }
    }
    Ok(())
}

fn triangles_around(nodes: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0u32; nodes + 1];
    for &node in triangles.as_flattened() {
        offsets[node as usize + 1] += 1;
    }
    for node in 0..nodes {
        offsets[node + 1] += offsets[node];
    }
    let mut next = offsets.clone();
    let mut around = vec![0; 3 * triangles.len()];
    for (triangle, corners) in triangles.iter().enumerate() {
        for &node in corners {
            around[next[node as usize] as usize] = triangle as u32;
            next[node as usize] += 1;
        }
    }
    (offsets, around)
}

/// One side of an edge: its ends in ascending order, its triangle, and which of the triangle's edges it is.
type Side = ([u32; 2], u32, usize);

/// The triangle across each edge of each triangle.
fn pair_edges(nodes: &[DVec3], triangles: &[[u32; 3]]) -> Result<Vec<[u32; 3]>, String> {
    let mut sides: Vec<Side> = Vec::with_capacity(3 * triangles.len());
    for (triangle, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            sides.push(([a.min(b), a.max(b)], triangle as u32, k));
        }
    }
    sides.sort_unstable();
    let mut across = vec![[0; 3]; triangles.len()];
    let mut open = None;
    let mut open_edges = 0;
    for group in sides.chunk_by(|a, b| a.0 == b.0) {
        match group {
            [(_, first, i), (_, second, j)] => {
                across[*first as usize][*i] = *second;
                across[*second as usize][*j] = *first;
            }
            [(ends, ..)] => {
                open_edges += 1;
                open.get_or_insert(*ends);
            }
            many => {
                let (edge, count) = (between(nodes, many[0].0), many.len());
                return Err(format!("the surface is not a manifold: {edge} has {count} triangles, not 2"));
            }
        }
    }
    match open {
        Some(ends) => Err(format!(
            "the surface is open: {} has a triangle on one side only ({} in all): close the holes, or merge vertices by \
             distance",
            between(nodes, ends),
            counted(open_edges, ["edge", "edges"])
        )),
        None => Ok(across),
    }
}

/// A connected part of the surface.
struct Part {
    triangles: Vec<u32>,
    /// Triangles that were turned to agree with the part's first.
    turned: usize,
}

/// Turns triangles so that neighbours run along their common edge in opposite senses; the parts that are connected.
fn orient(nodes: &[DVec3], triangles: &mut [[u32; 3]], across: &[[u32; 3]]) -> Result<Vec<Part>, String> {
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut parts = Vec::new();
    for seed in 0..triangles.len() {
        if turned[seed].is_some() {
            continue;
        }
        turned[seed] = Some(false);
        let mut part = Part { triangles: vec![seed as u32], turned: 0 };
        let mut next = 0;
        while let Some(&current) = part.triangles.get(next) {
            next += 1;
            let corners = triangles[current as usize];
            let current_turned = turned[current as usize] == Some(true);
            for k in 0..3 {
                let neighbour = across[current as usize][k];
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let wanted = runs_along(triangles[neighbour as usize], a, b) != current_turned;
                match turned[neighbour as usize] {
                    None => {
                        turned[neighbour as usize] = Some(wanted);
                        part.turned += usize::from(wanted);
                        part.triangles.push(neighbour);
                    }
                    Some(found) if found != wanted => {
                        return Err(format!(
                            "the surface has no inside: its triangles cannot be oriented alike across {}",
                            between(nodes, [a, b])
                        ));
                    }
                    Some(_) => {}
                }
            }
        }
        parts.push(part);
    }
    for (corners, turned) in triangles.iter_mut().zip(turned) {
        if turned == Some(true) {
            corners.swap(1, 2);
        }
    }
    Ok(parts)
}

/// Does the triangle run from a to b, rather than from b to a?
fn runs_along(corners: [u32; 3], a: u32, b: u32) -> bool {
    (0..3).any(|k| corners[k] == a && corners[(k + 1) % 3] == b)
}

/// Turns the parts whose signed volume is negative, or positive where they bound a cavity.
fn turn_outward(
    nodes: &[DVec3],
    triangles: &mut [[u32; 3]],
    parts: &[Part],
    warnings: &mut Vec<String>,
) -> Result<(), String> {
    let mut total_turned = 0;
    let mut cavities = 0;
    for part in parts {
        let seed = triangles[part.triangles[0] as usize][0];
        let origin = nodes[seed as usize];
        let (mut volume, mut size) = (0.0, 0.0);
        for &triangle in &part.triangles {
            let [a, b, c] = triangles[triangle as usize].map(|node| nodes[node as usize] - origin);
            let six_volumes = a.dot(b.cross(c));
            volume += six_volumes;
            size += a.length() * (b - a).cross(c - a).length();
        }
        let solid = volume.abs() > MIN_TRIANGLE_ASPECT * size;
        if !solid {
            let seed = at(nodes, seed);
            return Err(format!("the part of the surface around {seed} encloses no volume: it is folded flat"));
        }
        let mut turned = part.turned;
        let around = parts.iter().filter(|other| !std::ptr::eq(part, *other));
        let depth = around.filter(|other| surrounds(nodes, triangles, other, origin)).count();
        let cavity = depth % 2 == 1;
        cavities += usize::from(cavity);
        if (volume < 0.0) != cavity {
            turned = part.triangles.len() - turned;
            for &triangle in &part.triangles {
                triangles[triangle as usize].swap(1, 2);
            }
        }
        total_turned += turned;
    }
    if total_turned > 0 {
        let (all, were) = (triangles.len(), if total_turned == 1 { "was" } else { "were" });
        warnings.push(format!("{total_turned} of {all} triangles of the surface faced the material and {were} turned"));
    }
    if cavities > 0 {
        warnings.push(format!(
            "{} inside others and taken as walls of cavities",
            counted(cavities, ["closed shell lies", "closed shells lie"])
        ));
    }
    Ok(())
}

/// Whether the closed surface `part` winds around `point`: the solid angles of its triangles seen from there add up to
/// 4 pi inside and to 0 outside (van Oosterom & Strackee, The solid angle of a plane triangle, 1983).
fn surrounds(nodes: &[DVec3], triangles: &[[u32; 3]], part: &Part, point: DVec3) -> bool {
    let half_angle = |triangle: u32| {
        let [a, b, c] = triangles[triangle as usize].map(|node| nodes[node as usize] - point);
        let [la, lb, lc] = [a, b, c].map(DVec3::length);
        let product = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        a.dot(b.cross(c)).atan2(product)
    };
    part.triangles.iter().map(|&triangle| half_angle(triangle)).sum::<f64>().abs() > PI
}

/// Refuses nodes at which two sheets touch: walking from triangle to triangle must visit all triangles around the node.
fn check_fans(nodes: &[DVec3], topology: &Topology, triangles: &[[u32; 3]]) -> Result<(), String> {
    for node in 0..topology.around_offsets.len() - 1 {
        let around = topology.triangles_around(node);
        let mut current = around[0] as usize;
        let mut visited = 0;
        while visited < around.len() {
            visited += 1;
            let corner = triangles[current].iter().position(|&corner| corner as usize == node).unwrap_or(0);
            current = topology.across[current][corner] as usize;
            if current == around[0] as usize {
                break;
            }
        }
        if visited != around.len() {
            return Err(format!(
                "the surface is not a manifold: separate sheets meet at {} only: give each sheet a node of its own",
                at(nodes, node as u32)
            ));
        }
    }
    Ok(())
}

fn nodes_of(part: &[u32], triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut nodes: Vec<u32> = part.iter().flat_map(|&triangle| triangles[triangle as usize]).collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}
