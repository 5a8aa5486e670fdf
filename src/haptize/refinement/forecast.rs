//! What a level of a grid says of the points halfway: torque, energy and contact forces, and how sure it is of them.

use super::{super::columns::Entry, level::Level, record::Record};
use crate::{
    JointVector,
    contact::Status,
    dataset::{Axis, Dataset, Provenance},
    field::{FieldError, TorqueField},
    scene::Interpolation,
    tolerances::LEVER_ARM,
};
use std::collections::BTreeMap;

/// The potential of one level.
pub(super) struct Forecast<'a> {
    level: &'a Level<'a>,
    field: TorqueField,
    /// What each joint's torque counts by: 1, or of a prismatic joint a lever arm [m].
    levers: JointVector,
}

/// What is said of a point, as columns hold it.
pub(super) struct Foretold {
    torque: JointVector,
    energy: f64,
    gap: f32,
    nodes: Vec<u32>,
    forces: Vec<f32>,
}

impl<'a> Forecast<'a> {
    /// From what `record` knows of the points of `level`, which is all of them.
    pub fn new(level: &'a Level<'a>, record: &Record) -> Result<Self, FieldError> {
        let grid = level.coarse();
        let (joints, points) = (grid.joints(), grid.points());
        let (mut torque, mut energy) = (Vec::with_capacity(points * joints), Vec::with_capacity(points));
        let mut status = Vec::with_capacity(points);
        for point in level.points() {
            match record.result(point) {
                Some(result) => torque.extend_from_slice(result.torque),
                None => torque.resize(torque.len() + joints, 0.0),
            }
            energy.push(record.result(point).map_or(0.0, |result| result.energy));
            status.push(record.status(point) as u8);
        }
        let mut levers = JointVector::zeros(joints);
        let lever = |axis: &Axis| if axis.unit == "m" { LEVER_ARM } else { 1.0 };
        levers.iter_mut().zip(&grid.axes).for_each(|(entry, axis)| *entry = lever(axis));
        let dataset = Dataset {
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
        };
        // A potential has no boundary layer: its slope is never asked for.
        let mut slope = JointVector::zeros(joints);
        slope.fill(1.0);
        let field = TorqueField::interpolated(&dataset, Interpolation::Potential, 0.0, &slope)?;
        Ok(Self { level, field, levers })
    }

    /// Memory of the forecast from a level of `points` points, at most [bytes].
    pub fn bytes(points: usize, joints: usize) -> usize {
        // Dataset, and what a field makes of it: roots, slopes, 2^d derivatives, points, their neighbours.
        let each = 8 * (joints + 1) + 1 + 8 + size_of::<JointVector>() + (8 << joints) + 16 + 8 * 4;
        points.saturating_mul(each)
    }

    /// How far the torque `tau` at `point` is from what is said of it [N m].
    pub fn error(&self, point: usize, tau: &[f64]) -> f64 {
        self.distance(&self.field.sample(&self.level.configuration(point)).torque, tau)
    }

    /// How far apart linear interpolation and the potential are at `point`, halfway [N m]. Where the field is smooth the potential
    /// is the better of the two by far; where it has a kink or a jump, both err, by about as much as they differ.
    pub fn doubt(&self, point: usize, record: &Record) -> f64 {
        let mut mean = JointVector::zeros(self.levers.len());
        let mut count = 0.0;
        for around in self.level.around(point) {
            count += 1.0;
            let result = record.result(around);
            result.into_iter().for_each(|r| mean.iter_mut().zip(r.torque).for_each(|(sum, tau)| *sum += tau));
        }
        mean.iter_mut().for_each(|sum| *sum /= count);
        self.error(point, &mean)
    }

    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let parts = a.iter().zip(b).zip(self.levers.iter());
        parts.map(|((a, b), lever)| (lever * (a - b)).powi(2)).sum::<f64>().sqrt()
    }

    /// What is said of `point`, halfway. Contact forces are the mean of those around, as far as the energy goes with them: as the
    /// graphics loop interpolates them.
    pub fn foretell(&self, point: usize, record: &Record) -> Foretold {
        let sample = self.field.sample(&self.level.configuration(point));
        let mut forces = BTreeMap::<u32, [f32; 3]>::new();
        let mut count = 0.0;
        for around in self.level.around(point) {
            count += 1.0;
            let Some(result) = record.result(around) else { continue };
            for (&node, force) in result.nodes.iter().zip(result.forces.as_chunks::<3>().0) {
                let sum = forces.entry(node).or_default();
                (0..3).for_each(|axis| sum[axis] += force[axis]);
            }
        }
        let share = (sample.share / count) as f32;
        forces.retain(|_, _| share > 0.0);
        Foretold {
            torque: sample.torque,
            energy: sample.energy,
            gap: record.gap(point),
            nodes: forces.keys().copied().collect(),
            forces: forces.into_values().flatten().map(|force| share * force).collect(),
        }
    }
}

impl Foretold {
    /// The result that it is taken for.
    pub fn entry(&self) -> Entry<'_> {
        Entry {
            torque: &self.torque,
            energy: self.energy,
            gap: self.gap,
            residual: 0.0,
            iterations: 0,
            status: Status::Filled as u8,
            nodes: &self.nodes,
            forces: &self.forces,
        }
    }
}
