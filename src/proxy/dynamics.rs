//! Inertia M(q) and how it changes along the motion, in one pass and without allocation: what an integrator with
//! configuration-dependent inertia needs each tick.
//!
//! With spatial vectors about the world's origin (Featherstone, Rigid Body Dynamics Algorithms, 2008): joint j moves
//! all links from j on with twist s_j, and I_j is the inertia of those links together. Then for i <= j
//!
//! `M_ij = s_i . I_j s_j` (composite rigid body algorithm), and by how twists and inertias move with joint k
//! `dM_ij/dq_k = 0` for k <= i, `(s_i x s_k) . I_j s_j` for i < k <= j,
//! `(s_i x s_k) . I_k s_j + (s_j x s_k) . I_k s_i` for j < k.
//!
//! This is over all links; the matrices over the joints are gathered from it, for how joints move links is linear.
//!
//! The Christoffel matrix is `C_ij = 1/2 sum_k (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) v_k`: its symmetric part is half
//! of `Mdot`, its skew part `1/2 (W - W^T)` with `W_ij = sum_k dM_ik/dq_j v_k`.

use super::{Chain, ChainLink, Links};
use crate::scene::JointKind;
use crate::{JointMatrix, MAX_JOINTS};
use glam::{DMat3, DVec3};

/// M and its change at one configuration and one velocity.
#[derive(Clone, Copy, Debug)]
pub struct Dynamics {
    /// M (kg m^2; kg m or kg where prismatic joints take part).
    pub inertia: JointMatrix,
    /// dM/dt, symmetric (kg m^2/s).
    pub inertia_rate: JointMatrix,
    /// Skew part of the Christoffel matrix C (kg m^2/s).
    pub coriolis: JointMatrix,
}

/// A twist (angular velocity, velocity of the point at the world's origin) or a momentum (angular about the world's
/// origin, linear).
#[derive(Clone, Copy)]
struct Spatial {
    angular: DVec3,
    linear: DVec3,
}

/// Inertia of rigid links about the world's origin: mass, first moment m c, second moments.
#[derive(Clone, Copy)]
struct Inertia {
    mass: f64,
    first: DVec3,
    second: DMat3,
}

impl Spatial {
    fn dot(self, other: Self) -> f64 {
        self.angular.dot(other.angular) + self.linear.dot(other.linear)
    }

    /// Change of the twist `other` as it is carried along by this one.
    fn cross(self, other: Self) -> Self {
        Self {
            angular: self.angular.cross(other.angular),
            linear: self.angular.cross(other.linear) + self.linear.cross(other.angular),
        }
    }
}

impl Inertia {
    fn momentum(&self, twist: Spatial) -> Spatial {
        Spatial {
            angular: self.second * twist.angular + self.first.cross(twist.linear),
            linear: self.mass * twist.linear + twist.angular.cross(self.first),
        }
    }
}

impl Chain {
    /// M at `q` and its change at velocity `v`, one number per joint each. Allocates nothing.
    #[must_use]
    pub fn dynamics(&self, q: &[f64], v: &[f64]) -> Dynamics {
        let joints = self.links.len().min(MAX_JOINTS);
        let v = self.link_rates(v).padded();
        let links = self.links(q);
        let twists = self.twists(&links);
        let composite = self.composite_inertias(&links);
        let zero = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        let (mut inertia, mut rate, mut turning) = (zero, zero, zero);
        for j in 0..joints {
            let momentum = composite[j].momentum(twists[j]);
            for i in 0..=j {
                inertia[i][j] = twists[i].dot(momentum);
                inertia[j][i] = inertia[i][j];
                for k in i + 1..joints {
                    let moved = twists[i].cross(twists[k]);
                    let slope = if k <= j {
                        moved.dot(momentum)
                    } else {
                        moved.dot(composite[k].momentum(twists[j]))
                            + twists[j].cross(twists[k]).dot(composite[k].momentum(twists[i]))
                    };
                    rate[i][j] += slope * v[k];
                    turning[i][k] += slope * v[j];
                    if i != j {
                        turning[j][k] += slope * v[i];
                    }
                }
                rate[j][i] = rate[i][j];
            }
            inertia[j][j] += self.links[j].spec.rotor_inertia;
        }
        let mut coriolis = zero;
        for i in 0..joints {
            for j in 0..joints {
                coriolis[i][j] = 0.5 * (turning[i][j] - turning[j][i]);
            }
        }
        let [inertia, inertia_rate, coriolis] = [inertia, rate, coriolis].map(|matrix| self.joint_matrix(&matrix));
        Dynamics { inertia, inertia_rate, coriolis }
    }

