//! The GPU against the CPU's f64 code, on whatever adapter there is (software Vulkan counts). None is a failure.

// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod adapter;
#[path = "../common/mod.rs"]
mod common;
mod equilibria;
mod fixture;
mod frames;
mod stores;
