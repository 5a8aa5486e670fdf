//! Datasets of known fields, shared by the unit tests and the test binaries: both name the crate `engine`.

use super::engine::{
    JointVector,
    contact::Status,
    dataset::{Axis, Dataset, Grid, Provenance},
};

/// A grid from (start, step, count) of each axis.
pub fn grid(axes: &[(f64, f64, usize)]) -> Grid {
    let axis = |(a, &(start, step, count)): (usize, &(f64, f64, usize))| Axis {
        name: format!("joint {a}"),
        unit: "rad".into(),
        start,
        step,
        count,
    };
    Grid { axes: axes.iter().enumerate().map(axis).collect() }
}

/// A dataset with `field(q) = (torque, U, status)` at every grid point.
pub fn dataset(grid: Grid, field: impl Fn(&JointVector) -> (JointVector, f64, Status)) -> Dataset {
    let (mut torque, mut energy, mut status) = (Vec::new(), Vec::new(), Vec::new());
    for point in 0..grid.points() {
        let (tau, u, s) = field(&grid.configuration(point));
        torque.extend_from_slice(&tau);
        energy.push(u);
        status.push(s as u8);
    }
    Dataset {
        grid,
        torque: torque.into(),
        energy: Some(energy.into()),
        gap: None,
        status: status.into(),
        residual: None,
        iterations: None,
        contacts: None,
        surface: None,
        scene: String::new(),
        provenance: Provenance::default(),
    }
}

/// A half space `n . q > 0` that pushes back with `U = 1/2 k (n . q)^2`; n has equal parts in all joints, |n| = 1.
pub fn half_space(grid: Grid, stiffness: f64) -> Dataset {
    let part = 1.0 / (grid.joints() as f64).sqrt();
    dataset(grid, |q| {
        let depth = q.iter().map(|x| part * x).sum::<f64>().max(0.0);
        let mut torque = JointVector::zeros(q.len());
        torque.iter_mut().for_each(|tau| *tau = -stiffness * depth * part);
        let status = if depth > 0.0 { Status::Contact } else { Status::Free };
        (torque, 0.5 * stiffness * depth * depth, status)
    })
}
