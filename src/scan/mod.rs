//! Haptization of a real object (section 2.2): a device, held by PD control, is led through a plan of configurations;
//! where it is steady, the contact torque is minus the control torque, gravity subtracted. Or a hand leads it: the
//! device gives way while it is held, holds on where it is let go, and is measured there, so that no row contains the
//! hand's own torque.
//!
//! What answers the device is a state machine (`controller.rs`), ticked like any other (`control/`). The device is the
//! [`simulated`] one, which touches no real object, and every log and dataset made with it says so; or a real one.

mod controller;
mod friction;
mod log;
mod pd_control;
mod plan;
pub mod simulated;
mod steady;
mod trajectory;

pub use controller::GRAVITY;
pub use friction::{add_slip, identify_friction};
pub use log::{LogHeader, LogWriter, RowStatus, SIGNATURE, ScanLog, ScanRow};
pub use pd_control::{PdControl, PdOutput};
pub use plan::{Plan, PressRecord, Stop};
pub use steady::Steadiness;
pub use trajectory::{PLAN, PLAN_LIBRARY, Trajectory};

use crate::{
    Error,
    control::{Clock, ControlLoop, Patience, beside},
    dataset::JointLabel,
    device::{Clamps, Device},
    error,
    proxy::Chain,
    scene::{JointSpec, ScanSpec},
};
use controller::{End, Route, ScanController};
use std::{
    collections::HashSet,
    fmt,
    sync::atomic::{AtomicBool, Ordering},
};

/// Where the rate of a scan is set.
pub const RATE: &str = "[scan.control] of the scene";

/// Measured rows that wait for the disk.
const ROWS: usize = 256;

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
    /// Presses of which rows were recorded, earlier runs included.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub histories: Option<usize>,
    /// Time on the rig's clock in this run (s).
    pub seconds: f64,
    /// True when every point that can be reached was logged, or a hand led for the time that was asked for.
    pub whole: bool,
    /// The rig's own words.
    pub rig: String,
    /// True where no real object was touched.
    pub simulated: bool,
}

/// Names and units of a chain's joints.
#[must_use]
pub fn labels(chain: &Chain) -> Vec<JointLabel> {
    let label = |joint: &JointSpec| JointLabel { name: joint.name.clone(), unit: joint.kind.unit().to_owned() };
    chain.joints.iter().map(label).collect()
}

/// A device and a log, ready to scan.
pub struct Session<'a> {
    /// How to scan.
    pub spec: &'a ScanSpec,
    /// The device's chain.
    pub chain: &'a Chain,
    /// The device, joint-true.
    pub device: &'a mut dyn Device,
    /// Whether it has a time of its own, so that it is ticked against that and `stop` ends the scan at once: motors are
    /// on. Else it is ticked as fast as it goes.
    pub against_time: bool,
    /// What the log says of device and scan.
    pub header: &'a LogHeader,
    /// Where rows go.
    pub log: &'a mut LogWriter,
    /// Ends the scan after the current point.
    pub stop: &'a AtomicBool,
    /// Called after every point.
    pub progress: &'a mut (dyn FnMut(ScanProgress) + Send),
}

