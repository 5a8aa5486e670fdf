//! The window of `haptize view`, driven as a person would: by its labels, by the pointer, and by looking at it. It is
//! drawn by software Vulkan, its haptic loop runs by steps, so that every run is the same.

#![cfg(feature = "viewer")]
#![allow(clippy::unwrap_used)]

mod feel;
mod looks;
mod open;
mod panels;
mod window;
