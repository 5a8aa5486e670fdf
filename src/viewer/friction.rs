//! The ellipse of friction in the plane of C-space: torques of friction lie on it while the arm slides, and inside
//! while it sticks. Shape and direction count: its greater half axis is a given share of the plane, whatever the friction.

use super::loaded::Loaded;
use crate::{JointVector, dataset::Axis, render::trace::Tick};

/// Greater half axis over the width of the plane (1).
const SIZE: f64 = 0.12;

/// Corners that it is drawn by.
const CORNERS: usize = 48;

/// Returns its corners about `q` in the plane of the joints `axes`, as at `tick`; absent where the loop has no
/// friction, or none acts.
#[must_use]
pub fn friction_ellipse(loaded: &Loaded, tick: &Tick, q: &JointVector, axes: [usize; 2]) -> Option<Vec<[f64; 2]>> {
    let field = loaded.setup.haptics.source().field()?;
    let is_felt = loaded.setup.scene.haptics.friction.is_some() && tick.sample.contact && axes[0] != axes[1];
    let slip = is_felt.then(|| field.slip(q, &field.sample(q))).filter(|slip| slip.normal_force > 0.0)?;
    // B u of unit vectors u: over two joints, the image of a circle under the Cholesky factor of B B^T.
    let rows = axes.map(|axis| JointVector::from_slice(&slip.jacobian[axis][..q.len()]));
    let length = rows[0].norm();
    let along = if length > 0.0 { rows[0].dot(&rows[1]) / length } else { 0.0 };
    let beside = (rows[1].dot(&rows[1]) - along * along).max(0.0).sqrt();
    let longest = length.max(rows[1].norm());
    let scales = axes.map(|axis| {
        let Axis { step, count, .. } = loaded.dataset.grid.axes[axis];
        SIZE * step * count as f64 / longest
    });
    let corner = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * k as f64 / CORNERS as f64).sin_cos();
        [q[axes[0]] + scales[0] * length * cos, q[axes[1]] + scales[1] * (along * cos + beside * sin)]
    };
    (longest > 0.0).then(|| (0..=CORNERS).map(corner).collect())
}
