//! Closest point of a triangle to a point, and the feature (face, edge, vertex) that it lies on.
//!
//! Voronoi regions of the triangle's features, decided by six inner products (Ericson, Real-Time Collision Detection,
//! 2005, section 5.1.5). The point is returned as barycentric weights, p = sum_k w_k corner_k, because contact spreads
//! its force by them; weights of corners that the feature does not touch are exactly zero.

use crate::contact::MINIMUM_SQUARE;
use glam::DVec3;

/// Part of a triangle. Edge k joins corners k and (k + 1) % 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Corner k.
    Vertex(usize),
    /// Edge k.
    Edge(usize),
    /// The interior.
    Face,
}

impl Feature {
    /// The feature of this number, which is how shaders tell it; `None` where there is none.
    #[must_use]
    pub fn from_number(number: u32) -> Option<Self> {
        match number {
            0..3 => Some(Self::Vertex(number as usize)),
            3..6 => Some(Self::Edge(number as usize - 3)),
            6 => Some(Self::Face),
            _ => None,
        }
    }
}

/// The closest point of one triangle.
#[derive(Clone, Copy, Debug)]
pub struct ClosestPoint {
    /// Barycentric weights of the three corners: none negative, sum one.
    pub weights: [f64; 3],
    /// Where on the triangle it lies.
    pub feature: Feature,
}

/// Closest point of the triangle `corners` (m) to `x` (m).
#[inline]
#[must_use]
pub fn closest_point(x: DVec3, corners: [DVec3; 3]) -> ClosestPoint {
    let [a, b, c] = corners;
    let ab = b - a;
    let ac = c - a;
    let ax = x - a;
    let d1 = ab.dot(ax);
    let d2 = ac.dot(ax);
    if d1 <= 0.0 && d2 <= 0.0 {
        return vertex(0);
    }
    let bx = x - b;
    let d3 = ab.dot(bx);
    let d4 = ac.dot(bx);
    if d3 >= 0.0 && d4 <= d3 {
        return vertex(1);
    }
    let cx = x - c;
    let d5 = ab.dot(cx);
    let d6 = ac.dot(cx);
    if d6 >= 0.0 && d5 <= d6 {
        return vertex(2);
    }
    let area_c = d1 * d4 - d3 * d2;
    if area_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return edge(0, d1 / (d1 - d3).max(MINIMUM_SQUARE));
    }
    let area_a = d3 * d6 - d5 * d4;
    if area_a <= 0.0 && d4 >= d3 && d5 >= d6 {
        return edge(1, (d4 - d3) / (d4 - d3 + d5 - d6).max(MINIMUM_SQUARE));
    }
    let area_b = d5 * d2 - d1 * d6;
    if area_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return edge(2, 1.0 - d2 / (d2 - d6).max(MINIMUM_SQUARE));
    }
    let area = (area_a + area_b + area_c).max(MINIMUM_SQUARE);
    let weight_b = area_b / area;
    let weight_c = area_c / area;
    ClosestPoint { weights: [1.0 - weight_b - weight_c, weight_b, weight_c], feature: Feature::Face }
}

/// Corner k.
fn vertex(k: usize) -> ClosestPoint {
    let mut weights = [0.0; 3];
    weights[k] = 1.0;
    ClosestPoint { weights, feature: Feature::Vertex(k) }
}

/// The point at share `t` along edge k.
fn edge(k: usize, t: f64) -> ClosestPoint {
    let mut weights = [0.0; 3];
    weights[k] = 1.0 - t;
    weights[(k + 1) % 3] = t;
    ClosestPoint { weights, feature: Feature::Edge(k) }
}

/// The point with barycentric `weights` on the triangle `corners` (m).
#[must_use]
pub fn point_at(corners: [DVec3; 3], weights: [f64; 3]) -> DVec3 {
    corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::sequence;

    #[test]
    fn no_sampled_point_of_the_triangle_is_closer() {
        let mut next = sequence(1);
        let mut point = || DVec3::new(next(), next(), next());
        let mut seen = [0usize; 3];
        for _ in 0..600 {
            let corners = [point(), point(), point()];
            let x = point();
            let found = closest_point(x, corners);
            seen[match found.feature {
                Feature::Vertex(_) => 0,
                Feature::Edge(_) => 1,
                Feature::Face => 2,
            }] += 1;
            assert!((found.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!(found.weights.iter().all(|&w| w >= -1e-14));
            let distance = x.distance(point_at(corners, found.weights));
            let steps = 40;
            for i in 0..=steps {
                for j in 0..=steps - i {
                    let (v, w) = (f64::from(i) / f64::from(steps), f64::from(j) / f64::from(steps));
                    let other = x.distance(point_at(corners, [1.0 - v - w, v, w]));
                    assert!(other >= distance - 1e-12, "{other} < {distance}");
                }
            }
        }
        assert!(seen.iter().all(|&count| count > 20), "every kind of feature must occur: {seen:?}");
    }

    #[test]
    fn degenerate_triangles_give_finite_weights() {
        let p = DVec3::new(0.1, 0.2, 0.3);
        let q = DVec3::new(0.4, 0.2, 0.3);
        for corners in [[p, p, p], [p, p, q], [p, q, q], [p, q, p.midpoint(q)]] {
            let found = closest_point(DVec3::ZERO, corners);
            assert!(found.weights.iter().all(|w| w.is_finite()), "{corners:?} {found:?}");
        }
    }
}
