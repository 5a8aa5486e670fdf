//! Haptization of a real object (section 2.2): a device, held by PD control, is led through a plan of configurations;
//! where it is steady, the contact torque is minus the control torque, gravity subtracted. Or a hand leads it: the
//! device gives way while it is held, holds on where it is let go, and is measured there, so that no row contains the
//! hand's own torque.
//!
//! Everything here drives a [`Rig`]: the [`simulated`] one, which touches no real object, and every log and dataset
//! made with it says so; or a device's (`device/rig.rs`).

mod control;
mod log;
mod plan;
mod rig;
pub mod simulated;
mod steady;
mod trajectory;

pub use control::{PdControl, PdOutput};
pub use log::{LogError, LogHeader, LogWriter, RowStatus, SIGNATURE, ScanLog, ScanRow};
pub use plan::{Plan, Stop};
pub use rig::{Rig, RigError, RigReading};
pub use steady::Steadiness;
pub use trajectory::Trajectory;

use crate::{
    JointVector,
    dataset::JointLabel,
    proxy::{Chain, Pose},
    scene::{JointKind, JointSpec, ScanSpec},
};
use glam::DVec3;
use std::{
    collections::HashSet,
    sync::atomic::{AtomicBool, Ordering},
};

/// Acceleration of gravity (m/s^2), standard value.
pub const GRAVITY: f64 = 9.806_65;

/// Time for which a device is braked after a limit (s): several time constants of damping against inertia.
const BRAKE_TIME: f64 = 0.3;

/// A scan failed or was stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScanError {
    /// The plan has too many points.
    #[error("the plan has more than {limit} points: widen its spacing")]
    TooManyPoints {
        /// The limit.
        limit: usize,
    },
    /// Not a point of the plan can be reached.
    #[error("the joints reach no point of the plan: check its start, directions and the joints' limits")]
    NothingReachable,
    /// The device failed.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The log failed.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A limit stopped the scan.
    #[error("stopped at point {point} for safety: {what}. The point is logged as `limit`; --resume goes on after it")]
    Limit {
        /// Number of the point that was approached.
        point: usize,
        /// Which limit, and by how much.
        what: String,
    },
}

/// How far a scan has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanProgress {
    /// Points logged, earlier ones included.
    pub done: usize,
    /// Points of the plan that can be reached.
    pub points: usize,
    /// Time on the rig's clock (s).
    pub time: f64,
}

/// Report of a scan.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct ScanReport {
    /// Points of the plan; where a hand led, those logged.
    pub points: usize,
    /// Points measured in steady contact or free space, earlier runs included.
    pub steady: usize,
    /// Points that were not steady in time.
    pub unsteady: usize,
    /// Points at which a limit stopped an earlier run.
    pub limited: usize,
    /// Points that the joints do not reach.
    pub unreachable: usize,
    /// Time on the rig's clock in this run (s).
    pub seconds: f64,
    /// True when every point that can be reached was logged, or a hand led for the time that was asked for.
    pub whole: bool,
    /// The rig's own words.
    pub rig: String,
    /// True where no real object was touched.
    pub simulated: bool,
}

/// A rig under control, tick by tick.
struct Driver<'a> {
    spec: &'a ScanSpec,
    chain: &'a Chain,
    rig: &'a mut dyn Rig,
    control: PdControl,
    steady: Steadiness,
    pose: Pose,
    /// The node whose position is kept within the workspace.
    node: usize,
    reading: RigReading,
    period: f64,
}

/// Names and units of a chain's joints.
#[must_use]
pub fn labels(chain: &Chain) -> Vec<JointLabel> {
    let label = |joint: &JointSpec| JointLabel { name: joint.name.clone(), unit: joint.kind.unit().to_owned() };
    chain.joints.iter().map(label).collect()
}

