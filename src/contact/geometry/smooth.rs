//! The smooth contact surface: the limit of Loop's subdivision of a control net that moves with the object's nodes.
//!
//! Where all corners of a facet have six neighbours the limit is a box spline, a triangle of degree four whose control
//! points are sums of the facet's twelve nodes (C. Loop, Smooth subdivision surfaces based on triangles, 1987; M. J.
//! Lai, Fortran subroutines for B-nets of box splines, 1992). It is twice continuously differentiable from facet to
//! facet. At a corner with another number of neighbours the control points next to it are chosen so that the surface
//! goes through Loop's limit point with Loop's limit tangents: it is continuous, and its normal is continuous at the
//! corner and nearly so along the edges that leave it.
//!
//! At rest the control net is the mesh plus an offset for which the surface passes through the mesh's nodes.
//! Displacements of nodes move the control net, so every point of the surface is a linear function of them.

use super::facet::{Direction, Facet};
use super::quartic::{CONTROLS, EXPONENTS, basis, basis_slopes, place};
use crate::object::Topology;
use glam::DVec3;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// Neighbours of a node up to which the surface is smooth there. At others, which no mesh has that is fit for
/// mechanics, it keeps the corner.
const MOST_NEIGHBOURS: usize = 10;

/// Nodes on which a facet depends at most: its corners and all their neighbours.
pub const CARRIERS: usize = 3 * MOST_NEIGHBOURS - 6;

/// Corrections of the control net at rest. Each multiplies the square of edge length over radius of curvature by which
/// the surface misses the nodes, so that the third is beyond the sixth order.
const CORRECTIONS: usize = 3;

/// The facets' nodes, and how each hangs on them.
pub struct SmoothSurface {
    /// Nodes of all triangles, one triangle after the other: see [`Shape`].
    nodes: Vec<u32>,
    /// Where those of each triangle begin, and where the last ends.
    starts: Vec<u32>,
    shapes: Vec<Shape>,
    /// The shape of each triangle.
    shape: Vec<u32>,
    /// From each node to its point of the control net, at rest (m).
    offsets: Vec<DVec3>,
}

/// How the control points of a facet hang on its nodes.
///
/// Nodes 0 to 2 are its corners, 3 + k is that across edge k. Those between, of which a corner with n neighbours has n
/// - 4, follow corner by corner, anticlockwise.
pub struct Shape {
    /// Number of nodes.
    count: usize,
    /// Nodes and weights of each control point.
    masks: [Vec<(u8, f64)>; CONTROLS],
}

impl Shape {
    /// The number of that whose corners all have six neighbours, in any surface.
    pub const REGULAR: u32 = 0;

    /// That of a facet whose corners have so many neighbours; zero stands for a corner that is kept.
    #[must_use]
    pub fn new(neighbours: [usize; 3]) -> Self {
        let mut count = 6;
        let mut masks: [Vec<(u8, f64)>; CONTROLS] = Default::default();
        for (corner, n) in neighbours.into_iter().enumerate() {
            let (next, last) = ((corner + 1) % 3, (corner + 2) % 3);
            let (before, after) = (3 + corner, 3 + last);
            let of = |at: [(usize, usize); 3]| {
                let mut exponents = [0; 3];
                at.iter().for_each(|&(k, exponent)| exponents[k] = exponent);
                place(exponents)
            };
            masks[of([(corner, 2), (next, 2), (last, 0)])] =
                weighted(&[(corner, 8.0), (next, 8.0), (last, 4.0), (before, 4.0)]);
            masks[of([(corner, 2), (next, 1), (last, 1)])] =
                weighted(&[(corner, 10.0), (next, 6.0), (last, 6.0), (before, 1.0), (after, 1.0)]);
            let between = count;
            let around: Vec<usize> = (0..n)
                .map(|i| match i {
                    0 => next,
                    1 => last,
                    2 => after,
                    _ if i + 1 == n => before,
                    _ => between + i - 3,
                })
                .collect();
            count += n.saturating_sub(4);
            masks[of([(corner, 4), (next, 0), (last, 0)])] = limit(corner, &around).collect();
            masks[of([(corner, 3), (next, 1), (last, 0)])] = beside(corner, &around, 0, next);
            masks[of([(corner, 3), (next, 0), (last, 1)])] = beside(corner, &around, 1, last);
        }
        Self { count, masks }
    }

