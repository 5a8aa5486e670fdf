//! The root w of the energy at the points of a uniform grid (`potential.rs`), of a dataset's columns.
//!
//! *Mixed derivatives* of w, which the interpolation needs beside w and its gradient, follow from the tangent d tau/d q
//! where it is known, `w_ab = -(d tau_a/d q_b + w_a w_b) / w`. Elsewhere they are differences of the gradient between
//! neighbouring points, the mean over both orders of differentiation. Each grid point has one number for each, so that
//! w is C1 whatever they are. On a smooth field tangents leave a fifth to a half of the error of differences. Those of
//! higher order are zero, which adds 1 to 10 % to the error that differences would leave.
//!
//! *Free points* take w and its gradient from the nearest points in contact by Taylor's formula, at most zero. Points
//! that were not computed do so, too, but there w may be positive: the torque goes on where the data end. *Unconverged
//! points* have an energy and a torque that do not belong together: the energy is taken, the gradient from differences
//! of w.
//!
//! Numbers are f64: of f32 the differences of neighbours lose their digits below a spacing of 5e-4 rad.

use super::{
    points::{Around, Checked, Generations, Point},
    potential::{Potential, RootNodes},
    unfit,
};
use crate::{
    Error, JointVector,
    contact::RESIDUAL_FLOOR,
    dataset::{Grid, corners},
    error, memory,
    store::{Cell, Gathered, Levels, Place, Root, record::width, weights, with_joints},
};
use std::sync::Arc;

/// Least stored energy over that of free space whose square root is distinguished from zero (J): a nanonewton over a
/// femtometre, as in [`RESIDUAL_FLOOR`].
pub const LEAST_ENERGY: f64 = RESIDUAL_FLOOR * RESIDUAL_FLOOR;

/// The root at the points of a grid.
pub(super) struct GridRoot {
    grid: Grid,
    points: Vec<Point>,
    /// `width(d)` numbers a grid point, lengths in steps of the grid.
    records: Vec<f64>,
}

impl GridRoot {
    /// The potential of `data`.
    pub fn potential(data: Checked<'_>) -> Result<Potential<Self>, Error> {
        if data.dataset.energy.is_none() {
            return Err(unfit(
                "the dataset holds no energy, as datasets of real objects do not, and the scene asks for interpolation = \
                 \"potential\", which needs it: set interpolation = \"linear\" in [haptics], or bake a virtual object",
            ));
        }
        let (grid, count) = (&data.dataset.grid, data.points.len());
        memory::check(count.saturating_mul(size_of::<f64>() * width(grid.joints()))).map_err(|shortage| {
            error!(
                "the interpolation: {shortage}; or set interpolation = \"linear\" in [haptics], which takes less, or take \
                 a coarser grid"
            )
        })?;
        let is_free = |p: &usize| data.points[*p].is_present() && !data.points[*p].in_contact;
        let free_energy = (0..count).find(is_free).map_or(Ok(0.0), |point| data.energy(point))?;
        let zeros = JointVector::zeros(grid.joints());
        let mut root = vec![0.0; count];
        let mut known = vec![false; count];
        for point in 0..count {
            // Checked whether or not it is used.
            let excess = data.energy(point)? - free_energy;
            data.torque(point, &zeros)?;
            if data.points[point].in_contact && excess > LEAST_ENERGY {
                root[point] = (2.0 * excess).sqrt();
                known[point] = true;
            }
        }
        let mut slopes = vec![zeros; count];
        for point in (0..count).filter(|&point| known[point]) {
            for (a, axis) in grid.axes.iter().enumerate() {
                slopes[point][a] = if data.points[point].is_converged() {
                    -data.torque(point, &zeros)?[a] / root[point]
                } else {
                    difference(grid, point, a, |p| known[p].then_some(root[p])) / axis.step
                };
            }
        }
        let generations = Generations::new(grid, |point| known[point]);
        for &point in &generations.outwards {
            let (mut value, mut slope, mut sources) = (0.0, zeros, 0.0);
            for (axis, distance, source) in generations.nearer(grid, point) {
                value += root[source] + distance * slopes[source][axis];
                slope.iter_mut().zip(slopes[source].iter()).for_each(|(sum, slope)| *sum += slope);
                sources += 1.0;
            }
            slope.iter_mut().for_each(|slope| *slope /= sources);
            value /= sources;
            root[point] = if data.points[point].is_present() { value.min(0.0) } else { value };
            slopes[point] = slope;
        }
        let mut records = Vec::with_capacity(count * width(grid.joints()));
        for point in 0..count {
            records.push(root[point]);
            let tangent = data.tangent(point).filter(|_| known[point]);
            for (a, axis) in grid.axes.iter().enumerate() {
                records.push(slopes[point][a] * axis.step);
                for (b, beside) in grid.axes[..a].iter().enumerate() {
                    // From d^2 U / dq_a dq_b = w_a w_b + w w_ab, and d tau_a / d q_b = -d^2 U / dq_a dq_b.
                    records.push(match tangent {
                        Some(tangent) => {
                            let tangent = f64::from(tangent[a * (a + 1) / 2 + b]);
                            let second = (-tangent - slopes[point][a] * slopes[point][b]) / root[point];
                            second * axis.step * beside.step
                        }
                        None => {
                            let along = |of: usize, axis| difference(grid, point, axis, |p| Some(slopes[p][of]));
                            0.5 * (along(a, b) * axis.step + along(b, a) * beside.step)
                        }
                    });
                }
            }
        }
        let nodes = Self { grid: grid.clone(), points: data.points, records };
        Ok(Potential::new(Arc::new(nodes), free_energy))
    }

