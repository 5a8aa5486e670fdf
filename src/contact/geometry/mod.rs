//! The surface: closest points, normals, and searches that skip what cannot be closest. Nothing of forces.

pub mod bounding_volumes;
pub mod closest_point;
mod distance_bounds;
pub mod facet;
pub mod normals;
pub mod packet;
pub mod quartic;
mod rest;
pub mod smooth;

pub use rest::RestSurface;
