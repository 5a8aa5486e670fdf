//! One number per joint, in an array of fixed capacity, so that the 1 kHz loop never allocates.

use std::ops::{Deref, DerefMut};

/// Most joints a virtual proxy may have.
pub const MAX_JOINTS: usize = 12;

/// Most axes of a grid in C-space: the cells of more have thousands of corners, whose 2^d numbers each are looked up in
/// a tick.
pub const MAX_AXES: usize = 6;

/// One number per joint: angles (rad) (or lengths (m) of prismatic joints), rates, or torques (N m) (forces (N)).
#[derive(Clone, Copy, Default, PartialEq)]
pub struct JointVector {
    len: usize,
    values: [f64; MAX_JOINTS],
}

impl JointVector {
    /// `len` zeros. Lengths over [`MAX_JOINTS`] are refused when the scene is read; here they are cut.
    #[must_use]
    pub fn zeros(len: usize) -> Self {
        Self { len: len.min(MAX_JOINTS), values: [0.0; MAX_JOINTS] }
    }

    /// The first [`MAX_JOINTS`] numbers of `values`.
    #[must_use]
    pub fn from_slice(values: &[f64]) -> Self {
        let mut vector = Self::zeros(values.len());
        let len = vector.len;
        vector.values[..len].copy_from_slice(&values[..len]);
        vector
    }

    /// The entries, then zeros.
    #[must_use]
    pub fn padded(&self) -> [f64; MAX_JOINTS] {
        self.values
    }

    /// Euclidean norm.
    #[must_use]
    pub fn norm(&self) -> f64 {
        self.dot(self).sqrt()
    }

    /// Inner product with a vector of the same length.
    #[must_use]
    pub fn dot(&self, other: &[f64]) -> f64 {
        self.iter().zip(other).map(|(a, b)| a * b).sum()
    }

    /// `factor` times the vector.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let mut scaled = *self;
        scaled.iter_mut().for_each(|entry| *entry *= factor);
        scaled
    }

    /// The same direction, no longer than `greatest`.
    #[must_use]
    pub fn shortened(&self, greatest: f64) -> Self {
        let mut shorter = *self;
        let square = self.dot(self);
        if square > greatest * greatest {
            let length = square.sqrt();
            shorter.iter_mut().for_each(|entry| *entry *= greatest / length);
        }
        shorter
    }

    /// True when every entry is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.iter().all(|x| x.is_finite())
    }
}

/// Numbers beyond [`MAX_JOINTS`] are cut.
impl FromIterator<f64> for JointVector {
    fn from_iter<I: IntoIterator<Item = f64>>(numbers: I) -> Self {
        let mut vector = Self::default();
        for (entry, number) in vector.values.iter_mut().zip(numbers) {
            (*entry, vector.len) = (number, vector.len + 1);
        }
        vector
    }
}

impl Deref for JointVector {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        &self.values[..self.len]
    }
}

impl DerefMut for JointVector {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.len]
    }
}

impl std::fmt::Debug for JointVector {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}
