//! Depth of a proxy node below the deformed surface, with its first and second derivative in the object's nodes.
//!
//! `depth = r + s`, `s = N . (p - x)`: x the proxy node, r its radius, p the closest surface point, N the outward unit
//! direction, s positive inside. p = sum_j w_j n_j over the nodes that carry the touched feature, and p moves on the
//! feature by parameters t_a: two on a face, one along an edge, none at a vertex.
//!
//! First derivative, by the envelope theorem (p is a minimiser, so its sliding along the feature has no effect):
//! `d depth / d n_j = w_j N`, `d depth / d x = -N`. With the energy 1/2 kc depth^2 the proxy node is pushed by lambda N
//! and object node j by -lambda w_j N, lambda = kc depth.
//!
//! Second derivative along node displacements v_j. They move the point by dp = sum_j w_j v_j, and turn the feature: its
//! tangents T_a = dp/dt_a change by dT_a = sum_j (dw_j/dt_a) v_j. With the metric I_ab = T_a . T_b, the curvature B_ab
//! = N . d2p/dt_a dt_b, H = I + s B, tau_a = T_a . dp and mu_a = N . dT_a, implicit differentiation of the closest
//! point gives `d2s = tau . (I^-1 B H^-1) tau - 2 tau . H^-1 mu - s mu . H^-1 mu + (1/s) |P dp|^2`, P taking out of dp
//! what is along N and along the feature: zero on faces. One form for flat and bent facets, faces, edges and vertices,
//! so that a product needs no branch. It is needed because contact points creep over the surface when it is left out.

use crate::contact::MINIMUM_SQUARE;
use crate::contact::geometry::closest_point::ClosestPoint;
use crate::contact::geometry::closest_point::Feature;
use crate::contact::geometry::facet::{Facet, directions};
use crate::contact::geometry::quartic::Jet;
use crate::contact::geometry::smooth::{CARRIERS, Shape};
use glam::DVec3;
use std::ops::Neg;

/// Least distance of a proxy node to its closest edge or vertex that curvature is divided by (m): below a nanometre the
/// direction between the two is rounding (coordinates of 0.1 m carry 1e-17 m, a direction good to 1e-6 needs 1e-11 m).
pub const MINIMUM_CURVATURE_RADIUS: f64 = 1e-11;

/// Least convexity of the distance to a bent facet, over that to a flat one, at which its second derivative is used
/// [1]: beyond, the point is within a hundredth of the surface's radius of curvature from where the closest point
/// leaps, and a step by it would be a hundred times as far.
pub const LEAST_CONVEXITY: f64 = 1e-2;

/// One proxy node and the closest feature of the surface: a row of the contact problem.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Number of the proxy node.
    pub proxy_node: u32,
    /// The object's nodes that carry the closest point.
    pub carriers: Carriers,
    /// Unit direction N in which the surface pushes the proxy node.
    pub normal: DVec3,
    /// r + s, positive in contact (m).
    pub depth: f64,
    /// Stiffness of the proxy node's spring over that of [`crate::contact::Model::kc`] (1).
    pub share: f64,
    /// Force lambda by which the curvature counts: the row's force at the solution (N).
    pub multiplier: f64,
    /// Second derivative of s.
    pub curvature: Curvature,
}

/// The nodes of a facet, and how its closest point hangs on them.
#[derive(Clone, Copy, Debug)]
pub struct Carriers {
    /// Three on a flat facet, on a smooth one the corners and all their neighbours.
    count: usize,
    nodes: [u32; CARRIERS],
    /// w_j; exactly zero for nodes that the feature does not touch.
    weights: [f64; CARRIERS],
    /// dw_j/dt_a; zero for parameters that the feature has not.
    slopes: [[f64; CARRIERS]; 2],
}

