//! Square matrices over the joints, in arrays of fixed capacity, and the systems that they make. Nothing here allocates.

use crate::joint_vector::{JointVector, MAX_JOINTS};

/// One number per pair of joints: a tangent stiffness (N m/rad), an inertia (kg m^2). The first d rows and columns
/// count, the others are zero.
pub type JointMatrix = [[f64; MAX_JOINTS]; MAX_JOINTS];

/// Adds `value` to the entries (k, l) and (l, k), once where they are the same.
pub fn add_symmetric(matrix: &mut JointMatrix, k: usize, l: usize, value: f64) {
    matrix[k][l] += value;
    if k != l {
        matrix[l][k] += value;
    }
}

/// Numbers that [`lower`] yields for `joints` joints.
#[must_use]
pub fn entries(joints: usize) -> usize {
    joints * (joints + 1) / 2
}

/// The lower triangle of the leading `joints` rows, row by row: (0, 0), (1, 0), (1, 1), (2, 0) and so on.
pub fn lower(matrix: &JointMatrix, joints: usize) -> impl Iterator<Item = f64> {
    matrix.iter().take(joints).enumerate().flat_map(|(k, row)| row.iter().take(k + 1).copied())
}

/// Returns the lower Cholesky factor of the leading `joints` rows and columns; `None` if they are not positive
/// definite. Allocates nothing.
#[must_use]
pub fn cholesky(matrix: &JointMatrix, joints: usize) -> Option<JointMatrix> {
    let mut factor = [[0.0; MAX_JOINTS]; MAX_JOINTS];
    for i in 0..joints {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let entry = matrix[i][j] - sum;
            if i == j {
                // Also false for what is not a number.
                if !(entry > 0.0 && entry.is_finite()) {
                    return None;
                }
                factor[i][i] = entry.sqrt();
            } else {
                factor[i][j] = entry / factor[j][j];
            }
        }
    }
    Some(factor)
}

/// `vector <- L^-T vector`.
pub fn solve_transposed(factor: &JointMatrix, vector: &mut JointVector) {
    let joints = vector.len();
    for i in (0..joints).rev() {
        let sum: f64 = (i + 1..joints).map(|j| factor[j][i] * vector[j]).sum();
        vector[i] = (vector[i] - sum) / factor[i][i];
    }
}

/// Solves `M x = b` in place; x is NaN if M is not positive definite, as every inertia with positive rotor inertias is.
/// Allocates nothing.
pub fn solve_positive(matrix: &JointMatrix, b: &mut JointVector) {
    let Some(factor) = cholesky(matrix, b.len()) else {
        b.iter_mut().for_each(|entry| *entry = f64::NAN);
        return;
    };
    for i in 0..b.len() {
        let sum: f64 = (0..i).map(|k| factor[i][k] * b[k]).sum();
        b[i] = (b[i] - sum) / factor[i][i];
    }
    solve_transposed(&factor, b);
}
