//! Random chains for this room's tests: 1 to 6 joints, both kinds mixed, the same in every run.

use super::{Chain, Node};
use crate::JointVector;
use crate::random::Random;
use crate::scene::{JointKind, JointSpec};
use glam::DMat3;

/// Sixty chains, each with a configuration and a rate.
pub fn chains() -> impl Iterator<Item = (Chain, JointVector, JointVector)> {
    (0..60).map(|seed: u64| {
        let mut random = Random::new(seed * 7919 + 1);
        let count = 1 + seed as usize % 6;
        let joints = (0..count).map(|index| JointSpec {
            name: format!("q{index}"),
            kind: if random.between(-1.0, 1.0) < 0.3 { JointKind::Prismatic } else { JointKind::Revolute },
            origin: 0.2 * random.vector(),
            axis: random.vector().normalize(),
            limits: [-2.0, 2.0],
            mass: 0.1 + random.between(-1.0, 1.0).abs(),
            centre_of_mass: 0.1 * random.vector(),
            inertia: {
                // Positive semidefinite, with products of inertia.
                let root = DMat3::from_cols(random.vector(), random.vector(), random.vector());
                1e-3 * root * root.transpose()
            },
            rotor_inertia: 1e-3 * (1.1 + random.between(-1.0, 1.0)),
            nodes: Vec::new(),
        });
        let joints: Vec<JointSpec> = joints.collect();
        let nodes =
            (0..3 * count).map(|k| Node { link: k / 3, position: 0.2 * random.vector(), radius: 0.0, length: 0.0 });
        let nodes = nodes.collect();
        let mut vector = |size: f64| {
            JointVector::from_slice(&(0..count).map(|_| size * random.between(-1.0, 1.0)).collect::<Vec<_>>())
        };
        let (q, rate) = (vector(2.0), vector(3.0));
        (Chain { joints, nodes }, q, rate)
    })
}

/// The chain at q + t rate.
pub fn at(chain: &Chain, q: &[f64], rate: &[f64], t: f64) -> super::Pose {
    let moved: Vec<f64> = q.iter().zip(rate).map(|(q, rate)| q + t * rate).collect();
    let mut pose = chain.new_pose();
    chain.pose(&moved, &mut pose);
    pose
}
