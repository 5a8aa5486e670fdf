//! The scan as what answers a device: a state machine that goes from stop to stop, waits until the device is steady, and
//! averages; or waits for a hand, gives way to it, and measures where it lets go.
//!
//! The torque that is commanded is taken for the measured one. So a scan ends when the device holds less than that: by
//! a clamp in size, warm motors, or a stop. The ramp at the start is over long before the first measurement.

use super::{PdControl, PdOutput, RowStatus, ScanRow, Steadiness, Stop, plan::PressRecord};
use crate::{
    JointVector,
    control::Controller,
    device::{Applied, Clamps, Halt, Reading},
    proxy::{Chain, Pose},
    scene::{JointKind, JointSpec, ScanSpec},
};
use glam::DVec3;
use std::sync::atomic::{AtomicBool, Ordering};

/// Acceleration of gravity (m/s^2), standard value.
pub const GRAVITY: f64 = 9.806_65;

/// Time that a row of a recorded press averages, and what it may be more of the time since the device arrived, as the
/// object's force changes ever more slowly (s, 1).
const RECORD_TIME: f64 = 5e-3;
const RECORD_SHARE: f64 = 0.1;

/// Time for which a device is braked after a limit (s): several time constants of damping against inertia.
const BRAKE_TIME: f64 = 0.3;

/// Where a scan goes.
pub(super) enum Route {
    /// To these stops, the last one first; of a plan of so many points.
    Planned(Vec<Stop>, usize),
    /// Where a hand leads, for so many seconds.
    Guided(f64),
}

/// A limit that was exceeded.
#[derive(Clone, Copy, Debug)]
pub(super) enum Limit {
    /// The torque on a joint.
    Torque(usize, f64),
    /// The speed of a joint.
    Speed(usize, f64),
    /// The place of the proxy (m).
    Workspace(DVec3),
}

/// Why a scan ended before its time.
#[derive(Clone, Copy, Debug)]
pub(super) enum End {
    /// At a limit, on the way to this point.
    Limit(usize, Limit),
    /// The device let go.
    Halt(Halt),
    /// The device held less than this (N m or N).
    Reduced(JointVector, Clamps),
}

/// What the controller is about.
enum Stage {
    /// It answers the first reading by zero torque.
    First,
    /// It holds the device where the second reading finds it.
    Second,
    Going(Stop),
    /// Until a hand takes hold.
    Waiting,
    /// By a hand.
    Led,
    /// Until the device is steady; whether it was at the last tick, if there was one here.
    Settling {
        arrived: f64,
        steady: Option<bool>,
    },
    Averaging,
    /// At a stop that is recorded, since this time.
    Holding {
        arrived: f64,
        recorded: PressRecord,
    },
    /// After a limit: damping alone, for so many more ticks.
    Braking(Limit, usize),
    Over,
}

/// Mean and squares of what is measured at a point.
struct Average {
    status: RowStatus,
    ticks: u32,
    q: JointVector,
    torque: JointVector,
    squares: JointVector,
}

/// A device under control, tick by tick.
pub(super) struct ScanController<'a> {
    spec: &'a ScanSpec,
    chain: &'a Chain,
    route: Route,
    stop: &'a AtomicBool,
    control: PdControl,
    brake: PdControl,
    steady: Steadiness,
    pose: Pose,
    /// The node whose position is kept within the workspace.
    node: usize,
    period: f64,
    average: Average,
    /// Ticks that are averaged at a point.
    average_ticks: u32,
    stage: Stage,
    /// Time of the last reading, and of the second one (s).
    time: f64,
    begun: f64,
    /// The point that is approached or measured.
    point: usize,
    /// Torque that was asked for.
    asked: JointVector,
    row: Option<ScanRow>,
    end: Option<End>,
}

