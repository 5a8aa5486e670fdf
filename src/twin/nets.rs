//! A closed triangle mesh between the inside and the outside of a function in space: surface nets (Gibson 1998).
//!
//! Of the lattice's corners those with a value below zero are inside. Where two of them meet only along an edge or in a
//! corner, corners between them are taken inside, too, until none do: the border of such a well-composed set is a
//! manifold (Latecki 1997). Each cell that the border crosses has one node, each edge of the lattice that it crosses one
//! quadrilateral of the nodes around it. Nodes start at the mean of their cell's crossings, and are moved to the mean of
//! their neighbours and back to zero along the gradient, in turns, so that triangles become regular. None leaves its
//! cell, so that the surface does not cross itself.

use glam::{DVec3, IVec3};

/// Rounds of moving nodes to the mean of their neighbours.
const ROUNDS: usize = 6;

/// Distance of nodes from the faces of their cells, in cells (1): nodes of cells side by side do not meet.
const MARGIN: f64 = 0.05;

/// Number of no node.
const ABSENT: u32 = u32::MAX;

/// Corners of a cell, by the bits of their number.
fn corner(k: usize) -> IVec3 {
    IVec3::new((k & 1) as i32, (k >> 1 & 1) as i32, (k >> 2 & 1) as i32)
}

/// A lattice of corners.
struct Corners {
    counts: IVec3,
    values: Vec<f64>,
    inside: Vec<bool>,
}

impl Corners {
    fn number(&self, at: IVec3) -> usize {
        ((at.x * self.counts.y + at.y) * self.counts.z + at.z) as usize
    }

    fn places(counts: IVec3) -> impl Iterator<Item = IVec3> {
        let row = move |x, y| (0..counts.z).map(move |z| IVec3::new(x, y, z));
        (0..counts.x).flat_map(move |x| (0..counts.y).flat_map(move |y| row(x, y)))
    }

    /// Takes corners inside until the set is well-composed.
    fn compose(&mut self) {
        let mut changed = true;
        while std::mem::take(&mut changed) {
            for at in Self::places(self.counts - 1) {
                let numbers: [usize; 8] = std::array::from_fn(|k| self.number(at + corner(k)));
                // Opposite corners of a face, and of the cell.
                for (k, differing) in (0..8).flat_map(|k| [3, 5, 6, 7].map(|bits| (k, bits))) {
                    let inside = |k: usize| self.inside[numbers[k]];
                    let between =
                        (1..8).filter(|bits| bits & !differing == 0 && *bits != differing).map(|bits| k ^ bits);
                    if inside(k) != inside(k ^ differing) || between.clone().any(|b| inside(b) == inside(k)) {
                        continue;
                    }
                    let value = |k: &usize| self.values[numbers[*k]];
                    let nearest = between.min_by(|a, b| value(a).total_cmp(&value(b))).filter(|_| inside(k));
                    self.inside[numbers[nearest.unwrap_or(k)]] = true;
                    changed = true;
                }
            }
        }
    }
}

/// Returns nodes (m) and triangles, facing outward, of the surface `value` = 0 in the box between two corners (m), which
/// must lie outside, on a lattice of cells of `size` (m).
pub fn surface([low, high]: [DVec3; 2], size: f64, value: impl Fn(DVec3) -> f64 + Sync) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    use rayon::prelude::*;
    let counts = ((high - low) / size).ceil().as_ivec3().max(IVec3::ONE) + 1;
    let place = |at: IVec3| low + size * at.as_dvec3();
    let all: Vec<IVec3> = Corners::places(counts).collect();
    let is_border = |at: IVec3| at.cmpeq(IVec3::ZERO).any() || at.cmpeq(counts - 1).any();
    let values: Vec<f64> = all.par_iter().map(|&at| value(place(at))).collect();
    let inside = all.iter().zip(&values).map(|(at, value)| *value < 0.0 && !is_border(*at)).collect();
    let mut corners = Corners { counts, values, inside };
    corners.compose();
    let (mut nodes, mut cells, mut numbers) = (Vec::new(), Vec::new(), vec![ABSENT; all.len()]);
    for &at in all.iter().filter(|at| at.cmplt(counts - 1).all()) {
        let (mut sum, mut crossings) = (DVec3::ZERO, 0.0);
        for (a, b) in
            (0..8).flat_map(|k| [1, 2, 4].into_iter().filter(move |bit| k & bit == 0).map(move |bit| (k, k | bit)))
        {
            let [from, to] = [a, b].map(|k| at + corner(k));
            let [f, t] = [from, to].map(|at| corners.number(at));
            if corners.inside[f] != corners.inside[t] {
                let (v, w) = (corners.values[f], corners.values[t]);
                // A corner that was taken inside has the sign of the outside.
                let share = if v * w < 0.0 { v / (v - w) } else { 0.5 };
                sum += place(from).lerp(place(to), share);
                crossings += 1.0;
            }
        }
        if crossings > 0.0 {
            numbers[corners.number(at)] = nodes.len() as u32;
            nodes.push(sum / crossings);
            cells.push(place(at));
        }
    }
    let mut triangles = Vec::new();
    for &at in &all {
        for axis in 0..3 {
            let mut next = at;
            next[axis] += 1;
            if next[axis] == counts[axis] {
                continue;
            }
            let [from, to] = [at, next].map(|at| corners.inside[corners.number(at)]);
            if from == to {
                continue;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let around = [[1, 1], [0, 1], [0, 0], [1, 0]].map(|[du, dv]| {
                let mut cell = at;
                cell[u] -= du;
                cell[v] -= dv;
                numbers[corners.number(cell)]
            });
            let [a, b, c, d] = if from { around } else { [around[3], around[2], around[1], around[0]] };
            // Along the shorter diagonal.
            let length = |i: u32, j: u32| nodes[i as usize].distance_squared(nodes[j as usize]);
            match length(a, c) <= length(b, d) {
                true => triangles.extend([[a, b, c], [a, c, d]]),
                false => triangles.extend([[a, b, d], [b, c, d]]),
            }
        }
    }
    // In the order in which an OBJ file is read: numbers of nodes are then those of the body that is made of it.
    let mut order: Vec<u32> = Vec::with_capacity(nodes.len());
    let mut places = vec![None; nodes.len()];
    for corner in triangles.as_flattened_mut() {
        let old = *corner;
        *corner = *places[old as usize].get_or_insert_with(|| {
            order.push(old);
            order.len() as u32 - 1
        });
    }
    let [mut nodes, cells] = [nodes, cells].map(|all| order.iter().map(|&old| all[old as usize]).collect::<Vec<_>>());
    relax(&mut nodes, &triangles, (&cells, size), &value);
    (nodes, triangles)
}

