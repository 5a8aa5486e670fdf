//! The nearest of several facets of a surface.

use super::{
    closest_point::{ClosestPoint, Feature},
    facet::Facet,
};
use glam::DVec3;

/// The closest feature of the surface.
#[derive(Clone, Copy)]
pub struct Closest {
    /// Squared distance (m^2).
    pub distance_squared: f64,
    /// Triangle.
    pub triangle: u32,
    /// Point and feature on it.
    pub point: ClosestPoint,
}

impl Closest {
    /// None yet.
    #[must_use]
    pub fn none() -> Self {
        let point = ClosestPoint { weights: [0.0; 3], feature: Feature::Face };
        Self { distance_squared: f64::MAX, triangle: u32::MAX, point }
    }

    /// Squared distance within which flat triangles may have a facet that is as close, where facets stand off them by
    /// at most `bulge` (m^2).
    #[must_use]
    pub fn within(&self, bulge: f64) -> f64 {
        if bulge == 0.0 { self.distance_squared } else { (self.distance_squared.sqrt() + bulge).powi(2) }
    }

    /// Takes `facet`, number `t`, instead if it is nearer to `x`, or as near with a lower number; its closest point,
    /// and the squared distance of that (m^2). Nothing is done, and none returned, where it is farther than `within`
    /// (m).
    pub fn consider(&mut self, x: DVec3, facet: &Facet, t: u32, within: f64) -> Option<(ClosestPoint, f64)> {
        let point = facet.closest(x, within)?;
        let distance_squared = x.distance_squared(facet.point(point.weights));
        if distance_squared < self.distance_squared || (distance_squared == self.distance_squared && t < self.triangle)
        {
            *self = Self { distance_squared, triangle: t, point };
        }
        Some((point, distance_squared))
    }
}
