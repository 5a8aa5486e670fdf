//! Torque of gravity on the chain.

use super::{Chain, ChainLink, Pose};
use crate::JointVector;
use glam::DVec3;

impl Chain {
    /// Torque with which gravity, of acceleration `gravity` (m/s^2), moves the joints at `pose`: sum over links of
    /// m Jv^T g, Jv the Jacobian of the link's centre of mass (N m or N).
    #[must_use]
    pub fn gravity_torque(&self, pose: &Pose, gravity: DVec3) -> JointVector {
        let mut torque = JointVector::zeros(self.links.len());
        for (link, ChainLink { spec: joint, .. }) in self.links.iter().enumerate() {
            let centre = pose.origins[link] + pose.rotations[link] * joint.centre_of_mass;
            for (i, torque) in torque.iter_mut().enumerate().take(link + 1) {
                *torque += joint.mass * self.point_velocity(pose, centre, i).dot(gravity);
            }
        }
        self.joint_torque(&torque)
    }
}

#[cfg(test)]
mod tests {
    use super::super::random;
    use super::*;

    #[test]
    fn gravity_torque_is_the_slope_of_the_height_energy() {
        const STEP: f64 = 1e-6;
        let gravity = DVec3::new(0.3, -0.2, -9.81);
        for (chain, q, rate) in random::chains() {
            let energy = |t: f64| {
                let pose = random::at(&chain, &q, &rate, t);
                let height =
                    |link: usize| pose.origins[link] + pose.rotations[link] * chain.links[link].spec.centre_of_mass;
                -(0..chain.links.len()).map(|link| chain.links[link].spec.mass * height(link).dot(gravity)).sum::<f64>()
            };
            let power = chain.gravity_torque(&random::at(&chain, &q, &rate, 0.0), gravity).dot(&rate);
            let slope = (energy(STEP) - energy(-STEP)) / (2.0 * STEP);
            assert!((power + slope).abs() < 1e-7, "{power} {slope}");
        }
    }
}
