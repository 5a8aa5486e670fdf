//! Equilibrium of one configuration, checked from outside.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod analytic;
mod balance;
mod comparison;
mod convex;
mod fixture;
mod invariance;
mod live;
mod oracle;
mod refinement;
mod rest;
