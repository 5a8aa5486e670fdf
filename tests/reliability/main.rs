//! Nothing silent, nothing lost: datasets that need nothing but their file, readers that no file harms, and bakes that
//! survive what stops them.

// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod alone;
mod cache;
#[path = "../common/mod.rs"]
mod common;
mod crash;
mod fuzz;
mod inputs;
mod objects;
mod outputs;
mod signals;
mod telling;
