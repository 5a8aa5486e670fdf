//! The one loop that ticks a device. A [`Clock`] says when, a [`Controller`] answers each reading by a torque, the device
//! holds what it can of that, and a sink takes the record. Sessions, replays, scans and the window differ in these four
//! and in nothing else.

mod check;
mod clock;
pub(crate) mod real_time;
pub mod timing;

pub use check::{CheckReport, PUSH_SHARE, Phase, check};
pub use clock::{Clock, LONGEST_ARREARS, Paced, Patience, check_rate};
use timing::Timing;

use crate::{
    Error, JointVector,
    device::{Applied, Device, Reading},
    threads::spawn_scoped,
};
use std::{thread, time::Duration};

/// How often records are taken over from another thread.
const TAKEN_EVERY: Duration = Duration::from_millis(5);

/// Runs `work` in a thread of its own of this `name`, and has `take` what that sends, soon after it, in this one.
/// Returns the result of `work`, or its panic.
///
/// # Errors
/// When the system gives no thread.
pub fn beside<T: Send, R: Send>(
    name: &str,
    mut sent: rtrb::Consumer<T>,
    work: impl FnOnce() -> R + Send,
    take: &mut dyn FnMut(T),
) -> Result<thread::Result<R>, Error> {
    thread::scope(|scope| {
        let working = spawn_scoped(scope, name, work)?;
        loop {
            let is_last = working.is_finished();
            while let Ok(record) = sent.pop() {
                take(record);
            }
            if is_last {
                return Ok(working.join());
            }
            thread::sleep(TAKEN_EVERY);
        }
    })
}

/// Answers readings by torques.
pub trait Controller: Send {
    /// The record of a tick.
    type Record: Send;

    /// Number of joints d.
    fn joints(&self) -> usize;

    /// Returns the torque that answers `reading` (N m or N), `elapsed` after the one before and `interval` before the
    /// next (s). Like all here it must not allocate, lock or wait.
    fn answer(&mut self, reading: &Reading, elapsed: f64, interval: f64) -> JointVector;

    /// Takes what the device holds of that torque, which ends the tick.
    fn held(&mut self, applied: &Applied) -> Self::Record;
}

/// A controller and its device: one call a tick. However it ends, it leaves the device without torque.
pub struct ControlLoop<'device, C: Controller> {
    /// The controller.
    pub controller: C,
    device: &'device mut dyn Device,
    has_ticked: bool,
}

impl<'device, C: Controller> ControlLoop<'device, C> {
    /// `controller` with `device`.
    #[must_use]
    pub fn of(controller: C, device: &'device mut dyn Device) -> Self {
        Self { controller, device, has_ticked: false }
    }

    /// One tick, `elapsed` after the one before and `interval` before the next (s): read, compute, apply. Never
    /// allocates unless the controller or the device does.
    pub fn tick(&mut self, elapsed: f64, interval: f64) -> C::Record {
        // The first reading comes at once.
        let since = if std::mem::replace(&mut self.has_ticked, true) { elapsed } else { 0.0 };
        let reading = self.device.read(since);
        let torque = self.controller.answer(&reading, elapsed, interval);
        let applied = self.device.apply(&torque);
        self.controller.held(&applied)
    }

    /// Ticks as `clock` says until `sink`, which takes each record, returns false; then commands zero torque. Asks the
    /// system for a real-time priority where the clock needs one.
    pub fn run(
        &mut self,
        mut clock: Clock<'_>,
        mut sink: impl FnMut(&mut C, C::Record, Paced) -> bool + Send,
    ) -> Timing {
        let mut refused = clock.begin();
        refused.extend(self.pace(&mut clock, &mut sink));
        clock.timing(refused)
    }

    /// As [`ControlLoop::run`], without asking the system for anything: it allocates, locks and prints nothing. Returns
    /// what stopped the device's own thread, if that calls.
    pub fn pace(
        &mut self,
        clock: &mut Clock<'_>,
        sink: &mut (impl FnMut(&mut C, C::Record, Paced) -> bool + Send),
    ) -> Option<String> {
        let mut stopped = None;
        match clock {
            Clock::Steps(period) => while self.step(*period, *period, Paced::default(), sink) {},
            Clock::Recorded(times) => {
                while let Some((elapsed, interval)) = times.next()
                    && self.step(elapsed, interval, Paced::default(), sink)
                {}
            }
            Clock::RealTime(deadlines, patience) => {
                let mut tick = |elapsed, interval, paced| self.step(elapsed, interval, paced, sink);
                while let Some(patience) = patience()
                    && deadlines.wait(patience).is_none_or(|due| deadlines.tick(due, &mut tick))
                {}
            }
            Clock::Scheduled(deadlines, scheduler, patience) => {
                let run = scheduler.run(&mut || {
                    let mut tick = |elapsed, interval, paced| self.step(elapsed, interval, paced, sink);
                    let due = deadlines.called();
                    let goes_on = deadlines.tick(due, &mut tick) && patience().is_some();
                    if !goes_on {
                        self.let_go();
                    }
                    goes_on
                });
                stopped = run.err().map(|halt| format!("the device's own thread stopped: {halt}"));
            }
        }
        self.let_go();
        stopped
    }

    /// A tick, and what `sink` says of it.
    fn step(
        &mut self,
        elapsed: f64,
        interval: f64,
        paced: Paced,
        sink: &mut impl FnMut(&mut C, C::Record, Paced) -> bool,
    ) -> bool {
        let record = self.tick(elapsed, interval);
        sink(&mut self.controller, record, paced)
    }

    /// Commands zero torque: the last that a device hears of a session.
    pub fn let_go(&mut self) {
        self.device.apply(&JointVector::zeros(self.controller.joints()));
    }
}

impl<C: Controller> Drop for ControlLoop<'_, C> {
    fn drop(&mut self) {
        self.let_go();
    }
}
