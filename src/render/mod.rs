//! Rendering: from a dataset to the torque of the haptic device at 1 kHz and the moving object at 60 Hz (section 3).

pub mod accounts;
pub mod flags;
pub mod trace;
