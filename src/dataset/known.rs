//! Datasets of fields that are known in closed form: for hard cases, tests and benches. No bake, no file.

use super::{Dataset, Grid};
use crate::{JointVector, contact::Status};

impl Dataset {
    /// `field(q) = (tau [N m], U [J], status)` at every point of `grid`, and nothing else: no contacts, no surface, no
    /// scene.
    #[must_use]
    pub fn of_field(grid: Grid, field: impl Fn(&JointVector) -> (JointVector, f64, Status)) -> Self {
        let (mut torque, mut energy, mut status) = (Vec::new(), Vec::new(), Vec::new());
        for point in 0..grid.points() {
            let (tau, u, s) = field(&grid.configuration(point));
            torque.extend_from_slice(&tau);
            energy.push(u);
            status.push(s as u8);
        }
        Self { energy: Some(energy.into()), ..Self::bare(grid, torque, status) }
    }

    /// A half space `n . q > 0` of C-space that pushes back with `U = 1/2 k (n . q)^2`, n the unit vector `normal` and
    /// k the `stiffness` (N m/rad).
    #[must_use]
    pub fn of_half_space(grid: Grid, normal: &JointVector, stiffness: f64) -> Self {
        Self::of_field(grid, |q| {
            let depth = q.dot(normal).max(0.0);
            let status = if depth > 0.0 { Status::Contact } else { Status::Free };
            (normal.scaled(-stiffness * depth), 0.5 * stiffness * depth * depth, status)
        })
    }
}
