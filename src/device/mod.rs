//! What drives the haptic loop: a device that reports joint positions and takes joint torques.

mod hand;
mod motion;
mod pointer;
mod recorded;

pub use hand::{HandError, SimulatedHand};
pub use motion::{Motion, MotionError};
pub use pointer::{Pointer, PointerInput};
pub use recorded::Recorded;

use crate::JointVector;

/// A haptic device, real or simulated. Both calls come from the real-time thread: they must not allocate, lock or wait.
pub trait Device: Send {
    /// Position now, `elapsed` [s] after the last reading (0 at the first). Simulated devices move on by it, under the
    /// torque applied last; for real ones time passes by itself.
    fn read(&mut self, elapsed: f64) -> Reading;

    /// Holds `torque` [N m or N] until the next call.
    fn apply(&mut self, torque: &JointVector);
}

/// What a device reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// y [rad or m].
    pub position: JointVector,
    /// Time since the position was measured [s].
    pub age: f64,
    /// Where the hand wants the device, if that is known; else the position [rad or m].
    pub hand: JointVector,
}
