//! The program as a user meets it: commands, what they print, scenes and robots that they read, and figures.

// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod arm;
mod commands;
#[path = "../common/mod.rs"]
mod common;
mod demo;
mod device_scenes;
mod docs;
mod mcap;
mod outputs;
mod page;
mod printed;
mod report;
mod robot;
mod scene;
mod vtk;
