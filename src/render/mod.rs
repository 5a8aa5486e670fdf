//! Rendering: from a dataset to the torque of the haptic device at 1 kHz and the moving object at 60 Hz (section 3).

pub mod accounts;
pub mod boundary;
mod clock;
pub mod coupling;
pub mod field;
pub mod flags;
pub mod graphics;
pub mod haptic;
pub mod npmi;
pub mod passivity;
pub mod realtime;
pub mod session;
pub mod setup;
pub mod stencil;
pub mod timing;
pub mod trace;

#[cfg(test)]
use crate as engine;

#[cfg(test)]
#[path = "../../tests/synthetic/mod.rs"]
mod synthetic;
