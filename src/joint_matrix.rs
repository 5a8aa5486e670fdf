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

/// Most sweeps of Jacobi's method (1): it converges quadratically, six rows to rounding in five or six.
const SWEEPS: usize = 12;

/// Eigenvalues of the leading `joints` rows and columns of a symmetric `matrix`, on a diagonal, and their vectors as
/// columns. By Jacobi's method (Golub and Van Loan, Matrix Computations, section 8.5). Allocates nothing.
fn eigenvalues(matrix: &JointMatrix, joints: usize) -> (JointMatrix, JointMatrix) {
    let mut diagonal = *matrix;
    let mut vectors = [[0.0; MAX_JOINTS]; MAX_JOINTS];
    vectors.iter_mut().enumerate().for_each(|(k, row)| row[k] = 1.0);
    for _ in 0..SWEEPS {
        let mut turned = false;
        for k in 0..joints {
            for l in 0..k {
                turned |= annihilate(&mut diagonal, &mut vectors, [k, l]);
            }
        }
        if !turned {
            break;
        }
    }
    (diagonal, vectors)
}

/// Greatest eigenvalue of the leading `joints` rows and columns of a symmetric `matrix`. Allocates nothing.
#[must_use]
pub fn greatest_eigenvalue(matrix: &JointMatrix, joints: usize) -> f64 {
    let (diagonal, _) = eigenvalues(matrix, joints);
    (0..joints).map(|k| diagonal[k][k]).fold(f64::NEG_INFINITY, f64::max)
}

/// Returns the symmetric positive semidefinite square root of the leading `joints` rows and columns of a symmetric
/// `matrix`, its negative eigenvalues taken for zero; the rest is zero. Allocates nothing.
#[must_use]
pub fn square_root(matrix: &JointMatrix, joints: usize) -> JointMatrix {
    let (diagonal, vectors) = eigenvalues(matrix, joints);
    let mut root = [[0.0; MAX_JOINTS]; MAX_JOINTS];
    for i in 0..joints {
        let size = diagonal[i][i].max(0.0).sqrt();
        for k in 0..joints {
            for l in 0..=k {
                add_symmetric(&mut root, k, l, size * vectors[k][i] * vectors[l][i]);
            }
        }
    }
    root
}

/// Turns rows and columns k and l of `matrix` so that entry (k, l) is zero, and `vectors` with them; returns whether it
/// was more than rounding.
fn annihilate(matrix: &mut JointMatrix, vectors: &mut JointMatrix, [k, l]: [usize; 2]) -> bool {
    let (off, beside) = (matrix[k][l], (matrix[k][k] * matrix[l][l]).abs());
    if off.is_nan() || off * off <= f64::EPSILON * f64::EPSILON * beside.max(f64::MIN_POSITIVE) {
        return false;
    }
    let ratio = (matrix[l][l] - matrix[k][k]) / (2.0 * off);
    let tangent = ratio.signum() / (ratio.abs() + ratio.hypot(1.0));
    let cosine = 1.0 / tangent.hypot(1.0);
    let sine = tangent * cosine;
    let turn = |a: &mut f64, b: &mut f64| (*a, *b) = (cosine * *a - sine * *b, sine * *a + cosine * *b);
    for row in matrix.iter_mut().chain(vectors) {
        if let Ok([a, b]) = row.get_disjoint_mut([k, l]) {
            turn(a, b);
        }
    }
    if let Ok([a, b]) = matrix.get_disjoint_mut([k, l]) {
        a.iter_mut().zip(b).for_each(|(a, b)| turn(a, b));
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// The square of the leading rows, and the greatest entry of a difference.
    fn square(root: &JointMatrix) -> JointMatrix {
        root.map(|row| std::array::from_fn(|l| row.iter().zip(root).map(|(a, other)| a * other[l]).sum()))
    }

    #[test]
    fn the_greatest_eigenvalue_is_the_greatest_of_rayleighs_quotients() {
        let mut random = Random::new(11);
        for joints in 1..=MAX_JOINTS {
            let mut matrix = JointMatrix::default();
            for k in 0..joints {
                (0..=k).for_each(|l| add_symmetric(&mut matrix, k, l, random.between(-1.0, 1.0)));
            }
            let greatest = greatest_eigenvalue(&matrix, joints);
            let times = |x: &JointVector| {
                let mut product = JointVector::zeros(joints);
                product
                    .iter_mut()
                    .zip(&matrix)
                    .for_each(|(y, row)| *y = row.iter().zip(x.iter()).map(|(a, b)| a * b).sum());
                product
            };
            // Power iteration on M + c 1, whose eigenvalues are positive.
            let mut x = JointVector::zeros(joints);
            x.iter_mut().for_each(|entry| *entry = random.between(0.5, 1.0));
            for _ in 0..4000 {
                let mut next = times(&x);
                next.iter_mut().zip(x.iter()).for_each(|(next, x)| *next += 6.0 * x);
                let length = next.iter().map(|entry| entry * entry).sum::<f64>().sqrt();
                next.iter_mut().for_each(|entry| *entry /= length);
                x = next;
            }
            let quotient: f64 = times(&x).iter().zip(x.iter()).map(|(a, b)| a * b).sum();
            assert!((greatest - quotient).abs() < 1e-6, "{joints} joints: {greatest} and {quotient}");
        }
    }

    #[test]
    fn a_square_root_squares_to_its_matrix_whatever_its_rank() {
        let mut random = Random::new(3);
        for joints in 1..=MAX_JOINTS {
            for rank in 1..=joints {
                for _ in 0..20 {
                    let mut matrix = JointMatrix::default();
                    for _ in 0..rank {
                        let mut vector = JointVector::zeros(joints);
                        vector.iter_mut().for_each(|entry| *entry = random.between(-1.0, 1.0));
                        for k in 0..joints {
                            (0..=k).for_each(|l| add_symmetric(&mut matrix, k, l, vector[k] * vector[l]));
                        }
                    }
                    let root = square_root(&matrix, joints);
                    let size = matrix.as_flattened().iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
                    let squared = square(&root);
                    let pairs = squared.as_flattened().iter().zip(matrix.as_flattened());
                    let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(off < 1e-13 * size.max(1e-3), "{joints} joints, rank {rank}: {off} of {size}");
                    // Not just any root: it is symmetric, and gives no direction a negative size.
                    for (k, row) in root.iter().enumerate() {
                        assert!((0..joints).all(|l| row[l] == root[l][k]) && row[k] >= 0.0);
                    }
                }
            }
        }
    }
}