impl Carriers {
    /// Notes how `point` hangs on these nodes: the corners of a flat facet, or all nodes of a smooth one with their
    /// shape.
    #[inline]
    #[must_use]
    pub fn new((nodes, shape): (&[u32], Option<&Shape>), point: &ClosestPoint) -> Self {
        let mut carriers =
            Self { count: nodes.len(), nodes: [0; CARRIERS], weights: [0.0; CARRIERS], slopes: [[0.0; CARRIERS]; 2] };
        carriers.nodes[..nodes.len()].copy_from_slice(nodes);
        match shape {
            None => carriers.weights[..3].copy_from_slice(&point.weights),
            Some(shape) => carriers.weights = shape.point_weights(point.weights),
        }
        for (slopes, &direction) in carriers.slopes.iter_mut().zip(directions(point.feature)) {
            match shape {
                None => slopes[..3].copy_from_slice(&direction),
                Some(shape) => *slopes = shape.point_slopes(point.weights, direction),
            }
        }
        carriers
    }

    /// None.
    #[must_use]
    pub fn none() -> Self {
        Self { count: 0, nodes: [0; CARRIERS], weights: [0.0; CARRIERS], slopes: [[0.0; CARRIERS]; 2] }
    }

    /// The nodes.
    #[inline]
    #[must_use]
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.count]
    }

    /// Whether the closest point hangs on the node in place j at all.
    #[inline]
    #[must_use]
    pub fn carries(&self, j: usize) -> bool {
        self.weights[j] != 0.0 || self.slopes.iter().any(|slopes| slopes[j] != 0.0)
    }

    /// The nodes with their weights.
    pub fn iter(&self) -> impl Iterator<Item = (u32, f64)> {
        self.nodes().iter().copied().zip(self.weights().iter().copied())
    }

    /// Their weights w_j in the closest point, in sum one.
    #[inline]
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights[..self.count]
    }
}

/// How displacements of the object's nodes move a closest point and turn the surface there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Variation {
    /// dp (m).
    pub point: DVec3,
    /// dT_a (m).
    pub tangents: [DVec3; 2],
}

impl Variation {
    /// A displacement of all nodes alike (m).
    #[must_use]
    pub fn translation(point: DVec3) -> Self {
        Self { point, ..Self::default() }
    }

    /// The work of a reaction.
    #[inline]
    #[must_use]
    pub fn dot(&self, reaction: &Self) -> f64 {
        self.point.dot(reaction.point)
            + self.tangents[0].dot(reaction.tangents[0])
            + self.tangents[1].dot(reaction.tangents[1])
    }
}

impl Neg for Variation {
    type Output = Self;

    fn neg(self) -> Self {
        Self { point: -self.point, tangents: self.tangents.map(|tangent| -tangent) }
    }
}

/// How s bends under displacements of the object's nodes; see the file's head.
#[derive(Clone, Copy, Debug, Default)]
pub struct Curvature {
    /// s (m).
    pub distance: f64,
    /// 1/s on edges and at vertices, zero on faces (1/m).
    pub inverse_distance: f64,
    /// Unit direction of the edge, else zero.
    pub along: DVec3,
    /// T_a; zero for parameters that the feature has not (m).
    pub tangents: [DVec3; 2],
    /// I^-1 B H^-1: its entries 00, 01 and 11 (1/m^3).
    pub bending: [f64; 3],
    /// H^-1, likewise (1/m^2).
    pub turning: [f64; 3],
}

/// Depth of the node at `x` with `radius`, from `point` of `facet`, which is closest to it.
///
/// `pseudonormal` decides the side; it is N on a face, and stands in for it where x lies on the edge or vertex itself.
#[inline]
#[must_use]
pub fn measure(
    x: DVec3,
    radius: f64,
    facet: &Facet,
    point: &ClosestPoint,
    pseudonormal: DVec3,
) -> (DVec3, f64, Curvature) {
    let mut curvature = Curvature::default();
    let jet = facet.jet(point.weights);
    let normal;
    if point.feature == Feature::Face {
        normal = pseudonormal;
        let foot = if facet.net.is_none() { facet.corners[0] } else { jet.point };
        curvature.distance = normal.dot(foot - x);
    } else {
        let offset = jet.point - x;
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
    }
    curvature.bend(&jet, facet.net.is_some(), point.feature, normal);
    (normal, radius + curvature.distance, curvature)
}

