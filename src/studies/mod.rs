//! Studies of the engine itself: what accuracy costs in time, and whether hard cases stay stable.

pub mod accuracy;
pub mod stability;
