//! Polynomials over one cell of a grid in Bernstein form: they lie between their least and greatest coefficient, and
//! the coefficients of their derivatives are differences of their own (Farin 2002, Curves and Surfaces for CAGD,
//! sections 5.3 and 6.3).
//!
//! The tensor product of cubics has `4^d` coefficients: digit a of a coefficient's place, to base 4, is its number along
//! axis a.

use super::stiffness::Stiffness;
use crate::{JointMatrix, JointVector, store::record::sets};

/// Degree along each axis.
const DEGREE: usize = 3;

/// A polynomial over one cell.
#[derive(Clone)]
pub(super) struct Bernstein {
    joints: usize,
    coefficients: Vec<f64>,
}

/// The place, of `4^joints`, of the number of Hermite interpolation that is derived along the axes in `set`, at the
/// corner on `side`: digit a, to base 4, is twice the side along axis a, and one more for the derivative along it.
fn place(joints: usize, side: usize, set: usize) -> usize {
    (0..joints).map(|a| (2 * (side >> a & 1) + (set >> a & 1)) << (2 * a)).sum()
}

/// Bounds over one cell.
pub(super) struct Bounds {
    /// The function is nowhere greater.
    pub greatest: f64,
    /// The size of the derivative along each axis is nowhere greater.
    pub first: JointVector,
    /// Nor that of the second derivatives along each pair of axes.
    pub second: JointMatrix,
}

impl Bounds {
    /// Bounds of the stiffness of `U = w^2 / 2`, w the function where it is positive, relative to `slopes`:
    /// `d^2 U / dq_a dq_b = w_a w_b + w w_ab`, each factor by its bound.
    pub fn stiffness(&self, slopes: &JointVector) -> Stiffness {
        Stiffness::new(slopes, |a, b| self.first[a] * self.first[b] + self.greatest * self.second[a][b])
    }
}

impl Bernstein {
    /// The cubic Hermite interpolant of the `numbers` of a cell's corners, kind by kind ([`crate::store::record`]),
    /// lengths in steps of the cell. Those of the kinds that there are not are zero.
    pub fn hermite(joints: usize, numbers: &[f64]) -> Self {
        let mut cell = Self { joints, coefficients: vec![0.0; 1 << (2 * joints)] };
        for (set, numbers) in sets(joints).zip(numbers.chunks_exact(1 << joints)) {
            for (side, number) in numbers.iter().enumerate() {
                cell.coefficients[place(joints, side, set)] = *number;
            }
        }
        for axis in 0..joints {
            cell.along(axis, |line| {
                line[1] = line[0] + line[1] / 3.0;
                line[2..].swap(0, 1);
                line[2] = line[3] - line[2] / 3.0;
            });
        }
        cell
    }

    /// Adds `other`, of the same degree over the same cell.
    pub fn add(&mut self, other: &Self) {
        self.coefficients.iter_mut().zip(&other.coefficients).for_each(|(sum, x)| *sum += x);
    }

    /// The same polynomial over the part of the cell that lies, along each axis, in the half that bit a of `side` says.
    pub fn half(&self, side: usize) -> Self {
        let mut cell = self.clone();
        for axis in 0..self.joints {
            let upper = side >> axis & 1 == 1;
            // De Casteljau's algorithm in the middle: what is done with leaves the line at one end.
            cell.along(axis, |line| {
                let last = line.len() - 1;
                for round in 0..last {
                    if upper {
                        (0..last - round).for_each(|k| line[k] = 0.5 * (line[k] + line[k + 1]));
                    } else {
                        (round..last).rev().for_each(|k| line[k + 1] = 0.5 * (line[k] + line[k + 1]));
                    }
                }
            });
        }
        cell
    }

