//! A tree of axis-aligned boxes over the triangles of the surface at rest, for searches near a point.
//!
//! Every leaf holds a packet of triangles, of which searches visit those near enough; every branch the boxes of eight
//! leaves or branches, which are measured at once (as in the ray tracers' trees: Wald, Benthin & Boulos 2008). Bounds
//! carry a slack for rounding ([`CULLING_SLACK`]), and ties go to the lower triangle number, so that no result depends
//! on the order of visits.

use super::packet::{LANES, Packet, greatest};
use crate::contact::linear::wide::{Kernel, widest};
use glam::DVec3;

/// Slack of squared lower bounds in culling, relative to the square of the scene's size (1): a squared distance between
/// points of coordinates up to L is rounded by a few eps L^2 (eps = 2.2e-16); 64 eps covers bound and distance.
pub const CULLING_SLACK: f64 = 64.0 * f64::EPSILON;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub struct Volume {
    low: DVec3,
    high: DVec3,
}

impl Volume {
    /// Between two corners (m).
    #[must_use]
    pub fn new((low, high): (DVec3, DVec3)) -> Self {
        Self { low, high }
    }

    /// The least that has both in it.
    #[must_use]
    pub fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Middle and radius of the ball around it (m).
    #[must_use]
    pub fn ball(&self) -> (DVec3, f64) {
        (self.low.midpoint(self.high), 0.5 * self.low.distance(self.high))
    }

    /// Squared distance of `x`; zero inside (m^2).
    #[inline]
    #[must_use]
    pub fn distance_squared(&self, x: DVec3) -> f64 {
        let outside = |axis: usize| {
            let (below, above) = (self.low[axis] - x[axis], x[axis] - self.high[axis]);
            greatest(greatest(below, above), 0.0)
        };
        let (a, b, c) = (outside(0), outside(1), outside(2));
        a * a + b * b + c * c
    }
}

/// Up to eight boxes side by side: low and high corner, and of each the coordinates (m); those beyond the last are
/// nowhere.
struct Branch {
    low: [[f64; LANES]; 3],
    high: [[f64; LANES]; 3],
    /// Whether in the boxes are leaves, else branches; the first one's number, and how many there are.
    holds_leaves: bool,
    first: usize,
    count: usize,
}

impl Branch {
    fn new(volumes: &[Volume], first: usize, holds_leaves: bool) -> Self {
        let lanes = |corner: fn(&Volume) -> DVec3, none: f64| {
            [0, 1, 2].map(|axis| std::array::from_fn(|lane| volumes.get(lane).map_or(none, |v| corner(v)[axis])))
        };
        let (low, high) = (lanes(|v| v.low, f64::INFINITY), lanes(|v| v.high, f64::NEG_INFINITY));
        Self { low, high, holds_leaves, first, count: volumes.len() }
    }
}

/// Squared distances of `x` to the boxes of a branch; zero inside them (m^2).
struct DistancesSquared<'b> {
    branch: &'b Branch,
    x: DVec3,
}

impl Kernel for DistancesSquared<'_> {
    type Output = [f64; LANES];

    #[inline(always)]
    fn run(self) -> [f64; LANES] {
        let Self { branch: Branch { low, high, .. }, x } = self;
        let mut squares = [0.0; LANES];
        for (axis, x) in x.to_array().into_iter().enumerate() {
            for lane in 0..LANES {
                let outside = greatest(greatest(low[axis][lane] - x, x - high[axis][lane]), 0.0);
                squares[lane] += outside * outside;
            }
        }
        squares
    }
}

/// A leaf of the tree.
pub struct Leaf {
    /// Box at rest.
    pub volume: Volume,
    /// Their numbers, side by side if they are near each other.
    pub triangles: Vec<u32>,
    /// Their nodes; lanes beyond the last triangle repeat it.
    pub nodes: [[u32; 3]; LANES],
    /// The triangles at rest.
    packet: Packet,
}

