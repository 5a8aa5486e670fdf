//! Lower bounds of the signed distance to the surface at rest, looked up in a lattice of cubes around it.
//!
//! The distance d_t to a triangle is a convex function: nowhere below its tangent plane at a cube's middle c, and in
//! the cube nowhere above what it is at the corners, less any linear function. With s the signed distance, h half a
//! cube's side and g the direction from the closest triangle to c,
//! - in a cube outside, `s = min_t d_t >= e + g . (x - c)` with `e = min_t ( d_t(c) - h |g - g_t|_1 )`, g_t = grad
//!   d_t(c),
//!   |.|_1 the sum of a vector's sizes along the axes;
//! - in a cube inside, `s >= -d_t >= e - g . (x - c)` for the closest triangle t, with
//!   `e = -max ( d_t(v) - g . (v - c) )` over the corners v;
//! - in a cube that the surface may pass through, `s >= s(c) - sqrt(3) h`, as s changes by no more than x moves.
//!
//! So away from the surface bounds are sharp to second order in h.

use super::DEPTH_ROUNDING;
use super::RestSurface;
use super::bounding_volumes::Leaf;
use super::closest_point::{closest_point, point_at};
use super::normals;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::SQRT_2;

/// Cubes for each triangle, about: their sides are not much longer than a triangle's where the lattice is twice as wide
/// as the object.
const CUBES_PER_TRIANGLE: usize = 16;

/// Least number of cubes: about twenty-five along each axis.
const LEAST_CUBES: usize = 1 << 14;

/// Most cubes: less than three megabytes.
const MOST_CUBES: usize = 1 << 17;

/// The bound within one cube, in single precision to stay in cache, and rounded down.
#[derive(Clone, Copy)]
struct Cube {
    /// The bound at the model's centre (m), and its gradient.
    constant: f32,
    gradient: Vec3,
    /// Triangle closest to the middle.
    triangle: u32,
}

/// The lattice.
pub struct DistanceBounds {
    /// Its low corner (m).
    low: DVec3,
    /// One over a cube's side (1/m).
    inverse_side: f64,
    /// Cubes along each axis.
    counts: [usize; 3],
    /// Last axis fastest.
    cubes: Vec<Cube>,
}

impl DistanceBounds {
    /// No cubes.
    #[must_use]
    pub fn none() -> Self {
        Self { low: DVec3::ZERO, inverse_side: 1.0, counts: [0; 3], cubes: Vec::new() }
    }

    /// The lattice for `surface`, which has none yet: the surface's box, widened all round by half
    /// of its longest side.
    #[must_use]
    pub fn new(surface: &RestSurface) -> Self {
        let low = surface.positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = surface.positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let margin = 0.5 * (high - low).max_element();
        let (low, size) = (low - margin, high - low + 2.0 * margin);
        let wanted = (CUBES_PER_TRIANGLE * surface.triangles.len()).clamp(LEAST_CUBES, MOST_CUBES);
        let side = (size.element_product() / wanted as f64).cbrt();
        if !(side > 0.0 && side.is_finite()) {
            return Self::none();
        }
        let counts = (size / side).to_array().map(|count| count.ceil() as usize);
        let slack = DEPTH_ROUNDING * (low.abs() + size).length();
        let cubes = (0..counts[0] * counts[1]).into_par_iter().flat_map_iter(|line| {
            let mut near = None;
            (0..counts[2]).map(move |k| {
                let index = [line / counts[1], line % counts[1], k];
                let middle = low + (DVec3::from_array(index.map(|place| place as f64)) + 0.5) * side;
                let cube = cube(surface, middle, 0.5 * side, slack, near);
                near = Some(cube.triangle);
                cube
            })
        });
        Self { low, inverse_side: side.recip(), counts, cubes: cubes.collect() }
    }

    /// Low corner of the lattice (m), one over a cube's side (1/m), and cubes along each axis.
    #[must_use]
    pub fn lattice(&self) -> (DVec3, f64, [usize; 3]) {
        (self.low, self.inverse_side, self.counts)
    }

    /// Of each cube, the last axis fastest: gradient of the bound (1), the bound at the model's centre (m), and the
    /// triangle closest to the middle.
    pub fn cubes(&self) -> impl Iterator<Item = (Vec3, f32, u32)> {
        self.cubes.iter().map(|cube| (cube.gradient, cube.constant, cube.triangle))
    }

    /// A lower bound of the signed distance of `x` to the surface (m), and a triangle near by; `None` where there are
    /// no cubes.
    #[inline]
    #[must_use]
    pub(super) fn at(&self, x: DVec3) -> Option<(f64, u32)> {
        let place = (x - self.low) * self.inverse_side;
        let [m, n, o] = self.counts;
        let (i, j, k) = (place.x as u32 as usize, place.y as u32 as usize, place.z as u32 as usize);
        if !(place.x >= 0.0 && place.y >= 0.0 && place.z >= 0.0 && i < m && j < n && k < o) {
            return None;
        }
        let cube = &self.cubes[(i * n + j) * o + k];
        Some((f64::from(cube.constant) + cube.gradient.as_dvec3().dot(x), cube.triangle))
    }
}

