//! The tensor product of cubic Hermite polynomials over a grid: C1, exact in values and gradients at the grid points.
//!
//! In one dimension, with f and its derivative g at both ends of a cell of length h and x the fraction of the cell,
//! `f(x) = f_0 (1 - 3x^2 + 2x^3) + g_0 h (x - 2x^2 + x^3) + f_1 (3x^2 - 2x^3) + g_1 h (x^3 - x^2)`. In d dimensions the
//! product of these, axis by axis: each grid point has 2^d numbers, the derivatives once or not at all along each axis,
//! numbered by the set of axes (bit a for axis a), and each cell 4^d. Lengths are in steps of the grid, so that all of
//! them have the unit of f.
//!
//! A cell is evaluated axis by axis, the last first: each contraction leaves a quarter of the numbers. Beside the
//! value, one gradient entry an axis joins the contraction where its axis is the one contracted: about 4^d sums of four
//! products in all. Nothing allocates, nothing branches.

use super::bernstein::{Bernstein, Bounds, place};
use crate::{
    JointVector,
    dataset::{Grid, Stencil},
    store::basis,
};

/// An interpolated function.
pub(super) struct Hermite {
    joints: usize,
    /// 1 / h along each axis (1/rad or 1/m).
    per_step: JointVector,
    /// 2^d numbers a grid point.
    derivatives: Vec<f64>,
}

impl Hermite {
    /// Returns the memory of the polynomials on `grid` (bytes).
    pub fn bytes(grid: &Grid) -> usize {
        grid.points().saturating_mul(size_of::<f64>() << grid.joints())
    }

    /// The function with `values` and gradients `slopes` at the points of `grid`, and the second derivative along
    /// axes a and b that `mixed` gives for (point, a, b), where it gives one.
    ///
    /// All other mixed derivatives are differences of those of one order less: central ones, one-sided at the rim, and
    /// the mean over the axis that comes last.
    pub fn new(
        grid: &Grid,
        values: &[f64],
        slopes: &[JointVector],
        mixed: impl Fn(usize, usize, usize) -> Option<f64>,
    ) -> Self {
        let joints = grid.joints();
        let sets = 1_usize << joints;
        let mut per_step = JointVector::zeros(joints);
        per_step.iter_mut().zip(&grid.axes).for_each(|(inverse, axis)| *inverse = 1.0 / axis.step);
        let mut derivatives = vec![0.0; values.len() * sets];
        for ((record, &value), slopes) in derivatives.chunks_exact_mut(sets).zip(values).zip(slopes) {
            record[0] = value;
            for (a, (slope, inverse)) in slopes.iter().zip(per_step.iter()).enumerate() {
                record[1 << a] = slope / inverse;
            }
        }
        // A set without one of its axes has a smaller number: it is done before.
        for set in (0..sets).filter(|set: &usize| set.count_ones() > 1) {
            let pair = (set.count_ones() == 2).then(|| [set.trailing_zeros() as usize, set.ilog2() as usize]);
            for point in 0..values.len() {
                if let Some([a, b]) = pair
                    && let Some(second) = mixed(point, a, b)
                {
                    derivatives[point * sets + set] = second / (per_step[a] * per_step[b]);
                    continue;
                }
                let mut sum = 0.0;
                for a in (0..joints).filter(|a| set >> a & 1 == 1) {
                    let [before, after] = grid.beside(point, a);
                    let apart = f64::from(u8::from(before.is_some()) + u8::from(after.is_some()));
                    let at = |p: Option<usize>| derivatives[p.unwrap_or(point) * sets + (set ^ 1 << a)];
                    sum += if apart > 0.0 { (at(after) - at(before)) / apart } else { 0.0 };
                }
                derivatives[point * sets + set] = sum / f64::from(set.count_ones());
            }
        }
        Self { joints, per_step, derivatives }
    }

    /// The function at grid point `point`.
    pub fn value(&self, point: usize) -> f64 {
        self.derivatives[point << self.joints]
    }