    fn around_in<const C: usize, const W: usize>(&self, fade: f64, cell: &Cell, root: &Root) -> Around {
        let (points, weights) = (corners::<C>(&self.grid.axes, &cell.low), weights::<C>(&cell.fractions));
        let corners = || points.into_iter().zip(weights);
        let linear: f64 = corners().map(|(point, weight)| weight * self.records[point * W].max(0.0)).sum();
        let depth = root.value.max(0.0);
        let share = if depth < linear { depth / linear } else { 1.0 };
        Around { share, ..Around::of(&self.points, fade, corners()) }
    }
}

/// The change of `number` at `point` of `grid` in a step along `axis`, between the neighbours that have one: central, or
/// one-sided; zero where neither has.
fn difference(grid: &Grid, point: usize, axis: usize, number: impl Fn(usize) -> Option<f64>) -> f64 {
    let [before, after] = grid.beside(point, axis).map(|p| p.and_then(&number));
    let apart = f64::from(u8::from(before.is_some()) + u8::from(after.is_some()));
    let here = number(point).unwrap_or(0.0);
    if apart > 0.0 { (after.unwrap_or(here) - before.unwrap_or(here)) / apart } else { 0.0 }
}

impl Levels for GridRoot {
    fn base(&self) -> &Grid {
        &self.grid
    }

    fn count(&self) -> u32 {
        1
    }

    fn gather<const C: usize, const W: usize>(&self, _: u32, low: &Place, numbers: &mut [[f64; C]; W]) -> Gathered {
        for (corner, point) in corners::<C>(&self.grid.axes, low).into_iter().enumerate() {
            let record = &self.records[point * W..(point + 1) * W];
            numbers.iter_mut().zip(record).for_each(|(number, entry)| number[corner] = *entry);
        }
        Gathered { found: true, whole: true, any: true, failed: false }
    }
}

impl RootNodes for GridRoot {
    /// Contact forces, which grow like w, are lessened from the multilinear interpolation of w over the corners in
    /// contact to w: they end with it at the boundary.
    fn around(&self, q: &[f64], cell: &Cell, root: &Root) -> Around {
        let fade = self.grid.fade(q);
        with_joints!(self.grid.joints(), D => self.around_in::<{ 1 << D }, { width(D) }>(fade, cell, root))
    }

    fn records(&self) -> Option<&[f64]> {
        Some(&self.records)
    }
}
