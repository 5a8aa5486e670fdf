//! The answer of every interpolation: which samples, with which weights, make up the torque at a configuration.

use super::{
    barycentric::{Weights, barycentric, corrected},
    cloud::{Cloud, Position},
};
use crate::MAX_AXES;

/// Vertices of a simplex; the first d + 1 entries count.
pub(super) type Simplex = [u32; MAX_AXES + 1];

/// A Delaunay triangulation that can be asked where a position lies.
pub(super) trait Triangulation: Sync {
    /// State of one worker between points; by default one that knows nothing yet.
    type Walk: Default;

    /// The simplex that holds `at`; `None` outside the convex hull.
    fn simplex(&self, walk: &mut Self::Walk, at: &Position) -> Option<Simplex>;

    /// Position of a vertex as it was triangulated.
    fn position(&self, vertex: u32) -> &Position;
}

/// Linear interpolation on the simplices of a triangulation.
///
/// Grid points that lie on the hull to rounding belong to it: where no simplex holds a position, it is pulled towards
/// the hull's centre by the fraction `pull` and looked up once more. The same where only a sliver holds it: points on a
/// flat hull, jittered, are covered by slivers that span many cells.
pub(super) struct Linear<'a, T> {
    pub triangulation: T,
    pub cloud: &'a Cloud,
    pub pull: f64,
}

impl<T: Triangulation> Linear<'_, T> {
    /// Returns what one worker asks, point after point along a path, for points and weights at a position; none outside
    /// the convex hull.
    pub fn walk(&self) -> impl FnMut(&Position, &mut Vec<(u32, f64)>) {
        let mut walk = T::Walk::default();
        move |at, weights| {
            weights.clear();
            if let Some((simplex, values)) = self.look_up(&mut walk, at) {
                weights.extend(simplex.into_iter().zip(values).take(self.cloud.joints + 1));
            }
        }
    }

    fn look_up(&self, walk: &mut T::Walk, at: &Position) -> Option<(Simplex, Weights)> {
        let first = self.simplex(walk, at, at);
        match first {
            Some((simplex, weights, true)) => Some((simplex, weights)),
            _ => {
                let inside = pulled_in(at, &self.cloud.centre, self.pull);
                let (simplex, weights, _) = self.simplex(walk, &inside, at).or(first)?;
                Some((simplex, weights))
            }
        }
    }

    /// The simplex that holds `inside`, weights at `at`, and whether its true corners span all directions.
    fn simplex(&self, walk: &mut T::Walk, inside: &Position, at: &Position) -> Option<(Simplex, Weights, bool)> {
        let simplex = self.triangulation.simplex(walk, inside)?;
        let count = self.cloud.joints + 1;
        let vertex = |i: usize| simplex[if i < count { i } else { 0 }];
        let jittered: [&Position; MAX_AXES + 1] = std::array::from_fn(|i| self.triangulation.position(vertex(i)));
        let corners: [&Position; MAX_AXES + 1] = std::array::from_fn(|i| &self.cloud.positions[vertex(i) as usize]);
        let weights = barycentric(&jittered[..count], inside)?;
        let (weights, rank) = corrected(weights, &corners[..count], at);
        Some((simplex, weights, rank == self.cloud.joints))
    }
}

/// `at`, pulled towards `centre` by the fraction `pull` of the way.
pub(super) fn pulled_in(at: &Position, centre: &Position, pull: f64) -> Position {
    std::array::from_fn(|axis| at[axis] + pull * (centre[axis] - at[axis]))
}
