//! A symmetric matrix over the joints, in an array of fixed capacity.

use crate::joint_vector::MAX_JOINTS;

/// One number per pair of joints, the same for (k, l) and (l, k): a tangent stiffness (N m/rad), an inertia (kg m^2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointMatrix {
    len: usize,
    rows: [[f64; MAX_JOINTS]; MAX_JOINTS],
}

impl JointMatrix {
    /// Zeros for `len` joints; more than [`MAX_JOINTS`] are cut.
    #[must_use]
    pub fn zeros(len: usize) -> Self {
        Self { len: len.min(MAX_JOINTS), rows: [[0.0; MAX_JOINTS]; MAX_JOINTS] }
    }

    /// Number of joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.len
    }

    /// Entry (k, l), both below [`MAX_JOINTS`].
    #[must_use]
    pub fn at(&self, k: usize, l: usize) -> f64 {
        self.rows[k][l]
    }

    /// Adds `value` to the entries (k, l) and (l, k), once where they are the same.
    pub fn add(&mut self, k: usize, l: usize, value: f64) {
        self.rows[k][l] += value;
        if k != l {
            self.rows[l][k] += value;
        }
    }

    /// Numbers that [`JointMatrix::lower`] yields for `joints` joints.
    #[must_use]
    pub fn entries(joints: usize) -> usize {
        joints * (joints + 1) / 2
    }

    /// The lower triangle, row by row: (0, 0), (1, 0), (1, 1), (2, 0) and so on.
    pub fn lower(&self) -> impl Iterator<Item = f64> {
        (0..self.len).flat_map(move |k| (0..=k).map(move |l| self.rows[k][l]))
    }

    /// True when every entry is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.lower().all(f64::is_finite)
    }
}