impl Curvature {
    /// Sets all that depends on the directions in which the point of a facet, which `is_bent` or not, may move on
    /// `feature`; `jet` is the facet's there.
    #[inline]
    fn bend(&mut self, jet: &Jet, is_bent: bool, feature: Feature, normal: DVec3) {
        let s = self.distance;
        match *directions(feature) {
            [_, _] => {
                let [a, b] = jet.face_tangents();
                self.tangents = [a, b];
                let metric = [a.dot(a), a.dot(b), b.dot(b)];
                let inverse = inverse(metric, MINIMUM_SQUARE);
                self.turning = inverse;
                if !is_bent {
                    return;
                }
                let bends = jet.face_bends().map(|bend| normal.dot(bend));
                let full = [metric[0] + s * bends[0], metric[1] + s * bends[1], metric[2] + s * bends[2]];
                // Where the distance is hardly convex the closest point is about to leave, and no derivative holds for
                // long.
                let area = metric[0] * metric[2] - metric[1] * metric[1];
                if full[0] > 0.0 && full[0] * full[2] - full[1] * full[1] > LEAST_CONVEXITY * area {
                    self.turning = self::inverse(full, MINIMUM_SQUARE);
                    self.bending = symmetric_product(inverse, bends, self.turning);
                }
            }
            [d] => {
                let tangent = jet.tangent(d);
                let metric = tangent.length_squared().max(MINIMUM_SQUARE);
                self.tangents[0] = tangent;
                self.along = tangent / metric.sqrt();
                self.turning[0] = metric.recip();
                let bend = normal.dot(jet.bend(d, d));
                let full = metric + s * bend;
                if full > LEAST_CONVEXITY * metric {
                    self.turning[0] = full.recip();
                    self.bending[0] = bend / (metric * full);
                }
            }
            _ => {}
        }
    }
}

/// The inverse of a symmetric matrix of two rows, its entries 00, 01, 11; its determinant counts as no less than
/// `least`.
#[inline]
fn inverse([a, b, c]: [f64; 3], least: f64) -> [f64; 3] {
    let determinant = (a * c - b * b).max(least);
    [c / determinant, -b / determinant, a / determinant]
}

