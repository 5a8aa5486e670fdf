//! Jacobians J_i of the contact nodes, column by column.
//!
//! Column j of J_i is the velocity of node i for a unit rate of joint j: a_j x (x_i - o_j) for a revolute joint with
//! axis a_j through o_j, a_j for a prismatic one, and zero where joint j lies beyond the node's link. The columns of
//! joints that follow it add to it, each times its multiplier.

use super::{Chain, Pose};
use crate::JointVector;
use crate::scene::JointKind;
use glam::DVec3;

impl Chain {
    /// Column `joint` of J_i of contact node `node` (m/rad, or 1 for a prismatic joint).
    #[must_use]
    pub fn jacobian_column(&self, pose: &Pose, node: usize, joint: usize) -> DVec3 {
        let velocity = |link: usize| self.links[link].multiplier * self.point_velocity(pose, pose.nodes[node], link);
        self.inward(node).filter(|link| self.links[*link].joint == joint).map(velocity).sum()
    }

    /// Second derivative of the position of contact node `node` by the coordinates of `joints`: that of two links is the
    /// velocity for the outer one turned about the axis of the inner one (m/rad^2, m/rad or 0).
    #[must_use]
    pub fn node_curvature(&self, pose: &Pose, node: usize, joints: [usize; 2]) -> DVec3 {
        let moved_by = |joint| self.inward(node).filter(move |link| self.links[*link].joint == joint);
        let pairs = moved_by(joints[0]).flat_map(|a| moved_by(joints[1]).map(move |b| [a, b]));
        let curvature = |[a, b]: [usize; 2]| {
            let turn = self.spin(pose, a.min(b)).cross(self.point_velocity(pose, pose.nodes[node], a.max(b)));
            self.links[a].multiplier * self.links[b].multiplier * turn
        };
        pairs.map(curvature).sum()
    }

    /// Numbers of the links that carry contact node `node`.
    fn inward(&self, node: usize) -> std::ops::RangeInclusive<usize> {
        0..=self.nodes[node].link
    }

    /// Adds J_i^T `force` to `torque`, for a force (N) at contact node `node`.
    pub fn add_torque(&self, pose: &Pose, node: usize, force: DVec3, torque: &mut JointVector) {
        for (joint, torque) in torque.iter_mut().enumerate() {
            *torque += self.jacobian_column(pose, node, joint).dot(force);
        }
    }

    /// Upper bounds r_ij of `|J_ij|` for each contact node i, at all configurations whose prismatic joints are within
    /// `ranges` [m/rad, or 1 for a prismatic joint]: the lengths of the links between joint j and the node, added up.
    #[must_use]
    pub fn jacobian_bounds(&self, ranges: &[[f64; 2]]) -> Vec<JointVector> {
        let of_joints = |bounds: JointVector| {
            let mut gathered = JointVector::zeros(self.joints.len());
            self.links
                .iter()
                .zip(bounds.iter())
                .for_each(|(link, r)| gathered[link.joint] += link.multiplier.abs() * r);
            gathered
        };
        self.link_bounds(ranges).into_iter().map(of_joints).collect()
    }

    /// The same of each link: bounds of the node's velocity for a unit rate of that link alone.
    #[must_use]
    pub fn link_bounds(&self, ranges: &[[f64; 2]]) -> Vec<JointVector> {
        let bounds = self.nodes.iter().map(|node| {
            let mut bound = JointVector::zeros(self.links.len());
            let mut distance = node.position.length();
            for (bound, link) in bound.iter_mut().zip(&self.links).take(node.link + 1).rev() {
                *bound = match link.spec.kind {
                    JointKind::Revolute => distance,
                    JointKind::Prismatic => 1.0,
                };
                distance += link.spec.origin.length() + link.slide(ranges);
            }
            bound
        });
        bounds.collect()
    }

    /// Velocity, for a unit rate of `link`, of a point that moves with it or with a link beyond it.
    pub(super) fn point_velocity(&self, pose: &Pose, point: DVec3, link: usize) -> DVec3 {
        let axis = pose.axes[link];
        match self.links[link].spec.kind {
            JointKind::Revolute => axis.cross(point - pose.origins[link]),
            JointKind::Prismatic => axis,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::random;
    use super::*;
    use crate::random::Random;

    /// Step of central differences: their error is a sixth of its square times third derivatives of order one.
    const STEP: f64 = 1e-5;

    #[test]
    fn jacobian_is_the_derivative_of_the_node_s_position() {
        for (chain, q, _) in random::chains() {
            let pose = random::at(&chain, &q, &q, 0.0);
            for joint in 0..chain.degrees_of_freedom() {
                let mut unit = JointVector::zeros(q.len());
                unit[joint] = 1.0;
                let (after, before) = (random::at(&chain, &q, &unit, STEP), random::at(&chain, &q, &unit, -STEP));
                for node in 0..chain.nodes.len() {
                    let difference = (after.nodes[node] - before.nodes[node]) / (2.0 * STEP);
                    let column = chain.jacobian_column(&pose, node, joint);
                    assert!(difference.distance(column) < 1e-9, "{difference} against {column}");
                }
            }
        }
    }

    #[test]
    fn curvature_is_the_derivative_of_the_jacobian_and_bounds_are_kept() {
        for (chain, q, _) in random::chains() {
            let pose = random::at(&chain, &q, &q, 0.0);
            let ranges: Vec<[f64; 2]> = q.iter().map(|q| [*q, *q]).collect();
            let bounds = chain.jacobian_bounds(&ranges);
            for (joint, other) in (0..q.len()).flat_map(|j| (0..q.len()).map(move |k| (j, k))) {
                let mut unit = JointVector::zeros(q.len());
                unit[other] = 1.0;
                let [before, after] = [-STEP, STEP].map(|t| random::at(&chain, &q, &unit, t));
                for (node, bound) in bounds.iter().enumerate() {
                    let column = |pose| chain.jacobian_column(pose, node, joint);
                    assert!(column(&pose).length() <= bound[joint] + 1e-12);
                    let difference = (column(&after) - column(&before)) / (2.0 * STEP);
                    let curvature = chain.node_curvature(&pose, node, [joint, other]);
                    assert!(difference.distance(curvature) < 1e-9, "{difference} against {curvature}");
                }
            }
        }
    }

    #[test]
    fn torque_does_the_work_of_the_force() {
        let mut random = Random::new(5);
        for (chain, q, rate) in random::chains() {
            let pose = random::at(&chain, &q, &rate, 0.0);
            let (mut torque, mut power) = (JointVector::zeros(q.len()), 0.0);
            for node in 0..chain.nodes.len() {
                let force = random.vector();
                chain.add_torque(&pose, node, force, &mut torque);
                let columns = rate.iter().enumerate().map(|(j, rate)| *rate * chain.jacobian_column(&pose, node, j));
                power += force.dot(columns.sum());
            }
            assert!((torque.dot(&rate) - power).abs() < 1e-12 * (1.0 + power.abs()));
        }
    }
}
