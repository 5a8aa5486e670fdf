//! Inertia M(q) of the chain: kinetic energy is 1/2 qdot^T M qdot.
//!
//! M = sum over links of m Jv^T Jv + Jw^T I Jw, plus the actuators' reflected inertia on the diagonal: Jv is the Jacobian
//! of the link's centre of mass, Jw that of its rotation, I its inertia turned into the world. Every reflected inertia is
//! positive in a validated scene, so that M is positive definite in every configuration, singular arms included.

use super::{Chain, Pose};
use crate::MAX_JOINTS;
use crate::scene::JointKind;
use glam::{DMat3, DVec3};

/// A square matrix over the joints: the first d rows and columns count, the others are zero.
pub type JointMatrix = [[f64; MAX_JOINTS]; MAX_JOINTS];

impl Chain {
    /// Inertia M at `pose`, symmetric positive definite [kg m^2; kg m or kg where prismatic joints take part]. Allocates
    /// nothing.
    #[must_use]
    pub fn inertia(&self, pose: &Pose) -> JointMatrix {
        let mut inertia = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        for (link, joint) in self.joints.iter().enumerate().take(MAX_JOINTS) {
            inertia[link][link] += joint.rotor_inertia;
            let rotation = pose.rotations[link];
            let centre = pose.origins[link] + rotation * joint.centre_of_mass;
            let moments = rotation * DMat3::from_diagonal(joint.inertia) * rotation.transpose();
            for (i, row) in inertia.iter_mut().enumerate().take(link + 1) {
                let momentum = joint.mass * self.point_velocity(pose, centre, i);
                let spin = moments * self.spin(pose, i);
                for (j, entry) in row.iter_mut().enumerate().take(i + 1) {
                    *entry += momentum.dot(self.point_velocity(pose, centre, j)) + spin.dot(self.spin(pose, j));
                }
            }
        }
        let lower = inertia;
        for (i, row) in inertia.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate().skip(i + 1) {
                *entry = lower[j][i];
            }
        }
        inertia
    }

    /// Angular velocity of the links beyond `joint`, for a unit rate of it.
    fn spin(&self, pose: &Pose, joint: usize) -> DVec3 {
        match self.joints[joint].kind {
            JointKind::Revolute => pose.axes[joint],
            JointKind::Prismatic => DVec3::ZERO,
        }
    }
}
