//! The sparse store of C-space: continuity across blocks and levels, exactness, order of publication.

#![allow(clippy::unwrap_used)] // clippy.toml allows it inside #[test] functions only; helpers need it, too.

mod file;
mod fixture;
mod interpolation;
mod lowest;
mod publication;
mod refine;
mod world;
