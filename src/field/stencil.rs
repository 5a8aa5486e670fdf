//! The grid cell around a configuration: the 2^d corners of multilinear interpolation and their weights.
//!
//! Weight of corner c: `w_c = prod_a (f_a or 1 - f_a)`, f_a the fraction of the cell along axis a. Beyond the grid the
//! nearest cell's face is used, and `fade` falls linearly from one to zero over one cell, so that whatever is
//! multiplied by it stays continuous. Nothing here allocates; the cost depends on the number of joints alone.

use crate::{MAX_JOINTS, dataset::Grid};

/// Corners of a cell with the greatest number of joints.
pub const MAX_CORNERS: usize = 1 << MAX_JOINTS;

/// A grid, prepared for look-up.
#[derive(Clone, Debug)]
pub struct Lattice {
    joints: usize,
    points: usize,
    axes: [Line; MAX_JOINTS],
}

/// One axis: coordinate `start + k step`, `k < count`, and the distance of its neighbours in the numbering of points.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    start: f64,
    end: f64,
    step: f64,
    count: usize,
    stride: usize,
}

impl Line {
    /// One within the axis, falling to zero one step beyond.
    fn fade(&self, coordinate: f64) -> f64 {
        let beyond = (coordinate - coordinate.clamp(self.start, self.end)).abs() / self.step;
        // False for what is not a number.
        if beyond < 1.0 { 1.0 - beyond } else { 0.0 }
    }
}

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
    pub fractions: [f64; MAX_JOINTS],
    /// One inside the grid, falling to zero one cell outside.
    pub fade: f64,
}

/// A grid cannot be looked up.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LatticeError {
    /// No joints, or too many.
    #[error("the dataset's grid has {0} axes; between 1 and {MAX_JOINTS} are possible")]
    Joints(usize),
    /// An axis has no points, or its spacing is not a positive number.
    #[error("axis {axis} of the dataset's grid has {count} points from {start} with spacing {step}")]
    Axis {
        /// Its name.
        axis: String,
        /// Its number of points.
        count: usize,
        /// Its first coordinate.
        start: f64,
        /// Its spacing.
        step: f64,
    },
    /// More points than can be numbered.
    #[error("the dataset's grid has more points than can be numbered")]
    Points,
}

