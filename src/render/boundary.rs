//! The boundary layer: the contact torque rises from zero at the object's boundary with a slope of at most Ks
//! (section 3.1), continuous in q and without memory.
//!
//! *Where the boundary is.* The paper interpolates the contact index I (1 in contact, 0 free) linearly and calls
//! `I_bar > Ith` contact. There the torque jumps from zero to about `Ith |tau|`.
//!
//! *Units.* Ks is given joint by joint. Distances are measured as `|q|_K = sqrt(sum_a Ks_a q_a^2)` and torques as
//! `|tau|_K = sqrt(sum_a tau_a^2 / Ks_a)`, both in square roots of joules: radians and metres mix rightly, and slope Ks
//! becomes slope one.
//!
//! *Depth.* Every grid point has a level: 0 where free; 1 within a king's move (one step along any axes at once) of a
//! free point; `1 + g E` beyond, E the distance `|.|_K` to the points of level 0 or 1 and
//! `g = sqrt(sum_a 1/(Ks_a h_a^2))`. E solves the eikonal equation `|grad E| = 1` on the grid, by fast marching (Sethian
//! 1996): exact behind flat boundaries in any direction, and without the steps of distances from point to point. In a cell with a free corner every other corner has level 1 = I: there the
//! interpolated level is I_bar; in all other cells it is at least 1. The contact region `level > Ith` is thus exactly the
//! paper's. In a mixed cell levels differ by at most one along an edge, so that the level changes by at most `g |dq|_K`;
//! in the others by at most `g G |dq|_K`, G the greatest gradient of the interpolated E, which is computed: between 1 and
//! sqrt(d), 1.0 to 1.4 behind flat boundaries, depending on how they meet the grid's rim. With E / G in place of E,
//! `s(q) = max(0, level(q) - Ith) / g` is a depth below the boundary that grows by no more than the distance travelled:
//! `|s(q) - s(q')| <= |q - q'|_K`, across cell faces too.
//!
//! *Torque.* The interpolated torque is shortened, in its own direction, to at most s: `tau_bar = tau min(1, s / |tau|_K)`,
//! the projection of tau onto the ball of radius s. Projections onto a ball move two points no further apart, nor by
//! more than the change of radius, so that `|tau_bar(q) - tau_bar(q')|_K <= (L + 1) |q - q'|_K`, L the Lipschitz bound
//! of tau in these measures. The layer's own slope is Ks / G and never above Ks; within the first cell it is less, Ks / d
//! at worst. Where the object is softer than that, the dataset's torque is untouched; a stiffer one is rendered with
//! slope Ks, the stiffest that the passivity condition lets through.

use super::stencil::Lattice;
use crate::{JointVector, MAX_JOINTS};
use std::{cmp::Reverse, collections::BinaryHeap};

/// The layer of one grid: its slope, threshold and unit of depth.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryLayer {
    threshold: f64,
    /// 1 / Ks_a [rad/(N m)].
    compliance: JointVector,
    /// g [1/sqrt(J)].
    density: f64,
}

/// Stands for the distance to a free point where there is none: beyond any grid, and finite, so that a weight of zero
/// times it is zero.
const NOTHING_FREE: f64 = 1e100;

impl BoundaryLayer {
    /// A layer of slope `slope` Ks, one positive number per joint [N m/rad], from contact index `threshold` Ith on.
    #[must_use]
    pub fn new(lattice: &Lattice, threshold: f64, slope: &JointVector) -> Self {
        let mut compliance = *slope;
        compliance.iter_mut().for_each(|slope| *slope = 1.0 / *slope);
        let density = lattice.lines().zip(compliance.iter()).map(|((_, step, _), c)| c / (step * step)).sum::<f64>();
        Self { threshold, compliance, density: density.sqrt() }
    }

    /// Ith.
    #[must_use]
    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// `|torque|_K` [sqrt(J)].
    #[must_use]
    pub fn size(&self, torque: &[f64]) -> f64 {
        torque.iter().zip(self.compliance.iter()).map(|(tau, c)| tau * tau * c).sum::<f64>().sqrt()
    }

    /// Depth s at interpolated level `level` [sqrt(J)].
    #[must_use]
    pub fn depth(&self, level: f64) -> f64 {
        let beyond = level - self.threshold;
        if beyond > 0.0 { beyond / self.density } else { 0.0 }
    }

    /// The factor that shortens `torque` [N m] to the depth at `level`; one where it is short enough.
    #[must_use]
    pub fn share(&self, torque: &[f64], level: f64) -> f64 {
        let (depth, size) = (self.depth(level), self.size(torque));
        if size > depth { depth / size } else { 1.0 }
    }

    /// Level of each grid point. `greatest`: largest size of a torque in the dataset [sqrt(J)]; depths beyond it are
    /// told apart no further, since nothing is held back there.
    #[must_use]
    pub fn levels(&self, lattice: &Lattice, free: &[bool], greatest: f64) -> Vec<f64> {
        let near = beside(lattice, free);
        if !near.contains(&true) {
            return vec![NOTHING_FREE; free.len()];
        }
        let depth = self.distances(lattice, &near, greatest * (lattice.joints() as f64).sqrt());
        let steepest = self.steepest(lattice, &depth);
        let level = |(&free, &depth): (&bool, &f64)| if free { 0.0 } else { 1.0 + self.density * depth / steepest };
        free.iter().zip(&depth).map(level).collect()
    }

