//! The graphics loop: how far the object's nodes and energy are from where a much finer frame step, or an exact solver,
//! brings them.
//!
//! The forces of the dataset's deepest contact push on the object at rest for a tenth of a second, then let go for
//! another. The error of positions is the distance of the nodes, over all nodes and all instants; that of energy the
//! difference of kinetic, elastic and gravitational energy, over all instants. The frame step is seen at the instants
//! that the coarsest visits; the solver at every frame of the scene's own rate, f32 iterations on the GPU against the
//! CPU's factor in f64.

use super::{Accuracy, AccuracyError, Cost, Row, Study, timed};
use crate::{
    dataset::Dataset,
    gpu::{AdapterChoice, Context, FrameError, FrameMethod, FrameUpdate},
    object::Object,
    render::graphics::{ContactForces, ObjectMotion},
    scene::{GraphicsEffects, Scene},
    sweep::{OTHER_ADAPTER, remedied},
};
use glam::DVec3;
use std::sync::Arc;

/// Frames a second.
const RATES: [u32; 5] = [30, 60, 120, 240, 480];

/// Frames a second of the reference: errors fall with the square of the step, so that its own is 1/64 of the finest's.
const REFERENCE_RATE: u32 = 3840;

/// How long the forces push, and how long the object then moves freely, in steps of the coarsest rate.
const PUSHED: u32 = 3;
const LET_GO: u32 = 3;

/// Iterations of conjugate gradients a frame.
const ITERATIONS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];

/// The object at one instant: displacements (m) and energy (J).
type Seen = (Vec<DVec3>, f64);

/// The grid point of the greatest stored energy.
pub(super) fn deepest(own: &Dataset) -> usize {
    let energy = |point: &usize| own.energy.as_ref().map_or(0.0, |energy| energy[*point]);
    (0..own.grid.points()).max_by(|a, b| energy(a).total_cmp(&energy(b))).unwrap_or(0)
}

/// The object, the push and the effects.
struct Push<'a> {
    object: &'a Object,
    effects: GraphicsEffects,
    /// Frames a second, as the scene says (Hz).
    rate: f64,
    forces: Vec<DVec3>,
    none: Vec<DVec3>,
}

/// Errors and time against the frame step and against the iterations of the solver.
pub(super) fn graphics(
    scene: &Scene,
    object: &Object,
    own: &Dataset,
    study: &mut Accuracy,
) -> Result<(), AccuracyError> {
    let Some(graphics) = scene.graphics else {
        study.notes.push("the graphics is not studied: the scene says graphics = false".to_owned());
        return Ok(());
    };
    let none = vec![DVec3::ZERO; object.rest.len()];
    let mut forces = none.clone();
    ContactForces::new(own, none.len())?.at(&own.grid.configuration(deepest(own)), 1.0, &mut forces);
    let push = Push { object, effects: graphics.effects, rate: graphics.rate, forces, none };
    frames(&push, study)?;
    if let Err(error) = iterations(&push, study) {
        study.notes.push(format!(
            "iterations of the graphics on a GPU are not measured: {}",
            remedied(&error.to_string(), OTHER_ADAPTER)
        ));
    }
    Ok(())
}

/// Errors and time against the frame step.
fn frames(push: &Push<'_>, study: &mut Accuracy) -> Result<(), AccuracyError> {
    let run = |rate: u32| -> Result<Vec<Seen>, AccuracyError> {
        let mut motion = ObjectMotion::new(push.object, 1.0 / f64::from(rate), &push.effects)?;
        let each = rate / RATES[0];
        let mut seen = Vec::new();
        for instant in 0..PUSHED + LET_GO {
            for _ in 0..each {
                motion.step(if instant < PUSHED { &push.forces } else { &push.none });
            }
            seen.push((motion.displacement().to_vec(), motion.energy()));
        }
        Ok(seen)
    };
    let exact = run(REFERENCE_RATE)?;
    let mut found = Vec::new();
    for rate in RATES {
        found.push((rate, timed(study.rounds, || run(rate))?));
    }
    let nearest = |rate: &u32| (f64::from(*rate) - push.rate).abs();
    let baseline = found.iter().min_by(|a, b| nearest(&a.0).total_cmp(&nearest(&b.0))).map_or(0.0, |f| f.1.0.least);
    for (rate, (cost, seen)) in found {
        let (setting, value) = (format!("{rate} Hz"), 1.0 / f64::from(rate));
        study.rows.extend(rows(Study::Frame, &setting, value, cost.over(baseline), &seen, &exact));
    }
    Ok(())
}

