//! The boundary layer: the contact torque rises from zero at the object's boundary with a slope of at most Ks
//! (section 3.1), continuous in q and without memory.
//!
//! *Units.* Ks is given joint by joint. Distances are measured as `|q|_K = sqrt(sum_a Ks_a q_a^2)` and torques as
//! `|tau|_K = sqrt(sum_a tau_a^2 / Ks_a)`, both in square roots of joules: radians and metres mix rightly, and slope Ks
//! becomes slope one.
//!
//! *Depth.* Every grid point has a depth, positive below the object's boundary, and between them it is interpolated
//! linearly: s(q). It grows by no more than the distance travelled, `|s(q) - s(q')| <= |q - q'|_K`, across cell faces
//! too. Away from the boundary it follows the eikonal equation `|grad s| = 1` on the grid, by fast marching (Sethian
//! 1996): exact behind flat boundaries in any direction, and without the steps of distances from point to point. The
//! interpolated depth is then up to sqrt(d) times as steep where distances meet (1.0 to 1.4 behind flat boundaries); G,
//! its greatest steepness, is computed and divided out.
//!
//! *Boundary of the contact index* (the paper). Contact is where the index I, 1 in contact and 0 free, exceeds Ith when
//! interpolated linearly; there the torque jumps from zero to about `Ith |tau|`. Depth is `(level - Ith) / g`,
//! `g = sqrt(sum_a 1/(Ks_a h_a^2))`, with levels 0 where free, 1 within a king's move (one step along any axes at once)
//! of a free point, `1 + g E / G` beyond, E the distance to the points of level 0 or 1. In a cell with a free corner
//! the level is I_bar, in all others at least 1: the region `s > 0` is exactly the paper's.
//!
//! *Torque.* The interpolated torque is shortened, in its own direction, to at most s:
//! `tau_bar = tau min(1, s / |tau|_K)`, the projection of tau onto the ball of radius s. Projections onto a ball move
//! two points no further apart, nor by more than the change of radius. Where the torque is shortened these changes are
//! at right angles, so that `|tau_bar(q) - tau_bar(q')|_K <= sqrt(L^2 + 1) |q - q'|_K`, L the Lipschitz bound of tau in
//! these measures. The layer's own slope is Ks / G and never above Ks; within the first cell it is less, Ks / d at
//! worst. Where the object is softer than that, the dataset's torque is untouched.
//!
//! *An object stiffer than Ks* is rendered with slope Ks to all depths, and not only where it begins. It is the paper's
//! linear slope drawn until it meets the torque, which here is nowhere; and it is what is passive, since
//! `Ks <= mu bv / T` bounds every slope that the loop renders, that of a jump and that of a stiff object alike. To feel
//! it stiffer, raise Ks to the bound, and the bound by bv.

use crate::{
    JointVector, MAX_AXES,
    dataset::{Axis, Grid},
};
use std::{cmp::Reverse, collections::BinaryHeap};

/// The layer of one grid.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryLayer {
    /// 1 / Ks_a (rad/(N m)).
    compliance: JointVector,
    /// g (1/sqrt(J)).
    density: f64,
}

/// Stands for the depth where there is no free point: beyond any grid, and finite, so that a weight of zero times it is
/// zero (sqrt(J)).
const NOTHING_FREE: f64 = 1e100;

impl BoundaryLayer {
    /// A layer of slope `slope` Ks, one positive number per joint (N m/rad).
    #[must_use]
    pub fn new(grid: &Grid, slope: &JointVector) -> Self {
        let compliance: JointVector = slope.iter().map(|slope| 1.0 / slope).collect();
        let density = grid.axes.iter().zip(compliance.iter()).map(|(axis, c)| c / (axis.step * axis.step)).sum::<f64>();
        Self { compliance, density: density.sqrt() }
    }

    /// 1 / Ks, joint by joint (rad/(N m)).
    pub(super) fn compliance(&self) -> JointVector {
        self.compliance
    }

    /// `|torque|_K` (sqrt(J)).
    #[must_use]
    #[inline]
    pub fn size(&self, torque: &[f64]) -> f64 {
        torque.iter().zip(self.compliance.padded()).map(|(tau, c)| tau * tau * c).sum::<f64>().sqrt()
    }

    /// The factor that shortens `torque` (N m) to `depth` (sqrt(J)); one where it is short enough.
    #[must_use]
    #[inline]
    pub fn share(&self, torque: &[f64], depth: f64) -> f64 {
        let (depth, size) = (depth.max(0.0), self.size(torque));
        if size > depth { depth / size } else { 1.0 }
    }

