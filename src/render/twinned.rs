//! The dataset of a real object with its twin: where torques were measured they are felt, and where none were the twin
//! answers, solved in every tick ([`LiveScene`]).
//!
//! *Energy*. With the share s of what was measured, the loop feels `U = s U_m + (1 - s) f U_t` and minus its
//! gradient,
//! `tau = s tau_m + (1 - s) f tau_t - (U_m - f U_t) ds/dq`,
//! so that no closed way gives energy, across the border or along it. Both energies are zero where nothing touches: no
//! constant is free to match them. What they differ by at the border is the error of the twin, and would be felt there as
//! a force across. The factor f takes from it what the whole border shares: the median of U_m over U_t there, weighted by
//! U_m, which points at which the twin has another shape do not bend.
//!
//! *Share*. `s(q) = sum_c I_c prod_a h(t_a)`, with `h = t^2 (3 - 2 t)` of the fraction t of the cell, is continuous with its
//! gradient. I is one at grid points around which all are measured, so that s is zero before the first point that is not,
//! and the two pass over within one cell.

use super::live::{LiveScene, LiveSession};
use crate::{
    Error, JointVector,
    contact::{Slip, Solver, Solvers, Status},
    dataset::Dataset,
    field::{Sample, TorqueField},
    scene::{Interpolation, THRESHOLD},
};
use std::sync::Arc;

/// Points of the border at which the twin's energy is looked at (1): a factor is known by far fewer.
const BORDER_POINTS: usize = 2048;

/// A dataset and the twin of its object. Sessions share it.
pub struct TwinnedField {
    measured: TorqueField,
    twin: Arc<LiveScene>,
    /// I, of each grid point.
    surrounded: Vec<bool>,
    factor: f64,
}

impl TwinnedField {
    /// `twin` beside `dataset`, which has an energy.
    ///
    /// # Errors
    /// When the dataset is not consistent or holds no energy.
    pub fn new(dataset: &Dataset, twin: Arc<LiveScene>) -> Result<Self, Error> {
        let mut slopes = JointVector::zeros(dataset.grid.joints());
        slopes.fill(1.0);
        let measured = TorqueField::interpolated(dataset, Interpolation::Potential, THRESHOLD, &slopes)?;
        let surrounded = surrounded(dataset);
        let factor = factor(dataset, &surrounded, &twin);
        Ok(Self { measured, twin, surrounded, factor })
    }

    /// The twin.
    #[must_use]
    pub fn twin(&self) -> &Arc<LiveScene> {
        &self.twin
    }

    /// What was measured.
    #[must_use]
    pub fn measured(&self) -> &TorqueField {
        &self.measured
    }

    /// f, of the twin's energy and torque (1).
    #[must_use]
    pub fn factor(&self) -> f64 {
        self.factor
    }

    /// Whether it is known how contacts slip.
    #[must_use]
    pub fn has_slip(&self) -> bool {
        self.measured.has_slip()
    }

    /// Stiffness of both torques relative to `slopes`, the greater (1); see
    /// [`TorqueSource::relative_stiffness`](super::source::TorqueSource::relative_stiffness). That of the passage between
    /// them is not in it.
    #[must_use]
    pub fn relative_stiffness(&self, slopes: &JointVector) -> f64 {
        self.measured.relative_stiffness(slopes).max(self.factor * self.twin.relative_stiffness(slopes))
    }

    /// s at `q`, and ds/dq (1/rad or 1/m). Never allocates.
    fn share(&self, q: &[f64]) -> (f64, JointVector) {
        let grid = self.measured.grid();
        let (mut share, mut slope) = (0.0, JointVector::zeros(q.len()));
        let stencil = grid.locate(q);
        if stencil.fade < 1.0 {
            return (share, slope);
        }
        let side = |corner: usize, a: usize| {
            let t = stencil.fractions[a];
            let (rise, change) = (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) / grid.axes[a].step);
            if corner >> a & 1 == 1 { (rise, change) } else { (1.0 - rise, -change) }
        };
        let is_surrounded = |&corner: &usize| self.surrounded[stencil.points[corner]];
        if (0..stencil.count).all(|corner| is_surrounded(&corner)) {
            // Without rounding: there the twin is not asked.
            return (1.0, slope);
        }
        for corner in (0..stencil.count).filter(is_surrounded) {
            share += (0..q.len()).map(|a| side(corner, a).0).product::<f64>();
            for (a, slope) in slope.iter_mut().enumerate() {
                let others = (0..q.len()).filter(|&b| b != a).map(|b| side(corner, b).0);
                *slope += side(corner, a).1 * others.product::<f64>();
            }
        }
        (share, slope)
    }
}

