//! Numeric Cholesky factorisation by supernodes.
//!
//! Supernode after supernode: its diagonal block is factorised, the rows below are divided by it, and the products of
//! these rows are taken from the supernodes that have them for columns (right-looking: Ng & Peyton, Block sparse Cholesky
//! algorithms, 1993). Those are other supernodes each, so that threads share them, and each is changed in the same order
//! on any number of threads.

use super::supernodes::Supernodes;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::linalg::{matmul::matmul, triangular_solve::solve_lower_triangular_in_place};
use faer::{Accum, Mat, MatMut, MatRef, Par};
use rayon::prelude::*;
use std::ops::Range;

/// Multiplications of a supernode's products from which on they are shared out (1): they take a tenth of a millisecond,
/// waking threads some hundredths.
const LEAST_TO_SHARE: usize = 1 << 20;

/// A supernode from which products are taken: its number, its columns' places in the pattern of the other, its values.
type Target<'v> = (usize, Range<usize>, &'v mut [f64]);

/// Replaces the lower half of a matrix, stored in the places of its factor, by the factor. Returns whether it is
/// positive definite.
pub(super) fn factorize(supernodes: &Supernodes, mut values: &mut [f64]) -> bool {
    for s in 0..supernodes.count() {
        let (own, later) = values.split_at_mut(supernodes.range(s).len());
        let (width, pattern) = (supernodes.columns(s).len(), supernodes.pattern(s));
        let (mut diagonal, mut below) =
            MatMut::from_column_major_slice_mut(own, width + pattern.len(), width).split_at_row_mut(width);
        let mut scratch = MemBuffer::new(cholesky_in_place_scratch::<f64>(width, Par::Seq, Default::default()));
        let stack = MemStack::new(&mut scratch);
        if cholesky_in_place(diagonal.as_mut(), Default::default(), Par::Seq, stack, Default::default()).is_err() {
            return false;
        }
        solve_lower_triangular_in_place(diagonal.as_ref(), below.as_mut().transpose_mut(), Par::Seq);
        let subtract = |target: Target<'_>| subtract(supernodes, pattern, below.as_ref(), target);
        let targets = targets(supernodes, s, later);
        if width * pattern.len() * pattern.len() > LEAST_TO_SHARE {
            targets.into_par_iter().for_each(subtract);
        } else {
            targets.into_iter().for_each(subtract);
        }
        values = later;
    }
    true
}

/// The supernodes whose columns are rows of supernode `s`. `later`: the values after its own.
fn targets<'v>(supernodes: &Supernodes, s: usize, mut later: &'v mut [f64]) -> Vec<Target<'v>> {
    let (pattern, mut taken) = (supernodes.pattern(s), supernodes.range(s).end);
    let (mut targets, mut first) = (Vec::new(), 0);
    while first < pattern.len() {
        let target = supernodes.with(pattern[first]);
        let end = supernodes.columns(target).end;
        let next = first + pattern[first..].partition_point(|row| *row < end);
        let range = supernodes.range(target);
        let (own, after) = later.split_at_mut(range.start - taken).1.split_at_mut(range.len());
        targets.push((target, first..next, own));
        (later, taken, first) = (after, range.end, next);
    }
    targets
}

/// Subtracts from a supernode the products of the rows `below` of another, which are those of `pattern`.
fn subtract(supernodes: &Supernodes, pattern: &[usize], below: MatRef<'_, f64>, (s, columns, values): Target<'_>) {
    let rows = pattern.len() - columns.start;
    let left = below.subrows(columns.start, rows);
    let mut product = Mat::zeros(rows, columns.len());
    matmul(product.as_mut(), Accum::Replace, left, left.subrows(0, columns.len()).transpose(), 1.0, Par::Seq);
    let places: Vec<usize> = pattern[columns.start..].iter().map(|&row| supernodes.place(s, row)).collect();
    let height = supernodes.columns(s).len() + supernodes.pattern(s).len();
    for (k, product) in product.col_iter().enumerate() {
        let column = &mut values[height * places[k]..][..height];
        places.iter().zip(product.iter()).skip(k).for_each(|(&place, product)| column[place] -= product);
    }
}
