//! Depth of a proxy node below the deformed surface, with its first and second derivative in the object's nodes.
//!
//! `depth = r + s`, `s = N . (p - x)`: x the proxy node, r its radius, p the closest surface point, N the outward unit
//! direction, s positive inside. p = sum_j w_j n_j over the nodes of the touched feature.
//!
//! First derivative, by the envelope theorem (p is a minimiser, so its sliding along the feature has no effect):
//! `d depth / d n_j = w_j N`, `d depth / d x = -N`. With the energy 1/2 kc depth^2 the proxy node is pushed by lambda N
//! and object node j by -lambda w_j N, lambda = kc depth.
//!
//! Second derivative along node displacements v_j, with dp = sum_j w_j v_j and sg = sum_j g_j (N . v_j), the turn of the
//! feature about itself:
//! `d2s = -s |sg|^2 - 2 sg . dp + (1/s) dp . P dp`
//! - face: g_j the in-plane gradients of the barycentric weights, P = 0;
//! - edge ab of unit direction e and length l: g_a = -e/l, g_b = e/l, P = T T^T with T = N x e;
//! - vertex: g = 0, P = I - N N^T.
//!
//! One form for all three, so that a product needs no branch: P dp = dp - N (N . dp) - e (e . dp), with 1/s = 0 on faces and
//! e = 0 at vertices. It is needed because contact points creep over flat facets when it is left out.

use crate::contact::geometry::closest_point::Feature;
use crate::tolerances::{MINIMUM_CURVATURE_RADIUS, MINIMUM_SQUARE};
use glam::DVec3;

/// One proxy node and a surface feature that it feels: a row of the contact problem. A point has one row, a ball one for each facet
/// that it feels (see [`super::series`]).
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Number of the proxy node.
    pub proxy_node: u32,
    /// Object nodes of the closest triangle.
    pub nodes: [u32; 3],
    /// Barycentric weights of p; exactly zero for nodes that the feature does not touch.
    pub weights: [f64; 3],
    /// Unit direction N in which the surface pushes the proxy node.
    pub normal: DVec3,
    /// r + s, positive in contact [m].
    pub depth: f64,
    /// Stiffness of the proxy node's spring over that of [`crate::contact::Model::kc`] [1].
    pub share: f64,
    /// Its part of the depth of the proxy node's spring: max(0, depth) where the node feels this facet alone; see
    /// [`super::series`] [m].
    pub push: f64,
    /// Force lambda by which the curvature counts: the row's force at the solution [N].
    pub multiplier: f64,
    /// Second derivative of s.
    pub curvature: Curvature,
}

/// How s bends under displacements of the object's nodes; see the file's head.
#[derive(Clone, Copy, Debug, Default)]
pub struct Curvature {
    /// s [m].
    pub distance: f64,
    /// 1/s on edges and at vertices, zero on faces [1/m].
    pub inverse_distance: f64,
    /// g_j [1/m].
    pub gradients: [DVec3; 3],
    /// Unit direction e of the edge, else zero.
    pub along: DVec3,
}

/// Depth of the node at `x` with `radius`, from the closest feature of the triangle `corners` with barycentric `weights`.
///
/// `pseudonormal` decides the side, and stands in for N where x lies on the edge or vertex itself.
#[inline]
#[must_use]
pub fn measure(
    x: DVec3,
    radius: f64,
    corners: [DVec3; 3],
    weights: [f64; 3],
    feature: Feature,
    pseudonormal: DVec3,
) -> (DVec3, f64, Curvature) {
    let p = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
    let offset = p - x;
    let mut curvature = Curvature::default();
    let normal;
    if feature == Feature::Face {
        normal = pseudonormal;
        curvature.distance = normal.dot(corners[0] - x);
        curvature.gradients = face_gradients(corners);
    } else {
        let length = offset.length();
        let inside = offset.dot(pseudonormal) >= 0.0;
        curvature.distance = if inside { length } else { -length };
        let divisor = curvature.distance.abs().max(MINIMUM_CURVATURE_RADIUS);
        curvature.inverse_distance = if inside { 1.0 / divisor } else { -1.0 / divisor };
        normal = if length > MINIMUM_CURVATURE_RADIUS {
            offset / curvature.distance
        } else {
            pseudonormal / pseudonormal.length_squared().max(MINIMUM_SQUARE).sqrt()
        };
        if let Feature::Edge(k) = feature {
            let edge = corners[(k + 1) % 3] - corners[k];
            let square = edge.length_squared().max(MINIMUM_SQUARE);
            curvature.along = edge / square.sqrt();
            curvature.gradients[k] = -edge / square;
            curvature.gradients[(k + 1) % 3] = edge / square;
        }
    }
    (normal, radius + curvature.distance, curvature)
}

