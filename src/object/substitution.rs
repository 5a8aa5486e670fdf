//! Forward and backward substitution with a supernodal Cholesky factor, for one right-hand side at a time.
//!
//! L is stored by supernodes: columns that share their rows, as one dense trapezoid each (Ng & Peyton, Block sparse Cholesky
//! algorithms, 1993). Those of a surface are a few columns wide, and a frame has one right-hand side: routines for dense blocks
//! then spend most of their time on being called. Plain loops over the columns read L once in each direction and do little else.
//! A right-hand side is of numbers, or of vectors where one matrix stands for all three coordinates.

use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use std::ops::{AddAssign, Mul, SubAssign};

/// What a right-hand side is made of.
pub(super) trait Entry: Copy + Default + AddAssign + SubAssign + Mul<f64, Output = Self> {}

impl<T: Copy + Default + AddAssign + SubAssign + Mul<f64, Output = T>> Entry for T {}

/// Solves `L L^T x = right` in place, both in the order of elimination.
pub(super) fn substitute<T: Entry>(factor: SupernodalLltRef<'_, usize, f64>, right: &mut [T]) {
    let symbolic = factor.symbolic();
    let values = |s: usize| &factor.values()[symbolic.col_ptr_for_val()[s]..symbolic.col_ptr_for_val()[s + 1]];
    let supernode = |s: usize| {
        let range = symbolic.supernode_begin()[s]..symbolic.supernode_end()[s];
        let pattern = symbolic.supernode(s).pattern();
        (range.clone(), pattern, values(s).chunks_exact((range.len() + pattern.len()).max(1)))
    };
    let mut below: Vec<T> = Vec::new();
    for s in 0..symbolic.n_supernodes() {
        let (range, pattern, columns) = supernode(s);
        let width = range.len();
        below.clear();
        below.resize(pattern.len(), T::default());
        let own = &mut right[range];
        for (c, column) in columns.enumerate() {
            let (diagonal, rest) = column.split_at(width);
            let solved = own[c] * diagonal[c].recip();
            own[c] = solved;
            for (entry, &l) in own[c + 1..].iter_mut().zip(&diagonal[c + 1..]) {
                *entry -= solved * l;
            }
            for (entry, &l) in below.iter_mut().zip(rest) {
                *entry += solved * l;
            }
        }
        for (&row, &entry) in pattern.iter().zip(&below) {
            right[row] -= entry;
        }
    }
    for s in (0..symbolic.n_supernodes()).rev() {
        let (range, pattern, columns) = supernode(s);
        let width = range.len();
        below.clear();
        below.extend(pattern.iter().map(|&row| right[row]));
        let own = &mut right[range];
        for (c, column) in columns.enumerate().rev() {
            let (diagonal, rest) = column.split_at(width);
            let mut entry = own[c];
            entry -= dot(&diagonal[c + 1..], &own[c + 1..]);
            entry -= dot(rest, &below);
            own[c] = entry * diagonal[c].recip();
        }
    }
}

/// Sums that run side by side, so that none waits for the one before.
const SUMS: usize = 4;

/// Sum of `weights` times `entries`, which are as many.
fn dot<T: Entry>(weights: &[f64], entries: &[T]) -> T {
    let mut sums = [T::default(); SUMS];
    let (weights, last_weights) = weights.as_chunks::<SUMS>();
    let (entries, last_entries) = entries.as_chunks::<SUMS>();
    for (weights, entries) in weights.iter().zip(entries) {
        for ((sum, &weight), &entry) in sums.iter_mut().zip(weights).zip(entries) {
            *sum += entry * weight;
        }
    }
    let [mut total, others @ ..] = sums;
    others.into_iter().for_each(|sum| total += sum);
    last_weights.iter().zip(last_entries).for_each(|(&weight, &entry)| total += entry * weight);
    total
}
