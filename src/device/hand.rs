//! A simulated device in a simulated hand: a mass, a spring and a damper of a human arm at each joint, pulling along a
//! motion.
//!
//! At each joint `(m_hand + m_device) yddot = -bd ydot + tau + Kh (r - y) + Bh (rdot - ydot)`, r the motion, tau the
//! torque held since the last tick. Stepped by the midpoint rule, passive for any step as the proxy is; the torque is
//! constant over a step, so that its work tau . (y_{k+1} - y_k) is exact.

use super::{Applied, Device, Motion, Reading};
use crate::{
    Error, JointVector, error,
    names::counted,
    scene::{HandSpec, HapticsSpec},
};

/// The device in a hand that follows a motion.
#[derive(Clone, Debug)]
pub struct SimulatedHand {
    motion: Motion,
    arm: Arm,
    time: f64,
}

/// The error of a hand that is told of `told` joints where its device has `device`.
pub(super) fn other_joints(told: usize, device: usize) -> Error {
    error!("the hand is told {} and the haptic device has {device}", counted(told, ["joint", "joints"]))
}

impl SimulatedHand {
    /// The hand and device of `spec`, at rest at the beginning of `motion`.
    ///
    /// # Errors
    /// When the joints do not fit, or hand and device have no inertia.
    pub fn new(spec: &HapticsSpec, motion: Motion) -> Result<Self, Error> {
        Self::holding(&spec.hand, &spec.device_inertia, &spec.device_damping, motion)
    }

    /// Returns `hand` holding a device of the given `inertia` (kg m^2) and `damping` (N m s/rad) at each joint, at rest
    /// at the beginning of `motion`.
    ///
    /// # Errors
    /// When the joints do not fit, or hand and device have no inertia.
    pub fn holding(
        hand: &HandSpec,
        inertia: &JointVector,
        damping: &JointVector,
        motion: Motion,
    ) -> Result<Self, Error> {
        let arm = Arm::holding(hand, inertia, damping, &motion.at(0.0).0)?;
        Ok(Self { motion, arm, time: 0.0 })
    }

    /// Returns the number of joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.arm.position().len()
    }
}

impl Device for SimulatedHand {
    fn read(&mut self, elapsed: f64) -> Reading {
        let (goal, velocity) = self.motion.at(self.time + 0.5 * elapsed);
        self.arm.step(&goal, &velocity, elapsed);
        self.time += elapsed;
        Reading { hand: self.motion.at(self.time).0, ..Reading::at(*self.arm.position()) }
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        self.arm.hold(torque);
        Applied::whole(torque)
    }
}

/// Arm and device: mass, spring and damper of each joint, and their state.
#[derive(Clone, Debug)]
pub(super) struct Arm {
    /// Hand and device together (kg m^2).
    inertia: JointVector,
    /// Kh (N m/rad), Bh (N m s/rad).
    stiffness: JointVector,
    damping: JointVector,
    /// bd (N m s/rad).
    device_damping: JointVector,
    position: JointVector,
    velocity: JointVector,
    torque: JointVector,
}

impl Arm {
    /// The hand and device of `spec`, at rest at `position`.
    pub(super) fn new(spec: &HapticsSpec, position: &JointVector) -> Result<Self, Error> {
        Self::holding(&spec.hand, &spec.device_inertia, &spec.device_damping, position)
    }

    fn holding(
        spec: &HandSpec,
        device_inertia: &JointVector,
        device_damping: &JointVector,
        position: &JointVector,
    ) -> Result<Self, Error> {
        let mut inertia = *device_inertia;
        if position.len() != inertia.len() {
            return Err(other_joints(position.len(), inertia.len()));
        }
        for (a, (inertia, hand)) in inertia.iter_mut().zip(spec.inertia.iter()).enumerate() {
            *inertia += hand;
            if !inertia.is_finite() || *inertia <= 0.0 {
                return Err(error!(
                    "hand and device have no inertia at joint {a}: give the device or the hand a positive one"
                ));
            }
        }
        let zero = JointVector::zeros(position.len());
        Ok(Self {
            inertia,
            stiffness: spec.stiffness,
            damping: spec.damping,
            device_damping: *device_damping,
            position: *position,
            velocity: zero,
            torque: zero,
        })
    }

    /// y (rad or m).
    pub(super) fn position(&self) -> &JointVector {
        &self.position
    }

    /// Holds `torque` from now on.
    pub(super) fn hold(&mut self, torque: &JointVector) {
        self.torque = *torque;
    }

    /// Moves on by `elapsed` (s); `goal` and `goal_velocity` are those of the hand in the middle of it.
    pub(super) fn step(&mut self, goal: &JointVector, goal_velocity: &JointVector, elapsed: f64) {
        let half = 0.5 * elapsed;
        for a in 0..self.position.len() {
            let torque = self.torque[a] + self.damping[a] * goal_velocity[a];
            let spring = self.stiffness[a] * (goal[a] - self.position[a]);
            let resistance =
                self.inertia[a] + half * (self.damping[a] + self.device_damping[a]) + half * half * self.stiffness[a];
            let midpoint = (self.inertia[a] * self.velocity[a] + half * (torque + spring)) / resistance;
            self.position[a] += elapsed * midpoint;
            self.velocity[a] = 2.0 * midpoint - self.velocity[a];
        }
    }
}
