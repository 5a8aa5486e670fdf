//! When ticks are done: at absolute deadlines, as a device's own thread calls, as fast as it goes, or as they were
//! recorded.
//!
//! A deadline that has passed before its tick could begin is left out, and counted; the tick before then has a longer
//! interval. A deadline is never moved, so that no delay adds up.

use super::{
    real_time,
    timing::{Durations, Timing},
};
use crate::{
    Error,
    device::{Device, Scheduler},
    error,
};
use std::{sync::Arc, thread, time::Duration};

/// Relative difference of two rates of which one is the inverse of a period that is the inverse of the other (1): each
/// division rounds once.
const SAME_RATE: f64 = 2.0 * f64::EPSILON;

/// Longest time for which ticks are done afterwards while nobody waits for them; beyond that deadlines are left out.
pub const LONGEST_ARREARS: Duration = Duration::from_secs(1);

/// How long a clock waits at a time while nobody waits for ticks, unless its thread is woken before: waking up takes
/// longer than the ticks of that time, which are done afterwards.
const REST: Duration = Duration::from_millis(25);

/// Says how to wait for the next tick, or that there is none.
pub type Patient<'a> = &'a (dyn Fn() -> Option<Patience> + Sync);

/// The source of ticks.
pub enum Clock<'a> {
    /// As fast as it goes, a period (s) apart: deterministic.
    Steps(f64),
    /// As they were recorded: time since the tick before and to the next (s).
    Recorded(&'a mut (dyn Iterator<Item = (f64, f64)> + Send)),
    /// Against time.
    RealTime(Deadlines, Patient<'a>),
    /// As the device's own thread calls.
    Scheduled(Deadlines, Arc<dyn Scheduler>, Patient<'a>),
}

/// How a tick is waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patience {
    /// The processor is kept busy before it: it begins within microseconds of its deadline.
    Spins,
    /// Asleep: some tens of microseconds later, for a hand that is simulated.
    Sleeps,
    /// Nobody sees it. Ticks are done one behind the other when some of them are due, each at its deadline's time.
    Rests,
}

/// A tick that is due.
#[derive(Clone, Copy)]
pub(super) struct Due {
    /// When it begins.
    now: Duration,
    deadline: Duration,
    in_arrears: bool,
}

/// How a tick came about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Paced {
    /// Deadlines that have come so far, those that were left out included; 0 where there are none.
    pub deadlines: u64,
    /// Whether the tick was done after its time, while nobody waited for it.
    pub in_arrears: bool,
    /// When it began, since the system clock's origin; none where nothing is waited for.
    pub began: Option<Duration>,
}

/// Absolute deadlines, and how punctual the ticks were.
pub struct Deadlines {
    period: Duration,
    began: Duration,
    /// Until when nobody waited for ticks.
    rested: Duration,
    /// When the last tick began; none before the first.
    last: Option<Duration>,
    /// Number of the next deadline.
    next: u64,
    lateness: Durations,
    interval: Durations,
    cost: Durations,
    missed: u64,
    late: u64,
}

impl<'a> Clock<'a> {
    /// The clock of `device` with a tick every `period` (s), which is set in `place`: against time, or that of its own
    /// thread. It lasts while there is `patience`.
    ///
    /// # Errors
    /// When that thread calls at another rate, or there is no memory.
    pub fn of(device: &dyn Device, period: f64, place: &'static str, patience: Patient<'a>) -> Result<Self, Error> {
        let deadlines = Deadlines::new(period).ok_or("no memory for histograms: close other programs")?;
        let Some(scheduler) = device.scheduler() else { return Ok(Self::RealTime(deadlines, patience)) };
        check_rate(scheduler.as_ref(), period, place)?;
        Ok(Self::Scheduled(deadlines, scheduler, patience))
    }

    /// Asks the system for a real-time priority for the calling thread where ticks are waited for, and sets the first
    /// deadline to now. Returns what was not granted.
    pub fn begin(&mut self) -> Vec<String> {
        let Self::RealTime(deadlines, _) = self else { return Vec::new() };
        let refused = real_time::ask_for_real_time();
        deadlines.began = real_time::now();
        refused
    }