impl<'a> ScanController<'a> {
    /// Goes `route`, from `point` on where a hand leads, until it is done or `stop` is raised.
    pub fn new(spec: &'a ScanSpec, chain: &'a Chain, (route, point): (Route, usize), stop: &'a AtomicBool) -> Self {
        let control = &spec.control;
        let zero = JointVector::zeros(chain.degrees_of_freedom());
        let ticks = (control.window * control.rate).round() as usize;
        Self {
            spec,
            chain,
            route,
            stop,
            control: PdControl::new(control.stiffness, control.damping, zero),
            brake: PdControl::new(zero, control.damping, zero),
            steady: Steadiness::new(ticks, control.still, control.drift),
            pose: chain.new_pose(),
            node: spec.plan.node(chain.nodes.len()),
            period: 1.0 / control.rate,
            average: Average::new(zero.len(), RowStatus::Steady),
            average_ticks: (control.average * control.rate).round().max(1.0) as u32,
            stage: Stage::First,
            time: 0.0,
            begun: 0.0,
            point,
            asked: zero,
            row: None,
            end: None,
        }
    }

    /// Time since the scan began (s).
    pub fn seconds(&self) -> f64 {
        self.time - self.begun
    }

    /// Whether it has ended.
    pub fn is_over(&self) -> bool {
        matches!(self.stage, Stage::Over)
    }

    /// Why it ended before its time, if it did.
    pub fn end(&self) -> Option<End> {
        self.end
    }

    /// Where to go next.
    fn depart(&mut self) -> Stage {
        if self.stop.load(Ordering::Relaxed) {
            return Stage::Over;
        }
        match &mut self.route {
            Route::Planned(stops, points) => {
                let Some(stop) = stops.pop() else { return Stage::Over };
                self.point = stop.point.unwrap_or(*points);
                self.average = Average::new(self.asked.len(), RowStatus::Moving);
                Stage::Going(stop)
            }
            Route::Guided(seconds) if self.time - self.begun < *seconds => Stage::Waiting,
            Route::Guided(_) => Stage::Over,
        }
    }

    /// Begins to wait until the device is steady where it is.
    fn settle(&mut self) -> Stage {
        self.control.rest();
        self.steady.restart();
        Stage::Settling { arrived: self.time, steady: None }
    }

    /// Begins to average.
    fn average(&mut self, status: RowStatus) -> Stage {
        self.average = Average::new(self.asked.len(), status);
        Stage::Averaging
    }

    /// Takes a tick of a recorded press, `held` for so long (s).
    fn record(&mut self, position: &JointVector, output: &PdOutput, held: f64) {
        self.average.add(position, &output.torque);
        let time = f64::from(self.average.ticks) * self.period;
        if time >= RECORD_TIME.max(RECORD_SHARE * held) {
            self.row = Some(self.average.row(self.point, self.time - 0.5 * (time - self.period)));
            self.average = Average::new(self.asked.len(), self.average.status);
        }
    }

    /// Whether it has been wherever it was to go.
    pub fn is_done(&self) -> bool {
        self.is_over() && !matches!(&self.route, Route::Planned(stops, _) if !stops.is_empty())
    }

    /// The torque of the PD control at `position`, unless a limit is exceeded; then the device is braked.
    #[expect(clippy::result_large_err, reason = "the real-time thread allocates no box")]
    fn control(&mut self, position: &JointVector) -> Result<PdOutput, Stage> {
        let output = self.control.torque(position, self.period);
        let ticks = (BRAKE_TIME * self.spec.control.rate) as usize;
        self.check(position, &output).map(|()| output).map_err(|limit| Stage::Braking(limit, ticks))
    }

    /// `Err` is the limit that is exceeded at `position`.
    fn check(&mut self, position: &JointVector, output: &PdOutput) -> Result<(), Limit> {
        let limits = &self.spec.limits;
        for joint in 0..position.len() {
            if output.torque[joint].abs() > limits.torque[joint] {
                return Err(Limit::Torque(joint, output.torque[joint].abs()));
            }
            if output.speed[joint].abs() > limits.speed {
                return Err(Limit::Speed(joint, output.speed[joint].abs()));
            }
        }
        self.chain.pose(position, &mut self.pose);
        let place = self.pose.nodes[self.node];
        let [least, greatest] = limits.workspace;
        let is_outside = place.cmplt(least).any() || place.cmpgt(greatest).any();
        if is_outside { Err(Limit::Workspace(place)) } else { Ok(()) }
    }

