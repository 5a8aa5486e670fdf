//! The stiffness of a torque field over a cell, and the cell where it is greatest.

use crate::{JointMatrix, JointVector};
use std::sync::{Mutex, PoisonError};

/// Bounds of the entries of d tau/d q over one cell (N m/rad, or what follows of prismatic joints).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stiffness {
    entries: JointMatrix,
    /// Square of the Frobenius norm of `S^-1/2 E S^-1/2`, E of these entries, S = diag(slopes) (1).
    square: f64,
}

impl Stiffness {
    /// Bounds of the entries `entry(a, b)`, compared with `slopes`.
    pub fn new(slopes: &JointVector, entry: impl Fn(usize, usize) -> f64) -> Self {
        let mut stiffness = Self::default();
        for (a, b) in (0..slopes.len()).flat_map(|a| (0..slopes.len()).map(move |b| (a, b))) {
            let entry = entry(a, b);
            stiffness.entries[a][b] = entry;
            stiffness.square += entry.powi(2) / (slopes[a] * slopes[b]);
        }
        stiffness
    }

    /// The greater one by its norm.
    pub fn max(self, other: Self) -> Self {
        if other.square > self.square { other } else { self }
    }
}

/// How far the ratios of two vectors' entries may be apart where one is a multiple of the other (1): some roundings of
/// factors that are applied entry by entry.
const ROUNDINGS: f64 = 8.0 * f64::EPSILON;

/// The steepest cell of a field, as it was last searched for: a session asks some times, for the same slopes or
/// multiples of them, and the search takes seconds where there are many cells of six joints.
#[derive(Default)]
pub(super) struct Steepest(Mutex<Option<Found>>);

#[derive(Clone, Copy)]
struct Found {
    cell: Stiffness,
    slopes: JointVector,
}

impl Steepest {
    /// Returns the norm of the steepest cell relative to `slopes`. `search` returns that cell.
    pub fn norm(&self, slopes: &JointVector, search: impl FnOnce() -> Stiffness) -> f64 {
        // The cell that is steepest relative to some slopes is it relative to their multiples, too.
        let is_known = |found: &Found| is_multiple(slopes, &found.slopes);
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner).filter(is_known);
        let found = last.unwrap_or_else(|| Found { cell: search(), slopes: *slopes });
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(found);
        Stiffness::new(slopes, |a, b| found.cell.entries[a][b]).square.sqrt()
    }
}

/// Whether `slopes` are those of `others` times one factor.
fn is_multiple(slopes: &JointVector, others: &JointVector) -> bool {
    let factor = |a: usize| slopes[a] / others[a];
    let is_first = |a: usize| (factor(a) - factor(0)).abs() <= ROUNDINGS * factor(0);
    slopes.len() == others.len() && (0..slopes.len()).all(is_first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steepest_cell_is_searched_for_again_where_slopes_are_others() {
        let steepest = Steepest::default();
        let mut searches = 0;
        let mut norm = |slopes: [f64; 2]| {
            let slopes = JointVector::from_slice(&slopes);
            let search = || {
                searches += 1;
                Stiffness::new(&slopes, |a, b| [[3.0, 2.0], [2.0, 1.0]][a][b])
            };
            (steepest.norm(&slopes, search), searches)
        };
        // The root of 9 + 4 / 2 + 4 / 2 + 1 / 4.
        let root = 13.25_f64.sqrt();
        assert_eq!(norm([1.0, 2.0]), (root, 1));
        assert_eq!(norm([1.0, 2.0]), (root, 1));
        assert_eq!(norm([4.0, 8.0]), (root / 4.0, 1));
        let third = 1.0 / 3.0;
        assert!((norm([0.1 * third, 0.2 * third]).0 * 0.1 * third - root).abs() < 1e-15 * root);
        assert_eq!(norm([1.0, 2.0]).1, 1);
        assert_eq!(norm([1.0, 2.0 + 1e-12]).1, 2);
        assert_eq!(norm([1.0, 2.0]).1, 3);
    }
}
