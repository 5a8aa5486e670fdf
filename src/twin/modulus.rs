//! Young's modulus of a twin, by Gauss-Newton on the measured torques.
//!
//! The model's torque under the law at rest and its derivative d tau / d ln E ([`Sensitivity`](crate::contact::Sensitivity))
//! come from one solution of each row in contact. All of the twin's stiffness grows with E: its solid, the skin that has a
//! width, the clamp of the ground. So its compliance is formed once, and `tau(E, kc) = E/E0 tau(E0, kc E0/E)`.
//!
//! Rows count whose contact lies on surface that was touched: where the body was cut nothing is known. Joints are weighted
//! by their noise. What a single approach would say, the others held, is its own apparent modulus: a map of what lies
//! below. E is their median, so that approaches at a border, where the shape is another, do not bend it.
//!
//! Friction holds back along the way of a node, `-mu |f_i| J_i^T t_i`, t_i being the part of its direction along the
//! surface: mu is found with E by least squares over all rows, and its torque subtracted.

use super::{Approaches, ScannedShape};
use crate::{
    Error, ErrorKind, JointVector,
    contact::{Equilibrium, Model, Solver, Status},
    scan::ScanRow,
};
use glam::DVec3;
use rayon::prelude::*;
use std::{
    collections::BTreeMap,
    sync::atomic::{AtomicBool, Ordering},
};

/// Change of ln E at which it is found (1): far below what any scan tells.
const FOUND: f64 = 1e-4;

/// Most steps, and the largest of one: from a modulus of liver the stiffest tissue is five away.
const STEPS: usize = 20;
const LONGEST_STEP: f64 = 2.0;

/// Part of a node's way that is along the surface from which on it slides (1): below, it sticks for a while.
const SLIDING: f64 = 0.2;

/// Standard deviation of a median over the median deviation from it, times the root of the number, of normal numbers (1).
const OF_MEDIAN: f64 = 1.858;

/// Rows between two looks at whether the work is to stop, and of a thread.
const TOGETHER: usize = 512;
const SHARE: usize = 32;

/// The modulus of a twin, and how well it explains the scan.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Modulus {
    /// Young's modulus (Pa).
    pub young: f64,
    /// Standard deviation of its logarithm (1).
    pub deviation: f64,
    /// Coefficient of friction between the arm and the object (1).
    pub friction: f64,
    /// Measured torque less the twin's, and measured torque, rms over rows and joints (N m or N).
    pub misfit: f64,
    /// See `misfit`.
    pub torque: f64,
    /// Rows in contact, and those of them that count.
    pub rows: usize,
    /// See `rows`.
    pub counted: usize,
    /// Greatest depth of those that count below the surface that was touched (m).
    pub deepest: f64,
    /// Apparent modulus of each approach, by its number (Pa).
    #[serde(skip)]
    pub apparent: BTreeMap<usize, f64>,
}

/// Who watches the work: whether it is to stop, and what is told of rows done and in all.
pub struct Watched<'a> {
    /// Ends the work.
    pub stop: &'a AtomicBool,
    /// Called now and then.
    pub progress: &'a mut dyn FnMut(usize, usize),
}

/// Of a row: torque, its derivative by ln E, and the torque of friction per coefficient; none where it does not count.
type Explained = Option<[JointVector; 3]>;

impl Modulus {
    /// Fits the modulus of the object of `model`, whose surface is `shape` and which was built with `young` (Pa), to the
    /// rows of `approaches` by its arm.
    ///
    /// # Errors
    /// When it is stopped, or no row counts.
    pub fn fit(
        model: &mut Model<'_>,
        young: f64,
        (approaches, shape): (&Approaches, &ScannedShape),
        watched: &mut Watched<'_>,
    ) -> Result<Self, Error> {
        let rows = &approaches.contact;
        let stiffness = model.contact.stiffness;
        let weights = weights(approaches);
        let mut found = Self { rows: rows.len(), ..Self::default() };
        let mut log_ratio = 0.0_f64;
        for _ in 0..STEPS {
            let ratio = log_ratio.exp();
            model.set_stiffness(stiffness / ratio);
            let explained = explain(model, approaches, shape, watched)?;
            found.counted = explained.iter().flatten().count();
            found.friction = friction(rows, &explained, &weights);
            // Of each approach s . r and s . s, r being what is left and s the derivative.
            let mut sums: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
            let (mut left, mut all, mut numbers) = (0.0, 0.0, 0.0);
            for (row, explained) in rows.iter().zip(&explained) {
                let Some([torque, slope, rubbing]) = explained else { continue };
                let sums = sums.entry(row.point / approaches.levels).or_default();
                for (k, weight) in weights.iter().enumerate() {
                    let rest = row.torque[k] - ratio * (torque[k] + found.friction * rubbing[k]);
                    sums[0] += weight * ratio * slope[k] * rest;
                    sums[1] += weight * (ratio * slope[k]).powi(2);
                    (left, all, numbers) = (left + rest * rest, all + row.torque[k].powi(2), numbers + 1.0);
                }
            }
            sums.retain(|_, [gradient, curvature]| *curvature > 0.0 && gradient.is_finite());
            let steps: Vec<f64> = sums.values().map(|[gradient, curvature]| gradient / curvature).collect();
            let Some(step) = median(&steps) else {
                return Err("no row counts: all contact is at the border of what was touched, where the shape is not known; scan a \
                            wider field"
                    .into());
            };
            if step.abs() < FOUND {
                let spread: Vec<f64> = steps.iter().map(|other| (other - step).abs()).collect();
                found.young = young * ratio;
                found.deviation = OF_MEDIAN * median(&spread).unwrap_or(0.0) / (steps.len() as f64).sqrt();
                found.misfit = f64::sqrt(left / numbers);
                found.torque = f64::sqrt(all / numbers);
                let mut pose = model.chain.new_pose();
                let counted = rows.iter().zip(&explained).filter(|(_, explained)| explained.is_some());
                let depths = counted.map(|(row, _)| shape.depth(&row.q, model.chain, &mut pose));
                found.deepest = depths.fold(0.0, f64::max);
                let apparent = sums.keys().zip(steps).map(|(line, step)| (*line, found.young * (1.0 + step).max(0.0)));
                found.apparent = apparent.collect();
                return Ok(found);
            }
            log_ratio += step.clamp(-LONGEST_STEP, LONGEST_STEP);
        }
        Err("the twin's modulus is not found: no elastic solid in this surface explains the torques".into())
    }
}

