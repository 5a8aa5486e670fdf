//! How contacts slip between the nodes ([`crate::contact::Slip`]): the normal force over the root w of the energy, and
//! the slip Jacobian, both interpolated multilinearly over the points of a grid or the levels of a store.
//!
//! The normal force is `w_bar(q)` times that ratio, which is smooth through the boundary of contact: so friction begins
//! and ends with the torque. Points out of contact take the mean of their neighbours that are nearer to contact. Where
//! the torque itself is interpolated and held behind a boundary layer, there is no w_bar: so is the normal force then.

use super::{
    grid_root::LEAST_ENERGY,
    points::{Checked, Generations, plausible},
};
use crate::{
    Error,
    contact::Slip,
    dataset::{Grid, SlipColumns, corners},
    joint_matrix::entries,
    store::{
        Cell, Store,
        record::{MAX_WIDTH, width},
        weights, with_joints,
    },
};
use std::sync::Arc;

/// How contacts slip, over the nodes.
pub(super) enum SlipField {
    Grid(GridSlips),
    Store(Arc<Store>),
}

impl SlipField {
    /// The slip at `q`, where normal forces are those of the nodes times `scale`. Never allocates.
    pub fn at(&self, q: &[f64], scale: f64) -> Slip {
        let numbers = match self {
            Self::Grid(slips) => with_joints!(q.len(), D => slips.at::<{ 1 << D }, { width(D) }>(q)),
            Self::Store(store) => store.slip(q),
        };
        let [ratio, triangle @ ..] = numbers;
        let mut slip = Slip { normal_force: scale * ratio.max(0.0), ..Slip::default() };
        for k in 0..q.len() {
            for l in 0..=k {
                let entry = triangle[k * (k + 1) / 2 + l];
                (slip.jacobian[k][l], slip.jacobian[l][k]) = (entry, entry);
            }
        }
        slip
    }
}

/// The slips at the points of a grid.
pub(super) struct GridSlips {
    grid: Grid,
    /// `width(d)` numbers a grid point: the normal force, over w in a potential, and the slip Jacobian.
    records: Vec<f32>,
}

impl GridSlips {
    /// Those of the columns `slip` of `data`, for a torque that has a potential or has none.
    pub fn new(data: &Checked<'_>, slip: &SlipColumns, is_potential: bool) -> Result<Self, Error> {
        let (grid, count) = (&data.dataset.grid, data.points.len());
        let (wide, entries) = (width(grid.joints()), entries(grid.joints()));
        let mut records = vec![0.0; count * wide];
        let mut known = vec![false; count];
        for point in 0..count {
            let (energy, force) = (data.energy(point)?, slip.normal_force[point]);
            plausible("normal force", point, force.into())?;
            // Without a potential the dataset may have no energy.
            let root = if is_potential { (2.0 * energy).sqrt() } else { 1.0 };
            if data.points[point].in_contact && (!is_potential || energy > LEAST_ENERGY) && force > 0.0 {
                known[point] = true;
                let record = &mut records[point * wide..(point + 1) * wide];
                record[0] = (f64::from(force) / root) as f32;
                record[1..].copy_from_slice(&slip.jacobian[point * entries..(point + 1) * entries]);
            }
        }
        let generations = Generations::new(grid, |point| known[point]);
        for &point in &generations.outwards {
            let sources: Vec<usize> = generations.nearer(grid, point).map(|(_, _, source)| source).collect();
            for k in 0..wide {
                let sum: f32 = sources.iter().map(|source| records[source * wide + k]).sum();
                records[point * wide + k] = sum / sources.len() as f32;
            }
        }
        if !is_potential {
            let forces = (0..count).map(|point| if known[point] { slip.normal_force[point] } else { 0.0 });
            records.iter_mut().step_by(wide).zip(forces).for_each(|(record, force)| *record = force);
        }
        Ok(Self { grid: grid.clone(), records })
    }

    /// The numbers at `q`, multilinear over the `C` corners of its cell, `W` of each.
    fn at<const C: usize, const W: usize>(&self, q: &[f64]) -> [f64; MAX_WIDTH] {
        let cell = Cell::of(&self.grid, q);
        let mut sums = [0.0; W];
        for (point, weight) in corners::<C>(&self.grid.axes, &cell.low).into_iter().zip(weights::<C>(&cell.fractions)) {
            let record = &self.records[point * W..(point + 1) * W];
            sums.iter_mut().zip(record).for_each(|(sum, number)| *sum += weight * f64::from(*number));
        }
        let mut numbers = [0.0; MAX_WIDTH];
        numbers[..W].copy_from_slice(&sums);
        numbers
    }
}