    /// The torque that answers `reading` in this stage, without gravity; `Err` is the stage to go on with.
    #[expect(clippy::result_large_err, reason = "the real-time thread allocates no box")]
    fn stage(&mut self, stage: Stage, reading: &Reading) -> Result<Option<JointVector>, Stage> {
        let position = &reading.position;
        let (next, output) = match stage {
            Stage::First => {
                self.stage = Stage::Second;
                return Ok(None);
            }
            Stage::Second => {
                self.control.follow(position);
                self.begun = self.time;
                return Err(self.depart());
            }
            Stage::Going(stop) => {
                let speed = stop.recorded.map_or(self.spec.control.speed, |recorded| recorded.speed);
                if self.control.advance(&stop.q, speed, self.period) {
                    return Err(match (stop.recorded, stop.point) {
                        (Some(recorded), _) => {
                            self.control.rest();
                            self.average = Average::new(self.asked.len(), RowStatus::Moving);
                            Stage::Holding { arrived: self.time, recorded }
                        }
                        (None, Some(_)) => self.settle(),
                        (None, None) => self.depart(),
                    });
                }
                let output = self.control(position)?;
                if stop.recorded.is_some() {
                    self.record(position, &output, 0.0);
                }
                (Stage::Going(stop), output)
            }
            Stage::Holding { .. } if reading.held => return Err(self.depart()),
            Stage::Holding { arrived, recorded } if self.time - arrived >= recorded.hold => return Err(self.depart()),
            Stage::Holding { arrived, recorded } => {
                let output = self.control(position)?;
                // The device itself rings before that.
                let is_held = self.time - arrived >= self.spec.control.window;
                if is_held && self.average.status == RowStatus::Moving {
                    self.average = Average::new(self.asked.len(), RowStatus::Held);
                }
                self.record(position, &output, self.time - arrived);
                (Stage::Holding { arrived, recorded }, output)
            }
            Stage::Waiting if reading.held => return Err(Stage::Led),
            Stage::Waiting => match self.depart() {
                waiting @ Stage::Waiting => (waiting, self.control(position)?),
                over => return Err(over),
            },
            Stage::Led => {
                self.control.follow(position);
                if !reading.held {
                    return Err(self.settle());
                }
                if let over @ Stage::Over = self.depart() {
                    return Err(over);
                }
                (Stage::Led, self.control.torque(position, self.period))
            }
            Stage::Settling { steady: Some(_), .. } if reading.held => return Err(self.depart()),
            Stage::Settling { steady: Some(true), .. } => return Err(self.average(RowStatus::Steady)),
            Stage::Settling { arrived, steady: Some(false) } if self.time - arrived > self.spec.control.timeout => {
                return Err(self.average(RowStatus::Unsteady));
            }
            Stage::Settling { arrived, .. } => {
                let output = self.control(position)?;
                let steady = Some(self.steady.observe(position, &output.torque));
                (Stage::Settling { arrived, steady }, output)
            }
            Stage::Averaging if reading.held && self.average.ticks > 0 => return Err(self.depart()),
            Stage::Averaging if self.average.ticks >= self.average_ticks => {
                self.row = Some(self.average.row(self.point, self.time));
                self.point += 1;
                return Err(self.depart());
            }
            Stage::Averaging => {
                let output = self.control(position)?;
                self.average.add(position, &output.torque);
                (Stage::Averaging, output)
            }
            Stage::Braking(limit, 0) => {
                let zero = JointVector::zeros(position.len());
                let mut stopped = Average::new(position.len(), RowStatus::Limit);
                stopped.add(position, &zero);
                self.row = Some(stopped.row(self.point, self.time));
                self.end = Some(End::Limit(self.point, limit));
                return Ok(None);
            }
            Stage::Braking(limit, ticks) => {
                (Stage::Braking(limit, ticks - 1), self.brake.torque(position, self.period))
            }
            Stage::Over => return Ok(None),
        };
        self.stage = next;
        Ok(Some(output.torque))
    }
}