/// Errors and time against the iterations of the GPU's solver, at the scene's rate.
fn iterations(push: &Push<'_>, study: &mut Accuracy) -> Result<(), AccuracyError> {
    let period = 1.0 / push.rate;
    let instants = (f64::from(PUSHED + LET_GO) / f64::from(RATES[0]) / period).round().max(2.0) as usize;
    let forces = |frame: usize| if 2 * frame < instants { &push.forces } else { &push.none };
    let mut twin = ObjectMotion::new(push.object, period, &push.effects)?;
    let mut exact: Vec<Seen> = Vec::new();
    for frame in 0..instants {
        twin.step(forces(frame));
        exact.push((twin.displacement().to_vec(), twin.energy()));
    }
    let context = Arc::new(Context::open(AdapterChoice::Any).map_err(FrameError::from)?);
    let run = |method: FrameMethod| -> Result<Vec<Seen>, AccuracyError> {
        let mut update = FrameUpdate::new(Arc::clone(&context), push.object, period, method, &push.effects)?;
        let frame = |frame: usize| -> Result<Seen, AccuracyError> {
            update.step(forces(frame)).map_err(FrameError::from)?;
            let (displacement, velocity) = update.read().map_err(FrameError::from)?;
            let energy = twin.energy_of(&displacement, &velocity);
            Ok((displacement, energy))
        };
        (0..instants).map(frame).collect()
    };
    let mut found = Vec::new();
    for count in ITERATIONS {
        found.push((count, timed(study.rounds, || run(FrameMethod::Iterations(count)))?));
    }
    let usual = found.iter().find(|(count, _)| *count == FrameMethod::USUAL_ITERATIONS);
    let baseline = usual.map_or(0.0, |(_, (cost, _))| cost.least);
    for (count, (cost, seen)) in found {
        let setting = format!("{count} iterations");
        study.rows.extend(rows(Study::Iterations, &setting, count.into(), cost.over(baseline), &seen, &exact));
    }
    Ok(())
}

/// The errors of positions and of energy.
fn rows(study: Study, setting: &str, value: f64, cost: Cost, seen: &[Seen], exact: &[Seen]) -> [Row; 2] {
    let nodes = seen.first().map_or(0, |(u, _)| u.len());
    let pairs = || seen.iter().zip(exact);
    let ways = pairs().flat_map(|((a, _), (b, _))| a.iter().zip(b)).map(|(a, b)| [a.distance(*b), b.length()]);
    let works = pairs().map(|((_, a), (_, b))| [(a - b).abs(), b.abs()]);
    let row = |series: &str, unit, errors: Vec<[f64; 2]>| {
        let rms =
            |part: usize| (errors.iter().map(|e| e[part] * e[part]).sum::<f64>() / errors.len().max(1) as f64).sqrt();
        Row {
            study,
            series: series.to_owned(),
            setting: setting.to_owned(),
            value,
            points: nodes,
            solved: 0,
            bytes: 0,
            cost,
            unit,
            rms: rms(0),
            worst: errors.iter().map(|e| e[0]).fold(0.0, f64::max),
            size: rms(1),
        }
    };
    [row("position", "m", ways.collect()), row("energy", "J", works.collect())]
}
