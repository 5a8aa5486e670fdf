//! The linear complementarity problem of the stops: the v with `A v = r + f`, each v_a within its bounds, and f_a
//! zero inside, pushing inwards at a bound. A is positive definite, so that the solution is unique.
//!
//! Principal pivoting by one joint at a time, always the last that is wrong: it never comes to the same set of stops
//! twice (Murty 1974; with two bounds a variable Judice and Pires 1992). One pivot without a stop, in practice one more
//! for each stop that is reached.

use super::linear::solve_held;
use crate::{JointMatrix, JointVector, MAX_JOINTS};

/// Pull of a joint stop, relative to the terms that balance it, that is taken for rounding (1): the balance is a sum of
/// eight terms of a solution whose residual is a few times the order of the matrix, six, in machine precision.
const STOP_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Whether a coordinate of the solution lies at a bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Inside,
    Low,
    High,
}

/// v, and which bounds hold it.
pub(super) struct Solved {
    pub point: JointVector,
    pub side: [Side; MAX_JOINTS],
}

/// Sets of stops that can differ: 3 states for each of [`MAX_JOINTS`] coordinates.
const MAX_PIVOTS: usize = 3_usize.pow(MAX_JOINTS as u32);

pub(super) fn solve_in_box(matrix: &JointMatrix, right: &JointVector, low: &JointVector, high: &JointVector) -> Solved {
    let joints = right.len();
    let mut side = [Side::Inside; MAX_JOINTS];
    let mut at = JointVector::zeros(joints);
    let mut point = solve_held(matrix, right, &at, &[false; MAX_JOINTS]);
    for _ in 0..MAX_PIVOTS {
        let wrong = (0..joints).rev().find_map(|a| {
            let better = corrected(a, side[a], &point, matrix, right, low, high);
            (better != side[a]).then_some((a, better))
        });
        let Some((a, better)) = wrong else { break };
        side[a] = better;
        match better {
            Side::Low => at[a] = low[a],
            Side::High => at[a] = high[a],
            Side::Inside => {}
        }
        point = solve_held(matrix, right, &at, &side.map(|side| side != Side::Inside));
    }
    Solved { point, side }
}

/// Returns where coordinate `a` belongs, judged by `point` for the present sides.
fn corrected(
    a: usize,
    side: Side,
    point: &JointVector,
    matrix: &JointMatrix,
    right: &JointVector,
    low: &JointVector,
    high: &JointVector,
) -> Side {
    if side == Side::Inside {
        return if point[a] > high[a] {
            Side::High
        } else if point[a] < low[a] {
            Side::Low
        } else {
            Side::Inside
        };
    }
    let terms = || matrix[a].iter().zip(point.iter()).map(|(m, v)| m * v);
    let force = terms().sum::<f64>() - right[a];
    let rounding = STOP_ROUNDING * (terms().map(f64::abs).sum::<f64>() + right[a].abs());
    let pull = if side == Side::Low { -force } else { force };
    if pull > rounding { Side::Inside } else { side }
}