impl Leaf {
    /// Its triangles that at rest are no farther from `x` than the squared radius `bound` (m^2).
    pub fn near(&self, x: DVec3, bound: f64) -> impl Iterator<Item = u32> {
        let squares = self.packet.distances_squared(x);
        self.triangles.iter().copied().zip(squares).filter(move |(_, square)| *square <= bound).map(|(t, _)| t)
    }
}

/// The tree.
pub struct BoundingVolumes {
    /// Level by level from the leaves' own up: the last one is the root.
    branches: Vec<Branch>,
    /// Box around all.
    volume: Option<Volume>,
    /// From left to right.
    pub leaves: Vec<Leaf>,
    /// Slack of squared distances (m^2).
    slack: f64,
}

impl BoundingVolumes {
    /// The tree over `triangles` with corners at `positions` (m).
    #[must_use]
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let size = positions.iter().map(|p| p.length_squared()).fold(0.0, f64::max);
        let mut leaves = Vec::with_capacity(triangles.len().div_ceil(LANES));
        build(positions, triangles, &mut order, &mut leaves);
        let mut branches: Vec<Branch> = Vec::new();
        let mut volumes: Vec<Volume> = leaves.iter().map(|leaf| leaf.volume).collect();
        let (mut first, mut holds_leaves) = (0, true);
        while holds_leaves || volumes.len() > 1 {
            let next = branches.len();
            for (k, volumes) in volumes.chunks(LANES).enumerate() {
                branches.push(Branch::new(volumes, first + LANES * k, holds_leaves));
            }
            volumes = volumes.chunks(LANES).filter_map(|some| some.iter().copied().reduce(Volume::join)).collect();
            (first, holds_leaves) = (next, false);
        }
        Self { branches, volume: volumes.first().copied(), leaves, slack: CULLING_SLACK * size }
    }

    /// All triangles, those side by side that are near each other.
    pub fn order(&self) -> impl Iterator<Item = u32> {
        self.leaves.iter().flat_map(|leaf| leaf.triangles.iter().copied())
    }

    /// Squared distance of `x` to the box around the whole surface; zero inside it (m^2).
    #[must_use]
    pub fn distance_squared(&self, x: DVec3) -> f64 {
        self.volume.map_or(f64::MAX, |volume| volume.distance_squared(x))
    }

    /// Middle and radius of the ball around the whole surface (m).
    #[must_use]
    pub fn ball(&self) -> (DVec3, f64) {
        self.volume.map_or((DVec3::ZERO, f64::INFINITY), |volume| volume.ball())
    }

    /// Returns the margin (m^2) by which a squared lower bound must exceed a squared distance to rule a triangle out,
    /// for a point `x`.
    #[must_use]
    pub fn slack(&self, x: DVec3) -> f64 {
        self.slack + CULLING_SLACK * x.length_squared()
    }

    /// Calls `visit` with the number of each leaf whose box is nearer to `x` than the squared radius that `visit`
    /// returned last; `bound` is the first (m^2).
    #[inline]
    pub fn walk(&self, x: DVec3, mut bound: f64, mut visit: impl FnMut(usize) -> f64) {
        if let Some(root) = self.branches.last() {
            self.walk_branch(root, x, &mut bound, &mut visit);
        }
    }

    fn walk_branch(&self, branch: &Branch, x: DVec3, bound: &mut f64, visit: &mut impl FnMut(usize) -> f64) {
        let squares = widest(DistancesSquared { branch, x });
        for (k, square) in squares.into_iter().enumerate().take(branch.count) {
            if square > *bound {
                continue;
            }
            if branch.holds_leaves {
                *bound = visit(branch.first + k);
            } else {
                self.walk_branch(&self.branches[branch.first + k], x, bound, visit);
            }
        }
    }

    /// Calls `visit` with each triangle that at rest is nearer to `x` than the squared radius that `visit` returned
    /// last; `radius_squared` is the first (m^2). Some that are as near but for rounding may be among them.
    pub fn search(&self, x: DVec3, radius_squared: f64, mut visit: impl FnMut(u32) -> f64) {
        let slack = self.slack(x);
        let mut bound = radius_squared + slack;
        self.walk(x, bound, |leaf| {
            let Leaf { triangles, packet, .. } = &self.leaves[leaf];
            for (&triangle, distance_squared) in triangles.iter().zip(packet.distances_squared(x)) {
                if distance_squared <= bound {
                    bound = visit(triangle) + slack;
                }
            }
            bound
        });
    }
}