/// The grid points of `dataset` of which all neighbours, across corners too, are in the grid and were measured.
fn surrounded(dataset: &Dataset) -> Vec<bool> {
    let grid = &dataset.grid;
    let mut all: Vec<bool> = (0..grid.points()).map(|point| dataset.status(point) != Status::Outside).collect();
    for axis in 0..grid.joints() {
        let is_held = |point: usize| {
            all[point] && grid.beside(point, axis).into_iter().all(|beside| beside.is_some_and(|point| all[point]))
        };
        all = (0..grid.points()).map(is_held).collect();
    }
    all
}

/// The energy of `dataset` over that of `twin` at the points of the border where both touch: its median, weighted by the
/// former.
fn factor(dataset: &Dataset, surrounded: &[bool], twin: &LiveScene) -> f64 {
    let Some(energy) = &dataset.energy else { return 1.0 };
    let is_border = |point: &usize| dataset.status(*point) == Status::Contact && !surrounded[*point];
    let border: Vec<usize> = (0..dataset.grid.points()).filter(is_border).collect();
    let some: Vec<usize> = border.iter().copied().step_by(border.len().div_ceil(BORDER_POINTS).max(1)).collect();
    let solvers = Solvers::new(twin.direct().model(), rayon::current_num_threads());
    let ratios = solvers.map(&some, |solver: &mut Solver<'_>, &point| {
        let found = solver.solve(&dataset.grid.configuration(point));
        let is_both = found.status == Status::Contact && found.energy > 0.0 && energy[point] > 0.0;
        is_both.then(|| (energy[point] / found.energy, energy[point]))
    });
    let mut ratios: Vec<(f64, f64)> = ratios.into_iter().flatten().collect();
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = 0.5 * ratios.iter().map(|(_, weight)| weight).sum::<f64>();
    let middle = ratios.iter().find(|(_, weight)| {
        left -= weight;
        left <= 0.0
    });
    // A twin that the border does not touch answers as it is.
    middle.map_or(1.0, |(ratio, _)| *ratio)
}

/// A [`TwinnedField`] in one session.
pub struct TwinnedSession<'a> {
    field: &'a TwinnedField,
    twin: LiveSession<'a>,
    /// Ticks since the twin was asked last.
    idle: u32,
}

impl<'a> TwinnedSession<'a> {
    /// Room for all that a session solves.
    #[must_use]
    pub fn new(field: &'a TwinnedField) -> Self {
        Self { field, twin: LiveSession::new(&field.twin), idle: 0 }
    }

    /// Contact at `q`, and how many ticks ago it was solved. Never allocates.
    pub(super) fn sample(&mut self, q: &[f64]) -> (Sample, u32) {
        let (share, slope) = self.field.share(q);
        let measured = Sample { share: 1.0, ..self.field.measured.sample(q) };
        if share >= 1.0 {
            self.idle = self.idle.saturating_add(1);
            return (measured, 0);
        }
        let (own, age) = self.twin.sample(q);
        let age = if age == 0 { 0 } else { age.saturating_add(self.idle) };
        if age == 0 {
            self.idle = 0;
        }
        let rest = 1.0 - share;
        let factor = self.field.factor;
        let excess = measured.energy - factor * own.energy;
        let mut felt = Sample {
            index: share * measured.index + rest * own.index,
            contact: own.contact || share > 0.0 && measured.contact,
            energy: share * measured.energy + rest * factor * own.energy,
            twin: rest,
            flags: if share > 0.0 { measured.flags | own.flags } else { own.flags },
            ..own
        };
        for (a, torque) in felt.torque.iter_mut().enumerate() {
            *torque = share * measured.torque[a] + rest * factor * *torque - excess * slope[a];
        }
        (felt, age)
    }

    /// How the contacts slip at `q`, which was sampled last. Never allocates.
    pub(super) fn slip(&mut self, q: &[f64], sample: &Sample) -> Slip {
        let rest = sample.twin;
        let mut slip = self.field.measured.slip(q, sample);
        if rest > 0.0 {
            let own = self.twin.slip(q);
            let (measured, own_force) = ((1.0 - rest) * slip.normal_force, rest * self.field.factor * own.normal_force);
            let sum = measured + own_force;
            slip.normal_force = sum;
            let part = if sum > 0.0 { own_force / sum } else { 0.0 };
            let entries = slip.jacobian.as_flattened_mut().iter_mut().zip(own.jacobian.as_flattened());
            entries.for_each(|(entry, own)| *entry += part * (own - *entry));
        }
        slip
    }
}
