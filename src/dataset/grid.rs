//! The uniform grid over C-space.

use crate::{JointVector, MAX_AXES, csv::plain, names, scene::effort_unit};
use serde::{Deserialize, Serialize};

/// Grid coordinates `start + k step`, `k < count`, of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// The joint's name.
    pub name: String,
    /// `rad` or `m`.
    pub unit: String,
    /// First grid line (rad or m).
    pub start: f64,
    /// Distance between grid lines, positive (rad or m).
    pub step: f64,
    /// Number of grid lines.
    pub count: usize,
}

/// Name and unit of one joint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JointLabel {
    /// As in the dataset.
    pub name: String,
    /// `rad` or `m`.
    pub unit: String,
}

/// A uniform grid, last axis fastest: the numbering of its points, their neighbours, and the cells between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// One per joint, in the chain's order.
    pub axes: Vec<Axis>,
}

impl Axis {
    /// Coordinate of grid line `k` (rad or m).
    #[must_use]
    pub fn coordinate(&self, k: usize) -> f64 {
        self.start + k as f64 * self.step
    }

    /// Coordinate of the last grid line (rad or m).
    #[must_use]
    pub fn last(&self) -> f64 {
        self.coordinate(self.count.saturating_sub(1))
    }

    /// Number of the grid line nearest to `coordinate`, at the axis's ends beyond them.
    #[must_use]
    pub fn nearest_line(&self, coordinate: f64) -> usize {
        // What is not a number becomes 0.
        ((coordinate - self.start) / self.step).round().clamp(0.0, self.count.saturating_sub(1) as f64) as usize
    }

    /// Unit of what acts along the axis: a torque, or a force where the joint is prismatic.
    #[must_use]
    pub fn effort_unit(&self) -> &'static str {
        effort_unit(&self.unit)
    }
}

impl JointLabel {
    /// Unit of what acts along the joint's axis.
    #[must_use]
    pub fn effort_unit(&self) -> &'static str {
        effort_unit(&self.unit)
    }

    /// Returns the heading of the column that holds the joint's `what`, a coordinate.
    #[must_use]
    pub fn heading(&self, what: &str) -> String {
        format!("{what} {} [{}]", plain(&self.name), self.unit)
    }

    /// Returns the heading of the column that holds the joint's `what`, a torque or force.
    #[must_use]
    pub fn effort_heading(&self, what: &str) -> String {
        format!("{what} {} [{}]", plain(&self.name), self.effort_unit())
    }
}

