//! The sparse store of C-space: continuity across blocks and levels, exactness, order of publication, readers beside
//! writers.

#![allow(clippy::unwrap_used)] // clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::duplicate_mod)] // The directory is included twice: with the orders that it has, and with weaker ones.

mod concurrent;
mod file;
mod fixture;
mod interleavings;
mod interpolation;
mod lowest;
mod publication;
mod refine;
mod world;
