//! The numbers of a node: a function w, its gradient and its mixed second derivatives.
//!
//! They are ordered by axis: those that belong to the first a axes alone are the first [`width`]`(a)`. Axis a adds
//! `w_a` and then `w_ab` for all b < a. Second derivatives along one axis are not among them: Hermite interpolation
//! does not use them.

use crate::{MAX_AXES, contact::Slip, joint_matrix};

/// Numbers of a node of `joints` joints: 1, 2, 4, 7, 11, 16, 22.
#[must_use]
pub const fn width(joints: usize) -> usize {
    1 + joints * (joints + 1) / 2
}

/// Most numbers that a node has.
pub const MAX_WIDTH: usize = width(MAX_AXES);

/// Position of `w_a`.
#[must_use]
pub const fn slope(a: usize) -> usize {
    width(a)
}

/// Position of `w_ab`, b < a.
#[must_use]
pub const fn mixed(a: usize, b: usize) -> usize {
    width(a) + 1 + b
}

/// The axes along which each number is derived, as a set of bits, in their order.
pub fn sets(joints: usize) -> impl Iterator<Item = usize> {
    let of_axis = |a: usize| std::iter::once(1 << a).chain((0..a).map(move |b| 1 << a | 1 << b));
    std::iter::once(0).chain((0..joints).flat_map(of_axis))
}

/// The numbers of a node of `joints` joints that say how its contacts slip, as many as [`width`]: the normal force over
/// w, and the lower triangle of the slip Jacobian. The ratio is smooth through the boundary of contact, where both end.
#[must_use]
pub fn slip_of(slip: &Slip, root: f64, joints: usize) -> Vec<f64> {
    std::iter::once(slip.normal_force / root).chain(joint_matrix::lower(&slip.jacobian, joints)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_axis_adds_its_own_numbers_behind_those_before() {
        assert_eq!([0, 1, 2, 3, 4, 5, 6].map(width), [1, 2, 4, 7, 11, 16, 22]);
        let sets: Vec<usize> = sets(MAX_AXES).collect();
        assert_eq!(sets.len(), MAX_WIDTH);
        for a in 0..MAX_AXES {
            assert_eq!(sets[slope(a)], 1 << a);
            for b in 0..a {
                assert_eq!(sets[mixed(a, b)], 1 << a | 1 << b);
            }
            assert!(sets[..width(a)].iter().all(|set| set >> a == 0));
        }
    }
}
