//! The object: its surface, its material, its stiffness and its compliance, against closed forms and converged solutions.

// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod body;
#[path = "../common/mod.rs"]
mod common;
mod nodule;
mod real_objects;
mod skin;
mod solid;