/// Appends the leaves over the triangles `order`, split along the longest axis so that all leaves and branches but the
/// last are full.
fn build(positions: &[DVec3], triangles: &[[u32; 3]], order: &mut [u32], leaves: &mut Vec<Leaf>) {
    let corners = |t: u32| super::normals::corners(positions, triangles[t as usize]);
    let volume = |t: u32| {
        let [a, b, c] = corners(t);
        Volume::new((a.min(b).min(c), a.max(b).max(c)))
    };
    let Some(volume) = order.iter().map(|&t| volume(t)).reduce(Volume::join) else { return };
    if order.len() <= LANES {
        let nodes = std::array::from_fn(|lane| triangles[order[lane.min(order.len() - 1)] as usize]);
        let mut packet = Packet::default();
        packet.set(positions, &nodes);
        leaves.push(Leaf { volume, triangles: order.to_vec(), nodes, packet });
        return;
    }
    let axis = (volume.high - volume.low).max_position();
    let centre = |t: u32| {
        let corners = corners(t).map(|corner| corner[axis]);
        corners.iter().copied().fold(f64::MAX, f64::min) + corners.iter().copied().fold(f64::MIN, f64::max)
    };
    let mut full = LANES;
    while full * LANES < order.len() {
        full *= LANES;
    }
    let middle = (order.len() / 2).next_multiple_of(full);
    order.select_nth_unstable_by(middle, |&s, &t| centre(s).total_cmp(&centre(t)).then(s.cmp(&t)));
    let (left, right) = order.split_at_mut(middle);
    build(positions, triangles, left, leaves);
    build(positions, triangles, right, leaves);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::geometry::closest_point::{closest_point, point_at};
    use crate::contact::geometry::normals;
    use crate::random::sequence;

    /// Trees of every height up to four, full and not: against all triangles tried one by one, for spheres of fixed
    /// size and for one that shrinks to the nearest triangle.
    #[test]
    fn searches_visit_all_that_is_near_and_each_once() {
        let mut next = sequence(11);
        for count in [0_usize, 1, 7, 8, 9, 64, 65, 200, 512, 513, 700, 4097] {
            let mut point = || DVec3::new(next(), next(), next());
            let positions: Vec<DVec3> = (0..count)
                .flat_map(|_| {
                    let a = point();
                    [a, a + point() * 0.1, a + point() * 0.1]
                })
                .collect();
            let triangles: Vec<[u32; 3]> = (0..count as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            let tree = BoundingVolumes::new(&positions, &triangles);
            let mut order: Vec<u32> = tree.order().collect();
            order.sort_unstable();
            assert!(order.into_iter().eq(0..count as u32));
            assert_eq!(tree.leaves.len(), count.div_ceil(LANES), "leaves are full");
            for _ in 0..20 {
                let x = point();
                let square = |t: u32| {
                    let corners = normals::corners(&positions, triangles[t as usize]);
                    x.distance_squared(point_at(corners, closest_point(x, corners).weights))
                };
                let radius_squared = 0.3;
                let mut found = Vec::new();
                tree.search(x, radius_squared, |t| {
                    found.push(t);
                    radius_squared
                });
                found.sort_unstable();
                let near: Vec<u32> = (0..count as u32).filter(|&t| square(t) <= radius_squared).collect();
                assert_eq!(found, near, "of {count}");
                let mut least = f64::MAX;
                let mut visits = 0;
                tree.search(x, least, |t| {
                    visits += 1;
                    least = least.min(square(t));
                    least
                });
                let nearest = (0..count as u32).map(square).fold(f64::MAX, f64::min);
                assert_eq!(least, nearest, "of {count}");
                assert!(count < 200 || visits < count / 2, "{visits} visits of {count}");
            }
        }
    }
}