    /// Distance [sqrt(J)] of each grid point to the points of `origins`, or `farthest` where that is less.
    ///
    /// Points are settled in the order of their distance, each from its settled neighbours.
    fn distances(&self, lattice: &Lattice, origins: &[bool], farthest: f64) -> Vec<f64> {
        let mut distance: Vec<f64> = origins.iter().map(|&at| if at { 0.0 } else { farthest }).collect();
        // Distances are not negative: their bits are in the same order as they.
        let mut queue: BinaryHeap<Reverse<(u64, usize)>> =
            (0..origins.len()).filter(|&point| origins[point]).map(|point| Reverse((0, point))).collect();
        let mut settled = vec![false; origins.len()];
        while let Some(Reverse((_, point))) = queue.pop() {
            if std::mem::replace(&mut settled[point], true) {
                continue;
            }
            for (count, _, stride) in lattice.lines() {
                for neighbour in neighbours(point, count, stride).into_iter().flatten().filter(|&p| !settled[p]) {
                    let found = self.behind(lattice, neighbour, &distance, &settled);
                    if found < distance[neighbour] {
                        distance[neighbour] = found;
                        queue.push(Reverse((found.to_bits(), neighbour)));
                    }
                }
            }
        }
        distance
    }

    /// The eikonal equation at `point`: the u with `sum_a (u - u_a)^2 / (Ks_a h_a^2) = 1` over the axes whose nearer
    /// settled neighbour u_a lies below u.
    fn behind(&self, lattice: &Lattice, point: usize, distance: &[f64], settled: &[bool]) -> f64 {
        let mut below = [(f64::INFINITY, 0.0); MAX_JOINTS];
        for (((count, step, stride), compliance), below) in lattice.lines().zip(self.compliance.iter()).zip(&mut below)
        {
            let nearer = neighbours(point, count, stride).into_iter().flatten().filter(|&p| settled[p]);
            *below = (nearer.map(|p| distance[p]).fold(f64::INFINITY, f64::min), compliance / (step * step));
        }
        below.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        // w u^2 - 2 p u + q = 1 with the sums over the axes taken so far.
        let (mut w, mut p, mut q, mut found) = (0.0, 0.0, 0.0, f64::INFINITY);
        for (value, weight) in below {
            if value >= found {
                break;
            }
            (w, p, q) = (w + weight, p + weight * value, q + weight * value * value);
            found = (p + (p * p - w * (q - 1.0)).max(0.0).sqrt()) / w;
        }
        found
    }

    /// Greatest gradient of the interpolated `depth`, at least one: at a corner of a cell its components are the
    /// differences along the edges that meet there, and nowhere in the cell is it greater.
    fn steepest(&self, lattice: &Lattice, depth: &[f64]) -> f64 {
        let square = |point: usize| {
            let along = |((count, step, stride), compliance): ((usize, f64, usize), &f64)| {
                let rise =
                    neighbours(point, count, stride).map(|p| p.map_or(0.0, |p| (depth[point] - depth[p]).powi(2)));
                rise[0].max(rise[1]) * compliance / (step * step)
            };
            lattice.lines().zip(self.compliance.iter()).map(along).sum::<f64>()
        };
        (0..depth.len()).map(square).fold(1.0, f64::max).sqrt()
    }
}

/// The points before and after `point` along the axis with `count` points and `stride`.
fn neighbours(point: usize, count: usize, stride: usize) -> [Option<usize>; 2] {
    let position = Lattice::position(point, count, stride);
    [(position > 0).then(|| point - stride), (position + 1 < count).then(|| point + stride)]
}

