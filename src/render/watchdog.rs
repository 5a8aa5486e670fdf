//! The watchdog of the haptic loop: what a tick may be told, and what must bring the torque to zero.
//!
//! A tick's inputs are good if the position is one (as many joints as the dataset has, finite, within reach), is fresh,
//! comes in time, and can have been reached: `|y_k - y_{k-1}| <= speed_limit max(T_{k-1}, T)` at each joint. The nominal T
//! in there keeps an encoder's step from looking like a leap when two ticks follow closely. The first failure is a fault
//! that stays, whatever comes after it, until somebody restarts the loop: a device that comes and goes must not kick.

use super::{flags::Fault, haptic::Inputs};
use crate::{
    JointVector,
    tolerances::{GREATEST_INPUT, GREATEST_INTERVAL, GREATEST_POSITION_AGE, LEAST_INTERVAL},
};

/// What the inputs are held against.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watchdog {
    /// T [s].
    period: f64,
    /// Greatest speed of each joint that is taken for motion [rad/s or m/s].
    speed_limit: JointVector,
}

impl Watchdog {
    /// A watchdog for ticks every `period` [s] and joints no faster than `speed_limit` [rad/s or m/s].
    #[must_use]
    pub fn new(period: f64, speed_limit: JointVector) -> Self {
        Self { period, speed_limit }
    }

    /// Whether `inputs` are good, the position before having been `before`.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn check(&self, inputs: &Inputs, before: &JointVector) -> Result<(), Fault> {
        self.check_position(&inputs.position)?;
        if inputs.age > GREATEST_POSITION_AGE || inputs.age.is_nan() {
            return Err(Fault::Stale);
        }
        if !(is_interval(inputs.elapsed) && is_interval(inputs.interval)) {
            return Err(Fault::Late);
        }
        let time = inputs.elapsed.max(self.period);
        let reached = |a: usize| (inputs.position[a] - before[a]).abs() <= self.speed_limit[a] * time;
        if (0..before.len()).all(reached) { Ok(()) } else { Err(Fault::Leap) }
    }

    /// Whether `position` can be one of the device.
    ///
    /// # Errors
    /// Why not.
    pub fn check_position(&self, position: &JointVector) -> Result<(), Fault> {
        if position.len() != self.speed_limit.len() {
            return Err(Fault::Joints);
        }
        // Comparisons are false for what is not a number.
        if position.iter().all(|y| y.abs() <= GREATEST_INPUT) { Ok(()) } else { Err(Fault::NotFinite) }
    }
}

/// Whether `seconds` can lie between two ticks.
#[must_use]
pub fn is_interval(seconds: f64) -> bool {
    (LEAST_INTERVAL..=GREATEST_INTERVAL).contains(&seconds)
}
