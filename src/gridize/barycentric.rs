//! Barycentric weights in a simplex: sum w_i x_i = x, sum w_i = 1.
//!
//! Solved by elimination with full pivoting, whose residual stays at rounding level however thin the simplex is: the
//! weights of a sliver are ill-conditioned, the position that they reproduce is not.
//!
//! A triangulation of jittered points is looked up at jittered corners. [`corrected`] then moves the weights by the
//! least that the true corners ask for, leaving out directions in which those span nothing (a sliver made of four
//! points in a plane), so that a torque linear in q is reproduced exactly there too.

use super::cloud::Position;
use crate::MAX_AXES;

/// Pivot below which the corners of a simplex span nothing in a direction, as a fraction of the extent: between the
/// jitter (1e-7 and less), which makes slivers of points in a plane, and the thickness of honest simplices.
const SLIVER_PIVOT: f64 = 1e-5;

/// Weights of the vertices of a simplex, in their order; entries beyond d + 1 are zero.
pub(super) type Weights = [f64; MAX_AXES + 1];

/// Rows of a linear system, right-hand side in column d.
type Rows = [[f64; MAX_AXES + 1]; MAX_AXES];

/// Weights at `at` of the simplex of d + 1 `corners`; `None` when the corners span nothing.
pub(super) fn barycentric(corners: &[&Position], at: &Position) -> Option<Weights> {
    let joints = corners.len() - 1;
    let (solution, rank) = eliminate(system(corners, at), joints, f64::MIN_POSITIVE);
    let weights = completed(solution, joints);
    (rank == joints && weights.iter().all(|weight| weight.is_finite())).then_some(weights)
}

/// `weights` changed so that they reproduce `at` on `corners` as far as these span it, and the rank of their span.
pub(super) fn corrected(mut weights: Weights, corners: &[&Position], at: &Position) -> (Weights, usize) {
    let joints = corners.len() - 1;
    let mut missing = *corners[joints];
    for axis in 0..joints {
        let reproduced: f64 = corners.iter().zip(weights).map(|(corner, w)| corner[axis] * w).sum();
        missing[axis] += at[axis] - reproduced;
    }
    let (change, rank) = eliminate(system(corners, &missing), joints, SLIVER_PIVOT);
    for (weight, change) in weights.iter_mut().zip(change).take(joints) {
        *weight += change;
    }
    weights[joints] -= change.iter().sum::<f64>();
    (weights, rank)
}

/// Edges from the last corner as columns, the position relative to it as right-hand side.
fn system(corners: &[&Position], at: &Position) -> Rows {
    let joints = corners.len() - 1;
    let base = corners[joints];
    let mut rows = [[0.0; MAX_AXES + 1]; MAX_AXES];
    for axis in 0..joints {
        for column in 0..joints {
            rows[axis][column] = corners[column][axis] - base[axis];
        }
        rows[axis][joints] = at[axis] - base[axis];
    }
    rows
}

/// The last weight is what the others leave of one.
fn completed(solution: [f64; MAX_AXES], joints: usize) -> Weights {
    let mut weights = [0.0; MAX_AXES + 1];
    weights[..joints].copy_from_slice(&solution[..joints]);
    weights[joints] = 1.0 - solution.iter().sum::<f64>();
    weights
}

/// Gaussian elimination with full pivoting that stops at pivots below `smallest`: solution, zero where it stopped, and
/// rank.
fn eliminate(mut rows: Rows, joints: usize, smallest: f64) -> ([f64; MAX_AXES], usize) {
    let mut order: [usize; MAX_AXES] = std::array::from_fn(|column| column);
    let mut rank = 0;
    while rank < joints {
        let (mut pivot, mut largest) = ((rank, rank), 0.0);
        for (row, entries) in rows.iter().enumerate().take(joints).skip(rank) {
            for (column, entry) in entries.iter().enumerate().take(joints).skip(rank) {
                if entry.abs() > largest {
                    (pivot, largest) = ((row, column), entry.abs());
                }
            }
        }
        if largest < smallest {
            break;
        }
        rows.swap(rank, pivot.0);
        order.swap(rank, pivot.1);
        for row in &mut rows[..joints] {
            row.swap(rank, pivot.1);
        }
        let pivot_row = rows[rank];
        for row in &mut rows[rank + 1..joints] {
            let factor = row[rank] / pivot_row[rank];
            for column in rank..=joints {
                row[column] -= factor * pivot_row[column];
            }
        }
        rank += 1;
    }
    let mut reduced = [0.0; MAX_AXES];
    for step in (0..rank).rev() {
        let known: f64 = (step + 1..rank).map(|column| rows[step][column] * reduced[column]).sum();
        reduced[step] = (rows[step][joints] - known) / rows[step][step];
    }
    let mut solution = [0.0; MAX_AXES];
    for (column, value) in order.into_iter().zip(reduced) {
        solution[column] = value;
    }
    (solution, rank)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAT: [Position; 4] = [
        [0.1, 0.2, 0.3, 0.0, 0.0, 0.0],
        [0.4, 0.25, 0.3, 0.0, 0.0, 0.0],
        [0.2, 0.6, 0.3, 0.0, 0.0, 0.0],
        [0.5, 0.7, 0.3, 0.0, 0.0, 0.0],
    ];

    fn reproduced(corners: &[Position], weights: &Weights, axis: usize) -> f64 {
        corners.iter().zip(weights).map(|(corner, weight)| corner[axis] * weight).sum()
    }

    #[test]
    fn weights_reproduce_the_position_even_in_a_sliver() {
        for thickness in [1.0, 1e-6, 1e-12] {
            let mut corners = FLAT;
            corners[2][2] += thickness;
            let at = [0.3, 0.4, 0.3 + 0.25 * thickness, 0.0, 0.0, 0.0];
            let weights = barycentric(&corners.each_ref(), &at).unwrap();
            for (axis, x) in at.iter().enumerate().take(3) {
                assert!((reproduced(&corners, &weights, axis) - x).abs() < 1e-15, "thickness {thickness} axis {axis}");
            }
        }
    }

    #[test]
    fn weights_found_at_jittered_corners_are_corrected_to_the_true_ones_in_a_plane() {
        let mut moved = FLAT;
        for (corner, shift) in moved.iter_mut().zip([3e-8, 1e-8, 2e-8, -4e-8]) {
            corner[0] += shift;
            corner[2] += shift * shift * 1e8;
        }
        let at = [0.3, 0.4, 0.3, 0.0, 0.0, 0.0];
        let weights = barycentric(&moved.each_ref(), &at).unwrap();
        assert!((reproduced(&FLAT, &weights, 0) - at[0]).abs() > 1e-9);
        let (weights, rank) = corrected(weights, &FLAT.each_ref(), &at);
        assert_eq!(rank, 2);
        for (axis, x) in at.iter().enumerate().take(3) {
            assert!((reproduced(&FLAT, &weights, axis) - x).abs() < 1e-15, "axis {axis}");
        }
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn corners_in_one_plane_have_no_weights() {
        assert!(barycentric(&FLAT.each_ref(), &[0.3; MAX_AXES]).is_none());
    }
}
