//! The walls that a ball feels: the facets that are about as near to its centre as the nearest. Each is a wall by itself, to whichever
//! side it shows; how many there are makes little difference, because they are springs in series with one that is the ball's own (see
//! [`super::series`]). So a hollow has several walls and no kink, and crumpled facets push like others.
//!
//! Facets are rounded a little: the distance is the least of `|x - p(w)| sqrt(1 + k |w|^2)` over barycentric weights w, with
//! k = [`crate::tolerances::FACET_ROUNDING`]; while a ball comes in gently, more. Where a facet is pressed to no area, its closest point
//! can be told by many w, and the force may go to any of its nodes: the distance's derivative in their positions would jump there, and
//! stiff balls come to rest just on such places. Rounded, it is continuous.
//!
//! Inside the object the nearest wall is felt from its far side, the depth being r plus the distance.

use super::closest_point::{ClosestPoint, Feature, point_at, rounded};
use super::depth::{Contact, Curvature};
use super::surface;
use crate::tolerances::{MINIMUM_CURVATURE_RADIUS, MINIMUM_SQUARE};
use glam::DVec3;

/// How a distance bends under displacements of the wall's nodes, and what the wall bears.
#[derive(Clone, Copy, Debug)]
pub struct Wall {
    /// For each of two directions in which the closest point may slide, by how much displacements of the corners make it.
    slides: [[DVec3; 3]; 2],
    /// 1 + k |w|^2 over the distance, negative outside [1/m].
    direct: f64,
    /// One over the distance, negative outside; zero where geometry is frozen [1/m].
    scale: f64,
    /// What it bears, over kc; see [`super::series`] [m].
    pub push: f64,
}

impl Wall {
    /// Second variation of the depth along displacements `v` of the wall's nodes [m]; see [`super::depth::second_variation`].
    ///
    /// With F = 1/2 distance^2 least over w, `F'' = F_vv - F_vw F_ww^-1 F_wv`; the factor of F_ww^-1 is in the slides.
    #[inline]
    #[must_use]
    pub fn second_variation(&self, weights: [f64; 3], normal: DVec3, v: [DVec3; 3]) -> [DVec3; 3] {
        let straight = self.straight(weights, normal, v);
        let slid = self.slid(v);
        [0, 1, 2].map(|j| straight * weights[j] + slid[j])
    }

    /// Of the two squares that the second variation is the difference of, the positive one [m]: what the point slides by from outside,
    /// what it moves by from inside.
    #[must_use]
    pub fn convex_variation(&self, weights: [f64; 3], normal: DVec3, v: [DVec3; 3]) -> [DVec3; 3] {
        if self.scale < 0.0 {
            return self.slid(v);
        }
        let straight = self.straight(weights, normal, v);
        weights.map(|weight| straight * weight)
    }

    /// The part of F_vv.
    #[inline]
    fn straight(&self, weights: [f64; 3], normal: DVec3, v: [DVec3; 3]) -> DVec3 {
        let moved = v[0] * weights[0] + v[1] * weights[1] + v[2] * weights[2];
        moved * self.direct - normal * (self.scale * normal.dot(moved))
    }

    /// The part of F_vw F_ww^-1 F_wv.
    #[inline]
    fn slid(&self, v: [DVec3; 3]) -> [DVec3; 3] {
        let [one, other] =
            self.slides.map(|slide| self.scale * (slide[0].dot(v[0]) + slide[1].dot(v[1]) + slide[2].dot(v[2])));
        [0, 1, 2].map(|j| -self.slides[0][j] * one - self.slides[1][j] * other)
    }

    /// The wall does not bend any more.
    pub fn freeze(&mut self) {
        self.direct = 0.0;
        self.scale = 0.0;
    }
}