/// The coefficient of friction with which a factor on the twin's torque explains all rows best (1).
fn friction(rows: &[ScanRow], explained: &[Explained], weights: &[f64]) -> f64 {
    // Normal equations of factor and factor times friction.
    let mut sums = [0.0; 5];
    for (row, [torque, _, rubbing]) in rows.iter().zip(explained).filter_map(|(row, some)| Some((row, (*some)?))) {
        for (k, w) in weights.iter().enumerate() {
            let (t, f, y) = (torque[k], rubbing[k], row.torque[k]);
            sums.iter_mut().zip([t * t, t * f, f * f, t * y, f * y]).for_each(|(sum, term)| *sum += w * term);
        }
    }
    let [tt, tf, ff, ty, fy] = sums;
    let (factor, rubbed) = (ty * ff - fy * tf, fy * tt - ty * tf);
    if factor > 0.0 && ff > 0.0 { (rubbed / factor).max(0.0) } else { 0.0 }
}

/// The number in the middle, if there are any.
fn median(numbers: &[f64]) -> Option<f64> {
    let mut numbers = numbers.to_vec();
    let middle = numbers.len() / 2;
    (!numbers.is_empty()).then(|| *numbers.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// One over the variance of each joint's noise.
fn weights(approaches: &Approaches) -> Vec<f64> {
    let rows = &approaches.contact;
    let joints = rows.first().map_or(0, |row| row.q.len());
    let variance =
        |k: usize| rows.iter().map(|row| row.deviation[k].powi(2) / f64::from(row.ticks.max(1))).sum::<f64>();
    let variances: Vec<f64> = (0..joints).map(variance).collect();
    // Without noise all joints count alike.
    if variances.iter().all(|variance| *variance > 0.0) {
        variances.iter().map(|variance| rows.len() as f64 / variance).collect()
    } else {
        vec![1.0; joints]
    }
}

/// Solves contact in all rows.
fn explain(
    model: &Model<'_>,
    approaches: &Approaches,
    shape: &ScannedShape,
    watched: &mut Watched<'_>,
) -> Result<Vec<Explained>, Error> {
    let is_known = |equilibrium: &Equilibrium| {
        let carriers = equilibrium.touches.iter().flat_map(|touch| &touch.carriers);
        let is_touched = |node: u32| shape.deviations.get(node as usize).is_some_and(Option::is_some);
        equilibrium.status == Status::Contact && carriers.into_iter().all(|(node, _)| is_touched(*node))
    };
    let ways: BTreeMap<usize, JointVector> =
        approaches.onsets.iter().map(|onset| (onset.line, onset.direction)).collect();
    let rubbing = |solver: &Solver<'_>, equilibrium: &Equilibrium, way: &JointVector| {
        let mut torque = JointVector::zeros(way.len());
        for (node, force) in equilibrium.on_proxy() {
            let columns = way.iter().enumerate();
            let way: DVec3 =
                columns.map(|(k, dq)| *dq * model.chain.jacobian_column(solver.pose(), node as usize, k)).sum();
            let way = way.normalize_or_zero();
            let along = way - way.project_onto(force.normalize_or(DVec3::Z));
            let push = -force.length() * along / along.length().max(SLIDING);
            model.chain.add_torque(solver.pose(), node as usize, push, &mut torque);
        }
        torque
    };
    let rows = &approaches.contact;
    let mut all = Vec::with_capacity(rows.len());
    for some in rows.chunks(TOGETHER) {
        if watched.stop.load(Ordering::Relaxed) {
            return Err(Error::new("interrupted: nothing is written").of(ErrorKind::Stopped));
        }
        let solve = |solver: &mut Solver<'_>, row: &ScanRow| {
            let equilibrium = solver.solve(&row.q);
            let sensitivity = solver.sensitivity().filter(|_| is_known(&equilibrium))?;
            let way = ways.get(&(row.point / approaches.levels))?;
            Some([equilibrium.torque, sensitivity.by_modulus(), rubbing(solver, &equilibrium, way)])
        };
        let solved = some.par_iter().with_min_len(SHARE).map_init(|| Solver::new(model), solve);
        all.par_extend(solved);
        (watched.progress)(all.len(), rows.len());
    }
    Ok(all)
}
