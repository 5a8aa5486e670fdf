//! The link frames at one configuration, in arrays: the real-time loop places the chain without a
//! [`Pose`](super::Pose).

use super::Chain;
use crate::MAX_JOINTS;
use crate::scene::JointKind;
use glam::{DMat3, DVec3};

/// Link frames and joint axes in the world; one entry for each link, then zeros.
#[derive(Clone, Copy, Debug)]
pub struct Links {
    /// Origins o of the link frames (m).
    pub origins: [DVec3; MAX_JOINTS],
    /// Rotations R of the link frames: from the link's frame to the world.
    pub rotations: [DMat3; MAX_JOINTS],
    /// Joint axes, unit vectors.
    pub axes: [DVec3; MAX_JOINTS],
}

impl Chain {
    /// The link frames at configuration `q`, one number per independent joint; missing ones count as zero. Allocates
    /// nothing.
    #[must_use]
    pub fn links(&self, q: &[f64]) -> Links {
        let mut links = Links {
            origins: [DVec3::ZERO; MAX_JOINTS],
            rotations: [DMat3::IDENTITY; MAX_JOINTS],
            axes: [DVec3::ZERO; MAX_JOINTS],
        };
        let (mut origin, mut rotation) = (DVec3::ZERO, DMat3::IDENTITY);
        for (index, link) in self.links.iter().enumerate().take(MAX_JOINTS) {
            let (joint, coordinate) = (&link.spec, link.coordinate(q));
            let axis = rotation * joint.axis;
            origin += rotation * joint.origin;
            match joint.kind {
                JointKind::Revolute => rotation *= DMat3::from_axis_angle(joint.axis, coordinate),
                JointKind::Prismatic => origin += coordinate * axis,
            }
            links.origins[index] = origin;
            links.rotations[index] = rotation;
            links.axes[index] = axis;
        }
        links
    }

    /// Position of contact node `node` (m) with the chain's links at `links`.
    #[must_use]
    pub fn node_position(&self, links: &Links, node: usize) -> DVec3 {
        let node = &self.nodes[node];
        links.origins[node.link] + links.rotations[node.link] * node.position
    }

    /// Columns of the Jacobian J_i of contact node `node` at `position`, as [`Chain::jacobian_column`] (m/rad or 1).
    #[must_use]
    pub fn node_jacobian(&self, links: &Links, node: usize, position: DVec3) -> [DVec3; MAX_JOINTS] {
        let mut columns = [DVec3::ZERO; MAX_JOINTS];
        for (index, link) in self.links.iter().enumerate().take(self.nodes[node].link + 1) {
            columns[link.joint] += link.multiplier
                * match link.spec.kind {
                    JointKind::Revolute => links.axes[index].cross(position - links.origins[index]),
                    JointKind::Prismatic => links.axes[index],
                };
        }
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::super::random;

    #[test]
    fn nodes_and_jacobians_are_those_of_the_pose() {
        for (chain, q, rate) in random::chains() {
            let (links, pose) = (chain.links(&q), random::at(&chain, &q, &rate, 0.0));
            for node in 0..chain.nodes.len() {
                let position = chain.node_position(&links, node);
                assert_eq!(position, pose.nodes[node]);
                let columns = chain.node_jacobian(&links, node, position);
                for (joint, column) in columns.iter().enumerate().take(q.len()) {
                    assert_eq!(*column, chain.jacobian_column(&pose, node, joint));
                }
            }
        }
    }
}
