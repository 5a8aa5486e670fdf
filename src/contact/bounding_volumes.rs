//! A tree of axis-aligned boxes over the triangles of the surface at rest, for closest-triangle queries.
//!
//! The tree is one array in depth-first order: a query walks it with a single index, entering a box by stepping to the
//! next entry and leaving it by jumping to `skip`. Every leaf holds one triangle. Bounds carry a slack for rounding
//! ([`CULLING_SLACK`]), and ties go to the lower triangle number, so that no result depends on the order of visits.

use crate::tolerances::CULLING_SLACK;
use glam::DVec3;

/// One box.
#[derive(Clone, Copy, Debug)]
struct Entry {
    low: DVec3,
    high: DVec3,
    /// Where to go on when this box is left out.
    skip: u32,
    /// Its triangle, in a leaf; else [`u32::MAX`].
    triangle: u32,
}

/// The tree.
pub struct BoundingVolumes {
    entries: Vec<Entry>,
    /// Slack of squared distances [m^2].
    slack: f64,
}

impl BoundingVolumes {
    /// The tree over `triangles` with corners at `positions` [m].
    #[must_use]
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let boxes: Vec<(DVec3, DVec3)> = triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = super::surface::corners(positions, *triangle);
                (a.min(b).min(c), a.max(b).max(c))
            })
            .collect();
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut entries = Vec::with_capacity(2 * triangles.len());
        build(&boxes, &mut order, &mut entries);
        let size = positions.iter().map(|p| p.length_squared()).fold(0.0, f64::max);
        Self { entries, slack: CULLING_SLACK * size }
    }

    /// All triangles, those side by side that are near each other.
    pub fn order(&self) -> impl Iterator<Item = u32> {
        self.entries.iter().map(|entry| entry.triangle).filter(|&triangle| triangle != u32::MAX)
    }

    /// Squared distance of `x` to the box around the whole surface; zero inside it [m^2].
    #[must_use]
    pub fn distance_squared(&self, x: DVec3) -> f64 {
        self.entries.first().map_or(f64::MAX, |root| box_distance_squared(root, x))
    }

    /// What squared lower bounds must exceed a squared distance by before they rule a triangle out, for a point `x` [m^2].
    #[must_use]
    pub fn slack(&self, x: DVec3) -> f64 {
        self.slack + CULLING_SLACK * x.length_squared()
    }

    /// Calls `visit(triangle, squared distance of x to its box)` for each triangle whose box is nearer than the squared
    /// radius that `visit` returned last; `radius_squared` is the first [m^2].
    pub fn search(&self, x: DVec3, radius_squared: f64, mut visit: impl FnMut(u32, f64) -> f64) {
        let slack = self.slack(x);
        let mut bound = radius_squared + slack;
        let mut k = 0;
        while k < self.entries.len() {
            let entry = &self.entries[k];
            let distance_squared = box_distance_squared(entry, x);
            if distance_squared > bound {
                k = entry.skip as usize;
                continue;
            }
            if entry.triangle != u32::MAX {
                bound = visit(entry.triangle, distance_squared) + slack;
            }
            k += 1;
        }
    }
}

/// Squared distance of `x` to a box; zero inside it.
fn box_distance_squared(entry: &Entry, x: DVec3) -> f64 {
    (entry.low - x).max(x - entry.high).max(DVec3::ZERO).length_squared()
}

/// Appends the subtree over the triangles `order`, split at the median along the longest axis.
fn build(boxes: &[(DVec3, DVec3)], order: &mut [u32], entries: &mut Vec<Entry>) {
    if order.is_empty() {
        return;
    }
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    for &t in order.iter() {
        low = low.min(boxes[t as usize].0);
        high = high.max(boxes[t as usize].1);
    }
    let at = entries.len();
    let triangle = if order.len() == 1 { order[0] } else { u32::MAX };
    entries.push(Entry { low, high, skip: 0, triangle });
    if order.len() > 1 {
        let axis = (high - low).max_position();
        let centre = |t: u32| boxes[t as usize].0[axis] + boxes[t as usize].1[axis];
        let middle = order.len() / 2;
        order.select_nth_unstable_by(middle, |&s, &t| centre(s).total_cmp(&centre(t)).then(s.cmp(&t)));
        let (left, right) = order.split_at_mut(middle);
        build(boxes, left, entries);
        build(boxes, right, entries);
    }
    entries[at].skip = entries.len() as u32;
}
