//! The interpolant of one cell, from the numbers at its 2^d corners.
//!
//! A corner's number says by bit a on which side of the cell it lies along axis a. Numbers are kept kind by kind,
//! corners side by side: to contract the last axis is to combine the second half of the corners with the first, which
//! the compiler does several at a time. Lengths are in steps of the cell. Nothing allocates, nothing branches on data.
//!
//! *Hermite.* In one dimension `f(x) = f_0 (1 - 3x^2 + 2x^3) + g_0 (x - 2x^2 + x^3) + f_1 (3x^2 - 2x^3) + g_1 (x^3 -
//! x^2)`; in d dimensions the product, axis by axis, of which a corner has the value, the d slopes and the mixed second
//! derivatives: all derivatives of higher order are zero there. Contracting axis a turns the numbers of the first a + 1
//! axes (see [`super::record`]) into those of the first a at half as many corners. Six joints take some 5,000
//! multiplications, three 250.

use super::record::{MAX_WIDTH, mixed, sets, slope, width};
use crate::MAX_AXES;

/// Numbers that the derivatives along `joints` axes take before they are contracted: axis a has `2^a width(a)`.
pub(super) const fn rates(joints: usize) -> usize {
    let (mut sum, mut a) = (0, 0);
    while a < joints {
        sum += width(a) << a;
        a += 1;
    }
    sum
}

/// Weights of f_0, g_0, f_1, g_1 at fraction `x` of a cell, and their derivatives by x.
#[inline(always)]
fn basis(x: f64) -> [[f64; 4]; 2] {
    let far = x * x * (3.0 - 2.0 * x);
    let rate = 6.0 * x * (1.0 - x);
    let weights = [1.0 - far, x * (1.0 - x) * (1.0 - x), far, x * x * (x - 1.0)];
    [weights, [-rate, (1.0 - x) * (1.0 - 3.0 * x), rate, x * (3.0 * x - 2.0)]]
}

/// The Hermite interpolant and its gradient. `C = 2^D`, `W = width(D)`, `R = rates(D)`. The numbers are overwritten.
pub(super) fn hermite<const D: usize, const C: usize, const W: usize, const R: usize>(
    numbers: &mut [[f64; C]; W],
    fractions: &[f64; MAX_AXES],
) -> (f64, [f64; D]) {
    let mut derived = [0.0; R];
    let numbers = numbers.as_flattened_mut();
    for axis in (0..D).rev() {
        let both = basis(fractions[axis]);
        contract_both(numbers, C, &mut derived[rates(axis)..], axis, &both);
        for above in axis + 1..D {
            contract(&mut derived[rates(above)..], 1 << above, axis, &both[0]);
        }
    }
    (numbers[0], std::array::from_fn(|axis| derived[rates(axis)]))
}

/// Calls a function of the corners left after `axis` is contracted, a constant, so that its loops are unrolled.
macro_rules! with_half {
    ($axis:expr, $function:ident ( $($argument:expr),* )) => {
        match $axis {
            0 => $function::<1>($($argument),*),
            1 => $function::<2>($($argument),*),
            2 => $function::<4>($($argument),*),
            3 => $function::<8>($($argument),*),
            4 => $function::<16>($($argument),*),
            _ => $function::<32>($($argument),*),
        }
    };
}

/// Contracts `axis`, the last one left, of `numbers`, `stride` a kind.
#[inline(always)]
fn contract(numbers: &mut [f64], stride: usize, axis: usize, weights: &[f64; 4]) {
    with_half!(axis, contract_half(numbers, stride, axis, weights));
}

/// [`contract`] with the first four weights, and with the others into `to`, `2^axis` a kind.
#[inline(always)]
fn contract_both(numbers: &mut [f64], stride: usize, to: &mut [f64], axis: usize, both: &[[f64; 4]; 2]) {
    with_half!(axis, contract_half_both(numbers, stride, to, axis, both));
}

