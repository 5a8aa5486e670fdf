//! The uniform grid over C-space.

use crate::JointVector;
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
