//! Grids and half spaces in short, shared by the unit tests and the test binaries: both name the crate `engine`.

use super::engine::{
    JointVector,
    dataset::{Axis, Dataset, Grid},
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

/// A half space whose normal has equal parts in all joints.
pub fn half_space(grid: Grid, stiffness: f64) -> Dataset {
    let mut normal = JointVector::zeros(grid.joints());
    normal.fill(1.0 / (grid.joints() as f64).sqrt());
    Dataset::of_half_space(grid, &normal, stiffness)
}
