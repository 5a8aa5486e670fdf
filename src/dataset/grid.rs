//! The uniform grid over C-space.

use crate::{JointVector, MAX_JOINTS};
use serde::{Deserialize, Serialize};

/// Grid coordinates `start + k step`, `k < count`, of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// The joint's name.
    pub name: String,
    /// `rad` or `m`.
    pub unit: String,
    /// First grid line [rad or m].
    pub start: f64,
    /// Distance between grid lines, positive [rad or m].
    pub step: f64,
    /// Number of grid lines.
    pub count: usize,
}

/// A uniform grid, last axis fastest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// One per joint, in the chain's order.
    pub axes: Vec<Axis>,
}

impl Axis {
    /// Coordinate of grid line `k` [rad or m].
    #[must_use]
    pub fn coordinate(&self, k: usize) -> f64 {
        self.start + k as f64 * self.step
    }

    /// Unit of what acts along the axis: a torque, or a force where the joint is prismatic.
    #[must_use]
    pub fn effort_unit(&self) -> &'static str {
        if self.unit == "m" { "N" } else { "N m" }
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

    /// Number of points of a sound grid: 1 to [`MAX_JOINTS`] axes of ascending, finite, distinct grid lines, and no more
    /// points than can be counted.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check(&self) -> Result<usize, String> {
        if self.axes.is_empty() || self.axes.len() > MAX_JOINTS {
            return Err(format!("the grid has {} axes, not 1 to {MAX_JOINTS}", self.axes.len()));
        }
        let mut points = 1_usize;
        for axis in &self.axes {
            let name = &axis.name;
            if axis.unit != "rad" && axis.unit != "m" {
                return Err(format!("axis {name} has unit {:?}, not rad or m", axis.unit));
            }
            if axis.count == 0 {
                return Err(format!("axis {name} has no grid lines"));
            }
            points = points.checked_mul(axis.count).ok_or("the grid has too many points")?;
            // Where a step is lost in rounding at either end, neighbouring grid lines coincide.
            let (first, last) = (axis.coordinate(0), axis.coordinate(axis.count - 1));
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

    /// Configuration q of grid point `point`.
    #[must_use]
    pub fn configuration(&self, point: usize) -> JointVector {
        let mut q = JointVector::zeros(self.joints());
        let mut rest = point;
        for (axis, value) in self.axes.iter().zip(q.iter_mut()).rev() {
            *value = axis.coordinate(rest % axis.count);
            rest /= axis.count;
        }
        q
    }
}