impl Grid {
    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.axes.len()
    }

    /// Number of grid points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.axes.iter().map(|axis| axis.count).product()
    }

    /// Number of grid lines of each axis.
    #[must_use]
    pub fn counts(&self) -> Vec<usize> {
        self.axes.iter().map(|axis| axis.count).collect()
    }

    /// Number of points of a sound grid: 1 to [`MAX_AXES`] axes of ascending, finite, distinct grid lines, and no
    /// more points than can be counted.
    ///
    /// # Errors
    /// Problem, in words.
    pub fn check(&self) -> Result<usize, String> {
        if self.axes.is_empty() || self.axes.len() > MAX_AXES {
            return Err(format!("the grid has {} axes, not 1 to {MAX_AXES}", self.axes.len()));
        }
        let mut points = 1_usize;
        for axis in &self.axes {
            let name = &axis.name;
            names::check(name)?;
            if axis.unit != "rad" && axis.unit != "m" {
                return Err(format!("axis {name} has unit {:?}, not rad or m", axis.unit));
            }
            if axis.count == 0 {
                return Err(format!("axis {name} has no grid lines"));
            }
            points = points.checked_mul(axis.count).ok_or("the grid has too many points")?;
            // Where a step is lost in rounding at either end, neighbouring grid lines coincide.
            let (first, last) = (axis.start, axis.last());
            let ascends = axis.step > 0.0 && first + axis.step > first && last - axis.step < last;
            if !(axis.step.is_finite() && first.is_finite() && last.is_finite() && ascends) {
                return Err(format!(
                    "axis {name} from {} by {} does not ascend through finite numbers",
                    axis.start, axis.step
                ));
            }
        }
        Ok(points)
    }

    /// The grid point nearest to `q`; `None` where `q` lies more than half a step outside the grid.
    #[must_use]
    pub fn nearest(&self, q: &[f64]) -> Option<usize> {
        self.axes.iter().zip(q).try_fold(0, |point, (axis, q)| {
            let line = ((q - axis.start) / axis.step).round();
            (line >= 0.0 && line < axis.count as f64).then(|| point * axis.count + line as usize)
        })
    }

    /// Returns the grid lines on which `point` lies, one per joint; further entries are zero.
    #[must_use]
    pub fn lines(&self, point: usize) -> [usize; MAX_AXES] {
        let (mut lines, mut rest) = ([0; MAX_AXES], point);
        for (line, axis) in lines.iter_mut().zip(&self.axes).rev() {
            (*line, rest) = (rest % axis.count, rest / axis.count);
        }
        lines
    }

    /// Returns the point on the grid lines `lines`, one per joint.
    #[must_use]
    pub fn point(&self, lines: impl IntoIterator<Item = usize>) -> usize {
        self.axes.iter().zip(lines).fold(0, |point, (axis, line)| point * axis.count + line)
    }

    /// Returns the points before and after `point` along `axis`.
    #[must_use]
    pub fn beside(&self, point: usize, axis: usize) -> [Option<usize>; 2] {
        let stride: usize = self.axes[axis + 1..].iter().map(|axis| axis.count).product();
        let (line, count) = (point / stride % self.axes[axis].count, self.axes[axis].count);
        [(line > 0).then(|| point - stride), (line + 1 < count).then(|| point + stride)]
    }

    /// Returns the points before and after `point` along each axis.
    pub fn neighbours(&self, point: usize) -> impl DoubleEndedIterator<Item = [Option<usize>; 2]> {
        (0..self.joints()).map(move |axis| self.beside(point, axis))
    }

    /// The configuration of the grid's range that is nearest to `q`, joint by joint.
    #[must_use]
    pub fn clamp(&self, q: &JointVector) -> JointVector {
        q.iter().zip(&self.axes).map(|(x, axis)| x.max(axis.start).min(axis.last())).collect()
    }

    /// Configuration q of grid point `point`.
    #[must_use]
    pub fn configuration(&self, point: usize) -> JointVector {
        self.axes.iter().zip(self.lines(point)).map(|(axis, line)| axis.coordinate(line)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(counts: &[usize]) -> Grid {
        let axis = |&count| Axis { name: "a".into(), unit: "rad".into(), start: -0.3, step: 0.1, count };
        Grid { axes: counts.iter().map(axis).collect() }
    }

    #[test]
    fn the_nearest_point_to_a_grid_point_is_itself() {
        for counts in [&[5][..], &[2, 3], &[3, 1, 4], &[2, 2, 2, 2, 2, 3]] {
            let grid = grid(counts);
            for point in 0..grid.points() {
                let mut q = grid.configuration(point);
                assert_eq!(grid.nearest(&q), Some(point));
                q.iter_mut().for_each(|x| *x += 0.049);
                assert_eq!(grid.nearest(&q), Some(point));
                q[0] -= 10.0;
                assert_eq!(grid.nearest(&q), None);
                q[0] = f64::NAN;
                assert_eq!(grid.nearest(&q), None);
            }
        }
    }

    #[test]
    fn points_are_numbered_with_the_last_axis_fastest() {
        let grid = grid(&[3, 1, 4]);
        for point in 0..grid.points() {
            let lines = grid.lines(point);
            assert_eq!(lines, [point / 4, 0, point % 4, 0, 0, 0]);
            assert_eq!(grid.point(lines), point);
            let before = |apart: usize, line: usize| (line > 0).then(|| point - apart);
            let after = |apart: usize, line: usize, count: usize| (line + 1 < count).then(|| point + apart);
            let along = |axis: usize, apart, count| [before(apart, lines[axis]), after(apart, lines[axis], count)];
            assert!(grid.neighbours(point).eq([along(0, 4, 3), [None; 2], along(2, 1, 4)]));
        }
    }

    #[test]
    fn a_grid_without_distinct_finite_lines_is_unsound() {
        assert_eq!(grid(&[5, 7]).check(), Ok(35));
        assert!(grid(&[]).check().is_err());
        assert!(grid(&[2; 7]).check().is_err());
        assert!(grid(&[usize::MAX, 2]).check().is_err());
        for (start, step) in [(0.0, 0.0), (0.0, -1.0), (1e17, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            let mut grid = grid(&[5]);
            (grid.axes[0].start, grid.axes[0].step) = (start, step);
            assert!(grid.check().is_err(), "{start} {step}");
        }
    }
}