#[inline(always)]
fn contract_half<const HALF: usize>(numbers: &mut [f64], stride: usize, axis: usize, weights: &[f64; 4]) {
    let &[near, rise, far, fall] = weights;
    let mut with_slope = |set: usize, along: usize| {
        let (own, slopes) = numbers.split_at_mut(along * stride);
        let (own, beyond) = own[set * stride..][..2 * HALF].split_at_mut(HALF);
        let (slopes, slopes_beyond) = slopes[..2 * HALF].split_at(HALF);
        for (((own, beyond), slope), slope_beyond) in own.iter_mut().zip(beyond).zip(slopes).zip(slopes_beyond) {
            *own = near * *own + rise * slope + far * *beyond + fall * slope_beyond;
        }
    };
    with_slope(0, slope(axis));
    (0..axis).for_each(|b| with_slope(slope(b), mixed(axis, b)));
    for set in (0..axis).flat_map(|b| (0..b).map(move |c| mixed(b, c))) {
        let (own, beyond) = numbers[set * stride..][..2 * HALF].split_at_mut(HALF);
        own.iter_mut().zip(beyond).for_each(|(own, beyond)| *own = near * *own + far * *beyond);
    }
}

#[inline(always)]
fn contract_half_both<const HALF: usize>(
    numbers: &mut [f64],
    stride: usize,
    to: &mut [f64],
    axis: usize,
    [weights, rates]: &[[f64; 4]; 2],
) {
    let mut with_slope = |set: usize, along: usize| {
        let (own, slopes) = numbers.split_at_mut(along * stride);
        let (own, beyond) = own[set * stride..][..2 * HALF].split_at_mut(HALF);
        let (slopes, slopes_beyond) = slopes[..2 * HALF].split_at(HALF);
        let to = to[set * HALF..][..HALF].iter_mut().zip(own).zip(beyond).zip(slopes).zip(slopes_beyond);
        for ((((to, own), beyond), slope), slope_beyond) in to {
            let sum =
                |[near, rise, far, fall]: &[f64; 4]| near * *own + rise * slope + far * *beyond + fall * slope_beyond;
            (*to, *own) = (sum(rates), sum(weights));
        }
    };
    with_slope(0, slope(axis));
    (0..axis).for_each(|b| with_slope(slope(b), mixed(axis, b)));
    for set in (0..axis).flat_map(|b| (0..b).map(move |c| mixed(b, c))) {
        let (own, beyond) = numbers[set * stride..][..2 * HALF].split_at_mut(HALF);
        let to = to[set * HALF..][..HALF].iter_mut().zip(own).zip(beyond);
        for ((to, own), beyond) in to {
            (*to, *own) = (rates[0] * *own + rates[2] * *beyond, weights[0] * *own + weights[2] * *beyond);
        }
    }
}

/// Weight that each number of a corner on `side` has in each number of a node at `fractions` of its cell, in steps of
/// the cell: entry `[to][from]`. `None` where all are zero.
pub(super) fn transfer(
    joints: usize,
    side: usize,
    fractions: &[f64; MAX_AXES],
) -> Option<[[f64; MAX_WIDTH]; MAX_WIDTH]> {
    let mut factors = [[[0.0; 2]; 2]; MAX_AXES];
    for (axis, factors) in factors.iter_mut().enumerate().take(joints) {
        let both = basis(fractions[axis]);
        let first = 2 * (side >> axis & 1);
        *factors = [0, 1].map(|to: usize| [0, 1].map(|from: usize| both[to][first + from]));
        if factors.as_flattened().iter().all(|factor| *factor == 0.0) {
            return None;
        }
    }
    let mut weights = [[0.0; MAX_WIDTH]; MAX_WIDTH];
    for (weights, to) in weights.iter_mut().zip(sets(joints)) {
        for (weight, from) in weights.iter_mut().zip(sets(joints)) {
            *weight = (0..joints).map(|axis| factors[axis][to >> axis & 1][from >> axis & 1]).product();
        }
    }
    Some(weights)
}