impl Session<'_> {
    /// Leads the device through `plan` and logs every point that is not among `logged`.
    ///
    /// # Errors
    /// When the device or the log fails, or a limit is exceeded; the log then holds all that was measured.
    pub fn scan(&mut self, plan: &Plan, logged: &[ScanRow]) -> Result<ScanReport, Error> {
        let done: HashSet<usize> = logged.iter().map(|row| row.point).collect();
        let stops = pending(plan, &done).into_iter().rev().collect();
        let unreachable = plan.unreachable.len();
        let report = ScanReport { points: plan.points, unreachable, ..ScanReport::default() };
        let mut report = self.run((Route::Planned(stops, plan.points), 0), report, logged)?;
        report.whole = report.whole && report.logged() >= plan.points - unreachable;
        Ok(report)
    }

    /// Logs wherever a hand leads the device to and lets go of it, for `seconds`; rows are numbered on from those
    /// `logged`.
    ///
    /// While the hand holds the device ([`Reading::held`](crate::device::Reading::held)), damping alone resists it, and
    /// no limit applies: nothing drives it. Once it is let go, PD control holds it where it is, under all limits; when
    /// it is steady, it is measured. A hand that takes hold meanwhile ends the measurement without a row.
    ///
    /// # Errors
    /// When the device or the log fails, or a limit is exceeded; the log then holds all that was measured.
    pub fn guided(&mut self, seconds: f64, logged: &[ScanRow]) -> Result<ScanReport, Error> {
        let next = logged.iter().map(|row| row.point + 1).max().unwrap_or(0);
        let mut report = self.run((Route::Guided(seconds), next), ScanReport::default(), logged)?;
        (report.points, report.whole) = (report.logged(), true);
        Ok(report)
    }

    /// Runs the scan and counts its rows in `report`.
    fn run(&mut self, route: (Route, usize), mut report: ScanReport, logged: &[ScanRow]) -> Result<ScanReport, Error> {
        (report.rig, report.simulated) = (self.header.rig.clone(), self.header.simulated);
        let mut last_recorded = None;
        let mut count = |report: &mut ScanReport, row: &ScanRow| {
            if row.status.is_recorded() {
                let is_new = last_recorded.replace(row.point) != Some(row.point);
                *report.histories.get_or_insert(0) += usize::from(is_new);
            }
            report.count(row.status);
        };
        logged.iter().for_each(|row| count(&mut report, row));
        let (spec, chain, against_time) = (self.spec, self.chain, self.against_time);
        let controller = ScanController::new(spec, chain, route, self.stop);
        let (log, progress) = (&mut *self.log, &mut *self.progress);
        let reachable = report.points - report.unreachable;
        let mut keep = |row: ScanRow| -> Result<(), Error> {
            log.append(&row)?;
            count(&mut report, &row);
            let done = report.logged();
            progress(ScanProgress { done, points: reachable.max(done), time: row.time });
            Ok(())
        };
        let (failed, period) = (AtomicBool::new(false), 1.0 / spec.control.rate);
        let stop = self.stop;
        let patience = || (!failed.load(Ordering::Relaxed) && !stop.load(Ordering::Relaxed)).then_some(Patience::Spins);
        let mut kept = Ok(());
        let mut take = |row: ScanRow| {
            if kept.is_ok() {
                kept = keep(row);
                failed.store(kept.is_err(), Ordering::Relaxed);
            }
        };
        let mut stopped = Vec::new();
        let clock = if against_time { Clock::of(self.device, period, RATE, &patience)? } else { Clock::Steps(period) };
        let mut driver = ControlLoop::of(controller, self.device);
        if against_time {
            let (mut rows, measured) = rtrb::RingBuffer::new(ROWS);
            // A disk that keeps so many rows waiting is as good as one that fails.
            let send = |scan: &mut ScanController<'_>, row: Option<ScanRow>, _| {
                row.is_none_or(|row| rows.push(row).is_ok()) && !scan.is_over()
            };
            stopped = beside("device", measured, || driver.run(clock, send).refused, &mut take)?
                .map_err(|_| rig_failed("the thread that drives the device ended unexpectedly"))?;
        } else {
            driver.run(clock, |scan, row, _| {
                let is_measured = row.as_ref().is_some_and(|row| !row.status.is_recorded());
                row.into_iter().for_each(&mut take);
                let is_stopped = failed.load(Ordering::Relaxed) || is_measured && stop.load(Ordering::Relaxed);
                !scan.is_over() && !is_stopped
            });
        }
        let controller = &driver.controller;
        kept?;
        report.seconds = controller.seconds();
        report.whole = controller.is_done();
        match controller.end() {
            None if controller.is_over() || !against_time => Ok(report),
            None if stop.load(Ordering::Relaxed) => {
                Err(rig_failed("interrupted; --resume goes on after the last point in the log"))
            }
            None => Err(rig_failed(stopped.pop().unwrap_or_else(|| "the log takes too long to write".into()))),
            Some(End::Limit(point, limit)) => {
                let what = limit.text(spec, chain);
                Err(error!(
                    "stopped at point {point} for safety: {what}. The point is logged as `limit`; --resume goes on after it"
                ))
            }
            Some(End::Halt(halt)) => Err(rig_failed(halt)),
            Some(End::Reduced(torque, clamps)) => {
                let is_warm = clamps.contains(Clamps::WARM);
                let why = if is_warm { "its motors are warm" } else { "it is beyond the device's limit" };
                Err(rig_failed(format_args!(
                    "the device cannot hold {torque:.3?} (N m or N, joint by joint), {why}: what it would measure is \
                     not the contact's torque; press less deep or lower the gains of [scan.control]"
                )))
            }
        }
    }
}

/// The error of a device that failed.
fn rig_failed(why: impl fmt::Display) -> Error {
    error!("the rig failed: {why}")
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
        match status {
            RowStatus::Steady => self.steady += 1,
            RowStatus::Unsteady => self.unsteady += 1,
            RowStatus::Limit => self.limited += 1,
            RowStatus::Moving | RowStatus::Held => {}
        }
    }

    fn logged(&self) -> usize {
        self.steady + self.unsteady + self.limited
    }
}

#[cfg(test)]
mod tests;