    /// The facet whose control net has these nodes (m).
    #[inline]
    #[must_use]
    pub fn facet(&self, at: impl Fn(usize) -> DVec3) -> Facet {
        let mut nodes = [DVec3::ZERO; CARRIERS];
        nodes[..self.count].iter_mut().enumerate().for_each(|(j, node)| *node = at(j));
        let mut net = [DVec3::ZERO; CONTROLS];
        for (control, mask) in net.iter_mut().zip(&self.masks) {
            for &(j, weight) in mask {
                *control += nodes[usize::from(j)] * weight;
            }
        }
        Facet::bent(net)
    }

    /// The weight of node `j` in each control point (1).
    #[must_use]
    pub fn mask_of(&self, j: usize) -> [f64; CONTROLS] {
        let weight = |mask: &Vec<(u8, f64)>| {
            let own = mask.iter().filter(|(node, _)| usize::from(*node) == j);
            own.map(|(_, weight)| weight).sum()
        };
        self.masks.each_ref().map(weight)
    }

    /// The weights of its nodes in its point at barycentric weights `w` (1).
    #[inline]
    #[must_use]
    pub fn point_weights(&self, w: [f64; 3]) -> [f64; CARRIERS] {
        self.spread(basis(w))
    }

    /// Their derivative at `w` along `d`.
    #[inline]
    #[must_use]
    pub fn point_slopes(&self, w: [f64; 3], d: Direction) -> [f64; CARRIERS] {
        self.spread(basis_slopes(w, d))
    }

    #[inline]
    fn spread(&self, controls: [f64; CONTROLS]) -> [f64; CARRIERS] {
        let mut weights = [0.0; CARRIERS];
        for (control, mask) in controls.into_iter().zip(&self.masks) {
            for &(j, weight) in mask {
                weights[usize::from(j)] += control * weight;
            }
        }
        weights
    }
}

/// A mask whose weights are given in twenty-fourths.
fn weighted(terms: &[(usize, f64)]) -> Vec<(u8, f64)> {
    terms.iter().map(|&(node, weight)| (node as u8, weight / 24.0)).collect()
}

/// Weight of each of n neighbours in the limit point of Loop's scheme; the node itself has what is left of one.
fn limit_weight(n: usize) -> f64 {
    let n_ = n as f64;
    let beta = (5.0 / 8.0 - (3.0 / 8.0 + (TAU / n_).cos() / 4.0).powi(2)) / n_;
    if n == 0 { 0.0 } else { (3.0 / (8.0 * beta) + n_).recip() }
}

/// The mask of the limit point of `corner`, which has neighbours `around`.
fn limit(corner: usize, around: &[usize]) -> impl Iterator<Item = (u8, f64)> {
    let weight = limit_weight(around.len());
    let own = (corner as u8, 1.0 - weight * around.len() as f64);
    std::iter::once(own).chain(around.iter().map(move |&node| (node as u8, weight)))
}

/// The mask of the control point next to `corner` towards its neighbour number `towards`, which is the node `end`: a
/// quarter of the limit tangent further.
fn beside(corner: usize, around: &[usize], towards: usize, end: usize) -> Vec<(u8, f64)> {
    if around.is_empty() {
        return vec![(corner as u8, 0.75), (end as u8, 0.25)];
    }
    let n = around.len() as f64;
    let mut mask: Vec<(u8, f64)> = limit(corner, around).collect();
    for (i, (_, weight)) in mask[1..].iter_mut().enumerate() {
        *weight += 0.5 / n * (TAU * (i as f64 - towards as f64) / n).cos();
    }
    mask
}

