//! The sparse store of C-space: continuity across blocks and levels, exactness, order of publication.

mod file;
mod fixture;
mod interpolation;
mod lowest;
mod publication;
mod random_ticks;
mod refine;
mod world;
