//! One facet of the contact surface: a flat triangle, or a triangle of degree four that joins its neighbours smoothly.
//!
//! Its points belong to barycentric weights. A point closest to x is found by Newton's method from the closest point of
//! the flat triangle between the corners.

use super::closest_point::{ClosestPoint, Feature, closest_point};
use super::normals::{area_vector, unit_or_zero};
use super::quartic::{CONTROLS, Jet, place};
use crate::contact::MINIMUM_SQUARE;
use glam::DVec3;

/// Steps of Newton's method for the closest point of a bent facet at most: from the flat triangle's closest point three
/// or four reach rounding, and where the distance is not convex more do not help.
pub const FACET_ITERATIONS: usize = 16;

/// Step of barycentric weights at which the search for that point ends (1): the next step would be about its square,
/// far below the rounding of a weight.
pub const FACET_STEP: f64 = 1e-8;

/// A triangle of the contact surface (m).
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// Its corners, anticlockwise seen from outside.
    pub corners: [DVec3; 3],
    /// Its control points; none where it is flat.
    pub net: Option<[DVec3; CONTROLS]>,
}

/// A direction in which barycentric weights change; the changes sum to zero.
pub type Direction = [f64; 3];

/// The two directions in which a point moves over a face: towards corners 1 and 2.
const FACE: [Direction; 2] = [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]];

/// The direction in which a point moves along each edge.
const EDGES: [[Direction; 1]; 3] = [[[-1.0, 1.0, 0.0]], [[0.0, -1.0, 1.0]], [[1.0, 0.0, -1.0]]];

/// Returns the directions in which a point that lies on `feature` may move on it: two on a face, one on an edge, none
/// on a vertex.
#[must_use]
pub fn directions(feature: Feature) -> &'static [Direction] {
    match feature {
        Feature::Face => &FACE,
        Feature::Edge(k) => &EDGES[k],
        Feature::Vertex(_) => &[],
    }
}

impl Facet {
    /// Returns a flat triangle.
    #[must_use]
    pub fn flat(corners: [DVec3; 3]) -> Self {
        Self { corners, net: None }
    }

    /// Returns a triangle of degree four.
    #[must_use]
    pub fn bent(net: [DVec3; CONTROLS]) -> Self {
        const CORNERS: [usize; 3] = [place([4, 0, 0]), place([0, 4, 0]), place([0, 0, 4])];
        Self { corners: CORNERS.map(|corner| net[corner]), net: Some(net) }
    }

    /// Returns its point at barycentric weights `w`, with the derivatives there.
    #[inline]
    #[must_use]
    pub fn jet(&self, w: [f64; 3]) -> Jet {
        match &self.net {
            None => Jet::flat(&self.corners, w),
            Some(net) => Jet::new(net, w),
        }
    }

    /// Returns its point at barycentric weights `w` (m).
    #[inline]
    #[must_use]
    pub fn point(&self, w: [f64; 3]) -> DVec3 {
        match &self.net {
            None => Jet::flat(&self.corners, w).point,
            Some(net) => Jet::new(net, w).point,
        }
    }

    /// Returns its outward unit normal at `w`; zero where it has none.
    #[must_use]
    pub fn normal(&self, w: [f64; 3]) -> DVec3 {
        unit_or_zero(match self.net {
            None => area_vector(self.corners),
            Some(_) => {
                let [first, second] = self.jet(w).face_tangents();
                first.cross(second)
            }
        })
    }

    /// Returns the angle between its two edges at corner k (rad).
    #[must_use]
    pub fn angle(&self, k: usize) -> f64 {
        let mut at = [0.0; 3];
        at[k] = 1.0;
        let jet = self.jet(at);
        let (left, right) = (jet.tangent(EDGES[k][0]), -jet.tangent(EDGES[(k + 2) % 3][0]));
        left.cross(right).length().atan2(left.dot(right))
    }

    /// Finds the point of it that is closest to `x`; none where a bent facet is farther than `within` (m).
    #[inline]
    #[must_use]
    pub fn closest(&self, x: DVec3, within: f64) -> Option<ClosestPoint> {
        let flat = closest_point(x, self.corners);
        let Some(net) = &self.net else { return Some(flat) };
        // All of it lies between its control points, so no point of it is nearer than the nearest of these along any
        // direction.
        let towards = (x - Jet::flat(&self.corners, flat.weights).point).normalize_or_zero();
        let farthest = net.iter().map(|control| towards.dot(*control)).fold(f64::MIN, f64::max);
        let least = towards.dot(x) - farthest;
        (least <= within || within.is_nan()).then(|| self.closest_bent(x, flat.weights))
    }