    /// Bounds on the function and its derivatives over the cell whose first corner is `point`, `None` where no cell
    /// begins there.
    pub fn bounds(&self, grid: &Grid, point: usize) -> Option<Bounds> {
        let joints = self.joints;
        // An axis of one point has no extent: the cell is flat there.
        let mut corners = vec![point];
        let mut per_step = self.per_step;
        for (a, (axis, per_step)) in grid.axes.iter().zip(per_step.iter_mut()).enumerate() {
            let after = grid.beside(point, a)[1];
            if axis.count > 1 && after.is_none() {
                return None;
            }
            if axis.count == 1 {
                *per_step = 0.0;
            }
            let beyond = after.unwrap_or(point) - point;
            let far: Vec<usize> = corners.iter().map(|corner| corner + beyond).collect();
            corners.extend(far);
        }
        let mut numbers = vec![0.0; 1 << (2 * joints)];
        for (side, corner) in corners.iter().enumerate() {
            for set in 0..1 << joints {
                numbers[place(joints, side, set)] = self.derivatives[(corner << joints) + set];
            }
        }
        Some(Bernstein::hermite(joints, numbers).bounds(&per_step))
    }

    /// The function and its gradient in the cell of `stencil`. `N = 4^(D-1)`.
    pub fn at<const D: usize, const N: usize>(&self, stencil: &Stencil) -> (f64, [f64; D]) {
        let mut value = [0.0; N];
        let mut slopes = [[0.0; N]; D];
        let corner = |c: usize| &self.derivatives[stencil.points[c] << D..(stencil.points[c] + 1) << D];
        // The last axis, straight from the records.
        let mut half = 1 << (D - 1);
        let [weights, rates] = basis(stencil.fractions[D - 1]);
        for c in 0..half {
            let (near, far) = (corner(c).split_at(half), corner(c + half).split_at(half));
            let row = c * half..(c + 1) * half;
            let (value, slope) = (&mut value[row.clone()], &mut slopes[D - 1][row]);
            for s in 0..half {
                let four = [near.0[s], near.1[s], far.0[s], far.1[s]];
                value[s] = dot(&weights, &four);
                slope[s] = dot(&rates, &four);
            }
        }
        for axis in (0..D - 1).rev() {
            half /= 2;
            let [weights, rates] = basis(stencil.fractions[axis]);
            contract(&value, &mut slopes[axis], half, &rates);
            contract_in_place(&mut value, half, &weights);
            for slope in &mut slopes[axis + 1..] {
                contract_in_place(slope, half, &weights);
            }
        }
        let mut gradient = [0.0; D];
        for ((entry, slope), inverse) in gradient.iter_mut().zip(&slopes).zip(self.per_step.iter()) {
            *entry = slope[0] * inverse;
        }
        (value[0], gradient)
    }
}

fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

/// From rows of `2 half` numbers for `2 half` corners to rows of `half` for `half` corners. A row's second half are the
/// derivatives along the axis contracted; the second half of the corners are those beyond.
fn contract<const N: usize>(from: &[f64; N], to: &mut [f64; N], half: usize, weights: &[f64; 4]) {
    for c in 0..half {
        let near = from[2 * half * c..2 * half * (c + 1)].split_at(half);
        let far = from[2 * half * (c + half)..2 * half * (c + half + 1)].split_at(half);
        let to = &mut to[half * c..half * (c + 1)];
        for (s, to) in to.iter_mut().enumerate() {
            *to = dot(weights, &[near.0[s], near.1[s], far.0[s], far.1[s]]);
        }
    }
}

/// [`contract`] onto itself: a row is written where no later one is read.
fn contract_in_place<const N: usize>(numbers: &mut [f64; N], half: usize, weights: &[f64; 4]) {
    for c in 0..half {
        let (near, far) = (2 * half * c, 2 * half * (c + half));
        for s in 0..half {
            let four = [numbers[near + s], numbers[near + half + s], numbers[far + s], numbers[far + half + s]];
            numbers[half * c + s] = dot(weights, &four);
        }
    }
}
