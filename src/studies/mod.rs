//! Studies of the engine itself: what accuracy costs in time.

pub mod accuracy;
