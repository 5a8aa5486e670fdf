//! A simulated device whose hand another thread leads: the pointer of a viewer.
//!
//! A pointer moves by leaps, once a frame; a device cannot. So the pointer says where the hand wants to be, and the
//! hand, a mass on a spring and a damper as in [`super::SimulatedHand`], pulls the device there against the torque that
//! it feels. Between the pointer's reports the hand holds still. They are exchanged without a lock: the latest counts.

use super::{
    Applied, Device, Reading,
    hand::{Arm, other_joints},
};
use crate::{Error, JointVector, error, input::GREATEST_INPUT, scene::HapticsSpec};

/// The device, for the haptic loop.
#[derive(Debug)]
pub struct Pointer {
    arm: Arm,
    goal: triple_buffer::Output<JointVector>,
}

/// The pointer, for the thread that moves it.
#[derive(Debug)]
pub struct PointerInput {
    joints: usize,
    goal: triple_buffer::Input<JointVector>,
}

impl Pointer {
    /// The hand and device of `spec`, at rest at `start` (rad or m), and what moves the hand.
    ///
    /// # Errors
    /// When the joints do not fit, hand and device have no inertia, or `start` is no place.
    pub fn new(spec: &HapticsSpec, start: &JointVector) -> Result<(Self, PointerInput), Error> {
        let arm = Arm::new(spec, start)?;
        check(start, spec.device_inertia.len())?;
        let (goal, read) = triple_buffer::triple_buffer(start);
        Ok((Self { arm, goal: read }, PointerInput { joints: start.len(), goal }))
    }
}

impl PointerInput {
    /// From now on the hand wants to be at `place` (rad or m). Never waits.
    ///
    /// # Errors
    /// When `place` has another number of joints or a coordinate that is none; the hand then keeps its last goal.
    pub fn move_to(&mut self, place: &JointVector) -> Result<(), Error> {
        check(place, self.joints)?;
        self.goal.write(*place);
        Ok(())
    }
}

impl Device for Pointer {
    fn read(&mut self, elapsed: f64) -> Reading {
        let goal = *self.goal.read();
        self.arm.step(&goal, &JointVector::zeros(goal.len()), elapsed);
        Reading { hand: goal, ..Reading::at(*self.arm.position()) }
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        self.arm.hold(torque);
        Applied::whole(torque)
    }
}

fn check(place: &JointVector, joints: usize) -> Result<(), Error> {
    if place.len() != joints {
        return Err(other_joints(place.len(), joints));
    }
    // False for what is not a number.
    if place.iter().all(|x| x.abs() <= GREATEST_INPUT) {
        return Ok(());
    }
    Err(error!("{place:?} is no place for a hand: its coordinates must be finite and within reach"))
}
