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
//! *Depth.* At every grid point let m be the number of king's moves (one step along any axes at once) to the nearest
//! free point, zero at free points. In a cell with a free corner every other corner has m = 1 = I, so that
//! `m_bar = I_bar` and the contact region `m_bar > Ith` is exactly the paper's; in all other cells `m_bar >= 1`. Along
//! axis a neighbours differ by at most one, hence m_bar changes by at most `g |dq|_K`, `g = sqrt(sum_a 1/(Ks_a h_a^2))`,
//! and `s(q) = max(0, m_bar(q) - Ith) / g` is a depth below the boundary that grows by no more than the distance
//! travelled: `|s(q) - s(q')| <= |q - q'|_K`, across cell faces too.
//!
//! *Torque.* The interpolated torque is shortened, in its own direction, to at most s: `tau_bar = tau min(1, s / |tau|_K)`,
//! the projection of tau onto the ball of radius s. Projections onto a ball move two points no further apart, nor by
//! more than the change of radius, so that `|tau_bar(q) - tau_bar(q')|_K <= (L + 1) |q - q'|_K`, L the Lipschitz bound
//! of tau in these measures. The slope of the layer itself lies between Ks / sqrt(d) (along one of d alike axes) and Ks
//! (along a diagonal): never above Ks. Where the object is softer than that, the dataset's torque is untouched; a
//! stiffer one is rendered with slope Ks, the stiffest that the passivity condition lets through.

use super::stencil::Lattice;
use crate::JointVector;

/// Stands for the king's moves to a free point where there is none: beyond any grid, and finite, so that a weight of
/// zero times it is zero.
pub const NOTHING_FREE: f64 = 1e100;

/// King's moves from each grid point to the nearest free one; [`NOTHING_FREE`] everywhere if no point is free.
///
/// One pass an axis: `m'(p) = min_t max(|t|, m(p + t))` along it, because max over axes and min over points commute.
#[must_use]
pub fn moves_to_free(lattice: &Lattice, free: &[bool]) -> Vec<f64> {
    let mut moves: Vec<f64> = free.iter().map(|&free| if free { 0.0 } else { NOTHING_FREE }).collect();
    let mut line = Vec::new();
    for (count, _, stride) in lattice.lines() {
        for first in (0..moves.len()).filter(|&point| Lattice::position(point, count, stride) == 0) {
            line.clear();
            line.extend((0..count).map(|k| moves[first + k * stride]));
            for k in 0..count {
                let mut best = line[k];
                let mut t = 1;
                while (t as f64) < best && (k >= t || k + t < count) {
                    let before = if k >= t { line[k - t] } else { NOTHING_FREE };
                    let after = if k + t < count { line[k + t] } else { NOTHING_FREE };
                    best = best.min(before.min(after).max(t as f64));
                    t += 1;
                }
                moves[first + k * stride] = best;
            }
        }
    }
    moves
}

/// The layer of one grid: its slope, threshold and unit of depth.
#[derive(Clone, Copy, Debug)]
pub struct BoundaryLayer {
    threshold: f64,
    /// 1 / Ks_a [rad/(N m)].
    compliance: JointVector,
    /// 1 / g [sqrt(J)].
    depth_per_move: f64,
}

impl BoundaryLayer {
    /// A layer of slope `slope` Ks, one positive number per joint [N m/rad], from contact index `threshold` Ith on.
    #[must_use]
    pub fn new(lattice: &Lattice, threshold: f64, slope: &JointVector) -> Self {
        let mut compliance = *slope;
        compliance.iter_mut().for_each(|slope| *slope = 1.0 / *slope);
        let density = lattice.lines().zip(compliance.iter()).map(|((_, step, _), c)| c / (step * step)).sum::<f64>();
        Self { threshold, compliance, depth_per_move: 1.0 / density.sqrt() }
    }

    /// Ith.
    #[must_use]
    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// Depth s where the interpolated king's moves are `moves` [sqrt(J)].
    #[must_use]
    pub fn depth(&self, moves: f64) -> f64 {
        let beyond = moves - self.threshold;
        if beyond > 0.0 { self.depth_per_move * beyond } else { 0.0 }
    }