    fn twists(&self, links: &Links) -> [Spatial; MAX_JOINTS] {
        let mut twists = [Spatial { angular: DVec3::ZERO, linear: DVec3::ZERO }; MAX_JOINTS];
        for (index, ChainLink { spec: joint, .. }) in self.links.iter().enumerate().take(MAX_JOINTS) {
            let axis = links.axes[index];
            twists[index] = match joint.kind {
                JointKind::Revolute => Spatial { angular: axis, linear: links.origins[index].cross(axis) },
                JointKind::Prismatic => Spatial { angular: DVec3::ZERO, linear: axis },
            };
        }
        twists
    }

    /// Inertia of all links from each joint on.
    fn composite_inertias(&self, links: &Links) -> [Inertia; MAX_JOINTS] {
        let mut sum = Inertia { mass: 0.0, first: DVec3::ZERO, second: DMat3::ZERO };
        let mut composite = [sum; MAX_JOINTS];
        for (index, ChainLink { spec: joint, .. }) in self.links.iter().enumerate().take(MAX_JOINTS).rev() {
            let rotation = links.rotations[index];
            let centre = links.origins[index] + rotation * joint.centre_of_mass;
            let outer = DMat3::from_cols(centre.x * centre, centre.y * centre, centre.z * centre);
            let about_origin = DMat3::from_diagonal(DVec3::splat(centre.length_squared())) - outer;
            sum.mass += joint.mass;
            sum.first += joint.mass * centre;
            sum.second += rotation * joint.inertia * rotation.transpose() + joint.mass * about_origin;
            composite[index] = sum;
        }
        composite
    }
}

#[cfg(test)]
mod tests {
    use super::super::random;
    use super::*;

    #[test]
    fn inertia_is_that_of_the_sum_over_the_links() {
        for (chain, q, rate) in random::chains() {
            let (inertia, found) =
                (chain.inertia(&random::at(&chain, &q, &rate, 0.0)), chain.dynamics(&q, &rate).inertia);
            for (expected, found) in inertia.iter().flatten().zip(found.iter().flatten()) {
                assert!((expected - found).abs() < 1e-13, "{found} for {expected}");
            }
        }
    }

    #[test]
    fn rates_are_those_of_finite_differences() {
        const STEP: f64 = 1e-5;
        for (chain, q, v) in random::chains() {
            let joints = q.len();
            let inertia = |direction: &[f64], t: f64| chain.inertia(&random::at(&chain, &q, direction, t));
            let slope = |k: usize| {
                let mut unit = [0.0; MAX_JOINTS];
                unit[k] = 1.0;
                let (after, before) = (inertia(&unit[..joints], STEP), inertia(&unit[..joints], -STEP));
                move |i: usize, j: usize| (after[i][j] - before[i][j]) / (2.0 * STEP)
            };
            let slopes: Vec<_> = (0..joints).map(slope).collect();
            let found = chain.dynamics(&q, &v);
            for i in 0..joints {
                for j in 0..joints {
                    let rate: f64 = (0..joints).map(|k| slopes[k](i, j) * v[k]).sum();
                    // C less C^T, straight from Christoffel's symbols.
                    let skew: f64 = (0..joints).map(|k| 0.5 * (slopes[j](i, k) - slopes[i](j, k)) * v[k]).sum();
                    assert!((found.inertia_rate[i][j] - rate).abs() < 1e-8, "{} for {rate}", found.inertia_rate[i][j]);
                    assert!((found.coriolis[i][j] - skew).abs() < 1e-8, "{} for {skew}", found.coriolis[i][j]);
                }
            }
        }
    }
}
