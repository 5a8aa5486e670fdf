//! The parts of a device that a scan needs: joint positions to read, joint torques to command, tick by tick.

use crate::JointVector;

/// A device that can be driven, with the object it touches. A real one waits for its clock in [`Rig::hold`], a
/// simulated one moves on.
pub trait Rig {
    /// Holds `torque` for `period` (s), then reads the joints.
    ///
    /// # Errors
    /// When the device does not answer or refuses; the scan then stops.
    fn hold(&mut self, torque: &JointVector, period: f64) -> Result<RigReading, RigError>;

    /// Returns a description for logs, one line. Simulated rigs say so.
    fn description(&self) -> String;

    /// True where no real object is touched.
    fn is_simulated(&self) -> bool;
}

/// Measurement of a rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigReading {
    /// Time since the rig was started (s).
    pub time: f64,
    /// Measured joint positions (rad or m).
    pub position: JointVector,
    /// Whether a hand holds the device: a button on its handle, as haptic devices have one. What is read meanwhile is
    /// not the object's torque alone. Always false where there is no such button.
    pub held: bool,
}

/// A rig failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("the rig failed: {0}")]
pub struct RigError(
    /// Message.
    pub String,
);
