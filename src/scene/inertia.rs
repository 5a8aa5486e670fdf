//! Which matrices are inertias of bodies.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

/// The most that rounding takes from an eigenvalue of an inertia, as a share of its trace: scenes and robot files
/// give five digits or more.
const INERTIA_ROUNDING: f64 = 1e-5;

/// Returns the inertia of a body that `inertia` is the rounding of (kg m^2): the matrix itself, or, where its least
/// eigenvalue is below zero by rounding, the matrix with its moments raised by as much. `None` if it is not symmetric,
/// or farther from positive semidefinite than rounding takes it: no body has that inertia.
pub(crate) fn positive_semidefinite(inertia: DMat3) -> Option<DMat3> {
    let trace = inertia.x_axis.x + inertia.y_axis.y + inertia.z_axis.z;
    if inertia == DMat3::ZERO {
        return Some(inertia);
    }
    if inertia != inertia.transpose() || !(trace > 0.0 && trace.is_finite()) {
        return None;
    }
    let least = trace * least_eigenvalue(&(inertia * trace.recip()));
    (least >= -INERTIA_ROUNDING * trace).then(|| inertia + DMat3::from_diagonal(DVec3::splat((-least).max(0.0))))
}

/// Least eigenvalue of a symmetric matrix, by the trigonometric solution of its characteristic equation (Smith 1961,
/// *Communications of the ACM* 4, 168).
fn least_eigenvalue(matrix: &DMat3) -> f64 {
    let mean = (matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z) / 3.0;
    let deviator = *matrix - DMat3::from_diagonal(DVec3::splat(mean));
    let squares = deviator.to_cols_array().map(|entry| entry * entry).iter().sum::<f64>();
    let radius = (squares / 6.0).sqrt();
    if radius == 0.0 {
        return mean;
    }
    let cosine = ((deviator * radius.recip()).determinant() / 2.0).clamp(-1.0, 1.0);
    mean + 2.0 * radius * ((cosine.acos() + TAU) / 3.0).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rods_and_boxes_are_bodies_and_indefinite_matrices_are_not() {
        let turned = |moments: [f64; 3]| {
            let rotation = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
            let inertia = rotation * DMat3::from_diagonal(DVec3::from_array(moments)) * rotation.transpose();
            0.5 * (inertia + inertia.transpose())
        };
        for moments in [[0.0; 3], [0.0, 1e-4, 1e-4], [1e-9, 2e-9, 3e-9], [1e6, 2e6, 2.5e6], [3.0, 3.0, 3.0]] {
            let (given, largest) = (turned(moments), moments[2]);
            let body = positive_semidefinite(given).expect("a body");
            let changed = (body - given).to_cols_array().map(f64::abs).into_iter().fold(0.0, f64::max);
            assert!(changed <= ROUNDING * largest, "{moments:?}: changed by {changed}");
        }
        for moments in [[-1e-3, 1.0, 1.0], [1.0, -0.1, -0.1], [-1.0, -1.0, -1.0]] {
            assert!(positive_semidefinite(turned(moments)).is_none(), "{moments:?}");
        }
        assert!(positive_semidefinite(DMat3::from_diagonal(DVec3::new(f64::NAN, 1.0, 1.0))).is_none());
        assert!(positive_semidefinite(DMat3::from_diagonal(DVec3::splat(f64::MAX))).is_none());
        let asymmetric = DMat3::from_cols_array(&[1.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        assert!(positive_semidefinite(asymmetric).is_none());
    }

    /// An eigenvalue that a file's digits push below zero is lifted, however small the other moments are: a small
    /// moment beside a large one would otherwise give a chain an inertia that is not positive definite.
    #[test]
    fn eigenvalues_below_zero_by_rounding_are_lifted() {
        let [xx, xy, yy, zz] = [2e-3, 0.1, 1e-3, 2e5];
        let given = DMat3::from_cols_array(&[xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, zz]);
        let least = 0.5 * (xx + yy) - (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        let body = positive_semidefinite(given).expect("a body within rounding");
        let lifted = body.x_axis.x - xx;
        assert!((lifted + least).abs() <= ROUNDING * zz, "lifted by {lifted}, the eigenvalue was {least}");
        assert!(body.x_axis.x * body.y_axis.y - xy * xy >= -ROUNDING * zz, "{body}");
        assert_eq!((body.y_axis.x, body.z_axis.x, body.z_axis.y), (xy, 0.0, 0.0));
    }

    /// Rounding of an eigenvalue as a share of the largest: a few operations on entries, and the root of a double
    /// eigenvalue.
    const ROUNDING: f64 = 1e-8;
}