/// The points of `set` and all within a king's move of one.
fn beside(lattice: &Lattice, set: &[bool]) -> Vec<bool> {
    let mut grown = set.to_vec();
    for (count, _, stride) in lattice.lines() {
        let before = grown.clone();
        for (point, grown) in grown.iter_mut().enumerate() {
            *grown |= neighbours(point, count, stride).into_iter().flatten().any(|p| before[p]);
        }
    }
    grown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::synthetic::grid;

    fn slope(values: &[f64]) -> JointVector {
        JointVector::from_slice(values)
    }

    /// Numbers that look random, the same every time.
    fn scattered(lattice: &Lattice, sparsity: u64) -> Vec<bool> {
        let mut seed = 12345_u64;
        let mut next = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 33).is_multiple_of(sparsity)
        };
        let mut free: Vec<bool> = (0..lattice.points()).map(|_| next()).collect();
        free[lattice.points() / 2] = true;
        free
    }

    #[test]
    fn levels_keep_the_contact_index_beside_free_points_and_rise_beyond() {
        let cases = [
            (vec![(0.0, 0.1, 17)], vec![2.0]),
            (vec![(0.0, 0.1, 9), (0.0, 0.2, 8)], vec![2.0, 5.0]),
            (vec![(0.0, 1.0, 6), (0.0, 0.5, 7), (0.0, 2.0, 5)], vec![1.0, 3.0, 0.5]),
        ];
        for (axes, slopes) in cases {
            let lattice = Lattice::new(&grid(&axes)).unwrap();
            let layer = BoundaryLayer::new(&lattice, 0.5, &slope(&slopes));
            for sparsity in [3, 20, 100] {
                let free = scattered(&lattice, sparsity);
                let levels = layer.levels(&lattice, &free, 1e9);
                let steps = |p: usize, q: usize| {
                    let along = |(count, _, stride)| {
                        Lattice::position(p, count, stride).abs_diff(Lattice::position(q, count, stride))
                    };
                    lattice.lines().map(along).max().unwrap()
                };
                for (p, &level) in levels.iter().enumerate() {
                    match (0..free.len()).filter(|&q| free[q]).map(|q| steps(p, q)).min() {
                        Some(0) => assert_eq!(level, 0.0),
                        Some(1) => assert_eq!(level, 1.0),
                        _ => assert!(level > 1.0 && level < 100.0, "{level}"),
                    }
                }
                let depth: Vec<f64> = levels.iter().map(|level| (level - 1.0).max(0.0) / layer.density).collect();
                assert!(layer.steepest(&lattice, &depth) <= 1.0 + 1e-12);
            }
        }
    }

    #[test]
    fn behind_a_flat_boundary_of_any_direction_depth_grows_by_the_distance_travelled() {
        let lattice = Lattice::new(&grid(&[(0.0, 0.1, 16); 3])).unwrap();
        let layer = BoundaryLayer::new(&lattice, 0.5, &slope(&[1.0; 3]));
        let position = |p: usize| lattice.lines().map(move |(count, _, stride)| Lattice::position(p, count, stride));
        for directions in [1, 2, 3] {
            let along = |p: usize| position(p).take(directions).sum::<usize>();
            let free: Vec<bool> = (0..lattice.points()).map(|p| along(p) < 2 * directions).collect();
            let levels = layer.levels(&lattice, &free, 1e9);
            // The boundary is notched where it meets the grid's rim, which is what G is above one for.
            let at = |k: usize| layer.depth(levels[k * (256 + 16 + 1)]);
            let (grown, travelled) = (at(12) - at(5), 0.7 * (directions as f64).sqrt());
            assert!(grown > 0.7 * travelled && grown <= travelled + 1e-12, "{directions}: {grown} over {travelled}");
        }
    }

    #[test]
    fn without_a_free_point_the_layer_never_holds_back() {
        let lattice = Lattice::new(&grid(&[(0.0, 0.1, 4)])).unwrap();
        let layer = BoundaryLayer::new(&lattice, 0.5, &slope(&[3.0]));
        let levels = layer.levels(&lattice, &[false; 4], 1.0);
        assert_eq!(levels, [NOTHING_FREE; 4]);
        assert_eq!(layer.share(&[1e9], levels[0]), 1.0);
    }

    #[test]
    fn the_layer_starts_at_zero_and_rises_with_the_slope() {
        let lattice = Lattice::new(&grid(&[(0.0, 0.1, 4)])).unwrap();
        let layer = BoundaryLayer::new(&lattice, 0.5, &slope(&[3.0]));
        // At level one the boundary is half a cell of 0.1 rad behind: 0.15 N m at 3 N m/rad.
        for (level, bound) in [(0.2, 0.0), (0.5, 0.0), (1.0, 0.15), (2.5, 0.6)] {
            assert!((9.0 * layer.share(&[9.0], level) - bound).abs() < 1e-12, "at {level}");
        }
        assert_eq!(layer.share(&[0.0], 0.2), 1.0);
        assert_eq!(layer.share(&[0.149], 1.0), 1.0);
    }

    #[test]
    fn a_change_of_units_changes_nothing() {
        // The second joint in radians, then in milliradians: torque per mrad, slope per mrad^2.
        let radians = Lattice::new(&grid(&[(0.0, 0.1, 4), (0.0, 0.2, 4)])).unwrap();
        let milliradians = Lattice::new(&grid(&[(0.0, 0.1, 4), (0.0, 200.0, 4)])).unwrap();
        let (a, b) = (
            BoundaryLayer::new(&radians, 0.5, &slope(&[3.0, 2.0])),
            BoundaryLayer::new(&milliradians, 0.5, &slope(&[3.0, 2e-6])),
        );
        let (share_a, share_b) = (a.share(&[0.4, 0.7], 0.9), b.share(&[0.4, 0.7e-3], 0.9));
        assert!(share_a < 1.0 && (share_a - share_b).abs() < 1e-12, "{share_a} and {share_b}");
        let free: Vec<bool> = (0..16).map(|p| p < 3).collect();
        for (a, b) in a.levels(&radians, &free, 1e9).iter().zip(b.levels(&milliradians, &free, 1e9)) {
            assert!((a - b).abs() < 1e-12, "{a} and {b}");
        }
    }
}