/// The bound around `c`, `half` of a side to either side of it; `near` is a triangle near by, if any is known.
fn cube(surface: &RestSurface, c: DVec3, half: f64, slack: f64, near: Option<u32>) -> Cube {
    let offset = |t: u32, x: DVec3| {
        let corners = normals::corners(&surface.positions, surface.triangles[t as usize]);
        x - point_at(corners, closest_point(x, corners).weights)
    };
    let closest = surface.closest(c, near.unwrap_or(u32::MAX));
    let (distance, triangle) = (closest.distance_squared.sqrt(), closest.triangle);
    let s = if surface.is_inside(c, &closest) { -distance } else { distance };
    let reach = 3.0_f64.sqrt() * half;
    let nearest = offset(triangle, c);
    // The direction as it is stored.
    let gradient = (nearest / nearest.length()).as_vec3();
    let g = gradient.as_dvec3();
    let (least, gradient) = if s > reach + slack {
        let mut least = s;
        let matters = |leaf: &Leaf, least: f64| {
            let (middle, size) = leaf.volume.ball();
            let (away, distance) = (c - middle, c.distance(middle));
            // |g - g_t|, g_t being the direction from a point of that ball: with an angle phi,
            // sin(phi) <= size / distance.
            let turn = if size < distance { (g - away / distance).length() + SQRT_2 * size / distance } else { 2.0 };
            leaf.volume.distance_squared(c).sqrt() - reach * turn.min(2.0) < least
        };
        // |g - g_t|_1 is at most sqrt(3) |g - g_t|, and that at most 2; from outside the ball around all triangles both
        // directions are within a cone of half the angle asin(size / distance). The direction g is rounded to f32.
        let (middle, size) = surface.bounds.ball();
        let turn = (2.0 * size / c.distance(middle)).min(2.0) + f64::from(f32::EPSILON);
        let bound = |least: f64| (least + reach * turn).powi(2);
        surface.bounds.walk(c, bound(least), |leaf| {
            let leaf = &surface.bounds.leaves[leaf];
            if matters(leaf, least) {
                for &t in &leaf.triangles {
                    let offset = offset(t, c);
                    let distance = offset.length();
                    least = least.min(distance - half * (g - offset / distance).abs().element_sum());
                }
            }
            bound(least)
        });
        (least, gradient)
    } else if s < -reach - slack {
        let excess = (0..8).map(|k| {
            let v = DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) * 2.0 - 1.0;
            offset(triangle, c + v * half).length() - g.dot(v * half)
        });
        (-excess.fold(0.0, f64::max), -gradient)
    } else {
        (s - reach, Vec3::ZERO)
    };
    let constant = least - gradient.as_dvec3().dot(c) - slack;
    Cube { constant: (constant as f32).next_down(), gradient, triangle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::ContactSurface;
    use crate::{object::Object, random::Random, scene::Scene};
    use std::path::Path;

    /// Distances by trial of every triangle, sides by solid angles: on a convex surface and on one with a hollow.
    /// Bounds hold, and are idle only near the surface.
    #[test]
    fn bounds_hold_and_are_sharp_away_from_the_surface() {
        for name in ["tests/scenes/sphere.toml", "datasets/mesh.toml"] {
            let scene = Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap();
            let object = Object::build(&scene.object).unwrap();
            let surface = RestSurface::new(&object, ContactSurface::Facets);
            let bounds = DistanceBounds::new(&surface);
            let side = bounds.inverse_side.recip();
            let size = DVec3::from_array(bounds.counts.map(|count| count as f64)) * side;
            let mut random = Random::new(1);
            let mut next = || random.between(0.0, 1.0);
            let (mut slack, mut count, mut inside) = (0.0, 0.0, 0);
            for _ in 0..4000 {
                let x = bounds.low + size * DVec3::new(next(), next(), next());
                let distance = |t: u32| {
                    let corners = normals::corners(&surface.positions, object.triangles[t as usize]);
                    x.distance(point_at(corners, closest_point(x, corners).weights))
                };
                let distance = (0..object.triangles.len() as u32).map(distance).fold(f64::INFINITY, f64::min);
                let is_inside = normals::winding_number(&surface.positions, &object.triangles, x) > 0.5;
                let signed = if is_inside { -distance } else { distance };
                let (bound, _) = bounds.at(x).unwrap();
                assert!(bound <= signed, "{name}: {bound} {signed} at {x}");
                inside += usize::from(is_inside);
                if signed > 2.0 * side {
                    slack += (signed - bound) / side;
                    count += 1.0;
                }
            }
            assert!(
                slack < 0.1 * count && count > 1000.0 && inside > 100,
                "{name}: {} {count} {inside}",
                slack / count
            );
            let outside = bounds.low - 0.01 * side;
            assert!(bounds.at(outside).is_none() && bounds.at(outside + size + 0.02 * side).is_none());
            assert!(bounds.at(DVec3::NAN).is_none() && bounds.at(DVec3::INFINITY).is_none());
        }
    }
}
