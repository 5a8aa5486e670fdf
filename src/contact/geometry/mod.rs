//! The surface: closest points, normals, and searches that skip what cannot be closest. Nothing of forces.

pub mod bounding_volumes;
pub mod closest_point;
mod distance_bounds;
pub mod facet;
pub mod nearest;
pub mod normals;
pub mod packet;
pub mod quartic;
mod rest;
pub mod smooth;

pub use rest::RestSurface;

/// Rounding of a length from its coordinates, relative to it (1): a square of a sum of squares is good to a few eps.
pub const LENGTH_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Rounding of a depth, relative to the size of the object (1): differences and products of coordinates, each rounded
/// by eps / 2, add up to a few eps; 16 leave room for a flat angle between node and facet.
pub const DEPTH_ROUNDING: f64 = 16.0 * f64::EPSILON;
