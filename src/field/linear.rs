//! Multilinear torque behind a boundary layer, the paper's interpolation (section 3.1).
//!
//! `tau(q) = sum_c w_c tau_c` over the 2^d corners of the cell around q, tau_c = 0 at free points, shortened to the
//! depth below the boundary (`boundary.rs`), where the contact index passes its threshold. Both the boundary and the
//! torque beside it err with the spacing h. Component by component it is not the gradient of anything: it makes or
//! takes energy around a loop.
//!
//! Points that were not computed carry the torque of the nearest one that was. So the torque does not end inside the
//! object where the measurements do: it keeps the value that it has there.

use super::{
    Flags, Interpolant, Sample, Tables,
    boundary::BoundaryLayer,
    points::{Around, Checked, Point},
};
use crate::{
    Error, JointVector,
    dataset::{Axis, Grid, corners},
    store::{Cell, weights, with_joints},
};

/// Interleaved point by point, so that a corner is one stretch of memory.
pub(super) struct Linear {
    grid: Grid,
    points: Vec<Point>,
    layer: BoundaryLayer,
    /// `joints + 2` numbers a grid point: torque, depth (see `boundary.rs`), energy.
    records: Vec<f64>,
}

/// The interpolated numbers of a record.
struct Interpolated<const D: usize> {
    torque: [f64; D],
    /// Below the boundary (sqrt(J)).
    depth: f64,
    /// U (J).
    energy: f64,
    /// Factor of the layer on the torque, 0 to 1.
    held: f64,
}

impl Linear {
    /// Interpolates the torque of `data`, in contact where the index exceeds `threshold`.
    pub fn new(data: Checked<'_>, threshold: f64, slope: &JointVector) -> Result<Self, Error> {
        let grid = data.dataset.grid.clone();
        let layer = BoundaryLayer::new(&grid, slope);
        let zeros = JointVector::zeros(grid.joints());
        let mut records = Vec::with_capacity(data.points.len() * (grid.joints() + 2));
        for point in 0..data.points.len() {
            records.extend_from_slice(data.torque(point, &zeros)?);
            records.extend([0.0, data.energy(point)?]);
        }
        let mut field = Self { grid, points: data.points, layer, records };
        let free: Vec<bool> = field.points.iter().map(|point| !point.touching).collect();
        let depths = layer.depths_behind_index(&field.grid, &free, threshold, field.greatest());
        for (record, depth) in field.records.chunks_exact_mut(field.grid.joints() + 2).zip(depths) {
            record[field.grid.joints()] = depth;
        }
        Ok(field)
    }

    /// Largest size of a torque (sqrt(J)).
    fn greatest(&self) -> f64 {
        let joints = self.grid.joints();
        let sizes = self.records.chunks_exact(joints + 2).map(|record| self.layer.size(&record[..joints]));
        sizes.fold(0.0, f64::max)
    }

    /// The field between the `points` at the corners of a cell. `C = 2^D`.
    fn at<const D: usize, const C: usize>(&self, points: &[usize; C], weights: &[f64; C]) -> Interpolated<D> {
        let mut torque = [0.0; D];
        let (mut depth, mut energy) = (0.0, 0.0);
        for (&point, weight) in points.iter().zip(weights) {
            let record = &self.records[point * (D + 2)..(point + 1) * (D + 2)];
            for (sum, tau) in torque.iter_mut().zip(record) {
                *sum += weight * tau;
            }
            depth += weight * record[D];
            energy += weight * record[D + 1];
        }
        let held = self.layer.share(&torque, depth);
        torque.iter_mut().for_each(|tau| *tau *= held);
        Interpolated { torque, depth, energy, held }
    }

    /// [`Interpolant::sample`]. `C = 2^D`.
    fn sample_at<const D: usize, const C: usize>(&self, q: &[f64]) -> Sample {
        let cell = Cell::of(&self.grid, q);
        let (points, weights) = (corners::<C>(&self.grid.axes, &cell.low), weights::<C>(&cell.fractions));
        let at = self.at::<D, C>(&points, &weights);
        let mut around = Around::of(&self.points, self.grid.fade(q), points.into_iter().zip(weights));
        around.flags.set(Flags::LAYER, at.held < 1.0);
        around.share = at.held;
        around.sample(JointVector::from_slice(&at.torque), at.energy, at.depth > 0.0)
    }

    /// [`Interpolant::torques`]. `C = 2^D`.
    fn torques_at<const D: usize, const C: usize>(&self, q: &[f64], torques: &mut [f64]) {
        // As many axes as the compiler knows: its loops over them are unrolled.
        let Some(axes) = self.grid.axes.first_chunk::<D>() else { return };
        for (q, torque) in q.chunks_exact(D).zip(torques.chunks_exact_mut(D)) {
            let cell: [(usize, f64); D] = std::array::from_fn(|a| axes[a].cell(q[a]));
            let points = corners::<C>(axes, &cell.map(|(low, _)| low as u32));
            let at = self.at::<D, C>(&points, &weights(&cell.map(|(_, fraction)| fraction)));
            let fade = self.grid.fade(q);
            torque.iter_mut().zip(at.torque).for_each(|(out, tau)| *out = tau * fade);
        }
    }
}

impl Interpolant for Linear {
    fn sample(&self, q: &[f64]) -> Sample {
        with_joints!(self.grid.joints(), D => self.sample_at::<D, { 1 << D }>(q))
    }

    fn torques(&self, q: &[f64], torques: &mut [f64]) {
        with_joints!(self.grid.joints(), D => self.torques_at::<D, { 1 << D }>(q, torques));
    }

    /// The greatest Frobenius norm of `S^-1/2 (d tau/d q) S^-1/2`, S = diag(slopes), before the layer. The gradient is
    /// affine in each coordinate of a cell, so that its norm is greatest at a corner, where its columns are the
    /// differences along the edges that meet there.
    fn relative_stiffness(&self, slopes: &JointVector) -> f64 {
        let (grid, joints) = (&self.grid, self.grid.joints());
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

    fn tables(&self) -> Option<Tables<'_>> {
        Some(Tables { records: &self.records, free_energy: 0.0, compliance: Some(self.layer.compliance()) })
    }
}
