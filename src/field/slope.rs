//! How the torque changes with the configuration, and columns that only a look at the dataset needs.

use super::{TorqueField, stencil::Lattice};
use crate::MAX_JOINTS;

/// Step of the differences that give the slope of an interpolated torque, over the grid's own step (1): the cube root
/// of the rounding of f64, where what is rounded and what is left out are alike. Rounding costs 1e-11 of the torque for
/// each grid step, and along a polynomial piece of degree three what is left out is as little.
pub const GRADIENT_STEP: f64 = 1e-5;

impl TorqueField {
    /// The slope d tau/d q at `q`, row by row: entry `k d + l` of `slope` is the change of tau_k with q_l
    /// (N m/rad, or what follows of prismatic joints). Central differences of the interpolated torque; on a face of a
    /// cell, where that has a kink, the mean of both sides. `slope` has d^2 entries. Never allocates.
    pub fn slope(&self, q: &[f64], slope: &mut [f64]) {
        let joints = self.joints();
        let mut place = [0.0; MAX_JOINTS];
        place[..joints].copy_from_slice(&q[..joints]);
        for (l, (_, step, _)) in self.lattice.lines().enumerate() {
            let ends = [q[l] - GRADIENT_STEP * step, q[l] + GRADIENT_STEP * step];
            let [before, after] = ends.map(|end| {
                place[l] = end;
                self.sample(&place[..joints]).torque
            });
            place[l] = q[l];
            for (k, (before, after)) in before.iter().zip(after.iter()).enumerate() {
                // Where rounding swallows the step q is so far outside the grid that nothing changes.
                slope[k * joints + l] = if ends[0] < ends[1] { (after - before) / (ends[1] - ends[0]) } else { 0.0 };
            }
        }
    }
}

impl Lattice {
    /// Multilinear interpolation of `column`, one entry a grid point, at `q`; not a number outside the grid, where
    /// nothing is known.
    #[must_use]
    pub fn interpolate(&self, column: &[f32], q: &[f64]) -> f64 {
        let stencil = self.locate(q);
        if stencil.fade < 1.0 {
            return f64::NAN;
        }
        stencil.corners().map(|(point, weight)| weight * f64::from(column[point])).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        JointVector,
        field::synthetic::{grid, half_space},
        scene::Interpolation,
    };

    #[test]
    fn the_slope_of_a_spring_is_its_stiffness() {
        // tau = -k n max(n . q, 0), n with equal parts: every entry of the slope is -k/d inside.
        for joints in 1..=3 {
            let data = half_space(grid(&vec![(-0.6, 0.1, 13); joints]), 5.0);
            let steep = JointVector::from_slice(&vec![1e3; joints]);
            let field = TorqueField::interpolated(&data, Interpolation::Linear, 0.5, &steep).unwrap();
            let mut slope = vec![f64::NAN; joints * joints];
            field.slope(&vec![0.43; joints], &mut slope);
            let expected = -5.0 / joints as f64;
            // Rounding of a torque below 5 N m, over two steps.
            let rounding = 5.0 * f64::EPSILON / (GRADIENT_STEP * 0.1);
            assert!(slope.iter().all(|entry| (entry - expected).abs() < 8.0 * rounding), "{slope:?}");
            field.slope(&vec![-0.43; joints], &mut slope);
            assert!(slope.iter().all(|entry| *entry == 0.0), "{slope:?}");
        }
    }

    #[test]
    fn a_column_is_interpolated_inside_the_grid_and_unknown_outside() {
        let grid = grid(&[(0.0, 0.5, 3), (-1.0, 0.25, 5)]);
        let plane = |q: &[f64]| 3.0 * q[0] - 2.0 * q[1] + 0.5;
        let column: Vec<f32> = (0..grid.points()).map(|point| plane(&grid.configuration(point)) as f32).collect();
        let lattice = Lattice::new(&grid).unwrap();
        for q in [[0.0, -1.0], [0.3, -0.4], [1.0, 0.0]] {
            let found = lattice.interpolate(&column, &q);
            assert!((found - plane(&q)).abs() < 1e-6, "{found} at {q:?}");
        }
        for q in [[1.1, 0.0], [0.3, -1.1], [f64::NAN, 0.0]] {
            assert!(lattice.interpolate(&column, &q).is_nan(), "{q:?}");
        }
    }
}
