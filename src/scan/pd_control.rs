//! PD control of each joint about a commanded position that moves at bounded speed (section 2.2).
//!
//! `tau = Kp (q_d - q) + Kd (qdot_d - qdot) + g(q)`: in steady contact the contact torque on the proxy is
//! `-(tau - g) = Kp (q - q_d)`, so that no force sensor is needed. PD control is passive and so is the object: the
//! contact is stable. The measured speed is the difference over a few ticks, because encoder steps drown that over one.

use crate::JointVector;
use std::collections::VecDeque;

/// Ticks over which speed is measured.
const SPEED_TICKS: usize = 5;

/// The controller of all joints.
#[derive(Clone, Debug)]
pub struct PdControl {
    stiffness: JointVector,
    damping: JointVector,
    commanded: JointVector,
    commanded_speed: JointVector,
    /// Positions of the last ticks, newest last.
    history: VecDeque<JointVector>,
}

/// Output of the controller at a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PdOutput {
    /// Control torque without gravity (N m).
    pub torque: JointVector,
    /// Measured speed (rad/s or m/s).
    pub speed: JointVector,
}

impl PdControl {
    /// A controller that holds `position`.
    #[must_use]
    pub fn new(stiffness: JointVector, damping: JointVector, position: JointVector) -> Self {
        let zero = JointVector::zeros(position.len());
        let history = VecDeque::with_capacity(SPEED_TICKS + 1);
        Self { stiffness, damping, commanded: position, commanded_speed: zero, history }
    }

    /// Moves the commanded position towards `target` for one `period` (s), no joint faster than `speed` (rad/s or m/s);
    /// true when it is there. All joints arrive at the same time.
    pub fn advance(&mut self, target: &JointVector, speed: f64, period: f64) -> bool {
        let mut way = *target;
        way.iter_mut().zip(self.commanded.iter()).for_each(|(way, from)| *way -= from);
        let farthest = way.iter().map(|way| way.abs()).fold(0.0, f64::max);
        let share = (speed * period / farthest.max(f64::MIN_POSITIVE)).min(1.0);
        for joint in 0..target.len() {
            let step = share * way[joint];
            self.commanded[joint] += step;
            self.commanded_speed[joint] = step / period;
        }
        share >= 1.0
    }

    /// Ends the motion of the command where it is.
    pub fn rest(&mut self) {
        self.commanded_speed = JointVector::zeros(self.commanded.len());
    }

    /// Gives way: the commanded position is the measured one, so that damping alone resists whoever moves the device.
    pub fn follow(&mut self, position: &JointVector) {
        self.commanded = *position;
        self.rest();
    }

    /// Torque for the measured `position`, read every `period` (s).
    pub fn torque(&mut self, position: &JointVector, period: f64) -> PdOutput {
        if self.history.len() > SPEED_TICKS {
            self.history.pop_front();
        }
        self.history.push_back(*position);
        let oldest = self.history.front().copied().unwrap_or(*position);
        let time = (self.history.len().max(2) - 1) as f64 * period;
        let (mut torque, mut speed) = (*position, *position);
        for joint in 0..position.len() {
            speed[joint] = (position[joint] - oldest[joint]) / time;
            torque[joint] = self.stiffness[joint] * (self.commanded[joint] - position[joint])
                + self.damping[joint] * (self.commanded_speed[joint] - speed[joint]);
        }
        PdOutput { torque, speed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vector(values: [f64; 2]) -> JointVector {
        JointVector::from_slice(&values)
    }

    #[test]
    fn the_command_moves_straight_at_the_given_speed() {
        let mut control = PdControl::new(vector([1.0; 2]), vector([0.0; 2]), vector([0.0; 2]));
        let target = vector([0.1, -0.05]);
        let ticks = (0..1000).position(|_| control.advance(&target, 0.5, 1e-3)).unwrap();
        assert_eq!(ticks, 199);
        assert!((control.commanded[0] - 0.1).abs() < 1e-12 && (control.commanded[1] + 0.05).abs() < 1e-12);
    }

    #[test]
    fn steady_torque_is_stiffness_times_distance_and_speed_is_damped() {
        let mut control = PdControl::new(vector([10.0, 20.0]), vector([1.0; 2]), vector([0.0; 2]));
        for _ in 0..20 {
            control.torque(&vector([0.01, -0.02]), 1e-3);
        }
        let output = control.torque(&vector([0.01, -0.02]), 1e-3);
        assert!((output.torque[0] + 0.1).abs() < 1e-12 && (output.torque[1] - 0.4).abs() < 1e-12);
        for tick in 0..20 {
            control.torque(&vector([0.01 + 1e-3 * f64::from(tick), -0.02]), 1e-3);
        }
        let output = control.torque(&vector([0.03, -0.02]), 1e-3);
        assert!((output.speed[0] - 1.0).abs() < 1e-9, "{output:?}");
        control.follow(&vector([0.03, -0.02]));
        let output = control.torque(&vector([0.03, -0.02]), 1e-3);
        assert!((output.torque[0] + output.speed[0]).abs() < 1e-12, "damping alone: {output:?}");
    }
}
