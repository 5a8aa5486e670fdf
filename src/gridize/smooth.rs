//! Smoothing within the measured standard deviation, before interpolation.
//!
//! Each torque y is compared with p, the value of a plane fitted to its neighbours (itself left out), weighted by
//! distance and by their variances. Measurement noise sigma^2 explains a difference; so do curvature and steps, which
//! show as residuals of the plane beyond noise: `c^2 = max(0, residual variance - mean sigma^2)`. The best
//! combination of y and p is then
//! `y + w (p - y),   w = sigma^2 / (sigma^2 (1 + (d + 1) / k) + c^2)`
//! with (d + 1) / k for the noise of the plane itself, k neighbours. Exact measurements stay as they are, linear
//! torques too, and edges keep their height.

use super::{
    cloud::{Cloud, Position, distance_squared},
    normal,
};
use crate::{Error, MAX_AXES};
use rayon::prelude::*;
use std::collections::HashMap;

/// Pivot below which the neighbours of a sample span no plane, relative to the greatest: their thickness squared, a
/// thousandth of their reach.
const PLANE_PIVOT: f64 = 1e-6;

/// Neighbours a fitted coefficient.
const NEIGHBOURS_A_COEFFICIENT: usize = 5;
/// Coefficients of a plane, at most.
const MOST: usize = MAX_AXES + 1;

/// Points by cells of the unit box.
struct Cells {
    side: f64,
    joints: usize,
    points: HashMap<[i32; MAX_AXES], Vec<u32>>,
}

impl Cells {
    /// Cells of such a size that 3^d of them hold a few times `wanted` points if these are spread evenly.
    fn new(positions: &[Position], joints: usize, wanted: usize) -> Self {
        let share = 3.0 * wanted as f64 / positions.len() as f64;
        let side = (share.powf(1.0 / joints as f64) / 3.0).clamp(1e-3, 1.0);
        let mut cells = Self { side, joints, points: HashMap::new() };
        for (position, point) in positions.iter().zip(0..) {
            cells.points.entry(cells.cell(position)).or_default().push(point);
        }
        cells
    }

    fn cell(&self, position: &Position) -> [i32; MAX_AXES] {
        position.map(|x| (x / self.side).floor() as i32)
    }

    /// The `wanted` nearest points in the cells around `position`, with squared distances; `point` left out.
    fn near(&self, positions: &[Position], point: usize, wanted: usize) -> Vec<(f64, u32)> {
        let centre = self.cell(&positions[point]);
        let mut found: Vec<(f64, u32)> = Vec::new();
        for number in 0..3_usize.pow(self.joints as u32) {
            let mut cell = centre;
            let mut rest = number;
            for coordinate in cell.iter_mut().take(self.joints) {
                *coordinate += (rest % 3) as i32 - 1;
                rest /= 3;
            }
            for &other in self.points.get(&cell).into_iter().flatten().filter(|&&other| other as usize != point) {
                found.push((distance_squared(&positions[other as usize], &positions[point]), other));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.truncate(wanted);
        found
    }
}

/// Smooths the torques of `cloud`.
pub(super) fn smooth(cloud: &mut Cloud) -> Result<(), Error> {
    if cloud.variances.is_empty() {
        return Err("smoothing needs the standard deviation of the samples, and none was measured: leave it out".into());
    }
    let joints = cloud.joints;
    let wanted = NEIGHBOURS_A_COEFFICIENT * (joints + 1);
    let cells = Cells::new(&cloud.positions, joints, wanted);
    let smoothed: Vec<Vec<f64>> = (0..cloud.positions.len())
        .into_par_iter()
        .map(|point| {
            let near = cells.near(&cloud.positions, point, wanted);
            (0..joints).map(|joint| smoothed(cloud, &near, point, joint)).collect()
        })
        .collect();
    cloud.torques = smoothed.concat();
    Ok(())
}

/// The torque of `joint` at `point`, drawn towards the plane of its neighbours `near`.
fn smoothed(cloud: &Cloud, near: &[(f64, u32)], point: usize, joint: usize) -> f64 {
    let joints = cloud.joints;
    let entry = |point: usize| point * joints + joint;
    let (own, variance) = (cloud.torques[entry(point)], cloud.variances[entry(point)]);
    let Some(&(reach, _)) = near.last() else { return own };
    if near.len() < 2 * (joints + 1) || variance <= 0.0 {
        return own;
    }
    // Normal equations of the plane, with the origin at the point: its value there is the first coefficient.
    let scale = 1.0 / reach.max(f64::MIN_POSITIVE).sqrt();
    let rows = near.iter().map(|&(square, other)| {
        let other = other as usize;
        let mut row = [0.0; MOST];
        row[0] = 1.0;
        for axis in 0..joints {
            row[axis + 1] = scale * (cloud.positions[other][axis] - cloud.positions[point][axis]);
        }
        // Tricube in the distance (Cleveland 1979), beyond the farthest neighbour zero.
        let distance = (square.sqrt() * scale / 1.1).min(1.0);
        let weight = (1.0 - distance.powi(3)).powi(3) / cloud.variances[entry(other)].max(1e-2 * variance);
        (row, cloud.torques[entry(other)], cloud.variances[entry(other)], weight)
    });
    let rows: Vec<([f64; MOST], f64, f64, f64)> = rows.collect();
    let mut normal = vec![vec![0.0; joints + 2]; joints + 1];
    for (row, torque, _, weight) in &rows {
        for (i, line) in normal.iter_mut().enumerate() {
            for (entry, value) in line.iter_mut().zip(row[..=joints].iter().chain([torque])) {
                *entry += weight * row[i] * value;
            }
        }
    }
    let Some(plane) = normal::solve(normal, PLANE_PIVOT) else { return own };
    let (mut total, mut residual, mut noise) = (0.0, 0.0, 0.0);
    for (row, torque, variance, weight) in &rows {
        let fitted: f64 = row.iter().zip(&plane).map(|(x, c)| x * c).sum();
        total += weight;
        residual += weight * (torque - fitted).powi(2);
        noise += weight * variance;
    }
    let freedom = 1.0 - (joints + 1) as f64 / near.len() as f64;
    let curved = (residual / (total * freedom) - noise / total).max(0.0);
    let share = variance / (variance * (2.0 - freedom) + curved);
    own + share * (plane[0] - own)
}