/// A rig and a log, ready to scan.
pub struct Session<'a> {
    /// How to scan.
    pub spec: &'a ScanSpec,
    /// The device's chain.
    pub chain: &'a Chain,
    /// The device.
    pub rig: &'a mut dyn Rig,
    /// Where rows go.
    pub log: &'a mut LogWriter,
    /// Ends the scan after the current point.
    pub stop: &'a AtomicBool,
    /// Called after every point.
    pub progress: &'a mut dyn FnMut(ScanProgress),
}

impl Session<'_> {
    /// Leads the rig through `plan` and logs every point that is not among `logged`.
    ///
    /// # Errors
    /// When the rig or the log fails, or a limit is exceeded; the log then holds all that was measured.
    pub fn scan(&mut self, plan: &Plan, logged: &[ScanRow]) -> Result<ScanReport, ScanError> {
        let mut report = self.report(plan.points);
        report.unreachable = plan.unreachable.len();
        logged.iter().for_each(|row| report.count(row.status));
        let reachable = plan.points - plan.unreachable.len();
        let done: HashSet<usize> = logged.iter().map(|row| row.point).collect();
        let mut driver = Driver::start(self.spec, self.chain, &mut *self.rig)?;
        let begun = driver.reading.time;
        for next in pending(plan, &done) {
            if self.stop.load(Ordering::Relaxed) {
                break;
            }
            let row = match driver.visit(&next) {
                Ok(row) => row,
                Err(Interruption::Rig(error)) => return Err(error.into()),
                Err(Interruption::Limit(what)) => {
                    let row = driver.stopped(next.point.unwrap_or(plan.points))?;
                    self.log.append(&row)?;
                    return Err(ScanError::Limit { point: row.point, what });
                }
            };
            if let Some(row) = row {
                self.log.append(&row)?;
                report.count(row.status);
                (self.progress)(ScanProgress { done: report.logged(), points: reachable, time: row.time });
            }
        }
        report.seconds = driver.reading.time - begun;
        report.whole = report.logged() >= reachable;
        Ok(report)
    }

    /// Logs wherever a hand leads the device to and lets go of it, for `seconds`; rows are numbered on from those
    /// `logged`.
    ///
    /// While the hand holds the device ([`RigReading::held`]), damping alone resists it, and no limit applies: nothing
    /// drives it. Once it is let go, PD control holds it where it is, under all limits; when it is steady, it is
    /// measured. A hand that takes hold meanwhile ends the measurement without a row.
    ///
    /// # Errors
    /// When the rig or the log fails, or a limit is exceeded; the log then holds all that was measured.
    pub fn guided(&mut self, seconds: f64, logged: &[ScanRow]) -> Result<ScanReport, ScanError> {
        let mut report = self.report(0);
        logged.iter().for_each(|row| report.count(row.status));
        let mut next = logged.iter().map(|row| row.point + 1).max().unwrap_or(0);
        let mut driver = Driver::start(self.spec, self.chain, &mut *self.rig)?;
        let begun = driver.reading.time;
        let goes_on = |time: f64| time - begun < seconds && !self.stop.load(Ordering::Relaxed);
        while goes_on(driver.reading.time) {
            let row = match driver.be_led(next, &goes_on) {
                Ok(row) => row,
                Err(Interruption::Rig(error)) => return Err(error.into()),
                Err(Interruption::Limit(what)) => {
                    self.log.append(&driver.stopped(next)?)?;
                    return Err(ScanError::Limit { point: next, what });
                }
            };
            if let Some(row) = row {
                self.log.append(&row)?;
                next += 1;
                report.count(row.status);
                let done = report.logged();
                (self.progress)(ScanProgress { done, points: done, time: row.time });
            }
        }
        report.points = report.logged();
        report.seconds = driver.reading.time - begun;
        report.whole = true;
        Ok(report)
    }

    fn report(&self, points: usize) -> ScanReport {
        let (rig, simulated) = (self.rig.description(), self.rig.is_simulated());
        ScanReport { points, rig, simulated, ..ScanReport::default() }
    }
}

/// Why a visit ended early.
enum Interruption {
    Rig(RigError),
    Limit(String),
}

