//! What the twin of a real object errs by along a session, and where it answered.

use super::press::{TORQUE, curve, per_joint, stack};
use crate::{
    JointVector,
    contact::Solver,
    draw::{canvas::Canvas, chart::Lane},
    render::{
        trace::{Tick, Trace},
        twinned::TwinnedField,
    },
};
use serde::Serialize;

/// Instants at which the twin is looked at (1): as many as a figure has points across.
const INSTANTS: usize = 600;

/// The torque of the twin beside what was measured, along a session.
#[derive(Clone, Debug, Serialize)]
pub struct TwinError {
    /// On the twin's torque, so that it meets what was measured at the border (1).
    pub factor: f64,
    /// Twin less measured torque over measured torque, rms over the instants in contact where there is such (1).
    pub rms: Option<f64>,
    /// The instants (s), with twin less measured torque where both are known (N m or N).
    #[serde(skip)]
    errors: Vec<(f64, Option<JointVector>)>,
}

impl TwinError {
    /// Solves the twin of `field` along `trace`.
    #[must_use]
    pub fn along(field: &TwinnedField, trace: &Trace) -> Self {
        let mut solver = Solver::new(field.twin().direct().model());
        let (mut squares, mut size) = (0.0, 0.0);
        let mut error = |tick: &Tick| {
            let measured = field.measured().sample(&tick.proxy);
            if tick.sample.twin == 1.0 || !measured.contact {
                return None;
            }
            let mut error = solver.solve(&tick.proxy).torque;
            error.iter_mut().zip(measured.torque.iter()).for_each(|(tau, own)| *tau = field.factor() * *tau - own);
            squares += error.norm().powi(2);
            size += measured.torque.norm().powi(2);
            Some(error)
        };
        let ticks = trace.ticks.iter().step_by(trace.ticks.len().div_ceil(INSTANTS).max(1));
        let errors = ticks.map(|tick| (tick.time, error(tick))).collect();
        Self { factor: field.factor(), rms: (size > 0.0).then(|| f64::sqrt(squares / size)), errors }
    }

    /// Draws what was felt of `trace`, the error of the twin, and its share.
    #[must_use]
    pub fn draw(&self, trace: &Trace) -> Canvas {
        let felt = ["Contact torque on the proxy", "Contact force on the proxy"];
        let mut lanes = per_joint(trace, felt, TORQUE, |tick, joint| tick.sample.torque.get(joint).copied());
        let at = |time: f64| self.errors.partition_point(|(instant, _)| *instant <= time).checked_sub(1);
        let error = |tick: &Tick, joint: usize| self.errors[at(tick.time)?].1.as_ref()?.get(joint).copied();
        let names = ["Torque of the twin less what was measured", "Force of the twin less what was measured"];
        lanes.extend(per_joint(trace, names, TORQUE, error));
        let share = curve(trace, "", 0, |tick| tick.sample.twin);
        lanes.push(Lane { height: 90.0, ..Lane::new("Share of the twin [1]", vec![share]) });
        stack("What was measured is felt, and beyond it the twin", trace, lanes)
    }
}