impl Lattice {
    /// Prepares `grid`.
    ///
    /// # Errors
    /// When the grid has no axis, more than [`MAX_JOINTS`], an empty axis, or a spacing that is not positive.
    pub fn new(grid: &Grid) -> Result<Self, LatticeError> {
        let joints = grid.joints();
        if joints == 0 || joints > MAX_JOINTS {
            return Err(LatticeError::Joints(joints));
        }
        let mut axes = [Line::default(); MAX_JOINTS];
        let mut stride = 1_usize;
        for (axis, line) in grid.axes.iter().zip(&mut axes).rev() {
            let (start, step, count) = (axis.start, axis.step, axis.count);
            if count == 0 || !start.is_finite() || !step.is_finite() || step <= 0.0 {
                return Err(LatticeError::Axis { axis: axis.name.clone(), count, start, step });
            }
            let end = start + (count - 1) as f64 * step;
            *line = Line { start, end, step, count, stride };
            stride = stride.checked_mul(count).ok_or(LatticeError::Points)?;
        }
        Ok(Self { joints, points: stride, axes })
    }

    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Number of grid points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.points
    }

    /// Number of points, spacing (rad or m) and stride in the numbering of points of each axis.
    pub(super) fn lines(&self) -> impl Iterator<Item = (usize, f64, usize)> {
        self.axes[..self.joints].iter().map(|line| (line.count, line.step, line.stride))
    }

    /// First and last coordinate of each axis (rad or m).
    pub(super) fn ends(&self) -> impl Iterator<Item = [f64; 2]> {
        self.axes[..self.joints].iter().map(|line| [line.start, line.end])
    }

    /// Coordinates of the grid lines of each axis (rad or m).
    pub(super) fn grid_lines(&self) -> impl Iterator<Item = impl Iterator<Item = f64>> {
        self.axes[..self.joints].iter().map(|line| (0..line.count).map(|k| line.start + k as f64 * line.step))
    }

    /// Position of `point` along the axis with `count` points and `stride`.
    pub(super) fn position(point: usize, count: usize, stride: usize) -> usize {
        point / stride % count
    }

    /// The points before and after `point` along the axis with `count` points and `stride`.
    pub(super) fn neighbours(point: usize, count: usize, stride: usize) -> [Option<usize>; 2] {
        let position = Self::position(point, count, stride);
        [(position > 0).then(|| point - stride), (position + 1 < count).then(|| point + stride)]
    }

    /// [`Stencil::fade`] at `q`, which has one entry per joint.
    #[must_use]
    pub fn fade(&self, q: &[f64]) -> f64 {
        self.axes[..self.joints].iter().zip(q).fold(1.0, |fade, (line, &coordinate)| fade.min(line.fade(coordinate)))
    }

    /// The cell around `q`, which has one entry per joint. A configuration that is not finite is outside, with `fade`
    /// zero.
    #[must_use]
    pub fn locate(&self, q: &[f64]) -> Stencil {
        let mut stencil = Stencil {
            count: 1,
            points: [0; MAX_CORNERS],
            weights: [0.0; MAX_CORNERS],
            fractions: [0.0; MAX_JOINTS],
            fade: 1.0,
        };
        stencil.weights[0] = 1.0;
        for ((line, &coordinate), kept) in self.axes[..self.joints].iter().zip(q).zip(&mut stencil.fractions) {
            let held = if coordinate.is_finite() { coordinate.clamp(line.start, line.end) } else { line.start };
            stencil.fade = stencil.fade.min(line.fade(coordinate));
            let inside = ((held - line.start) / line.step).min((line.count - 1) as f64);
            // The last point belongs to the last cell; an axis of one point is a cell without extent.
            let low = (inside as usize).min(line.count.saturating_sub(2));
            let fraction = inside - low as f64;
            *kept = fraction;
            let stride = if line.count > 1 { line.stride } else { 0 };
            let half = stencil.count;
            for corner in 0..half {
                let point = stencil.points[corner] + low * line.stride;
                let weight = stencil.weights[corner];
                stencil.points[corner] = point;
                stencil.points[corner + half] = point + stride;
                stencil.weights[corner] = weight * (1.0 - fraction);
                stencil.weights[corner + half] = weight * fraction;
            }
            stencil.count = 2 * half;
        }
        stencil
    }
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
    use crate::field::synthetic::grid;

    #[test]
    fn weights_reproduce_the_configuration_in_one_to_six_joints() {
        for joints in 1..=MAX_JOINTS {
            let grid = grid(&vec![(-0.3, 0.1, 5); joints]);
            let lattice = Lattice::new(&grid).unwrap();
            let q: Vec<f64> = (0..joints).map(|a| -0.25 + 0.07 * a as f64).collect();
            let stencil = lattice.locate(&q);
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
        let lattice = Lattice::new(&grid(&[(0.0, 0.5, 3), (0.0, 0.5, 1)])).unwrap();
        for q in [[9.0, 0.0], [f64::NAN, 0.0], [0.2, f64::INFINITY], [0.0, -0.5], [1e300, -1e300]] {
            let stencil = lattice.locate(&q);
            assert_eq!(stencil.fade, 0.0, "{q:?}");
            assert!(stencil.corners().all(|(point, w)| point < 3 && (0.0..=1.0).contains(&w)), "{q:?}");
        }
        assert_eq!(lattice.locate(&[1.25, 0.0]).fade, 0.5);
    }

    #[test]
    fn grids_that_are_none_are_refused() {
        assert_eq!(Lattice::new(&grid(&[])).unwrap_err(), LatticeError::Joints(0));
        assert!(matches!(Lattice::new(&grid(&[(0.0, 0.1, 2); 7])), Err(LatticeError::Joints(7))));
        for bad in [(0.0, 0.0, 2), (0.0, -1.0, 2), (0.0, f64::NAN, 2), (f64::INFINITY, 1.0, 2), (0.0, 1.0, 0)] {
            assert!(matches!(Lattice::new(&grid(&[bad])), Err(LatticeError::Axis { .. })), "{bad:?}");
        }
        assert_eq!(Lattice::new(&grid(&[(0.0, 1.0, 1 << 40); 3])).unwrap_err(), LatticeError::Points);
    }
}
