//! Datasets and stores, and what fills and reads them: a dataset depends on nothing but scene and backend, and an
//! interruption leaves no trace in it.

// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod accuracy;
#[path = "../common/mod.rs"]
mod common;
mod dataset;
mod edges;
mod equilibria;
mod failure;
mod field;
mod fixture;
mod inspection;
mod lowest;
mod max_error;
mod memory;
mod placing;
#[cfg(unix)]
mod program;
mod reach;
mod results;
mod resume;
mod shards;
mod store;
mod thin_parts;
mod work;