/// The product A B C of symmetric matrices of two rows where that is symmetric.
#[inline]
fn symmetric_product(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> [f64; 3] {
    let ab = [
        [a[0] * b[0] + a[1] * b[1], a[0] * b[1] + a[1] * b[2]],
        [a[1] * b[0] + a[2] * b[1], a[1] * b[1] + a[2] * b[2]],
    ];
    let entry = |row: [f64; 2], column: [f64; 2]| row[0] * column[0] + row[1] * column[1];
    [entry(ab[0], [c[0], c[1]]), entry(ab[0], [c[1], c[2]]), entry(ab[1], [c[1], c[2]])]
}

/// Product of a symmetric matrix of two rows and a vector.
#[inline]
fn apply([a, b, c]: [f64; 3], [x, y]: [f64; 2]) -> [f64; 2] {
    [a * x + b * y, b * x + c * y]
}

impl Contact {
    /// A spring of the stiffness kc on the feature that [`measure`] found.
    #[inline]
    #[must_use]
    pub fn new(proxy_node: u32, carriers: Carriers, measured: (DVec3, f64, Curvature)) -> Self {
        let (normal, depth, curvature) = measured;
        Self { proxy_node, carriers, normal, depth, share: 1.0, multiplier: 0.0, curvature }
    }

    /// A spring that touches the rounded surface `depth` below it (m): what it hangs on is its row's
    /// ([`super::rounded`]).
    #[must_use]
    pub fn rounded(proxy_node: u32, depth: f64) -> Self {
        Self::new(proxy_node, Carriers::none(), (DVec3::ZERO, depth, Curvature::default()))
    }

    /// Whether it touches.
    #[inline]
    #[must_use]
    pub fn is_active(&self) -> bool {
        self.depth > 0.0
    }

    /// Its force over kc: max(0, depth) times the node's share (m).
    #[inline]
    #[must_use]
    pub fn force_over_kc(&self) -> f64 {
        self.share * self.depth.max(0.0)
    }

    /// Returns by how much displacements `v` of its nodes, by their place, move its closest point (m).
    #[inline]
    #[must_use]
    pub fn moved(&self, v: impl Fn(usize) -> DVec3) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for (j, &weight) in self.carriers.weights().iter().enumerate() {
            sum += v(j) * weight;
        }
        sum
    }

    /// Returns how displacements `v` of its nodes move its closest point, and turn the surface there, where that
    /// matters.
    #[inline]
    #[must_use]
    pub fn variation(&self, v: impl Fn(usize) -> DVec3) -> Variation {
        if self.multiplier == 0.0 { Variation::translation(self.moved(v)) } else { self.turned(v) }
    }

    /// Returns how displacements `v` of its nodes move its closest point, and turn the surface there.
    #[inline]
    fn turned(&self, v: impl Fn(usize) -> DVec3) -> Variation {
        let mut variation = Variation::translation(self.moved(&v));
        for (tangent, slopes) in variation.tangents.iter_mut().zip(&self.carriers.slopes) {
            for (j, &slope) in slopes[..self.carriers.count].iter().enumerate() {
                *tangent += v(j) * slope;
            }
        }
        variation
    }

    /// Returns minus the gradient of the depth in the place of the proxy node, where displacements `v` of the row's
    /// nodes deepen it linearly: the direction of the normal, and along the surface how the row changes there (1).
    #[inline]
    #[must_use]
    pub fn pushed(&self, v: impl Fn(usize) -> DVec3) -> DVec3 {
        self.normal + self.second_variation(&self.turned(v)).point
    }

    /// Returns by how much a variation brings the feature nearer, to first order (m).
    #[inline]
    #[must_use]
    pub fn depth_change(&self, variation: &Variation) -> f64 {
        self.normal.dot(variation.point)
    }

    /// Returns the reaction of a force `push` along the depth on the closest point: push N (N).
    #[inline]
    #[must_use]
    pub fn spread(&self, push: f64) -> Variation {
        Variation::translation(self.normal * push)
    }

    /// Returns the part of a reaction that node j, by its place, carries.
    #[inline]
    #[must_use]
    pub fn at_node(&self, reaction: &Variation, j: usize) -> DVec3 {
        let Carriers { weights, slopes: [first, second], .. } = &self.carriers;
        reaction.point * weights[j] + reaction.tangents[0] * first[j] + reaction.tangents[1] * second[j]
    }

    /// Returns the second variation of the depth along `variation`: the reaction whose work along another variation is
    /// d2s of both.
    #[inline]
    #[must_use]
    pub fn second_variation(&self, variation: &Variation) -> Variation {
        let Self { normal, curvature, .. } = self;
        let dp = variation.point;
        let sliding = [curvature.tangents[0].dot(dp), curvature.tangents[1].dot(dp)];
        let tilting = [normal.dot(variation.tangents[0]), normal.dot(variation.tangents[1])];
        let bent = apply(curvature.bending, sliding);
        let turned = apply(curvature.turning, tilting);
        let carried = apply(curvature.turning, sliding);
        let across = dp - *normal * normal.dot(dp) - curvature.along * curvature.along.dot(dp);
        let along = |a: usize| curvature.tangents[a] * (bent[a] - turned[a]);
        let turn = |a: usize| *normal * -(carried[a] + curvature.distance * turned[a]);
        Variation { point: across * curvature.inverse_distance + along(0) + along(1), tangents: [turn(0), turn(1)] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::geometry::facet::Direction;
    use crate::random::sequence;

    /// A facet on its own nodes, flat or bent, and where they are.
    struct Sample {
        nodes: Vec<u32>,
        shape: Option<Shape>,
        positions: Vec<DVec3>,
    }

    impl Sample {
        fn facet(&self, shift: impl Fn(usize) -> DVec3) -> Facet {
            let at: Vec<DVec3> = self.positions.iter().enumerate().map(|(j, position)| *position + shift(j)).collect();
            self.shape.as_ref().map_or(Facet::flat([at[0], at[1], at[2]]), |shape| shape.facet(|j| at[j]))
        }

        /// The contact of `x`; `outward` decides the side at edges and vertices.
        fn contact(&self, x: DVec3, radius: f64, facet: &Facet, outward: DVec3) -> (Feature, Contact) {
            let point = facet.closest(x, f64::MAX).unwrap();
            let pseudonormal = if point.feature == Feature::Face { facet.normal(point.weights) } else { outward };
            let measured = measure(x, radius, facet, &point, pseudonormal);
            let contact = Contact::new(0, Carriers::new((&self.nodes, self.shape.as_ref()), &point), measured);
            (point.feature, Contact { multiplier: 3.0 * measured.1, ..contact })
        }
    }

    /// Product of the Hessian of 1/2 kc depth^2 with `v`, times `w`.
    fn hessian(contact: &Contact, kc: f64, v: &[DVec3], w: &[DVec3]) -> f64 {
        let (v, w) = (contact.variation(|j| v[j]), contact.variation(|j| w[j]));
        let stretch = kc * contact.depth_change(&v) * contact.depth_change(&w);
        stretch + contact.multiplier * contact.second_variation(&v).dot(&w)
    }

    /// Random facets, flat and bent, points on either side, all features: gradient and Hessian of 1/2 kc depth^2
    /// against central differences. Errors are of order h^2 times the fourth derivative; points close to a feature are
    /// left out.
    #[test]
    fn derivatives_agree_with_finite_differences() {
        let mut next = sequence(7);
        let h = 1e-5;
        for (count, neighbours) in [(3, None), (12, Some([6, 6, 6])), (13, Some([4, 7, 8])), (6, Some([0, 3, 0]))] {
            let mut seen = [0usize; 6];
            for _ in 0..6000 {
                let mut point = || DVec3::new(next(), next(), next());
                let shape = neighbours.map(Shape::new);
                let mut sample = Sample { nodes: (0..count as u32).collect(), shape, positions: Vec::new() };
                // A smooth facet is half as large as the nodes lie apart, and bent by about a third of that.
                let size = if neighbours.is_some() { 2.0 } else { 1.0 };
                sample.positions.extend((0..count).map(|_| point() * size));
                let x = point();
                let v: Vec<DVec3> = (0..count).map(|_| point()).collect();
                let w: Vec<DVec3> = (0..count).map(|_| point()).collect();
                let outward = point();
                let radius = 0.1 + next().abs();
                let kc = 3.0;
                let facet = sample.facet(|_| DVec3::ZERO);
                let at = |s: f64| sample.facet(|j| v[j] * s);
                let area = (facet.corners[1] - facet.corners[0]).cross(facet.corners[2] - facet.corners[0]).length();
                let (feature, here) = sample.contact(x, radius, &facet, outward);
                let (feature_before, before) = sample.contact(x, radius, &at(-h), outward);
                let (feature_after, after) = sample.contact(x, radius, &at(h), outward);
                // Where a bent facet is about to let the closest point go, there is no derivative to speak of.
                let bent = neighbours.is_some() && !matches!(feature, Feature::Vertex(_));
                let foot = facet.closest(x, f64::MAX).unwrap().weights;
                let off = |d: &Direction| (facet.point(foot) - x).dot(facet.jet(foot).tangent(*d)).abs();
                if directions(feature).iter().any(|d| off(d) > 1e-9) {
                    continue;
                }
                let convex = here.curvature.turning.iter().all(|entry| entry.abs() < 30.0)
                    && !(bent && here.curvature.bending == [0.0; 3]);
                let clear = here.curvature.distance.abs() > 0.2 && here.normal.dot(outward).abs() > 0.1 && area > 0.3;
                if feature != feature_before || feature != feature_after || !clear || !convex {
                    continue;
                }
                let inside = here.curvature.distance > 0.0;
                let kind = match feature {
                    Feature::Vertex(_) => 0,
                    Feature::Edge(_) => 1,
                    Feature::Face => 2,
                };
                seen[kind + if inside { 3 } else { 0 }] += 1;
                let slope_along = |c: &Contact, v: &[DVec3]| kc * c.depth * c.depth_change(&c.variation(|j| v[j]));
                let energy = |c: &Contact| 0.5 * kc * c.depth * c.depth;
                let slope = (energy(&after) - energy(&before)) / (2.0 * h);
                let expected = slope_along(&here, &v);
                assert!((slope - expected).abs() < 1e-4 * (1.0 + expected.abs()), "{feature:?} {slope} {expected}");
                let bend = (slope_along(&after, &w) - slope_along(&before, &w)) / (2.0 * h);
                let expected = hessian(&here, kc, &v, &w);
                assert!(
                    (bend - expected).abs() < 1e-4 * (1.0 + expected.abs()),
                    "{count} {feature:?} {bend} {expected}"
                );
                // The reaction at the nodes is the same as on the variation.
                let reaction = here.second_variation(&here.variation(|j| v[j]));
                let at_nodes: f64 = (0..count).map(|j| here.at_node(&reaction, j).dot(w[j])).sum();
                assert!((at_nodes - reaction.dot(&here.variation(|j| w[j]))).abs() < 1e-9 * (1.0 + at_nodes.abs()));
            }
            assert!(seen.iter().all(|&count| count > 20), "every kind of feature must occur on both sides: {seen:?}");
        }
    }

    /// A flat facet at rest under one corner.
    fn corner() -> Sample {
        Sample { nodes: vec![0, 1, 2], shape: None, positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y] }
    }

    /// The second derivative in the direction along which the closest point slides is what frozen geometry leaves out.
    #[test]
    fn a_wrong_second_variation_is_noticed() {
        let sample = corner();
        let (_, mut here) = sample.contact(DVec3::new(0.3, 0.3, -0.5), 0.0, &sample.facet(|_| DVec3::ZERO), DVec3::Z);
        assert!((here.depth - 0.5).abs() < 1e-15);
        let v = [DVec3::new(0.2, 0.1, 0.4), DVec3::new(-0.3, 0.5, 0.1), DVec3::new(0.7, -0.2, -0.6)];
        let right = hessian(&here, 1.0, &v, &v);
        here.curvature.turning = [0.0; 3];
        let frozen = hessian(&here, 1.0, &v, &v);
        assert!((right - frozen).abs() > 0.05);
    }

    #[test]
    fn a_node_on_the_feature_itself_gives_finite_numbers() {
        let sample = corner();
        for x in [DVec3::ZERO, DVec3::X * 0.5, DVec3::new(0.2, 0.2, 0.0), DVec3::Y] {
            for radius in [0.0, 0.01] {
                let (_, here) = sample.contact(x, radius, &sample.facet(|_| DVec3::ZERO), DVec3::Z);
                assert!((here.normal - DVec3::Z).length() < 1e-15);
                assert!((here.depth - radius).abs() < 1e-15);
                assert!(hessian(&here, 1.0, &[DVec3::X, DVec3::Y, DVec3::Z], &[DVec3::Z; 3]).is_finite());
            }
        }
    }
}
