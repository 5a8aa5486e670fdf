//! Where each approach of a scan first touches: the onset of its torque.
//!
//! An approach is the rows along the last axis of a plan, in order. Its torque, less that of the free rows before it,
//! which holds the joints' dry friction, is projected on its own direction. Along the path s of the watched node it
//! rises as a hinge, `y = a (s - s0)^p` behind the onset s0 and zero before it. The exponent p in 1..2 (1: a surface of
//! constant stiffness; 3/2: a ball on an elastic body, Hertz 1881) is one number for all approaches: that with the least
//! misfit of all. With it `y^(1/p)` is a straight line in s, whose zero is s0. It lies between the last free row and the
//! first in contact.

use crate::{
    Error, JointVector, error,
    proxy::Chain,
    scan::{RowStatus, ScanLog, ScanRow},
    scene::{PlanSpec, ScanScene},
};
use glam::DVec3;
use std::collections::BTreeMap;

/// Rows of an approach in contact that the hinge is fitted to: one more than it has numbers. More: farther from the
/// onset, where the law is another.
const HINGE_ROWS: usize = 3;

/// Exponents that are tried.
const EXPONENTS: [f64; 2] = [1.0, 2.0];
const EXPONENT_STEP: f64 = 0.05;

/// Standard deviation of a number that is known to lie in a unit interval, 1 / sqrt(12) (1).
const UNIFORM: f64 = 0.288_675;

/// The first touch of an approach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Onset {
    /// Configuration there (rad or m).
    pub q: JointVector,
    /// How far the watched node has gone since the last free row (m).
    pub path: f64,
    /// Standard deviation of that (m).
    pub deviation: f64,
    /// Change of the configuration per metre of the path, towards the object (rad/m or 1).
    pub direction: JointVector,
    /// Number of the approach.
    pub line: usize,
}

/// The rows of a scan by what they tell of its object's shape.
#[derive(Clone, Debug, Default)]
pub struct Approaches {
    /// First touches.
    pub onsets: Vec<Onset>,
    /// Configurations in which nothing touches (rad or m).
    pub free: Vec<JointVector>,
    /// Steady rows in contact, the torque of the free rows before them subtracted.
    pub contact: Vec<ScanRow>,
    /// Points of an approach: by their quotient a row's point is the number of its approach.
    pub levels: usize,
    /// Exponent p of the hinge (1).
    pub exponent: f64,
    /// Approaches that never touch.
    pub untouched: usize,
    /// Approaches whose first row touches already, so that their onset is not known.
    pub begun: usize,
}

/// One approach that touches.
struct Approach<'a> {
    number: usize,
    /// The last free row.
    free: &'a ScanRow,
    /// Rows in contact.
    rows: Vec<&'a ScanRow>,
    /// Path of the watched node from the last free row to each (m).
    paths: Vec<f64>,
    /// Projected torque of each, and its standard deviation.
    heights: Vec<f64>,
    noise: Vec<f64>,
}

impl Approaches {
    /// The approaches of `log`, whose scene this is.
    ///
    /// # Errors
    /// When a hand led the scan, so that its rows are no approaches, or none of them has an onset.
    pub fn new(log: &ScanLog, scene: &ScanScene, chain: &Chain) -> Result<Self, Error> {
        if log.header.guided {
            return Err(
                "a scan led by hand has no approaches, whose onsets are its object's shape: scan by a plan".into()
            );
        }
        let levels = match &scene.scan.plan {
            PlanSpec::Workspace(plan) => plan.depth.count,
            PlanSpec::Joints(grid) => grid.axes.last().map_or(1, |axis| axis.count),
        };
        let mut lines: BTreeMap<usize, Vec<&ScanRow>> = BTreeMap::new();
        for row in log.rows.iter().filter(|row| row.status == RowStatus::Steady) {
            lines.entry(row.point / levels).or_default().push(row);
        }
        let node = scene.scan.plan.node(chain.nodes.len());
        let touches = |row: &ScanRow| row.torque.norm() > scene.scan.control.epsilon;
        let (mut found, mut approaches) = (Self { levels, ..Self::default() }, Vec::new());
        for (&number, line) in &mut lines {
            line.sort_by_key(|row| row.point);
            let first = line.iter().position(|row| touches(row)).unwrap_or(line.len());
            let (free, contact) = line.split_at(first);
            found.free.extend(free.iter().map(|row| row.q));
            let base = mean(free);
            found.contact.extend(contact.iter().map(|row| ScanRow { torque: less(&row.torque, &base), ..**row }));
            match (free.last(), contact.is_empty()) {
                (_, true) => found.untouched += 1,
                (None, false) => found.begun += 1,
                (Some(_), false) => approaches.push(Approach::new(number, (free, contact), chain, node)),
            }
        }
        let steps = ((EXPONENTS[1] - EXPONENTS[0]) / EXPONENT_STEP).round() as usize;
        let exponents = (0..=steps).map(|k| EXPONENTS[0] + k as f64 * EXPONENT_STEP);
        let misfit = |p: f64| approaches.iter().map(|approach| approach.hinge(p).1[0]).sum::<f64>();
        found.exponent = exponents.min_by(|a, b| misfit(*a).total_cmp(&misfit(*b))).unwrap_or(EXPONENTS[0]);
        // What the hinge itself leaves, beyond noise, is the error of its law.
        let fits: Vec<_> = approaches.iter().map(|approach| approach.hinge(found.exponent)).collect();
        let [misfit, freedom] = fits.iter().fold([0.0; 2], |sum, (_, fit)| [sum[0] + fit[0], sum[1] + fit[1]]);
        let scale = (misfit / freedom.max(1.0)).sqrt().max(1.0);
        found.onsets = approaches.iter().zip(fits).map(|(approach, (fit, _))| approach.onset(fit, scale)).collect();
        if found.onsets.is_empty() {
            return Err(error!(
                "no approach goes from a free row into contact, of {}: begin the plan's lines outside the object, and let \
                 them reach it",
                lines.len()
            ));
        }
        Ok(found)
    }
}

