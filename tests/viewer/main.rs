//! The window of `haptize view`, driven as a person would: by its labels, by the pointer, and by looking at it. It is
//! drawn by software Vulkan, its haptic loop runs by steps, so that every run is the same.

#![cfg(feature = "viewer")]
// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;
mod feel;
mod looks;
mod open;
mod panels;
mod placing;
mod window;
