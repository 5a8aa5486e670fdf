//! Multilinear torque behind a boundary layer, the paper's interpolation (section 3.1).
//!
//! `tau(q) = sum_c w_c tau_c` over the 2^d corners of the cell around q, tau_c = 0 at free points, shortened to the
//! depth below the boundary (`boundary.rs`), where the contact index passes its threshold. Both the boundary and the
//! torque beside it err with the spacing h. Component by component it is not the gradient of anything: it makes or
//! takes energy around a loop.
//!
//! Points that were not computed carry the torque of the nearest one that was. So the torque does not end inside the
//! object where the measurements do: it keeps the value that it has there.

use super::{FieldError, boundary::BoundaryLayer, points::Checked};
use crate::{
    JointVector,
    dataset::{Axis, Grid, Stencil},
};

/// Interleaved point by point, so that a corner is one stretch of memory.
pub(super) struct Layered {
    layer: BoundaryLayer,
    /// `joints + 2` numbers a grid point: torque, depth (see `boundary.rs`), energy.
    records: Vec<f64>,
}

/// The interpolated numbers of a record.
pub(super) struct Interpolated {
    pub torque: JointVector,
    /// Below the boundary (sqrt(J)).
    pub depth: f64,
    /// U (J).
    pub energy: f64,
    /// Factor of the layer on the torque, 0 to 1.
    pub held: f64,
}

impl Layered {
    /// The paper's: contact where the index exceeds `threshold`.
    pub fn linear(data: &Checked<'_>, threshold: f64, slope: &JointVector) -> Result<Self, FieldError> {
        let layer = BoundaryLayer::new(&data.dataset.grid, slope);
        let zeros = JointVector::zeros(data.dataset.grid.joints());
        let mut records = Vec::with_capacity(data.points.len() * (data.dataset.grid.joints() + 2));
        for point in 0..data.points.len() {
            records.extend_from_slice(data.torque(point, &zeros)?);
            records.extend([0.0, data.energy(point)?]);
        }
        let mut field = Self { layer, records };
        let free: Vec<bool> = data.points.iter().map(|point| !point.touching).collect();
        let depths = field.layer.depths_behind_index(&data.dataset.grid, &free, threshold, field.greatest(data));
        field.put_depths(&depths);
        Ok(field)
    }

    /// Largest size of a torque (sqrt(J)).
    fn greatest(&self, data: &Checked<'_>) -> f64 {
        let joints = data.dataset.grid.joints();
        let sizes = self.records.chunks_exact(joints + 2).map(|record| self.layer.size(&record[..joints]));
        sizes.fold(0.0, f64::max)
    }

    fn put_depths(&mut self, depths: &[f64]) {
        let width = self.records.len() / depths.len().max(1);
        for (record, &depth) in self.records.chunks_exact_mut(width).zip(depths) {
            record[width - 2] = depth;
        }
    }

    /// The field in the cell of `stencil`.
    pub fn at<const D: usize>(&self, stencil: &Stencil) -> Interpolated {
        let mut torque = [0.0; D];
        let (mut depth, mut energy) = (0.0, 0.0);
        for (point, weight) in stencil.corners() {
            let record = &self.records[point * (D + 2)..(point + 1) * (D + 2)];
            for (sum, tau) in torque.iter_mut().zip(record) {
                *sum += weight * tau;
            }
            depth += weight * record[D];
            energy += weight * record[D + 1];
        }
        let mut torque = JointVector::from_slice(&torque);
        let held = self.layer.share(&torque, depth);
        torque.iter_mut().for_each(|tau| *tau *= held);
        Interpolated { torque, depth, energy, held }
    }

    /// Greatest Frobenius norm of `S^-1/2 (d tau/d q) S^-1/2`, S = diag(slopes), before the layer. The gradient is
    /// affine in each coordinate of a cell, so that its norm is greatest at a corner, where its columns are the
    /// differences along the edges that meet there.
    pub fn relative_stiffness(&self, grid: &Grid, slopes: &JointVector) -> f64 {
        let joints = grid.joints();
        let torque = |point: usize| &self.records[point * (joints + 2)..point * (joints + 2) + joints];
        let steepness = |p: usize, q: usize| {
            let scaled = |((a, b), slope): ((&f64, &f64), &f64)| (a - b).powi(2) / slope;
            torque(p).iter().zip(torque(q)).zip(slopes.iter()).map(scaled).sum::<f64>()
        };
        let norm = |point: usize| {
            let along = |((axis, beside), slope): ((&Axis, [Option<usize>; 2]), &f64)| {
                let rises = beside.into_iter().flatten().map(|p| steepness(point, p));
                rises.fold(0.0, f64::max) / (axis.step * axis.step * slope)
            };
            grid.axes.iter().zip(grid.neighbours(point)).zip(slopes.iter()).map(along).sum::<f64>()
        };
        (0..grid.points()).map(norm).fold(0.0, f64::max).sqrt()
    }
}