/// In-plane gradients of the three barycentric weights [1/m].
#[must_use]
pub fn face_gradients(corners: [DVec3; 3]) -> [DVec3; 3] {
    let [a, b, c] = corners;
    let area_vector = (b - a).cross(c - a);
    let square = area_vector.length_squared().max(MINIMUM_SQUARE);
    [area_vector.cross(c - b) / square, area_vector.cross(a - c) / square, area_vector.cross(b - a) / square]
}

/// Second variation of the depth along node displacements `v` [m]: one vector per node, so that d2s(v, v') is the sum of
/// their inner products with v'_j.
#[inline]
#[must_use]
pub fn second_variation(contact: &Contact, v: [DVec3; 3]) -> [DVec3; 3] {
    let Contact { weights, normal, curvature, .. } = contact;
    let mut dp = DVec3::ZERO;
    let mut turn = DVec3::ZERO;
    for j in 0..3 {
        dp += v[j] * weights[j];
        turn += curvature.gradients[j] * normal.dot(v[j]);
    }
    let across = dp - *normal * normal.dot(dp) - curvature.along * curvature.along.dot(dp);
    let carried = across * curvature.inverse_distance - turn;
    let tilting = turn * curvature.distance + dp;
    let mut product = [DVec3::ZERO; 3];
    for j in 0..3 {
        product[j] = carried * weights[j] - *normal * curvature.gradients[j].dot(tilting);
    }
    product
}

impl Contact {
    /// Its force over kc: its part of the depth times the node's share [m].
    #[inline]
    #[must_use]
    pub fn force_over_kc(&self) -> f64 {
        self.share * self.push
    }

    /// A spring of the stiffness kc on the feature that [`measure`] found.
    #[inline]
    #[must_use]
    pub fn new(proxy_node: u32, nodes: [u32; 3], weights: [f64; 3], measured: (DVec3, f64, Curvature)) -> Self {
        let (normal, depth, curvature) = measured;
        Self { proxy_node, nodes, weights, normal, depth, share: 1.0, push: depth.max(0.0), multiplier: 0.0, curvature }
    }

    /// What displacements `v` of its nodes bring the feature nearer by, to first order [m].
    #[inline]
    #[must_use]
    pub fn deepening(&self, v: [DVec3; 3]) -> f64 {
        self.weights[0] * self.normal.dot(v[0])
            + self.weights[1] * self.normal.dot(v[1])
            + self.weights[2] * self.normal.dot(v[2])
    }

    /// What a force `push` along the depth gives to the feature's nodes: push w_j N [N].
    #[inline]
    #[must_use]
    pub fn spread(&self, push: f64) -> [DVec3; 3] {
        self.weights.map(|weight| self.normal * (push * weight))
    }

    /// Its depth changes in proportion to displacements from here on.
    pub fn freeze(&mut self) {
        self.curvature = Curvature::default();
    }

