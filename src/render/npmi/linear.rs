//! Small dense linear algebra over the joints: solves with held joints, and the gyroscopic matrix.

use crate::{JointMatrix, JointVector, MAX_JOINTS, proxy::Dynamics};

/// Solves `(A v)_free = r_free` with `v_held` as in `at`; A positive definite, symmetric or not. Elimination without
/// pivoting: the pivots of a positive definite matrix are positive, and so are those of its rows and columns that are
/// free (Golub and Van Loan, Matrix Computations, section 4.1.4).
pub(super) fn solve_held(
    matrix: &JointMatrix,
    right: &JointVector,
    at: &JointVector,
    held: &[bool; MAX_JOINTS],
) -> JointVector {
    let joints = right.len();
    let mut rows = *matrix;
    let mut solution = *right;
    for a in 0..joints {
        if held[a] {
            rows[a] = [0.0; MAX_JOINTS];
            rows[a][a] = 1.0;
            solution[a] = at[a];
        }
    }
    for pivot in 0..joints {
        let (above, below) = rows.split_at_mut(pivot + 1);
        let row = &above[pivot];
        let right = solution[pivot];
        for (offset, other) in below.iter_mut().take(joints - pivot - 1).enumerate() {
            let share = other[pivot] / row[pivot];
            for (entry, above) in other[pivot + 1..joints].iter_mut().zip(&row[pivot + 1..joints]) {
                *entry -= share * above;
            }
            solution[pivot + 1 + offset] -= share * right;
        }
    }
    for i in (0..joints).rev() {
        let sum: f64 = (i + 1..joints).map(|j| rows[i][j] * solution[j]).sum();
        solution[i] = (solution[i] - sum) / rows[i][i];
    }
    solution
}

/// S, the skew part of `C - L Ldot^T`, exactly skew. From `M = L L^T` follows `Ldot = L Phi`, Phi the lower triangle of
/// `Y = L^-1 Mdot L^-T` with half its diagonal, so that the skew part of `L Ldot^T` is half of `L U L^T`, U with
/// the upper triangle of Y and minus its lower one.
pub(super) fn gyroscopic(factor: &JointMatrix, dynamics: &Dynamics, joints: usize) -> JointMatrix {
    // Rows of L^-1 Mdot, then of its transpose: Y is symmetric.
    let forward = |matrix: &JointMatrix| {
        let mut solved = *matrix;
        for (i, row) in factor.iter().enumerate().take(joints) {
            let (above, below) = solved.split_at_mut(i);
            for (column, entry) in below[0].iter_mut().enumerate().take(joints) {
                let sum: f64 = above.iter().zip(row).map(|(above, share)| share * above[column]).sum();
                *entry = (*entry - sum) / row[i];
            }
        }
        solved
    };
    let half = forward(&dynamics.inertia_rate);
    let y = forward(&transposed(&half));
    let mut skew = [[0.0; MAX_JOINTS]; MAX_JOINTS];
    for i in 0..joints {
        for j in 0..i {
            // (L U L^T)_ij over the pairs of the skew U.
            let mut sum = 0.0;
            for a in 0..=i {
                for b in a + 1..=i {
                    let minor = factor[i][a] * factor[j][b] - factor[i][b] * factor[j][a];
                    sum += y[a][b] * minor;
                }
            }
            let entry = dynamics.coriolis[i][j] - 0.5 * sum;
            skew[i][j] = entry;
            skew[j][i] = -entry;
        }
    }
    skew
}

fn transposed(matrix: &JointMatrix) -> JointMatrix {
    let mut result = *matrix;
    for (i, row) in matrix.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            result[j][i] = *entry;
        }
    }
    result
}
