//! Equilibrium of one configuration, checked from outside, on CPU and GPU; the hard cases of every room; the paper's
//! iteration.

// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod analytic;
mod balance;
#[path = "../common/mod.rs"]
mod common;
mod comparison;
mod convex;
mod fixture;
mod gpu;
mod hard_cases;
mod invariance;
mod live;
mod oracle;
mod paper;
mod refinement;
mod rest;
mod rounded;
