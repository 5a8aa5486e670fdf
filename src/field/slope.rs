//! How the torque changes with the configuration.

use super::TorqueField;
use crate::MAX_AXES;

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
        let mut place = [0.0; MAX_AXES];
        place[..joints].copy_from_slice(&q[..joints]);
        for (l, axis) in self.grid.axes.iter().enumerate() {
            let ends = [q[l] - GRADIENT_STEP * axis.step, q[l] + GRADIENT_STEP * axis.step];
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        JointVector,
        fixtures::grids::{grid, half_space},
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
}
