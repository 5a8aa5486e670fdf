//! Which matrices are inertias.

use glam::DMat3;

/// Least principal minor of an inertia over its trace, that many factors: scenes and robot files give five digits or
/// more, and what is below zero by that much stays below the actuators' reflected inertia.
const INERTIA_ROUNDING: f64 = 1e-5;

/// Returns whether `inertia` is symmetric and positive semidefinite up to the rounding of its numbers, by its principal
/// minors.
pub(crate) fn is_positive_semidefinite(inertia: &DMat3) -> bool {
    let trace = inertia.x_axis.x + inertia.y_axis.y + inertia.z_axis.z;
    if *inertia == DMat3::ZERO {
        return true;
    }
    let unit = *inertia * trace.recip();
    let [xx, yy, zz] = [unit.x_axis.x, unit.y_axis.y, unit.z_axis.z];
    let [xy, xz, yz] = [unit.y_axis.x, unit.z_axis.x, unit.z_axis.y];
    let minors = [xx, yy, zz, xx * yy - xy * xy, xx * zz - xz * xz, yy * zz - yz * yz, unit.determinant()];
    *inertia == inertia.transpose() && trace > 0.0 && minors.into_iter().all(|minor| minor >= -INERTIA_ROUNDING)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn rods_and_boxes_are_bodies_and_indefinite_matrices_are_not() {
        let turned = |moments: [f64; 3]| {
            let rotation = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
            let inertia = rotation * DMat3::from_diagonal(DVec3::from_array(moments)) * rotation.transpose();
            0.5 * (inertia + inertia.transpose())
        };
        for moments in [[0.0; 3], [0.0, 1e-4, 1e-4], [1e-9, 2e-9, 3e-9], [1e6, 2e6, 2.5e6]] {
            assert!(is_positive_semidefinite(&turned(moments)), "{moments:?}");
        }
        for moments in [[-1e-3, 1.0, 1.0], [1.0, -0.1, -0.1], [-1.0, -1.0, -1.0]] {
            assert!(!is_positive_semidefinite(&turned(moments)), "{moments:?}");
        }
        assert!(!is_positive_semidefinite(&DMat3::from_diagonal(DVec3::new(f64::NAN, 1.0, 1.0))));
        assert!(!is_positive_semidefinite(&DMat3::from_cols_array(&[1.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])));
    }
}
