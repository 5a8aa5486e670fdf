//! From a device's coordinates m to the scene's: `q = A m + b`. Efforts go back by the transpose, `tau_m = A^T tau`, so
//! that both do the same work.
//!
//! The joints of a parallelogram are measured against the ground where a serial chain's are relative; the rows of A
//! subtract them. For a Cartesian device q is a position in the scene (m) and A turns (and scales) the device's axes.

use crate::{Error, JointVector, MAX_JOINTS, error, names::counted};
use faer::{Mat, linalg::solvers::DenseSolveCore};

/// The map of a device, and its inverse.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearMap {
    count: usize,
    /// A, by rows.
    matrix: [[f64; MAX_JOINTS]; MAX_JOINTS],
    /// A^-1, by rows.
    inverse: [[f64; MAX_JOINTS]; MAX_JOINTS],
    /// b (rad or m).
    offset: JointVector,
}

/// Largest deviation of A A^-1 from the identity (1): rounding of a well-conditioned matrix of order six stays a
/// million times below it, that of a singular one is of order one.
const INVERSE_ROUNDING: f64 = 1e-9;

impl LinearMap {
    /// Returns the map that changes nothing, for `count` coordinates.
    #[must_use]
    pub fn identity(count: usize) -> Self {
        let mut matrix = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        (0..MAX_JOINTS).for_each(|k| matrix[k][k] = 1.0);
        Self { count: count.min(MAX_JOINTS), matrix, inverse: matrix, offset: JointVector::zeros(count) }
    }

    /// Returns `q = A m + b` with the `rows` of A and `offset` b, for `count` coordinates.
    ///
    /// # Errors
    /// When a length differs from `count`, or A has no inverse or is not finite.
    pub fn new(rows: &[JointVector], offset: &JointVector, count: usize) -> Result<Self, Error> {
        if count > MAX_JOINTS || rows.len() != count || offset.len() != count || rows.iter().any(|r| r.len() != count) {
            return Err(other_size(count));
        }
        let square = Mat::from_fn(count, count, |i, j| rows[i][j]);
        let inverted = square.partial_piv_lu().inverse();
        let product = &square * &inverted;
        let exact = |i: usize, j: usize| (product[(i, j)] - f64::from(u8::from(i == j))).abs() < INVERSE_ROUNDING;
        if !offset.is_finite() || !(0..count).all(|i| (0..count).all(|j| exact(i, j))) {
            return Err(
                "the map has no inverse: several of its rows say the same, so that a torque has no motor to go to"
                    .into(),
            );
        }
        let mut map = Self { offset: *offset, ..Self::identity(count) };
        for i in 0..count {
            for j in 0..count {
                (map.matrix[i][j], map.inverse[i][j]) = (square[(i, j)], inverted[(i, j)]);
            }
        }
        Ok(map)
    }

    /// Returns the same map with `offset` b.
    ///
    /// # Errors
    /// When it has another length than the map.
    pub fn moved(self, offset: &JointVector) -> Result<Self, Error> {
        if offset.len() == self.count { Ok(Self { offset: *offset, ..self }) } else { Err(other_size(self.count)) }
    }

    /// Returns `A m + b` of a measured position.
    #[must_use]
    pub fn position(&self, measured: &JointVector) -> JointVector {
        let mut position = self.product(|i, j| self.matrix[i][j], measured);
        position.iter_mut().zip(self.offset.iter()).for_each(|(position, offset)| *position += offset);
        position
    }

    /// Returns `A^-1 (q - b)`, what the device measures at the position `q`.
    #[must_use]
    pub fn measured(&self, position: &JointVector) -> JointVector {
        let mut moved = *position;
        moved.iter_mut().zip(self.offset.iter()).for_each(|(moved, offset)| *moved -= offset);
        self.product(|i, j| self.inverse[i][j], &moved)
    }

    /// Returns `A^T tau`, the device's efforts for the scene's.
    #[must_use]
    pub fn effort(&self, torque: &JointVector) -> JointVector {
        self.product(|i, j| self.matrix[j][i], torque)
    }

    /// Returns `A^-T tau_m`, the scene's efforts for the device's.
    #[must_use]
    pub fn torque(&self, effort: &JointVector) -> JointVector {
        self.product(|i, j| self.inverse[j][i], effort)
    }

    /// The product of the matrix with these entries and `vector`.
    fn product(&self, entry: impl Fn(usize, usize) -> f64, vector: &JointVector) -> JointVector {
        let mut product = JointVector::zeros(self.count);
        for (i, product) in product.iter_mut().enumerate() {
            *product = (0..self.count).map(|j| entry(i, j) * vector[j]).sum();
        }
        product
    }
}

fn other_size(count: usize) -> Error {
    error!(
        "map and offset must have {} of {}, one for each coordinate of the device",
        counted(count, ["row", "rows"]),
        counted(count, ["number", "numbers"])
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vector(values: &[f64]) -> JointVector {
        JointVector::from_slice(values)
    }

    #[test]
    fn a_parallelogram_s_torques_do_the_same_work_in_both_coordinates() {
        // The third motor measures its link against the ground.
        let rows = [vector(&[1.0, 0.0, 0.0]), vector(&[0.0, 1.0, 0.0]), vector(&[0.0, -1.0, 1.0])];
        let map = LinearMap::new(&rows, &vector(&[0.1, 0.2, 0.3]), 3).unwrap();
        let (from, to) = (vector(&[0.3, -0.2, 0.9]), vector(&[0.31, -0.25, 1.0]));
        let tau = vector(&[0.5, -0.4, 0.7]);
        let moved = |from: &JointVector, to: &JointVector, tau: &JointVector| {
            (0..3).map(|a| (to[a] - from[a]) * tau[a]).sum::<f64>()
        };
        let scene = moved(&map.position(&from), &map.position(&to), &tau);
        let device = moved(&from, &to, &map.effort(&tau));
        assert!((scene - device).abs() < 1e-15, "{scene} {device}");
        let back = map.torque(&map.effort(&tau));
        assert!((0..3).all(|a| (back[a] - tau[a]).abs() < 1e-15), "{back:?}");
        assert_eq!(*map.effort(&vector(&[0.0, 0.0, 1.0])), [0.0, -1.0, 1.0]);
    }

    #[test]
    fn maps_without_an_inverse_or_of_another_size_are_refused() {
        let refusal =
            |rows: &[JointVector], count| LinearMap::new(rows, &vector(&[0.0; 2]), count).unwrap_err().to_string();
        let rows = [vector(&[1.0, 2.0]), vector(&[2.0, 4.0])];
        assert!(refusal(&rows, 2).contains("no inverse"));
        let rows = [vector(&[1.0, f64::NAN]), vector(&[2.0, 4.0])];
        assert!(refusal(&rows, 2).contains("no inverse"));
        assert!(refusal(&rows, 3).contains("3 rows of 3 numbers"));
        assert_eq!(LinearMap::new(&[], &vector(&[]), 0), Ok(LinearMap::identity(0)));
    }
}
