//! The chain and its forward kinematics.

use super::ChainLink;
use crate::JointVector;
use crate::scene::{JointSpec, ProxyNodeSpec, ProxySpec};
use glam::{DMat3, DVec3};

/// A serial chain.
#[derive(Clone, Debug, Default)]
pub struct Chain {
    /// Those that move independently, from the base outwards: a configuration has one coordinate for each.
    pub joints: Vec<JointSpec>,
    /// All joints, those that follow others included, from the base outwards.
    pub links: Vec<ChainLink>,
    /// Contact nodes of all links, link by link.
    pub nodes: Vec<Node>,
}

/// A contact node x_i.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// The link that carries it.
    pub link: usize,
    /// In the link's frame (m).
    pub position: DVec3,
    /// Zero for the paper's point nodes (m).
    pub radius: f64,
    /// Length of the link that the node stands for; zero for a node by itself (m).
    pub length: f64,
}

/// The chain placed in the world at one configuration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// Origins of the link frames (m).
    pub origins: Vec<DVec3>,
    /// Rotations of the link frames: from the link's frame to the world.
    pub rotations: Vec<DMat3>,
    /// Joint axes, unit vectors in the world.
    pub axes: Vec<DVec3>,
    /// Node positions x_i (m).
    pub nodes: Vec<DVec3>,
}

impl Chain {
    /// The chain of a validated scene.
    #[must_use]
    pub fn new(spec: &ProxySpec) -> Self {
        let links: Vec<ChainLink> = spec.links().into_iter().map(|(joint, spec)| ChainLink::new(joint, spec)).collect();
        let nodes = links.iter().enumerate().flat_map(|(link, joint)| {
            let node = move |node: &ProxyNodeSpec| Node {
                link,
                position: node.position,
                radius: node.radius,
                length: node.length,
            };
            joint.spec.nodes.iter().map(node)
        });
        let nodes = nodes.collect();
        Self { joints: spec.joints.clone(), links, nodes }
    }

    /// Number of coordinates d.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> usize {
        self.joints.len()
    }

    /// The chain at q = 0.
    #[must_use]
    pub fn new_pose(&self) -> Pose {
        let mut pose = Pose::default();
        self.pose(&JointVector::zeros(self.joints.len()), &mut pose);
        pose
    }

    /// Places the chain at configuration `q`, one number per independent joint; missing ones count as zero. Allocates
    /// only where `pose` does not have the chain's size yet.
    pub fn pose(&self, q: &[f64], pose: &mut Pose) {
        let links = self.links.len();
        pose.origins.resize(links, DVec3::ZERO);
        pose.rotations.resize(links, DMat3::IDENTITY);
        pose.axes.resize(links, DVec3::ZERO);
        pose.nodes.resize(self.nodes.len(), DVec3::ZERO);

        let links = self.links(q);
        pose.origins.iter_mut().zip(links.origins).for_each(|(slot, origin)| *slot = origin);
        pose.rotations.iter_mut().zip(links.rotations).for_each(|(slot, rotation)| *slot = rotation);
        pose.axes.iter_mut().zip(links.axes).for_each(|(slot, axis)| *slot = axis);
        let mut positions = &mut pose.nodes[..];
        for nodes in self.nodes.chunk_by(|a, b| a.link == b.link) {
            let (origin, rotation) = (pose.origins[nodes[0].link], pose.rotations[nodes[0].link]);
            for (position, node) in positions.iter_mut().zip(nodes) {
                *position = origin + rotation * node.position;
            }
            positions = &mut std::mem::take(&mut positions)[nodes.len()..];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::random;
    use super::*;
    use crate::scene::{Follows, JointKind};

    #[test]
    fn a_pose_is_reused_without_leaving_a_trace() {
        for (chain, q, rate) in random::chains() {
            let mut reused = random::at(&chain, &q, &rate, 0.7);
            let places = (reused.nodes.as_ptr(), reused.origins.as_ptr());
            chain.pose(&q, &mut reused);
            assert_eq!(reused, random::at(&chain, &q, &rate, 0.0));
            assert_eq!(places, (reused.nodes.as_ptr(), reused.origins.as_ptr()), "the pose was allocated anew");
        }
    }

    #[test]
    fn links_are_rigid() {
        for (chain, q, rate) in random::chains() {
            let (before, after) = (chain.new_pose(), random::at(&chain, &q, &rate, 0.0));
            for (i, a) in chain.nodes.iter().enumerate() {
                for (j, b) in chain.nodes.iter().enumerate().filter(|(_, b)| b.link == a.link) {
                    let lengths = [&before, &after].map(|pose| pose.nodes[i].distance(pose.nodes[j]));
                    assert!((lengths[0] - lengths[1]).abs() < 1e-14);
                    assert!((lengths[0] - a.position.distance(b.position)).abs() < 1e-14);
                }
            }
            for rotation in &after.rotations {
                assert!((rotation.determinant() - 1.0).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn a_planar_arm_reaches_where_trigonometry_says() {
        let joint = |x: f64| JointSpec {
            name: String::new(),
            kind: JointKind::Revolute,
            origin: DVec3::new(x, 0.0, 0.0),
            axis: DVec3::Z,
            limits: [-4.0, 4.0],
            mass: 1.0,
            centre_of_mass: DVec3::ZERO,
            inertia: DMat3::ZERO,
            rotor_inertia: 1.0,
            nodes: Vec::new(),
            follows: None,
        };
        let mut joints = vec![joint(0.0), joint(0.5)];
        joints[1].nodes = vec![ProxyNodeSpec { position: DVec3::new(0.3, 0.0, 0.0), radius: 0.0, length: 0.0 }];
        let chain = Chain::new(&ProxySpec::new(joints.clone()).unwrap());
        let (a, b) = (0.4_f64, 1.1_f64);
        let pose = random::at(&chain, &[a, b], &[0.0, 0.0], 0.0);
        let expected = DVec3::new(0.5 * a.cos() + 0.3 * (a + b).cos(), 0.5 * a.sin() + 0.3 * (a + b).sin(), 0.0);
        assert!(pose.nodes[0].distance(expected) < 1e-15);
        // The second joint as the first one's follower: one coordinate moves both.
        joints[0].name = "first".into();
        joints[1].follows = Some(Follows { joint: "first".into(), multiplier: 1.0, offset: b - a });
        let chain = Chain::new(&ProxySpec::new(joints).unwrap());
        assert_eq!(random::at(&chain, &[a], &[0.0], 0.0).nodes, pose.nodes);
    }
}
