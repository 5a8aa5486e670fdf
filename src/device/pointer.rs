//! A simulated device whose hand another thread leads: the pointer of a viewer.
//!
//! A pointer moves by leaps, once a frame; a device cannot. So the pointer says where the hand wants to be, and the hand,
//! a mass on a spring and a damper as in [`super::SimulatedHand`], pulls the device there against the torque that it
//! feels. Between the pointer's reports the hand holds still. They are exchanged without a lock: the latest counts.

use super::{Device, HandError, Reading, hand::Arm};
use crate::{JointVector, scene::HapticsSpec, tolerances::GREATEST_INPUT};

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
    /// The hand and device of `spec`, at rest at `start` [rad or m], and what moves the hand.
    ///
    /// # Errors
    /// When the joints do not fit, hand and device have no inertia, or `start` is no place.
    pub fn new(spec: &HapticsSpec, start: &JointVector) -> Result<(Self, PointerInput), HandError> {
        let arm = Arm::new(spec, start)?;
        check(start, spec.device_inertia.len())?;
        let (goal, read) = triple_buffer::triple_buffer(start);
        Ok((Self { arm, goal: read }, PointerInput { joints: start.len(), goal }))
    }
}

impl PointerInput {
    /// From now on the hand wants to be at `place` [rad or m]. Never waits.
    ///
    /// # Errors
    /// When `place` has another number of joints or a coordinate that is none; the hand then keeps its last goal.
    pub fn move_to(&mut self, place: &JointVector) -> Result<(), HandError> {
        check(place, self.joints)?;
        self.goal.write(*place);
        Ok(())
    }
}

impl Device for Pointer {
    fn read(&mut self, elapsed: f64) -> Reading {
        let goal = *self.goal.read();
        self.arm.step(&goal, &JointVector::zeros(goal.len()), elapsed);
        Reading { position: *self.arm.position(), age: 0.0, hand: goal }
    }

    fn apply(&mut self, torque: &JointVector) {
        self.arm.hold(torque);
    }
}

fn check(place: &JointVector, joints: usize) -> Result<(), HandError> {
    if place.len() != joints {
        return Err(HandError::Joints { told: place.len(), device: joints });
    }
    // False for what is not a number.
    if place.iter().all(|x| x.abs() <= GREATEST_INPUT) { Ok(()) } else { Err(HandError::Place(*place)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::HandSpec;

    fn spec() -> HapticsSpec {
        let all = |value| JointVector::from_slice(&[value; 2]);
        HapticsSpec {
            rate: 1000.0,
            threshold: 0.5,
            interpolation: crate::scene::Interpolation::Linear,
            boundary_slope: all(10.0),
            passivity_factor: 1.0,
            proxy_damping: all(0.02),
            proxy_inertia: crate::scene::ProxyInertia::Constant,
            coupling_stiffness: all(15.0),
            coupling_damping: all(0.01),
            device_damping: all(0.02),
            device_inertia: all(1e-3),
            torque_limit: all(2.0),
            torque_rate_limit: all(500.0),
            speed_limit: all(50.0),
            encoder_step: all(0.0),
            device_friction: all(0.0),
            effects: crate::scene::HapticEffects::default(),
            hand: HandSpec { stiffness: all(20.0), damping: all(0.2), inertia: all(2e-3) },
        }
    }

    #[test]
    fn the_device_goes_where_another_thread_points_and_yields_to_torque() {
        let start = JointVector::from_slice(&[0.1, -0.2]);
        let (mut device, mut pointer) = Pointer::new(&spec(), &start).unwrap();
        assert_eq!(device.read(0.0).position, start);
        let goal = JointVector::from_slice(&[0.4, 0.0]);
        std::thread::spawn(move || pointer.move_to(&goal).unwrap()).join().unwrap();
        device.apply(&JointVector::from_slice(&[0.0, -1.0]));
        let mut before = start;
        for _ in 0..2000 {
            let reading = device.read(1e-3);
            // Never faster than sqrt(Kh/m) times the way: no leap, whatever the pointer does.
            assert!((reading.position[0] - before[0]).abs() < 0.3 * (20.0_f64 / 3e-3).sqrt() * 1e-3);
            before = reading.position;
            assert_eq!(reading.hand, goal);
        }
        // At rest where the hand's spring holds the torque: Kh (goal - y) + tau = 0.
        assert!((before[0] - 0.4).abs() < 1e-9 && (before[1] + 1.0 / 20.0).abs() < 1e-9, "{before:?}");
    }

    #[test]
    fn a_place_that_is_none_is_refused_and_the_hand_keeps_its_goal() {
        let start = JointVector::zeros(2);
        let (mut device, mut pointer) = Pointer::new(&spec(), &start).unwrap();
        for place in [&[f64::NAN, 0.0][..], &[0.0, f64::INFINITY], &[0.0, -1e300]] {
            let place = JointVector::from_slice(place);
            assert!(matches!(pointer.move_to(&place), Err(HandError::Place(_))));
            assert!(matches!(Pointer::new(&spec(), &place), Err(HandError::Place(_))));
        }
        let other = JointVector::zeros(3);
        assert_eq!(pointer.move_to(&other), Err(HandError::Joints { told: 3, device: 2 }));
        assert!(Pointer::new(&spec(), &other).is_err());
        assert_eq!(device.read(1e-3).hand, start);
    }
}
