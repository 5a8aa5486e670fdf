//! What several test programs share.

#![allow(dead_code)] // Each program takes what it needs.

pub mod cubes;
pub mod desktop;
pub mod program;
pub mod scanned;
