//! How a configuration moves the links: the coordinate of each is an affine function of that of its own joint, or of
//! the joint that it follows.
//!
//! All together they are S q + c with a constant matrix S. By virtual work, efforts f at the links are torques S^T f of
//! the independent joints, and a quadratic form M over the links is S^T M S.

use super::Chain;
use crate::scene::{JointKind, JointSpec};
use crate::{JointMatrix, JointVector, MAX_JOINTS};

/// A link, and the joint that moves it.
#[derive(Clone, Debug)]
pub struct ChainLink {
    /// Its joint.
    pub spec: JointSpec,
    /// Number of the independent joint whose coordinate moves it.
    pub joint: usize,
    /// Factor on that coordinate: its own joint's is 1 (1, m/rad or rad/m).
    pub multiplier: f64,
    /// Coordinate of the link where that one is at zero (rad or m).
    pub offset: f64,
}

impl ChainLink {
    /// The link with the joint `spec`, which the independent joint `joint` moves.
    #[must_use]
    pub fn new(joint: usize, spec: &JointSpec) -> Self {
        let (multiplier, offset) = spec.follows.as_ref().map_or((1.0, 0.0), |it| (it.multiplier, it.offset));
        Self { spec: spec.clone(), joint, multiplier, offset }
    }

    /// Its coordinate at configuration `q`, whose missing numbers count as zero (rad or m).
    #[must_use]
    pub fn coordinate(&self, q: &[f64]) -> f64 {
        self.multiplier * q.get(self.joint).copied().unwrap_or(0.0) + self.offset
    }

    /// How far it slides at most with the independent joints within `ranges` (m).
    #[must_use]
    pub fn slide(&self, ranges: &[[f64; 2]]) -> f64 {
        let far = |end: f64| (self.multiplier * end + self.offset).abs();
        match (self.spec.kind, ranges.get(self.joint)) {
            (JointKind::Prismatic, Some([low, high])) => far(*low).max(far(*high)),
            _ => 0.0,
        }
    }
}

impl Chain {
    /// Rates of all links at the joint rates `v` (rad/s or m/s).
    #[must_use]
    pub(super) fn link_rates(&self, v: &[f64]) -> JointVector {
        self.links.iter().map(|link| link.multiplier * v.get(link.joint).copied().unwrap_or(0.0)).collect()
    }

    /// Torques of the independent joints that do the work of `efforts` at the links (N m or N).
    #[must_use]
    pub fn joint_torque(&self, efforts: &[f64]) -> JointVector {
        let mut torque = JointVector::zeros(self.joints.len());
        for (link, effort) in self.links.iter().zip(efforts) {
            torque[link.joint] += link.multiplier * effort;
        }
        torque
    }

    /// The quadratic form over the independent joints that `matrix` is over the links. Allocates nothing.
    #[must_use]
    pub fn joint_matrix(&self, matrix: &JointMatrix) -> JointMatrix {
        let mut gathered = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        for (a, row) in self.links.iter().zip(matrix) {
            for (b, entry) in self.links.iter().zip(row) {
                gathered[a.joint][b.joint] += a.multiplier * b.multiplier * entry;
            }
        }
        gathered
    }
}