impl SmoothSurface {
    /// Prepares the smooth surface through the nodes of a closed mesh at `positions` (m).
    #[must_use]
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]], topology: &Topology) -> Self {
        let mut surface = Self {
            nodes: Vec::new(),
            starts: vec![0],
            shapes: vec![Shape::new([6; 3])],
            shape: Vec::new(),
            offsets: offsets(positions, triangles, topology),
        };
        let mut known = HashMap::from([([6; 3], Shape::REGULAR)]);
        for t in 0..triangles.len() {
            surface.nodes.extend(&triangles[t]);
            surface.nodes.extend((0..3).map(|k| {
                let (across, back) = across(triangles, topology, t, k);
                triangles[across][(back + 2) % 3]
            }));
            let neighbours = [0, 1, 2].map(|k| {
                let around = around(triangles, topology, t, k);
                let n = if around.len() > MOST_NEIGHBOURS { 0 } else { around.len() };
                surface.nodes.extend(around[..n].get(3..n.max(4) - 1).unwrap_or_default());
                n
            });
            surface.starts.push(surface.nodes.len() as u32);
            let shapes = &mut surface.shapes;
            surface.shape.push(*known.entry(neighbours).or_insert_with(|| {
                shapes.push(Shape::new(neighbours));
                shapes.len() as u32 - 1
            }));
        }
        surface
    }

    /// The nodes on which facet `t` depends: its corners first.
    #[inline]
    #[must_use]
    pub fn nodes(&self, t: u32) -> &[u32] {
        &self.nodes[self.starts[t as usize] as usize..self.starts[t as usize + 1] as usize]
    }

    /// Returns how facet `t` hangs on them.
    #[inline]
    #[must_use]
    pub fn shape(&self, t: u32) -> &Shape {
        &self.shapes[self.shape[t as usize] as usize]
    }

    /// Facet `t` with nodes at `positions` (m).
    #[inline]
    #[must_use]
    pub fn facet(&self, positions: &[DVec3], t: u32) -> Facet {
        let nodes = self.nodes(t);
        self.shape(t).facet(|j| positions[nodes[j] as usize] + self.offsets[nodes[j] as usize])
    }

    /// From `node` to its point of the control net, at rest (m).
    #[must_use]
    pub fn offset(&self, node: u32) -> DVec3 {
        self.offsets[node as usize]
    }

    /// All shapes.
    #[must_use]
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// The number of the shape of facet `t` among them.
    #[must_use]
    pub fn shape_number(&self, t: u32) -> u32 {
        self.shape[t as usize]
    }

    /// Returns by how much `facets`, all of it, stand off the flat triangles of the mesh at most, whose nodes are at
    /// `positions` (m).
    #[must_use]
    pub fn bulge(&self, positions: &[DVec3], facets: &[Facet]) -> f64 {
        let farthest = |(t, facet): (usize, &Facet)| {
            let corners = [0, 1, 2].map(|k| positions[self.nodes(t as u32)[k] as usize]);
            facet.net.iter().flatten().zip(EXPONENTS).map(|(b, at)| b.distance(flat(corners, at))).fold(0.0, f64::max)
        };
        facets.iter().enumerate().map(farthest).fold(0.0, f64::max)
    }

    /// Returns a bound of the square of what displacements move the facets off the flat triangles by, where `square`
    /// bounds that of a sum of nodes' displacements, given as nodes and their weights. No point of a facet moves off
    /// more than all its control points do.
    pub fn bulge_squared(&self, square: impl Fn(&[(u32, f64)]) -> f64) -> f64 {
        let mut most = 0.0_f64;
        let mut terms = Vec::new();
        for t in 0..self.shape.len() as u32 {
            let nodes = self.nodes(t);
            for (mask, at) in self.shape(t).masks.iter().zip(EXPONENTS) {
                terms.clear();
                terms.extend(mask.iter().map(|&(j, weight)| (nodes[usize::from(j)], weight)));
                terms.extend((0..3).map(|k| (nodes[k], -0.25 * at[k] as f64)));
                most = most.max(square(&terms));
            }
        }
        most
    }
}

/// The point of a flat triangle where a control point with these exponents would be.
fn flat(corners: [DVec3; 3], at: [usize; 3]) -> DVec3 {
    (corners[0] * at[0] as f64 + corners[1] * at[1] as f64 + corners[2] * at[2] as f64) / 4.0
}

