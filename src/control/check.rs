//! The procedure of `haptize device check`: read with the motors off, then hold zero torque, then push with little
//! torque while a key is held.
//!
//! In the last phase each coordinate in turn is pushed by a sine of [`SWING`] Hz. If the device yields, the push does
//! positive work where map and sign are right, which the report shows as `moves_along`.

use super::{Clock, ControlLoop, Controller, Patience};
use crate::{
    Error, JointVector,
    device::{Applied, Device, Guard, Halt, Reading, Scheduler, Tally},
};
use serde::Serialize;
use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

/// Time between ticks, unless the device's own thread has one (s).
const PERIOD: f64 = 1e-3;

/// Rate of the push (Hz): slow enough to be followed by eye and hand.
const SWING: f64 = 0.5;

/// Part of the device's limit that pushes (1).
pub const PUSH_SHARE: f64 = 0.1;

/// One phase of the procedure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Motors off.
    Reading,
    /// Motors on, zero torque.
    ZeroTorque,
    /// A tenth of the torque.
    Push,
}

/// The findings of a phase.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// Which.
    pub phase: Phase,
    /// Duration (s).
    pub seconds: f64,
    /// Measurements that were new when they were taken.
    pub fresh: u64,
    /// Age of the oldest measurement (s).
    pub oldest: f64,
    /// Minimum and maximum of each coordinate (rad or m).
    pub range: Vec<[f64; 2]>,
    /// Work of the push on each coordinate (J): positive if the device moves the way it is pushed.
    pub moves_along: Vec<f64>,
    /// Whether each coordinate was pushed at all: not while the dead-man key is up.
    pub pushed: Vec<bool>,
    /// Clamps and stops.
    pub tally: Tally,
}

impl CheckReport {
    /// Whether the phase found nothing wrong: the device went on, and in the last phase each coordinate was pushed and
    /// moved the way it was pushed.
    #[must_use]
    pub fn is_good(&self) -> bool {
        let moved = || self.pushed.iter().zip(&self.moves_along).all(|(pushed, work)| *pushed && *work >= 0.0);
        self.tally.stopped.is_none() && (self.phase != Phase::Push || moved())
    }
}

/// A device in its own coordinates.
struct Bare<'a>(&'a mut Guard);

impl Device for Bare<'_> {
    fn read(&mut self, elapsed: f64) -> Reading {
        let measured = self.0.read(elapsed);
        Reading { age: measured.age, ..Reading::at(measured.position) }
    }

    fn apply(&mut self, effort: &JointVector) -> Applied {
        let held = self.0.write(effort);
        Applied { torque: held.effort, clamps: held.clamps, halt: held.halt }
    }

    fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
        self.0.scheduler()
    }
}

/// The controller of a phase of so many `seconds`.
struct Check {
    seconds: f64,
    most: JointVector,
    report: CheckReport,
    /// Position and effort at the last reading.
    last: Option<(JointVector, JointVector)>,
}

impl Controller for Check {
    type Record = ();

    fn joints(&self) -> usize {
        self.most.len()
    }

    fn answer(&mut self, reading: &Reading, elapsed: f64, _: f64) -> JointVector {
        let Self { seconds, report, .. } = self;
        report.seconds += elapsed;
        report.fresh += u64::from(reading.age <= elapsed);
        report.oldest = report.oldest.max(reading.age);
        let (before, effort) = self.last.unwrap_or((reading.position, self.most));
        for (a, position) in reading.position.iter().enumerate() {
            let [least, most] = &mut report.range[a];
            (*least, *most) = (least.min(*position), most.max(*position));
            report.moves_along[a] += effort[a] * (position - before[a]);
        }
        let mut wanted = JointVector::zeros(self.most.len());
        if report.phase == Phase::Push {
            // Each coordinate has its turn of the same length.
            let turn = ((report.seconds / *seconds * wanted.len() as f64) as usize).min(wanted.len() - 1);
            wanted[turn] = self.most[turn] * (std::f64::consts::TAU * SWING * report.seconds).sin();
        }
        self.last = Some((reading.position, wanted));
        wanted
    }

