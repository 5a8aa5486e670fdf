//! A tree of axis-aligned boxes over the triangles of the surface at rest, for searches near a point.
//!
//! The tree is one array in depth-first order: a query walks it with a single index, entering a box by stepping to the
//! next entry and leaving it by jumping to `skip`. Every leaf holds a packet of triangles, of which searches visit those near
//! enough. Bounds carry a slack for rounding ([`CULLING_SLACK`]), and ties go to the lower triangle number, so that no result
//! depends on the order of visits.

use super::packet::{LANES, Packet, greatest};
use crate::tolerances::CULLING_SLACK;
use glam::DVec3;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub struct Volume {
    low: DVec3,
    high: DVec3,
}

impl Volume {
    /// Between two corners [m].
    #[must_use]
    pub fn new((low, high): (DVec3, DVec3)) -> Self {
        Self { low, high }
    }

    /// The least that has both in it.
    #[must_use]
    pub fn join(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Squared distance of `x`; zero inside [m^2].
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

/// One box of the tree.
#[derive(Clone, Copy, Debug)]
struct Entry {
    volume: Volume,
    /// Where to go on when this box is left out.
    skip: u32,
    /// Its leaf's number; else [`u32::MAX`].
    leaf: u32,
}

/// What a leaf holds.
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

/// The tree.
pub struct BoundingVolumes {
    entries: Vec<Entry>,
    /// From left to right.
    pub leaves: Vec<Leaf>,
    /// Slack of squared distances [m^2].
    slack: f64,
}

impl BoundingVolumes {
    /// The tree over `triangles` with corners at `positions` [m].
    #[must_use]
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let size = positions.iter().map(|p| p.length_squared()).fold(0.0, f64::max);
        let mut tree = Self { entries: Vec::new(), leaves: Vec::new(), slack: CULLING_SLACK * size };
        tree.build(positions, triangles, &mut order);
        tree
    }

    /// All triangles, those side by side that are near each other.
    pub fn order(&self) -> impl Iterator<Item = u32> {
        self.leaves.iter().flat_map(|leaf| leaf.triangles.iter().copied())
    }

    /// Squared distance of `x` to the box around the whole surface; zero inside it [m^2].
    #[must_use]
    pub fn distance_squared(&self, x: DVec3) -> f64 {
        self.entries.first().map_or(f64::MAX, |root| root.volume.distance_squared(x))
    }

    /// What squared lower bounds must exceed a squared distance by before they rule a triangle out, for a point `x` [m^2].
    #[must_use]
    pub fn slack(&self, x: DVec3) -> f64 {
        self.slack + CULLING_SLACK * x.length_squared()
    }

    /// Calls `visit` with the number of each leaf whose box is nearer to `x` than the squared radius that `visit` returned last;
    /// `bound` is the first [m^2].
    #[inline]
    pub fn walk(&self, x: DVec3, mut bound: f64, mut visit: impl FnMut(usize) -> f64) {
        let mut k = 0;
        while let Some(entry) = self.entries.get(k) {
            if entry.volume.distance_squared(x) > bound {
                k = entry.skip as usize;
                continue;
            }
            if entry.leaf != u32::MAX {
                bound = visit(entry.leaf as usize);
            }
            k += 1;
        }
    }

    /// Calls `visit` with each triangle that at rest is nearer to `x` than the squared radius that `visit` returned last;
    /// `radius_squared` is the first [m^2]. Some that are as near but for rounding may be among them.
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

    /// Appends the subtree over the triangles `order`, split along the longest axis so that leaves are full.
    fn build(&mut self, positions: &[DVec3], triangles: &[[u32; 3]], order: &mut [u32]) {
        let corners = |t: u32| super::surface::corners(positions, triangles[t as usize]);
        let volume = |t: u32| {
            let [a, b, c] = corners(t);
            Volume::new((a.min(b).min(c), a.max(b).max(c)))
        };
        let Some(volume) = order.iter().map(|&t| volume(t)).reduce(Volume::join) else { return };
        let at = self.entries.len();
        let is_leaf = order.len() <= LANES;
        let leaf = if is_leaf { self.leaves.len() as u32 } else { u32::MAX };
        self.entries.push(Entry { volume, skip: 0, leaf });
        if is_leaf {
            let nodes = std::array::from_fn(|lane| triangles[order[lane.min(order.len() - 1)] as usize]);
            let mut packet = Packet::default();
            packet.set(positions, &nodes);
            self.leaves.push(Leaf { volume, triangles: order.to_vec(), nodes, packet });
        } else {
            let axis = (volume.high - volume.low).max_position();
            let centre = |t: u32| {
                let corners = corners(t).map(|corner| corner[axis]);
                corners.iter().copied().fold(f64::MAX, f64::min) + corners.iter().copied().fold(f64::MIN, f64::max)
            };
            let middle = (order.len() / 2).next_multiple_of(LANES);
            order.select_nth_unstable_by(middle, |&s, &t| centre(s).total_cmp(&centre(t)).then(s.cmp(&t)));
            let (left, right) = order.split_at_mut(middle);
            self.build(positions, triangles, left);
            self.build(positions, triangles, right);
        }
        self.entries[at].skip = self.entries.len() as u32;
    }
}
