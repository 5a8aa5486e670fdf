//! Inertia M(q) of the chain: kinetic energy is 1/2 qdot^T M qdot.
//!
//! M = sum over links of m Jv^T Jv + Jw^T I Jw, plus the actuators' reflected inertia on the diagonal: Jv is the
//! Jacobian of the link's centre of mass, Jw that of its rotation, I its inertia turned into the world. Every reflected
//! inertia is positive in a validated scene, so that M is positive definite in every configuration, singular arms
//! included.

use super::{Chain, ChainLink, Pose};
use crate::scene::JointKind;
use crate::{JointMatrix, MAX_JOINTS};
use glam::DVec3;

impl Chain {
    /// Inertia M at `pose`, symmetric positive definite (kg m^2; kg m or kg where prismatic joints take part).
    /// Allocates nothing.
    #[must_use]
    pub fn inertia(&self, pose: &Pose) -> JointMatrix {
        let mut inertia = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        for (link, ChainLink { spec: joint, .. }) in self.links.iter().enumerate().take(MAX_JOINTS) {
            inertia[link][link] += joint.rotor_inertia;
            let rotation = pose.rotations[link];
            let centre = pose.origins[link] + rotation * joint.centre_of_mass;
            let moments = rotation * joint.inertia * rotation.transpose();
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
        self.joint_matrix(&inertia)
    }

    /// Angular velocity of `link` and those beyond it, for a unit rate of it.
    pub(super) fn spin(&self, pose: &Pose, link: usize) -> DVec3 {
        match self.links[link].spec.kind {
            JointKind::Revolute => pose.axes[link],
            JointKind::Prismatic => DVec3::ZERO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::random;
    use super::*;
    use crate::random::Random;

    /// Twice the kinetic energy at `rate`.
    fn twice_energy(inertia: &JointMatrix, rate: &[f64]) -> f64 {
        rate.iter().enumerate().map(|(i, a)| a * rate.iter().zip(inertia[i]).map(|(b, m)| b * m).sum::<f64>()).sum()
    }

    #[test]
    fn kinetic_energy_is_the_sum_over_the_links() {
        const STEP: f64 = 1e-5;
        for (chain, q, rate) in random::chains() {
            let [before, pose, after] = [-STEP, 0.0, STEP].map(|t| random::at(&chain, &q, &rate, t));
            let mut energy = 0.0;
            let rates = chain.link_rates(&rate);
            for (link, ChainLink { spec: joint, .. }) in chain.links.iter().enumerate() {
                // Velocities by central differences of the link's placement, and the spin from R^T dR/dt = [w] in its
                // frame.
                let centre = |pose: &Pose| pose.origins[link] + pose.rotations[link] * joint.centre_of_mass;
                let velocity = (centre(&after) - centre(&before)) / (2.0 * STEP);
                let turning = (after.rotations[link] - before.rotations[link]) * (0.5 / STEP);
                let cross = pose.rotations[link].transpose() * turning;
                let spin = DVec3::new(cross.y_axis.z, cross.z_axis.x, cross.x_axis.y);
                energy += joint.mass * velocity.length_squared() + (joint.inertia * spin).dot(spin);
                energy += joint.rotor_inertia * rates[link] * rates[link];
            }
            let product = twice_energy(&chain.inertia(&pose), &rate);
            assert!((product / energy - 1.0).abs() < 1e-7, "{product} against {energy}");
        }
    }

    #[test]
    fn inertia_is_symmetric_and_positive_definite() {
        for (chain, q, rate) in random::chains() {
            let inertia = chain.inertia(&random::at(&chain, &q, &rate, 0.0));
            let count = q.len();
            let least_rotor = chain.joints.iter().map(|joint| joint.rotor_inertia).fold(f64::INFINITY, f64::min);
            let mut random = Random::new(11);
            for (i, row) in inertia.iter().enumerate() {
                for (j, entry) in row.iter().enumerate() {
                    assert_eq!(*entry, inertia[j][i]);
                    assert!((i < count && j < count) || *entry == 0.0);
                }
            }
            for _ in 0..50 {
                let direction: Vec<f64> = (0..count).map(|_| random.between(-1.0, 1.0)).collect();
                let squared: f64 = direction.iter().map(|x| x * x).sum();
                assert!(twice_energy(&inertia, &direction) >= 0.999 * least_rotor * squared);
            }
        }
    }
}
