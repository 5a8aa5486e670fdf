//! The distance to a triangle at rest without a branch: what a search needs of the many that are not the closest.

use super::surface::unit_or_zero;
use glam::{DVec2, DVec3};

/// A triangle in a frame of its own: its first corner at the origin, its first edge along u, its third corner at v >= 0.
///
/// The frame is orthonormal to rounding whatever the triangle's shape, so that distances are as good as the coordinates; for
/// a triangle without area they are lower bounds.
#[derive(Clone, Copy)]
pub struct Facet {
    origin: DVec3,
    u: DVec3,
    v: DVec3,
    normal: DVec3,
    /// Second corner's u, and the edges that meet in the third corner: directions and lengths [m].
    base: f64,
    from_second: DVec2,
    from_first: DVec2,
    lengths: DVec2,
}

impl Facet {
    /// The triangle `corners` [m].
    #[must_use]
    pub fn new(corners: [DVec3; 3]) -> Self {
        let [a, b, c] = corners;
        let u = unit_or_zero(b - a);
        let across = unit_or_zero((b - a).cross(c - a));
        let normal = unit_or_zero(across - u * u.dot(across));
        let v = normal.cross(u);
        let second = DVec2::new(u.dot(b - a), 0.0);
        let third = DVec2::new(u.dot(c - a), v.dot(c - a));
        let (first_edge, second_edge) = (third, third - second);
        Self {
            origin: a,
            u,
            v,
            normal,
            base: second.x,
            from_second: second_edge.normalize_or_zero(),
            from_first: first_edge.normalize_or_zero(),
            lengths: DVec2::new(first_edge.length(), second_edge.length()),
        }
    }

    /// Squared distance of `x` [m^2].
    #[inline]
    #[must_use]
    pub fn distance_squared(&self, x: DVec3) -> f64 {
        let offset = x - self.origin;
        let height = self.normal.dot(offset);
        let p = DVec2::new(self.u.dot(offset), self.v.dot(offset));
        let q = DVec2::new(p.x - self.base, p.y);
        let beyond = p.x - p.x.clamp(0.0, self.base);
        let to_base = beyond * beyond + p.y * p.y;
        let to_edge =
            |p: DVec2, along: DVec2, length: f64| (p - along * along.dot(p).clamp(0.0, length)).length_squared();
        let to_first = to_edge(p, self.from_first, self.lengths.x);
        let to_second = to_edge(q, self.from_second, self.lengths.y);
        let inside = p.y >= 0.0 && self.from_first.perp_dot(p) <= 0.0 && self.from_second.perp_dot(q) >= 0.0;
        let lateral = if inside { 0.0 } else { to_base.min(to_first).min(to_second) };
        height * height + lateral
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::closest_point::{closest_point, point_at};
    use crate::random::sequence;

    /// Against the branching search of Voronoi regions, slivers included.
    #[test]
    fn distances_are_those_of_the_closest_point() {
        let mut next = sequence(5);
        for k in 0..20_000 {
            let mut point = || DVec3::new(next(), next(), next());
            let (a, b, x) = (point(), point(), point());
            let height = [1.0, 1e-3, 1e-6][k % 3];
            let c = a.lerp(b, next()) + DVec3::new(next(), next(), next()) * height;
            let corners = [[a, b, c], [b, c, a], [c, a, b]][k / 3 % 3];
            let expected = x.distance_squared(point_at(corners, closest_point(x, corners).weights));
            let found = Facet::new(corners).distance_squared(x);
            assert!((found - expected).abs() < 1e-13, "{corners:?} {x}: {found} {expected}");
        }
    }

    #[test]
    fn a_triangle_without_area_is_no_farther_than_it_is() {
        let mut next = sequence(6);
        for k in 0..2000 {
            let mut point = || DVec3::new(next(), next(), next());
            let (a, b, x) = (point(), point(), point());
            let corners = [[a, a, a], [a, a, b], [a, b, b], [a, b, a], [a, b, a.midpoint(b)]][k % 5];
            let expected = x.distance_squared(point_at(corners, closest_point(x, corners).weights));
            let found = Facet::new(corners).distance_squared(x);
            assert!(found <= expected + 1e-13, "{corners:?} {x}: {found} {expected}");
        }
    }
}