/// Moves nodes to the mean of their neighbours, and back to the zero of `value`, some rounds. `cells`: the lowest corner
/// of that of each node, and their size (m).
fn relax(
    nodes: &mut Vec<DVec3>,
    triangles: &[[u32; 3]],
    (cells, size): (&[DVec3], f64),
    value: &(impl Fn(DVec3) -> f64 + Sync),
) {
    use rayon::prelude::*;
    for round in 0..=ROUNDS {
        let mut means = vec![(DVec3::ZERO, 0.0); nodes.len()];
        if round > 0 {
            for (a, b) in triangles.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]) {
                let mean = &mut means[a as usize];
                *mean = (mean.0 + nodes[b as usize], mean.1 + 1.0);
            }
        }
        let moved = nodes.par_iter().zip(&means).zip(cells).map(|((node, (sum, count)), cell)| {
            let x = if *count > 0.0 { 0.5 * (*node + *sum / *count) } else { *node };
            let [low, high] = [*cell + MARGIN * size, *cell + (1.0 - MARGIN) * size];
            let moved = project(x, size, value);
            let stays = moved.cmpge(low).all() && moved.cmple(high).all();
            if stays || round == 0 { moved.clamp(low, high) } else { *node }
        });
        *nodes = moved.collect();
    }
}

/// Moves `x` along the gradient of `value`, by differences, to its zero: two steps of Newton, none longer than half a
/// cell.
fn project(mut x: DVec3, size: f64, value: impl Fn(DVec3) -> f64) -> DVec3 {
    let step = 1e-3 * size;
    for _ in 0..2 {
        let slope = DVec3::AXES.map(|e| (value(x + step * e) - value(x - step * e)) / (2.0 * step));
        let gradient = DVec3::from_array(slope);
        let move_by = -value(x) * gradient / gradient.length_squared().max(f64::MIN_POSITIVE);
        x += move_by.clamp_length_max(0.5 * size);
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::Topology;
    use crate::random::Random;

    #[test]
    fn a_ball_is_closed_faces_outward_and_has_its_volume() {
        let box_ = [DVec3::splat(-0.062), DVec3::splat(0.063)];
        let (nodes, triangles) = surface(box_, 0.006, |x| x.length() - 0.05);
        Topology::of(&nodes, &mut triangles.clone());
        let volume: f64 = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|k| nodes[k as usize]);
                a.dot(b.cross(c)) / 6.0
            })
            .sum();
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.05_f64.powi(3);
        assert!((volume / ball - 1.0).abs() < 0.02, "{volume} {ball}");
        // But for nodes that would leave their cells.
        assert!(nodes.iter().all(|x| (x.length() - 0.05).abs() < 0.0006));
        assert!(nodes.iter().filter(|x| (x.length() - 0.05).abs() > 1e-6).count() < nodes.len() / 5);
    }

    /// Sums of random waves touch themselves along edges and in corners of the lattice.
    #[test]
    fn surfaces_of_any_function_are_manifolds() {
        for seed in 0..20 {
            let waves = Random::vectors(6, seed);
            let value = |x: DVec3| waves.iter().map(|k| (4.0 * k.dot(x) + k.z).sin()).sum::<f64>() + 0.4;
            let (nodes, triangles) = surface([DVec3::splat(-1.0), DVec3::splat(1.0)], 0.21, value);
            assert!(triangles.len() > 20);
            Topology::of(&nodes, &mut triangles.clone());
        }
    }
}
