//! What a tick of the haptic loop is given.

use crate::JointVector;

/// Input of a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Device position y_k (rad or m).
    pub position: JointVector,
    /// Age of that position (s).
    pub age: f64,
    /// Time since the tick before, T_{k-1} (s).
    pub elapsed: f64,
    /// Time to the next tick, T_k, by which the proxy moves on (s).
    pub interval: f64,
}