impl From<RigError> for Interruption {
    fn from(error: RigError) -> Self {
        Self::Rig(error)
    }
}

/// Stops whose point is not done; way points only where they lead to or from one.
fn pending(plan: &Plan, done: &HashSet<usize>) -> Vec<Stop> {
    let open = |stop: &Stop| stop.point.is_some_and(|point| !done.contains(&point));
    let mut stops: Vec<Stop> = Vec::new();
    let mut measured = false;
    for (index, stop) in plan.stops.iter().enumerate() {
        let leads = || {
            let line = plan.stops[index + 1..].iter().take_while(|next| next.point.is_some());
            line.clone().any(&open)
        };
        if open(stop) || stop.point.is_none() && (measured || leads()) {
            measured = stop.point.is_some();
            stops.push(*stop);
        }
    }
    stops
}

impl ScanReport {
    fn count(&mut self, status: RowStatus) {
        *match status {
            RowStatus::Steady => &mut self.steady,
            RowStatus::Unsteady => &mut self.unsteady,
            RowStatus::Limit => &mut self.limited,
        } += 1;
    }

    fn logged(&self) -> usize {
        self.steady + self.unsteady + self.limited
    }
}

impl<'a> Driver<'a> {
    /// Reads the device and holds it where it is.
    fn start(spec: &'a ScanSpec, chain: &'a Chain, rig: &'a mut dyn Rig) -> Result<Self, ScanError> {
        let control = &spec.control;
        let period = 1.0 / control.rate;
        let reading = rig.hold(&JointVector::zeros(chain.degrees_of_freedom()), period)?;
        let ticks = (control.window * control.rate).round() as usize;
        let node = spec.plan.node(chain.nodes.len());
        let pd = PdControl::new(control.stiffness, control.damping, control.speed, reading.position);
        let steady = Steadiness::new(ticks, control.still, control.drift);
        Ok(Self { spec, chain, rig, control: pd, steady, pose: chain.new_pose(), node, reading, period })
    }

    /// One tick of control; true when the device is steady.
    fn tick(&mut self) -> Result<bool, Interruption> {
        let output = self.control.torque(&self.reading.position, self.period);
        self.check(&output).map_err(Interruption::Limit)?;
        let steady = self.steady.observe(&self.reading.position, &output.torque);
        self.hold(&output.torque)?;
        Ok(steady)
    }

    /// Holds `torque` and the weight of the links for a tick.
    fn hold(&mut self, torque: &JointVector) -> Result<(), RigError> {
        self.chain.pose(&self.reading.position, &mut self.pose);
        let weight = self.chain.gravity_torque(&self.pose, DVec3::new(0.0, 0.0, -GRAVITY));
        let mut total = *torque;
        total.iter_mut().zip(weight.iter()).for_each(|(total, weight)| *total -= weight);
        self.reading = self.rig.hold(&total, self.period)?;
        Ok(())
    }

    /// Returns a message if a quantity exceeds its limit.
    fn check(&mut self, output: &PdOutput) -> Result<(), String> {
        let limits = &self.spec.limits;
        let joints = &self.chain.joints;
        for (joint, (name, kind)) in joints.iter().map(|joint| (&joint.name, joint.kind)).enumerate() {
            let (unit, effort) = (kind.unit(), kind.effort_unit());
            let (torque, most) = (output.torque[joint].abs(), limits.torque[joint]);
            if torque > most {
                let what = if kind == JointKind::Revolute { "torque" } else { "force" };
                return Err(format!("the {what} of joint `{name}` is {torque:.3}, its limit is {most} {effort}"));
            }
            let (speed, most) = (output.speed[joint].abs(), limits.speed);
            if speed > most {
                return Err(format!("the speed of joint `{name}` is {speed:.3}, the limit is {most} {unit}/s"));
            }
        }
        self.chain.pose(&self.reading.position, &mut self.pose);
        let place = self.pose.nodes[self.node];
        let [least, greatest] = limits.workspace;
        if place.cmplt(least).any() || place.cmpgt(greatest).any() {
            return Err(format!("the proxy is at {place:.4} m, outside the workspace {least} to {greatest}"));
        }
        Ok(())
    }

