//! The virtual proxy: a serial chain of revolute and prismatic joints with contact nodes on its links.

use crate::scene::JointKind;
use glam::{DMat3, DVec3};

/// A serial chain.
pub struct Chain {
    pub joints: Vec<Joint>,
    /// Contact nodes of all links, link by link.
    pub nodes: Vec<Node>,
}

pub struct Joint {
    pub name: String,
    pub kind: JointKind,
    /// In the parent link's frame [m].
    pub origin: DVec3,
    /// Unit vector in the joint's frame.
    pub axis: DVec3,
    pub limits: [f64; 2],
    pub mass: f64,
    pub centre_of_mass: DVec3,
    pub inertia: DVec3,
    pub rotor_inertia: f64,
}

/// A contact node x_i.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// The joint whose link carries it.
    pub link: usize,
    /// In the link's frame [m].
    pub position: DVec3,
    /// [m]
    pub radius: f64,
}

/// The chain placed in the world at one configuration.
#[derive(Clone, Debug, Default)]
pub struct Pose {
    /// Link frames: origin [m] and rotation.
    pub origins: Vec<DVec3>,
    pub rotations: Vec<DMat3>,
    /// Joint axes, unit vectors in the world.
    pub axes: Vec<DVec3>,
    /// Node positions x_i [m].
    pub nodes: Vec<DVec3>,
}