/// From each node to its point of the control net whose limit passes through the nodes at `positions` (m).
fn offsets(positions: &[DVec3], triangles: &[[u32; 3]], topology: &Topology) -> Vec<DVec3> {
    let neighbours: Vec<Vec<u32>> = (0..positions.len())
        .map(|node| {
            let first = topology.triangles_around(node).first().copied().unwrap_or(0) as usize;
            let k = triangles[first].iter().position(|&corner| corner as usize == node);
            let around = k.map_or(Vec::new(), |k| around(triangles, topology, first, k));
            if around.len() > MOST_NEIGHBOURS { Vec::new() } else { around }
        })
        .collect();
    let mut offsets = vec![DVec3::ZERO; positions.len()];
    for _ in 0..CORRECTIONS {
        let net: Vec<DVec3> = positions.iter().zip(&offsets).map(|(position, offset)| *position + *offset).collect();
        for (i, (offset, around)) in offsets.iter_mut().zip(&neighbours).enumerate() {
            let weight = limit_weight(around.len());
            let moved: DVec3 = around.iter().map(|&node| (net[node as usize] - net[i]) * weight).sum();
            *offset += positions[i] - (net[i] + moved);
        }
    }
    offsets
}

/// The neighbours of corner `k` of triangle `t`, anticlockwise from corner k + 1.
fn around(triangles: &[[u32; 3]], topology: &Topology, t: usize, k: usize) -> Vec<u32> {
    let mut around = vec![triangles[t][(k + 1) % 3]];
    let (mut at, mut corner) = (t, k);
    loop {
        let end = triangles[at][(corner + 2) % 3];
        (at, corner) = across(triangles, topology, at, (corner + 2) % 3);
        if at == t {
            return around;
        }
        around.push(end);
    }
}