/// The wall that the ball `i` at `x` with `radius` feels at `point` of the triangle `corners` with the object's `nodes`: from outside, or
/// from `inside`, facets rounded by `rounding`; `pseudonormal` stands in for its direction where x lies on it.
#[must_use]
pub fn wall(
    (i, x, radius): (u32, DVec3, f64),
    (nodes, corners): ([u32; 3], [DVec3; 3]),
    point: ClosestPoint,
    inside: bool,
    pseudonormal: DVec3,
    rounding: f64,
) -> Contact {
    let ClosestPoint { weights, feature } = point;
    let inner = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let rise = 1.0 + rounding * inner(weights, weights);
    let offset = x - point_at(corners, weights);
    let length = offset.length();
    let distance = if inside { -length * rise.sqrt() } else { length * rise.sqrt() };
    let normal = if length > MINIMUM_CURVATURE_RADIUS {
        offset * (rise / distance)
    } else {
        surface::unit_or_zero(pseudonormal)
    };
    let scale = -1.0 / distance.abs().max(MINIMUM_CURVATURE_RADIUS).copysign(distance);
    // Directions in which w may change: to corners b and c from a, or along the edge.
    let mut ways = [[0.0; 3]; 2];
    match feature {
        Feature::Face => ways = [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]],
        Feature::Edge(k) => (ways[0][k], ways[0][(k + 1) % 3]) = (-1.0, 1.0),
        Feature::Vertex(_) => {}
    }
    let tangents = ways.map(|way| point_at(corners, way));
    let slopes = ways.map(|way| 2.0 * rounding * inner(weights, way));
    let slide = |k: usize| {
        let turn = offset * slopes[k];
        [0, 1, 2].map(|j| (tangents[k] * weights[j] - offset * ways[k][j]) * rise - turn * weights[j])
    };
    let bend = |k: usize, l: usize| {
        let rounded = rounding * inner(ways[k], ways[l]) - slopes[k] * slopes[l] / rise;
        rise * tangents[k].dot(tangents[l]) + rounded * length * length
    };
    // Slides divided by the Cholesky factor of F_ww.
    let mut slides = [[DVec3::ZERO; 3]; 2];
    if !matches!(feature, Feature::Vertex(_)) {
        let first = bend(0, 0).max(MINIMUM_SQUARE).sqrt();
        slides[0] = slide(0).map(|part| part / first);
        if feature == Feature::Face {
            let mixed = bend(1, 0) / first;
            let second = (bend(1, 1) - mixed * mixed).max(MINIMUM_SQUARE).sqrt();
            let own = slide(1);
            slides[1] = [0, 1, 2].map(|j| (own[j] - slides[0][j] * mixed) / second);
        }
    }
    let wall = Wall { slides, direct: rise * scale, scale, push: 0.0 };
    let measured = (normal, radius - distance, Curvature::default());
    Contact { wall: Some(wall), ..Contact::new(i, nodes, weights, measured) }
}

/// A facet within reach.
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// Its triangle.
    pub triangle: u32,
    /// Its rounded closest point.
    pub point: ClosestPoint,
    /// Distance of that [m].
    pub distance: f64,
}

/// Finds the facets that one ball feels; its lists are reused from ball to ball.
#[derive(Default)]
pub struct WallSearch {
    near: Vec<u32>,
    facets: Vec<Facet>,
}

impl WallSearch {
    /// No triangles.
    pub fn clear(&mut self) {
        self.near.clear();
    }

    /// Takes in a triangle that may be within reach.
    pub fn push(&mut self, triangle: u32) {
        self.near.push(triangle);
    }