    /// Depth of each grid point behind the boundary where the contact index is `threshold` Ith (sqrt(J)). `greatest`:
    /// largest size of a torque in the dataset (sqrt(J)); depths beyond it are not distinguished, since nothing is held
    /// back there.
    #[must_use]
    pub fn depths_behind_index(&self, grid: &Grid, free: &[bool], threshold: f64, greatest: f64) -> Vec<f64> {
        let near = beside(grid, free);
        if !near.contains(&true) {
            return vec![NOTHING_FREE; free.len()];
        }
        let beyond = self.distances(grid, &near, greatest * (grid.joints() as f64).sqrt());
        let steepest = self.steepest(grid, &beyond);
        let level = |(&free, &beyond): (&bool, &f64)| if free { 0.0 } else { 1.0 + self.density * beyond / steepest };
        free.iter().zip(&beyond).map(level).map(|level| (level - threshold) / self.density).collect()
    }

    /// Distance (sqrt(J)) of each grid point from those that `origins` marks, or `farthest` where that is less.
    ///
    /// Points are settled in the order of their distance, each from its settled neighbours.
    fn distances(&self, grid: &Grid, origins: &[bool], farthest: f64) -> Vec<f64> {
        let mut distance: Vec<f64> = origins.iter().map(|&origin| if origin { 0.0 } else { farthest }).collect();
        // Distances are not negative: their bits are in the same order as they.
        let mut queue: BinaryHeap<Reverse<(u64, usize)>> =
            (0..origins.len()).filter(|&point| origins[point]).map(|point| Reverse((0, point))).collect();
        let mut settled = vec![false; origins.len()];
        while let Some(Reverse((_, point))) = queue.pop() {
            if std::mem::replace(&mut settled[point], true) {
                continue;
            }
            for neighbour in grid.neighbours(point).flatten().flatten().filter(|&p| !settled[p]) {
                let found = self.behind(grid, neighbour, &distance, &settled);
                if found < distance[neighbour] {
                    distance[neighbour] = found;
                    queue.push(Reverse((found.to_bits(), neighbour)));
                }
            }
        }
        distance
    }