    /// Finds the same on a bent facet, searching from `start`.
    fn closest_bent(&self, x: DVec3, start: [f64; 3]) -> ClosestPoint {
        let unbounded = self.stationary(x, start);
        if unbounded.into_iter().all(|weight| weight >= 0.0) {
            return ClosestPoint { weights: unbounded, feature: Feature::Face };
        }
        // On an edge beyond which the facet would have to go on.
        let mut best: Option<(f64, ClosestPoint)> = None;
        for k in (0..3).filter(|k| unbounded[(k + 2) % 3] < 0.0) {
            let point = self.closest_on_edge(x, k, start);
            let square = x.distance_squared(self.point(point.weights));
            if best.is_none_or(|(least, _)| square < least) {
                best = Some((square, point));
            }
        }
        best.map_or(ClosestPoint { weights: start, feature: Feature::Face }, |(_, point)| point)
    }

    /// Finds the point closest to `x` on the feature of `from`, which is closest to a place next to `x`. The feature
    /// is continued beyond its ends, so that the point depends smoothly on `x`.
    #[must_use]
    pub fn followed(&self, x: DVec3, from: &ClosestPoint) -> ClosestPoint {
        let weights = match from.feature {
            Feature::Face => self.stationary(x, from.weights),
            Feature::Edge(k) => on_edge(k, self.stationary_on_edge(x, k, from.weights, [f64::MIN, f64::MAX])),
            Feature::Vertex(_) => from.weights,
        };
        ClosestPoint { weights, feature: from.feature }
    }

    /// Finds the weights at which the distance to `x` is least, on the facet continued beyond its edges. Far outside it
    /// stops, since Newton's method would not come back.
    fn stationary(&self, x: DVec3, start: [f64; 3]) -> [f64; 3] {
        let mut w = start;
        for _ in 0..FACET_ITERATIONS {
            let jet = self.jet(w);
            let offset = jet.point - x;
            let ([a, b], bends) = (jet.face_tangents(), jet.face_bends());
            let slope = [offset.dot(a), offset.dot(b)];
            let metric = [a.dot(a), a.dot(b), b.dot(b)];
            let full =
                [metric[0] + offset.dot(bends[0]), metric[1] + offset.dot(bends[1]), metric[2] + offset.dot(bends[2])];
            // Where the distance is not convex, the metric alone leads downhill.
            let [h, i, j] = if full[0] > 0.0 && full[0] * full[2] > full[1] * full[1] { full } else { metric };
            let determinant = (h * j - i * i).max(MINIMUM_SQUARE);
            let step = [(i * slope[1] - j * slope[0]) / determinant, (i * slope[0] - h * slope[1]) / determinant];
            let (u, v) = (w[1] + step[0], w[2] + step[1]);
            w = [1.0 - u - v, u, v];
            let far = w.into_iter().any(|weight| weight < -1.0);
            if far || step[0].abs() + step[1].abs() < FACET_STEP {
                break;
            }
        }
        w
    }

    /// Finds the point of edge k that is closest to `x`, from the point of the edge that is next to `start`.
    fn closest_on_edge(&self, x: DVec3, k: usize, start: [f64; 3]) -> ClosestPoint {
        let t = self.stationary_on_edge(x, k, start, [0.0, 1.0]);
        let feature = match t {
            0.0 => Feature::Vertex(k),
            1.0 => Feature::Vertex((k + 1) % 3),
            _ => Feature::Edge(k),
        };
        ClosestPoint { weights: on_edge(k, t), feature }
    }

    /// Finds the place on edge k, from 0 at its first corner to 1 and within `ends`, at which the distance to `x` is
    /// least.
    fn stationary_on_edge(&self, x: DVec3, k: usize, start: [f64; 3], ends: [f64; 2]) -> f64 {
        let (direction, next) = (EDGES[k][0], (k + 1) % 3);
        let sum = start[k] + start[next];
        let mut t = if sum > 0.0 { start[next] / sum } else { 0.5 };
        for _ in 0..FACET_ITERATIONS {
            let jet = self.jet(on_edge(k, t));
            let (offset, tangent) = (jet.point - x, jet.tangent(direction));
            let metric = tangent.dot(tangent);
            let full = metric + offset.dot(jet.bend(direction, direction));
            let before = t;
            t -= offset.dot(tangent) / (if full > 0.0 { full } else { metric }).max(MINIMUM_SQUARE);
            t = t.clamp(ends[0], ends[1]);
            if (t - before).abs() < FACET_STEP {
                break;
            }
        }
        t
    }
}

/// The weights of the place `t` on edge k, from 0 at its first corner to 1.
fn on_edge(k: usize, t: f64) -> [f64; 3] {
    let mut weights = [0.0; 3];
    (weights[k], weights[(k + 1) % 3]) = (1.0 - t, t);
    weights
}