impl<'a> Approach<'a> {
    fn new(number: usize, (free, contact): (&[&'a ScanRow], &[&'a ScanRow]), chain: &Chain, node: usize) -> Self {
        let mut pose = chain.new_pose();
        let mut place = |row: &ScanRow| {
            chain.pose(&row.q, &mut pose);
            pose.nodes[node]
        };
        let last = free[free.len() - 1];
        let base = mean(free);
        let rows: Vec<&ScanRow> = contact.iter().take(HINGE_ROWS).copied().collect();
        let mut direction = less(&mean(&rows), &base);
        let size = direction.norm().max(f64::MIN_POSITIVE);
        direction.iter_mut().for_each(|x| *x /= size);
        let height = |row: &&ScanRow| direction.dot(&row.torque) - direction.dot(&base);
        let noise = |row: &&ScanRow| {
            let along = direction.iter().zip(row.deviation.iter()).map(|(n, deviation)| (n * deviation).powi(2));
            (along.sum::<f64>() / f64::from(row.ticks.max(1))).sqrt()
        };
        let (mut before, mut path) = (place(last), 0.0);
        let paths = rows.iter().map(|row| {
            let here = place(row);
            path += here.distance(std::mem::replace(&mut before, here));
            path
        });
        let paths = paths.collect();
        let (heights, noise) = (rows.iter().map(height).collect(), rows.iter().map(noise).collect());
        Self { number, free: last, paths, heights, noise, rows }
    }

    /// The onset with exponent `p` and its deviation by noise alone (m), and the misfit over noise with its degrees of
    /// freedom (1).
    fn hinge(&self, p: f64) -> ([f64; 2], [f64; 2]) {
        let first = self.paths[0];
        let middle = ([0.5 * first, UNIFORM * first], [0.0; 2]);
        let rows = || self.paths.iter().zip(&self.heights).zip(&self.noise).filter(|((_, y), _)| **y > 0.0);
        if rows().count() < 2 {
            return middle;
        }
        // y^(1/p) = c (s - s0), each weighted by the deviation that y gives it.
        let mut sums = [0.0; 5];
        let line = |y: f64, noise: f64| (y.powf(1.0 / p), noise.max(f64::MIN_POSITIVE) * y.powf(1.0 / p - 1.0) / p);
        for ((s, y), noise) in rows() {
            let (z, deviation) = line(*y, *noise);
            let w = deviation.powi(-2);
            for (sum, term) in sums.iter_mut().zip([w, w * s, w * s * s, w * z, w * s * z]) {
                *sum += term;
            }
        }
        let [w, ws, wss, wz, wsz] = sums;
        let determinant = w * wss - ws * ws;
        let slope = (w * wsz - ws * wz) / determinant;
        if !(slope > 0.0 && determinant > 0.0) {
            return middle;
        }
        let intercept = (wz - slope * ws) / w;
        let zero = -intercept / slope;
        // Of s0 = -b / c: its variance by those of b and c.
        let variance = (wss + 2.0 * zero * -ws + zero * zero * w) / (determinant * slope * slope);
        let onset = zero.clamp(0.0, first);
        let misfit: f64 = rows()
            .map(|((s, y), noise)| ((y - (slope * (s - zero)).max(0.0).powf(p)) / noise.max(f64::MIN_POSITIVE)).powi(2))
            .sum();
        ([onset, variance.sqrt()], [misfit, rows().count() as f64 - 2.0])
    }

    /// The onset at `path`, whose deviation by noise is `scale` times too small, and no more than where it may lie.
    fn onset(&self, [path, deviation]: [f64; 2], scale: f64) -> Onset {
        let (from, to) = (&self.free.q, &self.rows[0].q);
        let first = self.paths[0].max(f64::MIN_POSITIVE);
        let mut direction = less(to, from);
        direction.iter_mut().for_each(|x| *x /= first);
        let mut q = *from;
        add(&mut q, &direction, path);
        let deviation = (scale * deviation).min(UNIFORM * first);
        Onset { q, path, deviation, direction, line: self.number }
    }
}

/// The mean torque of `rows`, zero without any.
fn mean(rows: &[&ScanRow]) -> JointVector {
    let mut mean = rows.first().map_or_else(JointVector::default, |row| JointVector::zeros(row.q.len()));
    rows.iter().for_each(|row| add(&mut mean, &row.torque, 1.0 / rows.len() as f64));
    mean
}

/// `vector` less `other`, which has no more entries.
fn less(vector: &JointVector, other: &[f64]) -> JointVector {
    let mut less = *vector;
    add(&mut less, other, -1.0);
    less
}

/// Adds `factor` times `other` to `sum`.
fn add(sum: &mut JointVector, other: &[f64], factor: f64) {
    sum.iter_mut().zip(other).for_each(|(sum, x)| *sum += factor * x);
}

impl Onset {
    /// How node `node` of `chain` moves along the approach, at its unit speed (1).
    #[must_use]
    pub fn velocity(&self, chain: &Chain, pose: &crate::proxy::Pose, node: usize) -> DVec3 {
        self.direction.iter().enumerate().map(|(joint, rate)| *rate * chain.jacobian_column(pose, node, joint)).sum()
    }
}
