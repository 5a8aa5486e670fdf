//! Sweeps: the dataset depends on nothing but scene and backend, and an interruption leaves no trace in it.

#![allow(clippy::unwrap_used, clippy::panic)]

mod equilibria;
mod failure;
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
mod thin_parts;