    /// How punctual its ticks were, and what was `refused`; all zero where nothing was waited for.
    #[must_use]
    pub fn timing(&self, refused: Vec<String>) -> Timing {
        let (Self::RealTime(deadlines, _) | Self::Scheduled(deadlines, ..)) = self else { return Timing::default() };
        Timing {
            refused,
            lateness: deadlines.lateness.percentiles(),
            lateness_bins: deadlines.lateness.bins(),
            interval: deadlines.interval.percentiles(),
            tick_cost: deadlines.cost.percentiles(),
            missed_deadlines: deadlines.missed,
            late: deadlines.late,
            ..Timing::default()
        }
    }
}

impl Deadlines {
    /// The first one now; none where there is no memory.
    fn new(period: f64) -> Option<Self> {
        Some(Self {
            period: Duration::from_secs_f64(period),
            began: real_time::now(),
            rested: Duration::ZERO,
            last: None,
            next: 0,
            lateness: Durations::new()?,
            interval: Durations::new()?,
            cost: Durations::new()?,
            missed: 0,
            late: 0,
        })
    }

    /// Waits for the next deadline, and returns the tick that is due; none if nobody waits for one and none is due yet.
    /// Those that became due while nobody waited are done first, whoever waits then.
    pub(super) fn wait(&mut self, patience: Patience) -> Option<Due> {
        let deadline = self.deadline(self.next);
        if patience == Patience::Rests && deadline > self.rested {
            thread::park_timeout(REST);
            self.rested = real_time::now();
        }
        if deadline <= self.rested {
            let in_arrears = self.rested - deadline <= LONGEST_ARREARS;
            return Some(Due { now: if in_arrears { deadline } else { self.rested }, deadline, in_arrears });
        }
        let wait =
            || Due { now: real_time::wait_until(deadline, patience == Patience::Spins), deadline, in_arrears: false };
        (patience != Patience::Rests).then(wait)
    }

    /// Returns the tick that is due where somebody else calls: a period after the last one, or now, if that was less
    /// long ago.
    pub(super) fn called(&mut self) -> Due {
        let now = real_time::now();
        let deadline = self.last.map_or(now, |last| (last + self.period).min(now));
        self.began = deadline.saturating_sub(times(self.period, self.next));
        Due { now, deadline, in_arrears: false }
    }

    /// Has a tick done that is due, with the time since the one before and to the next (s).
    pub(super) fn tick(&mut self, due: Due, tick: &mut impl FnMut(f64, f64, Paced) -> bool) -> bool {
        let Due { now, deadline, in_arrears } = due;
        let begun = real_time::now();
        let by = now - deadline;
        self.lateness.record(by);
        self.late += u64::from(by > self.period / 2);
        // The next deadline that is at least half a period away.
        let behind = (now + self.period / 2).saturating_sub(self.deadline(self.next + 1));
        let skipped = behind.as_nanos().div_ceil(self.period.as_nanos().max(1)) as u64;
        self.missed += skipped;
        self.next += 1 + skipped;
        let elapsed = self.last.map_or(self.period, |last| now.saturating_sub(last));
        if self.last.is_some() {
            self.interval.record(elapsed);
        }
        let interval = self.deadline(self.next).saturating_sub(now);
        self.last = Some(now);
        let paced = Paced { deadlines: self.next, in_arrears, began: Some(begun) };
        let goes_on = tick(elapsed.as_secs_f64(), interval.as_secs_f64(), paced);
        self.cost.record(real_time::now() - begun);
        goes_on
    }

    /// Deadline `number`, in time since the clock's origin.
    fn deadline(&self, number: u64) -> Duration {
        self.began + times(self.period, number)
    }
}

/// Whether `scheduler` calls every `period` (s), which is set in `place`.
///
/// # Errors
/// When it calls at another rate.
pub fn check_rate(scheduler: &dyn Scheduler, period: f64, place: &'static str) -> Result<(), Error> {
    let (device, scene) = (scheduler.rate(), 1.0 / period);
    if (device - scene).abs() > SAME_RATE * scene {
        return Err(error!(
            "the device's own thread calls {device} times a second, and the scene's loop runs at {scene} Hz: set rate \
             = {device} in {place}"
        ));
    }
    Ok(())
}

/// `count` periods. Unlike `Duration * u32` it does not run out within a session of some weeks.
fn times(period: Duration, count: u64) -> Duration {
    let nanoseconds = period.as_nanos() * u128::from(count);
    Duration::new((nanoseconds / 1_000_000_000) as u64, (nanoseconds % 1_000_000_000) as u32)
}