    /// The facets within `reach(d)` of `x` among the triangles taken in, ascending, d being the distance of the nearest [m], and the place
    /// of that one; rounded by `rounding`.
    pub fn find(
        &mut self,
        x: DVec3,
        rounding: f64,
        reach: impl Fn(f64) -> f64,
        positions: &[DVec3],
        triangles: &[[u32; 3]],
    ) -> (&[Facet], usize) {
        let Self { near, facets } = self;
        near.sort_unstable();
        near.dedup();
        facets.clear();
        facets.extend(near.iter().map(|&triangle| {
            let (point, distance) = rounded(x, surface::corners(positions, triangles[triangle as usize]), rounding);
            Facet { triangle, point, distance }
        }));
        let least = facets.iter().map(|facet| facet.distance).fold(f64::INFINITY, f64::min);
        let reach = reach(least);
        facets.retain(|facet| facet.distance <= reach);
        let nearest = facets.iter().position(|facet| facet.distance == least).unwrap_or(0);
        (facets, nearest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::closest_point::closest_point;
    use crate::contact::depth::second_variation;
    use crate::random::sequence;
    use crate::tolerances::{FACET_ROUNDING, GENTLE_ROUNDING};

    /// Depth and its derivatives along displacements of a facet's corners, from outside and from inside, on faces, edges and vertices, and
    /// of facets pressed to a line and beyond: against central differences.
    #[test]
    fn derivatives_agree_with_finite_differences() {
        let mut next = sequence(11);
        let mut seen = [0usize; 3];
        let h = 1e-5;
        for turn in 0..1200 {
            let mut point = || DVec3::new(next(), next(), next());
            let mut corners = [point(), point(), point()];
            if turn % 3 == 0 {
                corners[2] = corners[0].lerp(corners[1], 0.3) + point() * 1e-3;
            }
            let x = point() * 2.0;
            let v = [point(), point(), point()].map(|v| v * 0.1);
            let w = [point(), point(), point()];
            let inside = turn % 2 == 0;
            let k = if turn % 4 < 2 { FACET_ROUNDING } else { GENTLE_ROUNDING };
            let at = |s: f64| {
                let corners = [0, 1, 2].map(|j| corners[j] + v[j] * s);
                wall((0, x, 0.5), ([0, 1, 2], corners), rounded(x, corners, k).0, inside, DVec3::X, k)
            };
            let (here, before, after) = (at(0.0), at(-h), at(h));
            let features = [&here, &before, &after].map(|row| row.weights.map(|w| w == 0.0));
            if features[0] != features[1] || features[0] != features[2] || (here.depth - 0.5).abs() < 0.2 {
                continue;
            }
            seen[features[0].iter().filter(|&&zero| zero).count()] += 1;
            let slope = here.deepening(v);
            let found = (after.depth - before.depth) / (2.0 * h);
            assert!((slope - found).abs() < 1e-6 * (1.0 + slope.abs()), "{turn}: {slope} {found}");
            let bent = second_variation(&here, v);
            let bend: f64 = bent.iter().zip(w).map(|(part, w)| part.dot(w)).sum();
            let found = (after.deepening(w) - before.deepening(w)) / (2.0 * h);
            assert!((bend - found).abs() < 1e-4 * (0.1 + found.abs()), "{turn}: {bend} {found}");
            let inner = |parts: [DVec3; 3]| parts.iter().zip(v).map(|(part, v)| part.dot(v)).sum::<f64>();
            let exact = inner(bent);
            let convex = inner(here.wall.unwrap().convex_variation(here.weights, here.normal, v));
            assert!(convex >= 0.0 && convex >= exact - 1e-9 * exact.abs(), "{turn}: {convex} {exact}");
        }
        assert!(seen.iter().all(|&count| count > 30), "{seen:?}");
    }

    /// Where a facet is pressed through a line, the weights of its closest point go over from one side to the other without a jump.
    #[test]
    fn weights_are_continuous_where_a_facet_has_no_area() {
        let x = DVec3::new(0.02, 0.0, 1.0);
        let at = |height: f64| {
            let corners = [DVec3::new(-0.5, 0.0, 0.0), DVec3::new(0.5, 0.0, 0.0), DVec3::new(0.0, 0.0, height)];
            let exact = closest_point(x, corners).weights;
            (rounded(x, corners, FACET_ROUNDING).0.weights, exact)
        };
        let mut greatest = [0.0f64; 2];
        for k in -2000..2000 {
            let (one, other) = (at(1e-6 * f64::from(k)), at(1e-6 * f64::from(k + 1)));
            for (greatest, (one, other)) in greatest.iter_mut().zip([(one.0, other.0), (one.1, other.1)]) {
                let step = one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                *greatest = greatest.max(step);
            }
        }
        assert!(greatest[0] < 0.01 && greatest[1] > 0.5, "{greatest:?}");
    }
}
