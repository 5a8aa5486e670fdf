//! Small dense systems: the lower Cholesky factor of a symmetric positive definite matrix, row after row, of whose
//! diagonal the reciprocal is kept.

use super::support::dot;

/// Puts the factor of `matrix`, of so many rows, into its lower triangle. What rounding leaves of a pivot is not
/// believed below its own rounding.
pub fn factorize(matrix: &mut [f64], order: usize) {
    for i in 0..order {
        let (above, below) = matrix.split_at_mut(i * order);
        let row = &mut below[..=i];
        let least = f64::EPSILON * row[i];
        let mut square = row[i];
        for (j, other) in above.chunks_exact(order).enumerate() {
            let entry = (row[j] - dot(&row[..j], &other[..j])) * other[j];
            row[j] = entry;
            square -= entry * entry;
        }
        row[i] = 1.0 / square.max(least).sqrt();
    }
}

/// Replaces N right-hand sides side by side, one row of `right` a row of the matrix, by the solutions.
pub fn solve<const N: usize>(factor: &[f64], right: &mut [[f64; N]]) {
    let order = right.len();
    for i in 0..order {
        let row = &factor[i * order..=i * order + i];
        let (known, unknown) = right.split_at_mut(i);
        // Four sums, none of which waits for another.
        let ((entries, last), (fours, others)) = (row[..i].as_chunks::<4>(), known.as_chunks::<4>());
        let mut sums = [[0.0; N]; 4];
        for (entries, fours) in entries.iter().zip(fours) {
            for (sum, (entry, known)) in sums.iter_mut().zip(entries.iter().zip(fours)) {
                (0..N).for_each(|k| sum[k] += entry * known[k]);
            }
        }
        for (sum, (entry, known)) in sums.iter_mut().zip(last.iter().zip(others)) {
            (0..N).for_each(|k| sum[k] += entry * known[k]);
        }
        let [a, b, c, d] = sums;
        (0..N).for_each(|k| unknown[0][k] = (unknown[0][k] - ((a[k] + b[k]) + (c[k] + d[k]))) * row[i]);
    }
    for i in (0..order).rev() {
        let row = &factor[i * order..=i * order + i];
        let (unknown, known) = right.split_at_mut(i);
        (0..N).for_each(|k| known[0][k] *= row[i]);
        for (entry, unknown) in row.iter().zip(unknown) {
            (0..N).for_each(|k| unknown[k] -= entry * known[0][k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::sequence;

    /// Random matrices B B^T + I, of every order up to that of four ties, against the product with what is found.
    #[test]
    fn systems_of_all_orders_are_solved() {
        let mut next = sequence(5);
        for order in 0..37 {
            let random: Vec<f64> = (0..order * order).map(|_| next()).collect();
            let row = |i: usize| &random[i * order..(i + 1) * order];
            let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
            let entry = |i: usize, j: usize| dot(row(i), row(j)) + unit(i, j);
            let mut matrix: Vec<f64> =
                (0..order).flat_map(|i| (0..order).map(move |j| (i, j))).map(|(i, j)| entry(i, j)).collect();
            let wanted: Vec<[f64; 3]> = (0..order).map(|_| [next(), next(), next()]).collect();
            let mut found = wanted.clone();
            factorize(&mut matrix, order);
            solve(&matrix, &mut found);
            for (i, wanted) in wanted.iter().enumerate() {
                for k in 0..3 {
                    let product: f64 = (0..order).map(|j| entry(i, j) * found[j][k]).sum();
                    assert!((product - wanted[k]).abs() < 1e-12, "order {order}: {product} {}", wanted[k]);
                }
            }
        }
    }

    /// Two equal rows leave nothing of the second pivot but rounding, which is never below zero.
    #[test]
    fn a_singular_matrix_has_a_finite_factor() {
        let mut matrix = [2.0, 2.0, 2.0, 2.0 - 1e-15];
        factorize(&mut matrix, 2);
        let mut right = [[1.0], [1.0]];
        solve(&matrix, &mut right);
        assert!(matrix.iter().chain(right.as_flattened()).all(|entry| entry.is_finite()), "{matrix:?} {right:?}");
    }
}