impl Controller for ScanController<'_> {
    /// A row that was measured.
    type Record = Option<ScanRow>;

    fn joints(&self) -> usize {
        self.asked.len()
    }

    fn answer(&mut self, reading: &Reading, elapsed: f64, _: f64) -> JointVector {
        if !matches!(self.stage, Stage::First) {
            self.time += elapsed;
        }
        let torque = loop {
            let stage = std::mem::replace(&mut self.stage, Stage::Over);
            match self.stage(stage, reading) {
                Ok(torque) => break torque,
                Err(stage) => self.stage = stage,
            }
        };
        self.asked = JointVector::zeros(self.asked.len());
        if let Some(torque) = torque {
            self.chain.pose(&reading.position, &mut self.pose);
            let weight = self.chain.gravity_torque(&self.pose, DVec3::new(0.0, 0.0, -GRAVITY));
            self.asked = torque;
            self.asked.iter_mut().zip(weight.iter()).for_each(|(total, weight)| *total -= weight);
        }
        self.asked
    }

    fn held(&mut self, applied: &Applied) -> Option<ScanRow> {
        if !self.is_over() {
            if let Some(halt) = applied.halt {
                (self.stage, self.end) = (Stage::Over, Some(End::Halt(halt)));
            } else if applied.clamps.intersects(Clamps::SIZE | Clamps::WARM) {
                (self.stage, self.end) = (Stage::Over, Some(End::Reduced(self.asked, applied.clamps)));
            }
        }
        self.row.take()
    }
}

impl Average {
    fn new(joints: usize, status: RowStatus) -> Self {
        let zero = JointVector::zeros(joints);
        Self { status, ticks: 0, q: zero, torque: zero, squares: zero }
    }

    /// Takes a tick with the device at `position` under `torque` of the control: the contact's is minus that.
    fn add(&mut self, position: &JointVector, torque: &JointVector) {
        self.ticks += 1;
        for joint in 0..position.len() {
            self.q[joint] += (position[joint] - self.q[joint]) / f64::from(self.ticks);
            let before = -torque[joint] - self.torque[joint];
            self.torque[joint] += before / f64::from(self.ticks);
            self.squares[joint] += before * (-torque[joint] - self.torque[joint]);
        }
    }

    fn row(&self, point: usize, time: f64) -> ScanRow {
        let Self { status, ticks, q, torque, mut squares } = *self;
        squares.iter_mut().for_each(|sum| *sum = (*sum / f64::from((ticks - 1).max(1))).sqrt());
        ScanRow { point, time, q, torque, deviation: squares, ticks, status }
    }
}

impl Limit {
    /// Says which limit of a scan by `spec` it is, and by how much.
    pub fn text(self, spec: &ScanSpec, chain: &Chain) -> String {
        let limits = &spec.limits;
        match self {
            Self::Torque(joint, torque) => {
                let JointSpec { name, kind, .. } = &chain.joints[joint];
                let what = if *kind == JointKind::Revolute { "torque" } else { "force" };
                let (most, unit) = (limits.torque[joint], kind.effort_unit());
                format!("the {what} of joint `{name}` is {torque:.3}, its limit is {most} {unit}")
            }
            Self::Speed(joint, speed) => {
                let JointSpec { name, kind, .. } = &chain.joints[joint];
                format!("the speed of joint `{name}` is {speed:.3}, the limit is {} {}/s", limits.speed, kind.unit())
            }
            Self::Workspace(place) => {
                let [least, greatest] = limits.workspace;
                format!("the proxy is at {place:.4} m, outside the workspace {least} to {greatest}")
            }
        }
    }
}