    /// Goes to a stop; measures there if it is a point.
    fn visit(&mut self, stop: &Stop) -> Result<Option<ScanRow>, Interruption> {
        while !self.control.advance(&stop.q, self.period) {
            self.tick()?;
        }
        stop.point.map_or(Ok(None), |point| self.measure(point))
    }

    /// Waits for a hand, gives way to it, and measures where it lets go; `None` where it takes hold again before that,
    /// or the time is over.
    fn be_led(&mut self, point: usize, goes_on: &impl Fn(f64) -> bool) -> Result<Option<ScanRow>, Interruption> {
        while !self.reading.held {
            if !goes_on(self.reading.time) {
                return Ok(None);
            }
            self.tick()?;
        }
        while self.reading.held {
            if !goes_on(self.reading.time) {
                return Ok(None);
            }
            self.control.follow(&self.reading.position);
            let torque = self.control.torque(&self.reading.position, self.period).torque;
            self.hold(&torque)?;
        }
        self.control.follow(&self.reading.position);
        self.measure(point)
    }

    /// Waits where it is until the device is steady, and averages; `None` where a hand takes hold of it.
    fn measure(&mut self, point: usize) -> Result<Option<ScanRow>, Interruption> {
        self.control.rest();
        self.steady.restart();
        let arrived = self.reading.time;
        let status = loop {
            let steady = self.tick()?;
            if self.reading.held {
                return Ok(None);
            }
            if steady {
                break RowStatus::Steady;
            }
            if self.reading.time - arrived > self.spec.control.timeout {
                break RowStatus::Unsteady;
            }
        };
        self.average(point, status)
    }

    /// Averages position and contact torque; `None` where a hand takes hold of the device.
    fn average(&mut self, point: usize, status: RowStatus) -> Result<Option<ScanRow>, Interruption> {
        let joints = self.chain.degrees_of_freedom();
        let zero = JointVector::zeros(joints);
        let (mut q, mut torque, mut squares) = (zero, zero, zero);
        let ticks = (self.spec.control.average * self.spec.control.rate).round().max(1.0) as u32;
        for tick in 1..=ticks {
            let output = self.control.torque(&self.reading.position, self.period);
            self.check(&output).map_err(Interruption::Limit)?;
            for joint in 0..joints {
                q[joint] += (self.reading.position[joint] - q[joint]) / f64::from(tick);
                let before = -output.torque[joint] - torque[joint];
                torque[joint] += before / f64::from(tick);
                squares[joint] += before * (-output.torque[joint] - torque[joint]);
            }
            self.hold(&output.torque)?;
            if self.reading.held {
                return Ok(None);
            }
        }
        let mut deviation = zero;
        for (deviation, sum) in deviation.iter_mut().zip(squares.iter()) {
            *deviation = (sum / f64::from((ticks - 1).max(1))).sqrt();
        }
        Ok(Some(ScanRow { point, time: self.reading.time, q, torque, deviation, ticks, status }))
    }

    /// After a limit: damping alone, until the device has come to rest; then the row that says where.
    fn stopped(&mut self, point: usize) -> Result<ScanRow, ScanError> {
        let joints = self.chain.degrees_of_freedom();
        let mut brake =
            PdControl::new(JointVector::zeros(joints), self.spec.control.damping, 0.0, self.reading.position);
        for _ in 0..(BRAKE_TIME * self.spec.control.rate) as usize {
            let torque = brake.torque(&self.reading.position, self.period).torque;
            self.hold(&torque)?;
        }
        let RigReading { time, position, .. } = self.reading;
        let zero = JointVector::zeros(joints);
        Ok(ScanRow { point, time, q: position, torque: zero, deviation: zero, ticks: 1, status: RowStatus::Limit })
    }
}

#[cfg(test)]
mod tests;
