//! Configuration-space haptization: contact between a multi-link virtual proxy and a deformable virtual object is
//! solved beforehand for every joint configuration, and felt at 1 kHz by interpolation.
//!
//! Data flows one way; a room knows only the rooms above it in this list.

pub mod scene;

pub mod object;
pub mod proxy;

pub mod contact;

pub mod gpu;

pub mod dataset;
pub mod haptize;

pub mod device;
pub mod render;

pub mod report;

pub mod tolerances;

mod joint_vector;

pub use joint_vector::{JointVector, MAX_JOINTS};