    fn held(&mut self, applied: &Applied) {
        let Self { report, last, .. } = self;
        last.iter_mut().for_each(|(_, effort)| *effort = applied.torque);
        report.pushed.iter_mut().zip(applied.torque.iter()).for_each(|(pushed, effort)| *pushed |= *effort != 0.0);
        // With its motors off nothing is asked of it yet.
        let counts = |halt: &Halt| report.phase != Phase::Reading || halt.is_final();
        report.tally.add(applied.clamps, applied.halt.filter(counts));
    }
}

/// Runs `phase` for `seconds` on `guard`, or until `stop` is raised. Motors are switched on where the phase needs them.
///
/// # Errors
/// When the device refuses to switch its motors on, or there is no memory.
pub fn check(guard: &mut Guard, phase: Phase, seconds: f64, stop: &AtomicBool) -> Result<CheckReport, Error> {
    let count = guard.coordinates().count();
    if phase == Phase::ZeroTorque {
        guard.enable()?;
    }
    if phase == Phase::Push {
        guard.limit_to(PUSH_SHARE);
    }
    let report = CheckReport {
        phase,
        seconds: 0.0,
        fresh: 0,
        oldest: 0.0,
        range: vec![[f64::INFINITY, f64::NEG_INFINITY]; count],
        moves_along: vec![0.0; count],
        pushed: vec![false; count],
        tally: Tally::default(),
    };
    let check = Check { seconds, most: *guard.most(), report, last: None };
    let goes_on = || (!stop.load(Ordering::Relaxed)).then_some(Patience::Sleeps);
    let mut device = Bare(guard);
    // No scene says how often: at the device's own rate, whatever it is.
    let period = device.scheduler().map_or(PERIOD, |scheduler| 1.0 / scheduler.rate());
    let mut clock = Clock::of(&device, period, "the check", &goes_on)?;
    let mut driver = ControlLoop::of(check, &mut device);
    // In an ordinary thread: it is to be careful, not punctual.
    driver.pace(&mut clock, &mut |check, (), _| {
        check.report.seconds < check.seconds && check.report.tally.stopped.is_none()
    });
    Ok(driver.controller.report.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{Command, Coordinates, Hardware, Limits, Measurement, Watchdog};

    /// One slide whose library calls 250 times a second.
    struct Slow;

    impl Hardware for Slow {
        fn description(&self) -> String {
            "a slow library".into()
        }

        fn coordinates(&self) -> Coordinates {
            Coordinates::Joints(1)
        }

        fn limits(&self) -> Limits {
            Limits { effort: JointVector::from_slice(&[1.0]), watchdog: Watchdog::None }
        }

        fn enable(&mut self) -> Result<(), Halt> {
            Ok(())
        }

        fn read(&mut self, _: f64) -> Result<Measurement, Halt> {
            Ok(Measurement::plain(JointVector::zeros(1), 0.0))
        }

        fn write(&mut self, _: &JointVector) -> Result<Command, Halt> {
            Ok(Command::Whole)
        }

        fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
            Some(Arc::new(Library))
        }

        fn release(&mut self) {}
    }

    struct Library;

    impl Scheduler for Library {
        fn run(&self, tick: &mut (dyn FnMut() -> bool + Send)) -> Result<(), Halt> {
            while tick() {
                std::thread::sleep(std::time::Duration::from_secs_f64(1.0 / self.rate()));
            }
            Ok(())
        }

        fn rate(&self) -> f64 {
            250.0
        }
    }

    #[test]
    fn a_device_is_checked_at_the_rate_of_its_own_library() {
        let mut guard = Guard::new(Box::new(Slow), None).unwrap();
        let stop = AtomicBool::new(false);
        for phase in [Phase::Reading, Phase::ZeroTorque] {
            let report = check(&mut guard, phase, 0.1, &stop).unwrap();
            assert!(report.seconds >= 0.1 && report.fresh > 1 && report.is_good(), "{report:?}");
        }
    }
}
