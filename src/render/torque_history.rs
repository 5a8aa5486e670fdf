//! The torques that the device has been under, tick by tick: a position that was measured some time ago belongs to the
//! torque of that time, and only with it is the work at the device's port right.

use super::watchdog::GREATEST_POSITION_AGE;
use crate::JointVector;

/// The last torques on the device, in a ring as long as a position may be old.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TorqueHistory {
    /// On the device (N m or N).
    torques: Vec<JointVector>,
    last: usize,
    /// Last torque that the loop asked for (N m or N).
    asked: JointVector,
    /// Nominal T (s).
    period: f64,
}

impl TorqueHistory {
    /// No torque on `joints` joints, with a tick every `period` (s).
    pub fn new(joints: usize, period: f64) -> Self {
        let ticks = (GREATEST_POSITION_AGE / period).ceil() as usize + 1;
        let zero = JointVector::zeros(joints);
        Self { torques: vec![zero; ticks], last: 0, asked: zero, period }
    }

    /// Returns the last torque that the loop asked for.
    pub fn asked(&self) -> &JointVector {
        &self.asked
    }

    /// `age` (s) ago, to a tick, or as long ago as is remembered.
    pub fn before(&self, age: f64) -> &JointVector {
        let count = self.torques.len();
        let ticks = ((age / self.period).round().max(0.0) as usize).min(count - 1);
        &self.torques[(self.last + count - ticks) % count]
    }

    /// Takes the torque that the loop asks for from now on.
    pub fn push(&mut self, torque: &JointVector) {
        self.last = (self.last + 1) % self.torques.len();
        self.torques[self.last] = *torque;
        self.asked = *torque;
    }

    /// Takes what the device holds of the last torque that was asked for.
    pub fn correct(&mut self, torque: &JointVector) {
        self.torques[self.last] = *torque;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torques_are_remembered_as_long_as_a_position_may_be_old() {
        let mut held = TorqueHistory::new(1, 1e-3);
        for k in 0..50 {
            held.push(&JointVector::from_slice(&[f64::from(k)]));
        }
        let at = |age: f64| held.before(age)[0];
        let asked = held.asked()[0];
        assert_eq!((asked, at(0.0), at(0.0004), at(0.003), at(0.01), at(1.0)), (49.0, 49.0, 49.0, 46.0, 39.0, 39.0));
        held.correct(&JointVector::from_slice(&[7.0]));
        assert_eq!((held.asked()[0], held.before(0.0)[0], held.before(0.001)[0]), (49.0, 7.0, 48.0));
    }
}
