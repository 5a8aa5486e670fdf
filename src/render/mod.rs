//! Rendering: from a dataset to the torque of the haptic device at 1 kHz and the moving object at 60 Hz (section 3).

pub mod accounts;
pub mod channels;
mod columns;
mod contact_forces;
pub mod control;
pub mod coupling;
pub mod driven;
pub mod flags;
mod force_rows;
mod friction;
pub mod graphics;
pub mod haptic;
mod inputs;
pub mod live;
pub mod npmi;
mod object_history;
mod object_memory;
pub mod object_motion;
mod own_motion;
pub mod passivity;
pub mod realtime;
pub mod recording;
mod relaxation;
pub mod session;
pub mod setup;
pub mod source;
mod torque_history;
pub mod trace;
pub mod twinned;
pub mod watchdog;

pub use crate::control::timing;
