//! The frame step of the graphics loop: how far the object's nodes are from where a much finer step brings them.
//!
//! The forces of the dataset's deepest contact push on the object at rest for a tenth of a second, then let go for another.
//! Error is the distance of the nodes, over all nodes and all instants that the coarsest step visits.

use super::{Accuracy, AccuracyError, Row, Study, timed};
use crate::{
    dataset::Dataset,
    object::Object,
    render::graphics::{ContactForces, ObjectMotion},
    scene::Scene,
};
use glam::DVec3;

/// Frames a second.
const RATES: [u32; 5] = [30, 60, 120, 240, 480];

/// Frames a second of the reference: errors fall with the square of the step, so that its own is 1/64 of the finest's.
const REFERENCE_RATE: u32 = 3840;

/// How long the forces push, and how long the object then moves freely, in steps of the coarsest rate.
const PUSHED: u32 = 3;
const LET_GO: u32 = 3;

/// Error and time against the frame step.
pub(super) fn frames(scene: &Scene, object: &Object, own: &Dataset, study: &mut Accuracy) -> Result<(), AccuracyError> {
    if scene.graphics.is_none() {
        study.notes.push("the frame step is not varied: the scene has no [graphics]".to_owned());
        return Ok(());
    }
    let effects = scene.graphics.as_ref().map(|graphics| graphics.effects).unwrap_or_default();
    let energy = |point: &usize| own.energy.as_ref().map_or(0.0, |energy| energy[*point]);
    let deepest = (0..own.grid.points()).max_by(|a, b| energy(a).total_cmp(&energy(b))).unwrap_or(0);
    let mut forces = vec![DVec3::ZERO; object.rest.len()];
    ContactForces::new(own, object.rest.len())?.interpolate(&own.grid.configuration(deepest), 1.0, &mut forces);
    let none = vec![DVec3::ZERO; forces.len()];
    let run = |rate: u32| -> Result<Vec<Vec<DVec3>>, AccuracyError> {
        let mut motion = ObjectMotion::new(object, 1.0 / f64::from(rate), &effects)?;
        let each = rate / RATES[0];
        let mut seen = Vec::new();
        for instant in 0..PUSHED + LET_GO {
            for _ in 0..each {
                motion.step(if instant < PUSHED { &forces } else { &none });
            }
            seen.push(motion.displacement().to_vec());
        }
        Ok(seen)
    };
    let exact = run(REFERENCE_RATE)?;
    let own_rate = scene.graphics.as_ref().map_or(60.0, |graphics| graphics.rate);
    let mut found = Vec::new();
    for rate in RATES {
        found.push((rate, timed(|| run(rate))?));
    }
    let nearest = |rate: &u32| (f64::from(*rate) - own_rate).abs();
    let baseline = found.iter().min_by(|a, b| nearest(&a.0).total_cmp(&nearest(&b.0))).map_or(0.0, |f| f.1.0.least);
    for (rate, (cost, seen)) in found {
        let distances = || seen.iter().flatten().zip(exact.iter().flatten()).map(|(a, b)| a.distance(*b));
        let count = seen.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        study.rows.push(Row {
            study: Study::Frame,
            series: "object".to_owned(),
            setting: format!("{rate} Hz"),
            value: 1.0 / f64::from(rate),
            points: object.rest.len(),
            bytes: 0,
            cost: cost.over(baseline),
            rms: (distances().map(|d| d * d).sum::<f64>() / count).sqrt(),
            worst: distances().fold(0.0, f64::max),
        });
    }
    Ok(())
}