/// Returns the triangle across edge `k` of triangle `t`, and which of its edges that is.
#[must_use]
pub fn across(triangles: &[[u32; 3]], topology: &Topology, t: usize, k: usize) -> (usize, usize) {
    let across = topology.across[t][k] as usize;
    let end = triangles[t][(k + 1) % 3];
    (across, triangles[across].iter().position(|&corner| corner == end).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use glam::DVec2;

    /// A closed mesh with nodes of 3, 6, 8 and 16 neighbours: a bipyramid over an octagon, its upper faces raised about
    /// their middles.
    fn mixed() -> (Vec<DVec3>, Vec<[u32; 3]>, Topology) {
        const SIDES: u32 = 8;
        let corner = |i: u32| DVec3::from((DVec2::from_angle(TAU * f64::from(i) / f64::from(SIDES)), 0.0));
        let mut positions: Vec<DVec3> = (0..SIDES).map(corner).chain([DVec3::Z, -DVec3::Z]).collect();
        let (top, bottom) = (SIDES, SIDES + 1);
        let mut triangles = Vec::new();
        for i in 0..SIDES {
            let next = (i + 1) % SIDES;
            let middle = positions.len() as u32;
            positions.push((corner(i) + corner(next) + DVec3::Z) * 0.4);
            triangles.extend([[next, i, bottom], [i, next, middle], [next, top, middle], [top, i, middle]]);
        }
        let topology = Topology::of(&positions, &mut triangles);
        (positions, triangles, topology)
    }

    /// A point of the limit surface of a regular net by brute force: Loop's subdivision over and over of a patch of the
    /// triangular lattice with heights `height`, at barycentric weights `w` of the triangle (0, 0), (1, 0), (0, 1).
    fn subdivided(height: impl Fn(i64, i64) -> f64, w: [f64; 3]) -> f64 {
        let mut net: HashMap<(i64, i64), f64> = HashMap::new();
        for i in -3..=4 {
            for j in -3..=4 {
                net.insert((i, j), height(i, j));
            }
        }
        const AROUND: [(i64, i64); 6] = [(1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1)];
        let levels = 9;
        let (mut u, mut v) = (w[1], w[2]);
        for _ in 0..levels {
            (u, v) = (2.0 * u, 2.0 * v);
            let (a, b) = (u.floor() as i64, v.floor() as i64);
            let old = |i: i64, j: i64| net[&(i, j)];
            let node = |i: i64, j: i64| match (i.rem_euclid(2), j.rem_euclid(2)) {
                (0, 0) => {
                    let (i, j) = (i / 2, j / 2);
                    old(i, j) * 10.0 / 16.0 + AROUND.iter().map(|(k, l)| old(i + k, j + l)).sum::<f64>() / 16.0
                }
                (x, y) => {
                    // The ends of the edge, and the corners on either side.
                    let (di, dj) = if (x, y) == (1, 1) { (1, -1) } else { (x, y) };
                    let (p, q) = (((i - di) / 2, (j - dj) / 2), ((i + di) / 2, (j + dj) / 2));
                    let sides = AROUND
                        .iter()
                        .map(|(k, l)| (p.0 + k, p.1 + l))
                        .filter(|side| AROUND.iter().any(|(k, l)| (q.0 + k, q.1 + l) == *side));
                    3.0 / 8.0 * (old(p.0, p.1) + old(q.0, q.1))
                        + sides.map(|side| old(side.0, side.1)).sum::<f64>() / 8.0
                }
            };
            let mut finer = HashMap::new();
            for i in a - 2..=a + 3 {
                for j in b - 2..=b + 3 {
                    finer.insert((i - a, j - b), node(i, j));
                }
            }
            net = finer;
            (u, v) = (u - a as f64, v - b as f64);
        }
        net[&(0, 0)] + u * (net[&(1, 0)] - net[&(0, 0)]) + v * (net[&(0, 1)] - net[&(0, 0)])
    }

    /// The nodes of a regular facet on the triangular lattice, in the order of [`Shape`].
    const LATTICE: [(i64, i64); 12] =
        [(0, 0), (1, 0), (0, 1), (1, -1), (1, 1), (-1, 1), (-1, 0), (0, -1), (2, -1), (2, 0), (0, 2), (-1, 2)];

    /// Between six neighbours each the control points are those of the limit of subdivision.
    #[test]
    fn a_regular_facet_is_the_limit_of_subdivision() {
        let shape = Shape::new([6, 6, 6]);
        let mut random = Random::new(8);
        for _ in 0..20 {
            let heights: HashMap<(i64, i64), f64> = (-3..=4)
                .flat_map(|i| (-3..=4).map(move |j| (i, j)))
                .map(|at| (at, random.between(-1.0, 1.0)))
                .collect();
            let (u, v) = (random.between(0.0, 0.5), random.between(0.0, 0.5));
            let w = [1.0 - u - v, u, v];
            let facet = shape.facet(|j| DVec3::splat(heights[&LATTICE[j]]));
            let expected = subdivided(|i, j| heights[&(i, j)], w);
            // Nine levels leave 4^-9 of the second differences.
            assert!((facet.point(w).x - expected).abs() < 1e-4, "{} {expected}", facet.point(w).x);
            let weights = shape.point_weights(w);
            let sum: f64 = LATTICE.iter().zip(weights).map(|(at, weight)| heights[at] * weight).sum();
            assert!((sum - facet.point(w).x).abs() < 1e-14);
        }
    }

    /// On a mesh of all kinds of nodes: the surface is continuous, passes close to the nodes, its normal is continuous
    /// at the nodes whose neighbours are few enough, and moving all nodes moves it as much.
    #[test]
    fn facets_join_on_any_mesh() {
        let (positions, triangles, topology) = mixed();
        let surface = SmoothSurface::new(&positions, &triangles, &topology);
        let (mut smooth, mut kept) = (0, 0);
        for t in 0..triangles.len() {
            let facet = surface.facet(&positions, t as u32);
            for k in 0..3 {
                let (other, back) = across(&triangles, &topology, t, k);
                let there = surface.facet(&positions, other as u32);
                for share in [0.0, 0.3, 0.9] {
                    let (mut here, mut beyond) = ([0.0; 3], [0.0; 3]);
                    (here[k], here[(k + 1) % 3]) = (1.0 - share, share);
                    (beyond[(back + 1) % 3], beyond[back]) = (1.0 - share, share);
                    assert!((facet.point(here) - there.point(beyond)).length() < 1e-14);
                    if share == 0.0 {
                        let angle = facet.normal(here).angle_between(there.normal(beyond));
                        if around(&triangles, &topology, t, k).len() <= MOST_NEIGHBOURS {
                            smooth += 1;
                            assert!(angle < 1e-6, "{angle}");
                        } else {
                            kept += 1;
                            assert!(angle > 1e-2, "{angle}");
                        }
                        let node = positions[triangles[t][k] as usize];
                        assert!(facet.point(here).distance(node) < 0.1, "{}", facet.point(here).distance(node));
                    }
                }
            }
            let shape = surface.shape(t as u32);
            let weights = shape.point_weights([0.2, 0.5, 0.3]);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert_eq!(surface.nodes(t as u32).len(), shape.count);
        }
        assert!(smooth >= 80 && kept >= 16, "{smooth} {kept}");
    }
}