    /// The function is nowhere greater.
    pub fn greatest(&self) -> f64 {
        self.coefficients.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Bounds over the cell, of which there are `per_step` (1/rad or 1/m) in a unit of each joint; zero along an axis
    /// without extent.
    pub fn bounds(&self, per_step: &JointVector) -> Bounds {
        let (joints, n) = (self.joints, DEGREE as f64);
        let stride = |axis: usize| (DEGREE + 1).pow(axis as u32);
        let mut bounds =
            Bounds { greatest: self.greatest(), first: JointVector::zeros(joints), second: JointMatrix::default() };
        let (mut along, mut twice) = (Vec::new(), Vec::new());
        for a in 0..joints {
            differences(&self.coefficients, DEGREE + 1, stride(a), &mut along);
            let rate = n * per_step[a];
            bounds.first[a] = rate * size(&along);
            differences(&along, DEGREE, stride(a), &mut twice);
            bounds.second[a][a] = (n - 1.0) * per_step[a] * rate * size(&twice);
            for b in 0..a {
                differences(&along, DEGREE + 1, stride(b), &mut twice);
                let both = rate * n * per_step[b] * size(&twice);
                (bounds.second[a][b], bounds.second[b][a]) = (both, both);
            }
        }
        bounds
    }

    /// Changes the coefficients of each line along `axis`.
    fn along(&mut self, axis: usize, change: impl Fn(&mut [f64])) {
        let count = DEGREE + 1;
        let stride = count.pow(axis as u32);
        let mut line = [0.0; 4];
        for block in self.coefficients.chunks_exact_mut(count * stride) {
            for k in 0..stride {
                (0..count).for_each(|digit| line[digit] = block[k + digit * stride]);
                change(&mut line[..count]);
                (0..count).for_each(|digit| block[k + digit * stride] = line[digit]);
            }
        }
    }
}

/// Differences of neighbours along an axis with `count` of them, `stride` apart: one fewer.
fn differences(of: &[f64], count: usize, stride: usize, into: &mut Vec<f64>) {
    into.clear();
    for line in of.chunks_exact(count * stride) {
        into.extend(line.iter().zip(&line[stride..]).map(|(low, high)| high - low));
    }
}

/// The greatest size of `numbers`: in lanes, which processors compare at once.
fn size(numbers: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    for chunk in numbers.chunks(lanes.len()) {
        for (most, x) in lanes.iter_mut().zip(chunk) {
            *most = if x.abs() > *most { x.abs() } else { *most };
        }
    }
    lanes.into_iter().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Value at fractions of the cell, by its definition.
    fn value(of: &Bernstein, at: &[f64]) -> f64 {
        let mut left = of.coefficients.clone();
        for x in at {
            let next = left.chunks_exact(DEGREE + 1).map(|line| {
                let mut line = line.to_vec();
                for last in (1..line.len()).rev() {
                    (0..last).for_each(|k| line[k] += x * (line[k + 1] - line[k]));
                }
                line[0]
            });
            left = next.collect();
        }
        left[0]
    }

    #[test]
    fn a_half_is_the_same_polynomial_and_bounds_hold() {
        let number = |k: usize| ((k * k + 7) as f64 * 0.37).sin();
        let cubic = Bernstein::hermite(2, &(0..16).map(number).collect::<Vec<_>>());
        // At the corners the values that it was made from.
        assert!((value(&cubic, &[1.0, 0.0]) - number(1)).abs() < 1e-14);
        assert!((value(&cubic, &[0.0, 1.0]) - number(2)).abs() < 1e-14);
        let steps = JointVector::from_slice(&[4.0, 2.0]);
        for side in 0..4 {
            let part = cubic.half(side);
            let bounds = part.bounds(&steps);
            for (x, y) in (0..6).flat_map(|i| (0..6).map(move |j| (f64::from(i) / 5.0, f64::from(j) / 5.0))) {
                let found = value(&part, &[x, y]);
                let into = [(x + (side & 1) as f64) / 2.0, (y + (side >> 1) as f64) / 2.0];
                assert!((found - value(&cubic, &into)).abs() < 1e-14);
                assert!(found <= bounds.greatest);
                let h = 1e-4;
                let at = |i: f64, j: f64| value(&part, &[x + i * h, y + j * h]);
                let along = 4.0 * (at(1.0, 0.0) - at(-1.0, 0.0)) / (2.0 * h);
                let both = 8.0 * (at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0)) / (4.0 * h * h);
                let twice = 16.0 * (at(1.0, 0.0) - 2.0 * found + at(-1.0, 0.0)) / (h * h);
                // Differences leave the cell by a ten thousandth, and their rounding is as large.
                let slack = 1e-2;
                assert!(along.abs() <= bounds.first[0] + slack);
                assert!(both.abs() <= bounds.second[0][1] + slack && twice.abs() <= bounds.second[0][0] + slack);
            }
        }
    }
}