    /// The eikonal equation at `point`: the u with `sum_a (u - u_a)^2 / (Ks_a h_a^2) = 1` over the axes whose nearer
    /// settled neighbour u_a lies below u.
    fn behind(&self, grid: &Grid, point: usize, distance: &[f64], settled: &[bool]) -> f64 {
        let mut below = [(f64::INFINITY, 0.0); MAX_AXES];
        let axes = grid.axes.iter().zip(grid.neighbours(point)).zip(self.compliance.iter());
        for (((axis, beside), compliance), below) in axes.zip(&mut below) {
            let nearer = beside.into_iter().flatten().filter(|&p| settled[p]);
            *below = (nearer.map(|p| distance[p]).fold(f64::INFINITY, f64::min), compliance / (axis.step * axis.step));
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
    fn steepest(&self, grid: &Grid, depth: &[f64]) -> f64 {
        let square = |point: usize| {
            let along = |((axis, beside), compliance): ((&Axis, [Option<usize>; 2]), &f64)| {
                let rise = beside.map(|p| p.map_or(0.0, |p| (depth[point] - depth[p]).powi(2)));
                rise[0].max(rise[1]) * compliance / (axis.step * axis.step)
            };
            grid.axes.iter().zip(grid.neighbours(point)).zip(self.compliance.iter()).map(along).sum::<f64>()
        };
        (0..depth.len()).map(square).fold(1.0, f64::max).sqrt()
    }
}

/// The points of `set` and all within a king's move of one.
fn beside(grid: &Grid, set: &[bool]) -> Vec<bool> {
    let mut grown = set.to_vec();
    for axis in 0..grid.joints() {
        let before = grown.clone();
        for (point, grown) in grown.iter_mut().enumerate() {
            *grown |= grid.beside(point, axis).into_iter().flatten().any(|p| before[p]);
        }
    }
    grown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{fixtures::grids::grid, random::Random};

    fn slope(values: &[f64]) -> JointVector {
        JointVector::from_slice(values)
    }

    /// Free points, one in `sparsity`, the same every time.
    fn scattered(grid: &Grid, sparsity: u64) -> Vec<bool> {
        let mut random = Random::new(12345);
        let mut next = || random.between(0.0, sparsity as f64) < 1.0;
        let mut free: Vec<bool> = (0..grid.points()).map(|_| next()).collect();
        free[grid.points() / 2] = true;
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
            let grid = grid(&axes);
            let layer = BoundaryLayer::new(&grid, &slope(&slopes));
            for sparsity in [3, 20, 100] {
                let free = scattered(&grid, sparsity);
                let depths = layer.depths_behind_index(&grid, &free, 0.5, 1e9);
                let levels: Vec<f64> = depths.iter().map(|depth| depth * layer.density + 0.5).collect();
                let steps = |p: usize, q: usize| {
                    grid.lines(p).iter().zip(grid.lines(q)).map(|(p, q)| p.abs_diff(q)).max().unwrap()
                };
                for (p, &level) in levels.iter().enumerate() {
                    match (0..free.len()).filter(|&q| free[q]).map(|q| steps(p, q)).min() {
                        Some(0) => assert!(level.abs() < 1e-12),
                        Some(1) => assert!((level - 1.0).abs() < 1e-12),
                        _ => assert!(level > 1.0 && level < 100.0, "{level}"),
                    }
                }
                let beyond: Vec<f64> = levels.iter().map(|level| (level - 1.0).max(0.0) / layer.density).collect();
                assert!(layer.steepest(&grid, &beyond) <= 1.0 + 1e-12);
            }
        }
    }

    #[test]
    fn behind_a_flat_boundary_of_any_direction_depth_grows_by_the_distance_travelled() {
        let grid = grid(&[(0.0, 0.1, 16); 3]);
        let layer = BoundaryLayer::new(&grid, &slope(&[1.0; 3]));
        for directions in [1, 2, 3] {
            let along = |p: usize| grid.lines(p).into_iter().take(directions).sum::<usize>();
            let free: Vec<bool> = (0..grid.points()).map(|p| along(p) < 2 * directions).collect();
            let depths = layer.depths_behind_index(&grid, &free, 0.5, 1e9);
            // The boundary is notched where it meets the grid's rim, which is what G is above one for.
            let at = |k: usize| depths[k * (256 + 16 + 1)];
            let (grown, travelled) = (at(12) - at(5), 0.7 * (directions as f64).sqrt());
            assert!(grown > 0.7 * travelled && grown <= travelled + 1e-12, "{directions}: {grown} over {travelled}");
        }
    }

    #[test]
    fn without_a_free_point_the_layer_never_holds_back() {
        let grid = grid(&[(0.0, 0.1, 4)]);
        let layer = BoundaryLayer::new(&grid, &slope(&[3.0]));
        let depths = layer.depths_behind_index(&grid, &[false; 4], 0.5, 1.0);
        assert_eq!(depths, [NOTHING_FREE; 4]);
        assert_eq!(layer.share(&[1e9], depths[0]), 1.0);
    }

    #[test]
    fn the_layer_starts_at_zero_and_rises_with_the_slope() {
        let grid = grid(&[(0.0, 0.1, 4)]);
        let layer = BoundaryLayer::new(&grid, &slope(&[3.0]));
        // One cell of 0.1 rad behind the free point the boundary is half a cell off: 0.15 N m at 3 N m/rad.
        let depths = layer.depths_behind_index(&grid, &[true, false, false, false], 0.5, 1e9);
        for (k, bound) in [(0, 0.0), (1, 0.15), (2, 0.45), (3, 0.75)] {
            assert!((9.0 * layer.share(&[9.0], depths[k]) - bound).abs() < 1e-12, "at {k}");
        }
        assert_eq!(layer.share(&[0.0], depths[0]), 1.0);
        assert_eq!(layer.share(&[0.149], depths[1]), 1.0);
    }

    #[test]
    fn a_change_of_units_changes_nothing() {
        // The second joint in radians, then in milliradians: torque per mrad, slope per mrad^2.
        let radians = grid(&[(0.0, 0.1, 4), (0.0, 0.2, 4)]);
        let milliradians = grid(&[(0.0, 0.1, 4), (0.0, 200.0, 4)]);
        let (a, b) = (
            BoundaryLayer::new(&radians, &slope(&[3.0, 2.0])),
            BoundaryLayer::new(&milliradians, &slope(&[3.0, 2e-6])),
        );
        let (share_a, share_b) = (a.share(&[0.4, 0.7], 0.2), b.share(&[0.4, 0.7e-3], 0.2));
        assert!(share_a < 1.0 && (share_a - share_b).abs() < 1e-12, "{share_a} and {share_b}");
        let free: Vec<bool> = (0..16).map(|p| p < 3).collect();
        for (a, b) in a.depths_behind_index(&radians, &free, 0.5, 1e9).iter().zip(b.depths_behind_index(
            &milliradians,
            &free,
            0.5,
            1e9,
        )) {
            assert!((a - b).abs() < 1e-12, "{a} and {b}");
        }
    }
}