    /// The factor that shortens `torque` [N m] to the depth at `moves`; one where it is short enough.
    #[must_use]
    pub fn share(&self, torque: &[f64], moves: f64) -> f64 {
        let depth = self.depth(moves);
        let size = torque.iter().zip(self.compliance.iter()).map(|(tau, c)| tau * tau * c).sum::<f64>().sqrt();
        if size > depth { depth / size } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::synthetic::grid;

    /// The definition, point against point.
    fn by_definition(lattice: &Lattice, free: &[bool]) -> Vec<f64> {
        let apart = |p: usize, q: usize| {
            let along = |(count, _, stride): (usize, f64, usize)| {
                Lattice::position(p, count, stride).abs_diff(Lattice::position(q, count, stride))
            };
            lattice.lines().map(along).max().unwrap() as f64
        };
        let nearest = |p: usize| (0..free.len()).filter(|&q| free[q]).map(|q| apart(p, q)).fold(NOTHING_FREE, f64::min);
        (0..free.len()).map(nearest).collect()
    }

    #[test]
    fn moves_count_the_steps_of_a_king() {
        for axes in
            [vec![(0.0, 0.1, 17)], vec![(0.0, 0.1, 6), (0.0, 0.2, 7)], vec![(0.0, 1.0, 5); 3], vec![(0.0, 1.0, 3); 5]]
        {
            let lattice = Lattice::new(&grid(&axes)).unwrap();
            let mut seed = 12345_u64;
            for sparsity in [2, 7, 40] {
                let free: Vec<bool> = (0..lattice.points())
                    .map(|_| {
                        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                        (seed >> 33).is_multiple_of(sparsity)
                    })
                    .collect();
                assert_eq!(moves_to_free(&lattice, &free), by_definition(&lattice, &free));
            }
        }
    }

    #[test]
    fn without_a_free_point_the_layer_never_holds_back() {
        let lattice = Lattice::new(&grid(&[(0.0, 0.1, 4)])).unwrap();
        let moves = moves_to_free(&lattice, &[false; 4]);
        assert_eq!(moves, [NOTHING_FREE; 4]);
        assert_eq!(BoundaryLayer::new(&lattice, 0.5, &slope(&[3.0])).share(&[1e9], NOTHING_FREE), 1.0);
    }

    fn slope(values: &[f64]) -> JointVector {
        JointVector::from_slice(values)
    }

    #[test]
    fn the_layer_starts_at_zero_and_rises_with_the_slope() {
        let lattice = Lattice::new(&grid(&[(0.0, 0.1, 4)])).unwrap();
        let layer = BoundaryLayer::new(&lattice, 0.5, &slope(&[3.0]));
        // At a whole move the boundary is half a cell of 0.1 rad behind: 0.15 N m at 3 N m/rad.
        for (moves, bound) in [(0.2, 0.0), (0.5, 0.0), (1.0, 0.15), (2.5, 0.6)] {
            assert!((9.0 * layer.share(&[9.0], moves) - bound).abs() < 1e-12, "at {moves}");
        }
        assert_eq!(layer.share(&[0.0], 0.2), 1.0);
        assert_eq!(layer.share(&[0.149], 1.0), 1.0);
    }

    #[test]
    fn a_change_of_units_changes_nothing() {
        // The second joint in radians, then in milliradians: torque per mrad, slope per mrad^2.
        let radians = Lattice::new(&grid(&[(0.0, 0.1, 4), (0.0, 0.2, 4)])).unwrap();
        let milliradians = Lattice::new(&grid(&[(0.0, 0.1, 4), (0.0, 200.0, 4)])).unwrap();
        let a = BoundaryLayer::new(&radians, 0.5, &slope(&[3.0, 2.0])).share(&[0.4, 0.7], 0.9);
        let b = BoundaryLayer::new(&milliradians, 0.5, &slope(&[3.0, 2e-6])).share(&[0.4, 0.7e-3], 0.9);
        assert!(a < 1.0 && (a - b).abs() < 1e-12, "{a} and {b}");
    }
}
