//! Random chains for this room's tests: 1 to 6 links, both kinds mixed, the same in every run. In every other one joint
//! follows another, from before it or behind it.

use super::Chain;
use crate::JointVector;
use crate::random::Random;
use crate::scene::{Follows, JointKind, JointSpec, ProxyNodeSpec, ProxySpec};
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
            follows: None,
        });
        let mut joints: Vec<JointSpec> = joints.collect();
        for joint in &mut joints {
            let node = || ProxyNodeSpec { position: 0.2 * random.vector(), radius: 0.0, length: 0.0 };
            joint.nodes = std::iter::repeat_with(node).take(3).collect();
        }
        if seed % 2 == 1 && count > 1 {
            let [follower, leader] = [seed as usize / 2 % count, (seed as usize / 2 + 1) % count];
            let (multiplier, offset) = (1.5 * random.between(-1.0, 1.0), random.between(-1.0, 1.0));
            joints[follower].limits = [-9.0, 9.0];
            joints[follower].follows = Some(Follows { joint: joints[leader].name.clone(), multiplier, offset });
        }
        let chain = Chain::new(&ProxySpec::new(joints).unwrap());
        let mut vector =
            |size: f64| -> JointVector { (0..chain.joints.len()).map(|_| size * random.between(-1.0, 1.0)).collect() };
        let (q, rate) = (vector(2.0), vector(3.0));
        (chain, q, rate)
    })
}

/// The chain at q + t rate.
pub fn at(chain: &Chain, q: &[f64], rate: &[f64], t: f64) -> super::Pose {
    let moved: Vec<f64> = q.iter().zip(rate).map(|(q, rate)| q + t * rate).collect();
    let mut pose = chain.new_pose();
    chain.pose(&moved, &mut pose);
    pose
}
