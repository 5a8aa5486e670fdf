//! The grid cell around a configuration: the 2^d corners of multilinear interpolation and their weights.
//!
//! Weight of corner c: `w_c = prod_a (f_a or 1 - f_a)`, f_a the fraction of the cell along axis a. Beyond the grid the
//! nearest cell's face is used, and `fade` falls linearly from one to zero over one cell, so that whatever is
//! multiplied by it stays continuous. Nothing here allocates; the cost depends on the number of joints alone.

use super::{
    Axis, Grid,
    store::{self, Cell, with_joints},
};
use crate::MAX_AXES;

/// Corners of a cell with the greatest number of joints.
const MAX_CORNERS: usize = 1 << MAX_AXES;

/// The corners around one configuration; the first `count` entries count.
#[derive(Clone, Copy, Debug)]
pub struct Stencil {
    /// 2^d.
    pub count: usize,
    /// Number of the grid point at each corner.
    pub points: [usize; MAX_CORNERS],
    /// Interpolation weight of each corner; they sum to one.
    pub weights: [f64; MAX_CORNERS],
    /// Fraction of the cell along each axis, 0 to 1. Bit a of a corner's number is its side along axis a.
    pub fractions: [f64; MAX_AXES],
    /// One inside the grid, falling to zero one cell outside.
    pub fade: f64,
}

impl Axis {
    /// The cell around `coordinate`, that at the axis's end beyond it: its first grid line and the fraction of the cell,
    /// 0 to 1. The last line belongs to the last cell; an axis of one line is a cell without extent.
    #[must_use]
    #[inline]
    pub fn cell(&self, coordinate: f64) -> (usize, f64) {
        // What is not a number becomes 0.
        let steps = ((coordinate - self.start) / self.step).max(0.0).min(self.count.saturating_sub(1) as f64);
        let low = (steps as usize).min(self.count.saturating_sub(2));
        (low, steps - low as f64)
    }

    /// One within the axis, falling to zero one step beyond.
    #[inline]
    fn fade(&self, coordinate: f64) -> f64 {
        // Where most look-ups are, without a division.
        if (self.start..=self.last()).contains(&coordinate) {
            return 1.0;
        }
        let beyond = (coordinate - coordinate.max(self.start).min(self.last())).abs() / self.step;
        // False for what is not a number.
        if beyond < 1.0 { 1.0 - beyond } else { 0.0 }
    }
}

impl Grid {
    /// [`Stencil::fade`] at `q`, which has one entry per joint.
    #[must_use]
    pub fn fade(&self, q: &[f64]) -> f64 {
        self.axes.iter().zip(q).fold(1.0, |fade, (axis, &coordinate)| fade.min(axis.fade(coordinate)))
    }

    /// First grid lines of the cell that begins at `point`, if one does; an axis of one line is a cell without extent.
    pub(crate) fn cell_from(&self, point: usize) -> Option<[u32; MAX_AXES]> {
        let low = self.lines(point);
        let begins = |(axis, line): (&Axis, &usize)| line + 1 < axis.count || axis.count == 1;
        self.axes.iter().zip(&low).all(begins).then(|| low.map(|line| line as u32))
    }

    /// The cell around `q`, which has one entry per joint, in a sound grid ([`Grid::check`]). A configuration that is
    /// not finite is outside, with `fade` zero.
    #[must_use]
    pub fn locate(&self, q: &[f64]) -> Stencil {
        let Cell { low, fractions } = Cell::of(self, q);
        let (mut points, mut weights) = ([0; MAX_CORNERS], [0.0; MAX_CORNERS]);
        with_joints!(self.joints(), D => {
            points[..1 << D].copy_from_slice(&corners::<{ 1 << D }>(&self.axes, &low));
            weights[..1 << D].copy_from_slice(&store::weights::<{ 1 << D }>(&fractions));
        });
        Stencil { count: 1 << self.joints(), points, weights, fractions, fade: self.fade(q) }
    }

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

/// The points at the corners of the cell of a grid of `axes` whose first corner lies on the lines `low`.
#[inline]
pub(crate) fn corners<const C: usize>(axes: &[Axis], low: &[u32]) -> [usize; C] {
    let mut points = [0; C];
    for (a, (axis, &low)) in axes.iter().zip(low).enumerate() {
        let (near, far) = points.split_at_mut(1 << a);
        for (near, far) in near.iter_mut().zip(far) {
            *near = *near * axis.count + low as usize;
            *far = *near + usize::from(axis.count > 1);
        }
    }
    points
}

impl Stencil {
    /// Grid point and weight of each corner.
    pub fn corners(&self) -> impl Iterator<Item = (usize, f64)> {
        self.points[..self.count].iter().copied().zip(self.weights[..self.count].iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::grids::grid;

    #[test]
    fn weights_reproduce_the_configuration_in_one_to_six_joints() {
        for joints in 1..=MAX_AXES {
            let grid = grid(&vec![(-0.3, 0.1, 5); joints]);
            let q: Vec<f64> = (0..joints).map(|a| -0.25 + 0.07 * a as f64).collect();
            let stencil = grid.locate(&q);
            assert_eq!(stencil.count, 1 << joints);
            assert_eq!(stencil.fade, 1.0);
            for (a, x) in q.iter().enumerate() {
                let mean: f64 = stencil.corners().map(|(point, w)| w * grid.configuration(point)[a]).sum();
                assert!((mean - x).abs() < 1e-14, "joint {a} of {joints}: {mean} for {x}");
            }
        }
    }

    #[test]
    fn far_outside_or_not_a_number_is_nothing() {
        let grid = grid(&[(0.0, 0.5, 3), (0.0, 0.5, 1)]);
        for q in [[9.0, 0.0], [f64::NAN, 0.0], [0.2, f64::INFINITY], [0.0, -0.5], [1e300, -1e300]] {
            let stencil = grid.locate(&q);
            assert_eq!(stencil.fade, 0.0, "{q:?}");
            assert!(stencil.corners().all(|(point, w)| point < 3 && (0.0..=1.0).contains(&w)), "{q:?}");
        }
        assert_eq!(grid.locate(&[1.25, 0.0]).fade, 0.5);
    }

    #[test]
    fn a_column_is_interpolated_inside_the_grid_and_unknown_outside() {
        let grid = grid(&[(0.0, 0.5, 3), (-1.0, 0.25, 5)]);
        let plane = |q: &[f64]| 3.0 * q[0] - 2.0 * q[1] + 0.5;
        let column: Vec<f32> = (0..grid.points()).map(|point| plane(&grid.configuration(point)) as f32).collect();
        for q in [[0.0, -1.0], [0.3, -0.4], [1.0, 0.0]] {
            let found = grid.interpolate(&column, &q);
            assert!((found - plane(&q)).abs() < 1e-6, "{found} at {q:?}");
        }
        for q in [[1.1, 0.0], [0.3, -1.1], [f64::NAN, 0.0]] {
            assert!(grid.interpolate(&column, &q).is_nan(), "{q:?}");
        }
    }
}
