//! A simulated rig: the proxy's chain as a driven device, and a spongy block that it touches. Nothing here is real, and
//! every log says so.
//!
//! `M(q) qddot = tau + noise + g(q) - b qdot - dry friction + sum_i J_i^T f_i`, M and g of the chain, f_i the forces of
//! the sponge on its contact nodes, plus a hand's torque where one leads the device. Coriolis terms are left out: at
//! the speeds of a scan (0.5 rad/s, links of 0.14 m and 0.1 kg) they are below 1e-3 N m. Stepped by semi-implicit Euler
//! at a quarter of the control period; dry friction is bounded by what stops the joint within a step, so that it never
//! drives it. Positions are read in whole encoder counts.

mod hand;
mod sponge;

pub use hand::Hand;
pub use sponge::{NodeContact, Sponge};

use crate::{
    JointVector,
    device::{Applied, Device, Halt, Reading},
    joint_matrix::solve_positive,
    proxy::{Chain, Pose},
    random::Random,
    scene::{Cover, JointKind, ProxySpec, SpecimenSpec},
};
use glam::DVec3;

/// Steps of the simulation within one control period.
const STEPS: usize = 4;
/// Viscous friction of the device's joints, relative to their inertia (1/s).
const VISCOUS: f64 = 5.0;

/// A device and a block, simulated.
#[derive(Clone, Debug)]
pub struct SimulatedRig {
    chain: Chain,
    sponge: Sponge,
    spec: SpecimenSpec,
    gravity: DVec3,
    contacts: Vec<NodeContact>,
    pose: Pose,
    position: JointVector,
    velocity: JointVector,
    /// That it is driven by.
    torque: JointVector,
    time: f64,
    noise: Random,
    hand: Option<Hand>,
}

impl SimulatedRig {
    /// The device of `proxy` at rest at `position`, with the block of `spec`. `seed` makes the noise.
    #[must_use]
    pub fn new(proxy: &ProxySpec, spec: &SpecimenSpec, position: JointVector, seed: u64) -> Self {
        let chain = Chain::new(proxy);
        let mut rig = Self {
            sponge: Sponge::new(spec),
            spec: spec.clone(),
            gravity: DVec3::new(0.0, 0.0, -crate::scan::GRAVITY),
            contacts: vec![NodeContact::default(); chain.nodes.len()],
            pose: chain.new_pose(),
            velocity: JointVector::zeros(position.len()),
            torque: JointVector::zeros(position.len()),
            position,
            time: 0.0,
            noise: Random::new(seed),
            hand: None,
            chain,
        };
        rig.chain.pose(&rig.position, &mut rig.pose);
        rig
    }

    /// The same rig, led by `hand`.
    #[must_use]
    pub fn led_by(mut self, hand: Hand) -> Self {
        self.hand = Some(hand);
        self
    }

    /// Returns a description for logs, one line.
    #[must_use]
    pub fn description(&self) -> String {
        let (size, is_bare) = (1e3 * self.spec.size, self.spec.cover == Cover::Bare);
        let cover = if is_bare { "bare" } else { "covered with fabric" };
        format!(
            "SIMULATED rig: a spongy block of {:.0} x {:.0} x {:.0} mm, {cover}; no real object was touched",
            size.x, size.y, size.z
        )
    }

    fn step(&mut self, torque: &JointVector, time: f64) {
        let mut load = self.chain.gravity_torque(&self.pose, self.gravity);
        for (node, contact) in self.contacts.iter_mut().enumerate() {
            let radius = self.chain.nodes[node].radius;
            let force = self.sponge.force(contact, self.pose.nodes[node], radius, time);
            if force != DVec3::ZERO {
                self.chain.add_torque(&self.pose, node, force, &mut load);
            }
        }
        if let Some(hand) = &mut self.hand {
            hand.add_torque(self.time, &self.position, &self.velocity, &mut load);
        }
        let inertia = self.chain.inertia(&self.pose);
        let viscous = |joint: usize| VISCOUS * inertia[joint][joint] * self.velocity[joint];
        let joints = 0..self.position.len();
        let mut rate = joints.map(|joint| torque[joint] + load[joint] - viscous(joint)).collect();
        solve_positive(&inertia, &mut rate);
        for joint in 0..rate.len() {
            let free = self.velocity[joint] + time * rate[joint];
            let braked = time * self.spec.joint_friction / inertia[joint][joint];
            self.velocity[joint] = free - free.clamp(-braked, braked);
            let moved = self.position[joint] + time * self.velocity[joint];
            let [least, greatest] = self.chain.joints[joint].limits;
            self.position[joint] = moved.clamp(least, greatest);
            if self.position[joint] != moved {
                self.velocity[joint] = 0.0;
            }
        }
        self.time += time;
        self.chain.pose(&self.position, &mut self.pose);
    }

    /// The joint's position in whole encoder counts.
    fn encoded(&self, joint: usize) -> f64 {
        let turn = match self.chain.joints[joint].kind {
            JointKind::Revolute => std::f64::consts::TAU,
            JointKind::Prismatic => 1.0,
        };
        if self.spec.encoder > 0.0 {
            let count = turn / self.spec.encoder;
            return (self.position[joint] / count).round() * count;
        }
        self.position[joint]
    }
}

impl Device for SimulatedRig {
    fn read(&mut self, elapsed: f64) -> Reading {
        if elapsed > 0.0 {
            let mut noisy = |torque: &f64| torque + self.spec.noise * self.noise.normal();
            let actual = self.torque.iter().map(&mut noisy).collect();
            for _ in 0..STEPS {
                self.step(&actual, elapsed / STEPS as f64);
            }
        }
        let position = (0..self.position.len()).map(|joint| self.encoded(joint)).collect();
        let held = self.hand.as_ref().is_some_and(|hand| hand.holds(self.time));
        Reading { held, ..Reading::at(position) }
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        if torque.is_finite() {
            self.torque = *torque;
            return Applied::whole(torque);
        }
        self.torque = JointVector::zeros(torque.len());
        Applied { halt: Some(Halt::NotFinite), ..Applied::whole(&self.torque) }
    }
}
