//! Distances to eight triangles at once, without a branch: what a search needs of the many that are not the closest.
//!
//! A triangle's distance is the least of those to its edges and, over its inside, to its plane. It may be too small
//! where a triangle has no area, and is nowhere too great by more than rounding: in the plane's place an edge is taken
//! by mistake only where it is as near as rounding can tell.

use crate::contact::MINIMUM_SQUARE;
use crate::contact::linear::wide::{Kernel, widest};
use glam::DVec3;

/// Triangles in a packet.
pub const LANES: usize = 8;

/// One number of each triangle.
type Lanes = [f64; LANES];

/// Eight triangles side by side: corners, and of each the coordinates (m).
#[derive(Clone, Debug, Default)]
pub struct Packet([[Lanes; 3]; 3]);

impl Packet {
    /// The triangles `nodes` with corners at `positions` (m).
    pub fn set(&mut self, positions: &[DVec3], nodes: &[[u32; 3]; LANES]) {
        for (lane, nodes) in nodes.iter().enumerate() {
            for (corner, &node) in self.0.iter_mut().zip(nodes) {
                let position = positions[node as usize].to_array();
                for (coordinates, coordinate) in corner.iter_mut().zip(position) {
                    coordinates[lane] = coordinate;
                }
            }
        }
    }

    /// The box around them: its low and high corner (m).
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        (self.extreme(least), self.extreme(greatest))
    }

    #[inline(always)]
    fn extreme(&self, take: impl Fn(f64, f64) -> f64) -> DVec3 {
        let [a, b, c] = &self.0;
        let mut extreme = [0.0; 3];
        for (axis, extreme) in extreme.iter_mut().enumerate() {
            let mut most = a[axis];
            for lane in 0..LANES {
                most[lane] = take(take(most[lane], b[axis][lane]), c[axis][lane]);
            }
            let mut left = LANES / 2;
            while left > 0 {
                for lane in 0..left {
                    most[lane] = take(most[lane], most[lane + left]);
                }
                left /= 2;
            }
            *extreme = most[0];
        }
        DVec3::from_array(extreme)
    }

    /// Squared distances of `x` (m^2).
    #[inline]
    #[must_use]
    pub fn distances_squared(&self, x: DVec3) -> Lanes {
        widest(DistancesSquared { packet: self, x })
    }
}

struct DistancesSquared<'p> {
    packet: &'p Packet,
    x: DVec3,
}

impl Kernel for DistancesSquared<'_> {
    type Output = Lanes;

    #[inline(always)]
    fn run(self) -> Lanes {
        let Self { packet: Packet([a, b, c]), x } = self;
        let mut distances = [0.0; LANES];
        for k in 0..LANES {
            let ab = [b[0][k] - a[0][k], b[1][k] - a[1][k], b[2][k] - a[2][k]];
            let ac = [c[0][k] - a[0][k], c[1][k] - a[1][k], c[2][k] - a[2][k]];
            let ax = [x.x - a[0][k], x.y - a[1][k], x.z - a[2][k]];
            let (abab, abac, acac) = (inner(ab, ab), inner(ab, ac), inner(ac, ac));
            let (abax, acax, axax) = (inner(ab, ax), inner(ac, ax), inner(ax, ax));
            let (bcbx, bcbc) = (abab - abax + acax - abac, abab - 2.0 * abac + acac);
            let to_ab = to_edge(axax, abax, abab);
            let to_ac = to_edge(axax, acax, acac);
            let to_bc = to_edge(axax - 2.0 * abax + abab, bcbx, bcbc);
            let to_edges = least(least(to_ab, to_ac), to_bc);
            let normal = [ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]];
            let height = inner(normal, ax);
            let to_plane = height * height / greatest(inner(normal, normal), MINIMUM_SQUARE);
            // Barycentric weights of the foot on the plane, times four areas squared.
            let weight_b = abax * acac - acax * abac;
            let weight_c = acax * abab - abax * abac;
            let weight_a = abab * acac - abac * abac - weight_b - weight_c;
            let inside = least(least(weight_a, weight_b), weight_c) >= 0.0;
            distances[k] = least(to_edges, if inside { to_plane } else { to_edges });
        }
        distances
    }
}

/// Squared distance to an edge e from a point that is `square` from its start squared, `along` = e . (x - start),
/// `length` = e . e.
#[inline(always)]
fn to_edge(square: f64, along: f64, length: f64) -> f64 {
    let share = greatest(least(along / greatest(length, MINIMUM_SQUARE), 1.0), 0.0);
    square - share * (2.0 * along - share * length)
}

#[inline(always)]
fn inner(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The lesser, as one instruction gives it.
#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater, as one instruction gives it.
#[inline(always)]
pub fn greatest(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::geometry::closest_point::{closest_point, point_at};
    use crate::random::sequence;

    /// The packet of triangles with these corners, their true squared distances from `x`, and those found.
    fn distances(corners: [[DVec3; 3]; LANES], x: DVec3) -> [(f64, f64); LANES] {
        let nodes: [[u32; 3]; LANES] = std::array::from_fn(|k| [0, 1, 2].map(|j| 3 * k as u32 + j));
        let mut packet = Packet::default();
        packet.set(corners.as_flattened(), &nodes);
        let (low, high) = packet.bounds();
        let all = corners.as_flattened().iter().copied();
        assert_eq!((low, high), (all.clone().fold(DVec3::MAX, DVec3::min), all.fold(DVec3::MIN, DVec3::max)));
        let found = packet.distances_squared(x);
        assert_eq!(found, DistancesSquared { packet: &packet, x }.run(), "the same in registers of every width");
        let expected = corners.map(|corners| x.distance_squared(point_at(corners, closest_point(x, corners).weights)));
        std::array::from_fn(|k| (expected[k], found[k]))
    }

    /// Against the branching search of Voronoi regions, slivers included.
    #[test]
    fn distances_are_those_of_the_closest_point() {
        let mut next = sequence(5);
        for k in 0..4000 {
            let mut point = || DVec3::new(next(), next(), next());
            let x = point();
            let corners = std::array::from_fn(|lane| {
                let (a, b) = (point(), point());
                let height = [1.0, 1e-3, 1e-6][k % 3];
                let share = point().x;
                let c = a.lerp(b, share) + point() * height;
                [[a, b, c], [b, c, a], [c, a, b]][lane % 3]
            });
            for (expected, found) in distances(corners, x) {
                assert!((found - expected).abs() < 2e-14, "{corners:?} {x}: {found} {expected}");
            }
        }
    }

    #[test]
    fn a_triangle_without_area_is_no_farther_than_it_is() {
        let mut next = sequence(6);
        for _ in 0..2000 {
            let mut point = || DVec3::new(next(), next(), next());
            let (a, b, x) = (point(), point(), point());
            let m = a.midpoint(b);
            let flat =
                [[a, a, a], [a, a, b], [a, b, b], [a, b, a], [a, b, m], [m, b, a], [b, m, a], [a, b, a.lerp(b, 2.0)]];
            for (expected, found) in distances(flat, x) {
                assert!(found <= expected + 2e-14, "{x}: {found} {expected}");
            }
        }
    }
}