    /// Whether two rows belong to one proxy node, whose spring they share.
    #[must_use]
    pub fn shares_spring(&self, other: &Self) -> bool {
        self.proxy_node == other.proxy_node
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::geometry::closest_point::closest_point;
    use crate::random::sequence;

    /// The contact of `x` with one triangle; `outward` decides the side at edges and vertices.
    fn contact(x: DVec3, radius: f64, corners: [DVec3; 3], outward: DVec3) -> (Feature, Contact) {
        let point = closest_point(x, corners);
        let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let pseudonormal = if point.feature == Feature::Face { face } else { outward };
        let measured = measure(x, radius, corners, point.weights, point.feature, pseudonormal);
        (point.feature, Contact { multiplier: 3.0 * measured.1, ..Contact::new(0, [0, 1, 2], point.weights, measured) })
    }

    /// Product of the Hessian of 1/2 kc depth^2 with `v`.
    fn hessian_product(contact: &Contact, kc: f64, v: [DVec3; 3]) -> [DVec3; 3] {
        let bend = second_variation(contact, v);
        let stretch = contact.normal * (kc * contact.deepening(v));
        [0, 1, 2].map(|j| stretch * contact.weights[j] + bend[j] * contact.multiplier)
    }

    fn inner(a: [DVec3; 3], b: [DVec3; 3]) -> f64 {
        a.iter().zip(&b).map(|(a, b)| a.dot(*b)).sum()
    }

    /// Random triangles, points on either side, all features: gradient and Hessian of 1/2 kc depth^2 against central
    /// differences. Errors are of order h^2 times the fourth derivative; points close to a feature are left out.
    #[test]
    fn derivatives_agree_with_finite_differences() {
        let mut next = sequence(7);
        let mut seen = [0usize; 6];
        let h = 1e-4;
        for _ in 0..4000 {
            let mut point = || DVec3::new(next(), next(), next());
            let corners = [point(), point(), point()];
            let x = point();
            let v = [point(), point(), point()];
            let w = [point(), point(), point()];
            let outward = point();
            let radius = 0.1 + next().abs();
            let kc = 3.0;
            let at = |s: f64| [0, 1, 2].map(|j| corners[j] + v[j] * s);
            let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            let (feature, here) = contact(x, radius, corners, outward);
            let (feature_before, before) = contact(x, radius, at(-h), outward);
            let (feature_after, after) = contact(x, radius, at(h), outward);
            let clear = here.curvature.distance.abs() > 0.2 && here.normal.dot(outward).abs() > 0.1 && area > 0.3;
            if feature != feature_before || feature != feature_after || !clear {
                continue;
            }
            let inside = here.curvature.distance > 0.0;
            let kind = match feature {
                Feature::Vertex(_) => 0,
                Feature::Edge(_) => 1,
                Feature::Face => 2,
            };
            seen[kind + if inside { 3 } else { 0 }] += 1;
            let gradient = |c: &Contact| c.weights.map(|weight| c.normal * (kc * c.depth * weight));
            let energy = |c: &Contact| 0.5 * kc * c.depth * c.depth;
            let slope = (energy(&after) - energy(&before)) / (2.0 * h);
            let expected = inner(gradient(&here), v);
            assert!((slope - expected).abs() < 1e-4 * (1.0 + expected.abs()), "{feature:?} {slope} {expected}");
            let bend = (inner(gradient(&after), w) - inner(gradient(&before), w)) / (2.0 * h);
            let expected = inner(hessian_product(&here, kc, v), w);
            assert!((bend - expected).abs() < 1e-4 * (1.0 + expected.abs()), "{feature:?} {bend} {expected}");
            let transposed = inner(hessian_product(&here, kc, w), v);
            assert!((transposed - expected).abs() < 1e-11 * (1.0 + expected.abs()), "symmetric");
        }
        assert!(seen.iter().all(|&count| count > 20), "vertex, edge, face; outside, inside: {seen:?}");
    }

    /// The second derivative in the direction along which the closest point slides is what frozen geometry leaves out.
    #[test]
    fn a_wrong_second_variation_is_noticed() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let (_, mut here) = contact(DVec3::new(0.3, 0.3, -0.5), 0.0, corners, DVec3::Z);
        assert!((here.depth - 0.5).abs() < 1e-15);
        let v = [DVec3::new(0.2, 0.1, 0.4), DVec3::new(-0.3, 0.5, 0.1), DVec3::new(0.7, -0.2, -0.6)];
        let right = inner(hessian_product(&here, 1.0, v), v);
        here.curvature.gradients = [DVec3::ZERO; 3];
        let frozen = inner(hessian_product(&here, 1.0, v), v);
        assert!((right - frozen).abs() > 0.05);
    }

    #[test]
    fn a_node_on_the_feature_itself_gives_finite_numbers() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for x in [DVec3::ZERO, DVec3::X * 0.5, DVec3::new(0.2, 0.2, 0.0), DVec3::Y] {
            for radius in [0.0, 0.01] {
                let (_, here) = contact(x, radius, corners, DVec3::Z);
                assert!((here.normal - DVec3::Z).length() < 1e-15);
                assert!((here.depth - radius).abs() < 1e-15);
                let product = hessian_product(&here, 1.0, [DVec3::X, DVec3::Y, DVec3::Z]);
                assert!(product.iter().all(|p| p.is_finite()));
            }
        }
    }
}
