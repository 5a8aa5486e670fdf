//! Jacobians J_i of the contact nodes, column by column.
//!
//! Column j of J_i is the velocity of node i for a unit rate of joint j: a_j x (x_i - o_j) for a revolute joint with axis
//! a_j through o_j, a_j for a prismatic one, and zero where joint j lies beyond the node's link.

use super::{Chain, Pose};
use crate::JointVector;
use crate::scene::JointKind;
use glam::DVec3;

impl Chain {
    /// Column `joint` of J_i of contact node `node` [m/rad, or 1 for a prismatic joint].
    #[must_use]
    pub fn jacobian_column(&self, pose: &Pose, node: usize, joint: usize) -> DVec3 {
        if joint > self.nodes[node].link {
            return DVec3::ZERO;
        }
        self.point_velocity(pose, pose.nodes[node], joint)
    }

    /// Adds J_i^T `force` to `torque`, for a force [N] at contact node `node`.
    pub fn add_torque(&self, pose: &Pose, node: usize, force: DVec3, torque: &mut JointVector) {
        for (joint, torque) in torque.iter_mut().enumerate() {
            *torque += self.jacobian_column(pose, node, joint).dot(force);
        }
    }

    /// Velocity, for a unit rate of `joint`, of a point that moves with a link beyond it.
    pub(super) fn point_velocity(&self, pose: &Pose, point: DVec3, joint: usize) -> DVec3 {
        let axis = pose.axes[joint];
        match self.joints[joint].kind {
            JointKind::Revolute => axis.cross(point - pose.origins[joint]),
            JointKind::Prismatic => axis,
        }
    }
}
