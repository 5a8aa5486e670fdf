//! The watchdog of the haptic loop: what a tick may receive, and what must bring the torque to zero.
//!
//! A tick's inputs are good if the position is one (as many joints as the dataset has, finite, within reach), is fresh,
//! comes in time, and can have been reached: `|y_k - y_{k-1}| <= speed_limit max(T_{k-1}, T)` at each joint. The
//! nominal T in there keeps an encoder's step from looking like a leap when two ticks follow closely. The first failure
//! is a fault that stays, whatever comes after it, until somebody restarts the loop: a device that comes and goes must
//! not kick.
//!
//! *Overruns.* A deadline that is missed once costs nothing but a longer step: the proxy is passive at any T_k, and
//! what the longer hold gives the hand is seen at the device's port ([`Fault::Energy`]). When deadlines are missed
//! persistently the torque rests on positions which, by the end of each hold, are as old as the time between ticks. So
//! its mean over `PACE_WINDOW` may not exceed what the age of a position may not, [`GREATEST_POSITION_AGE`], or,
//! where the loop is slow by design, 2 T: every other deadline missed. With W the window, ticks are counted by
//! `n_k = n_{k-1} / (1 + T_{k-1}/W) + 1`, each weighing less the longer ago it was; ticks evenly T apart tend to
//! `n = W/T + 1`, so that the mean is taken to be `W / (n_k - 1)`. One pause alone, however long it may be
//! ([`GREATEST_INTERVAL`]), lengthens it by half and is never enough.

use super::{flags::Fault, inputs::Inputs};
use crate::{JointVector, input::GREATEST_INPUT, scene::GREATEST_INTERVAL};

/// Greatest age of a device's position on which a torque may rest (s): ten ticks at 1 kHz. A hand, which moves at below
/// 10 Hz, has gone on by no more than half a radian of its phase.
pub const GREATEST_POSITION_AGE: f64 = 0.01;

/// Least time between two ticks (s): a device's encoder steps, of 1e-5 rad or so, divided by less would give velocities
/// of tens of rad/s to a device at rest.
const LEAST_INTERVAL: f64 = 1e-6;

/// Time over which the mean time between ticks is taken (s): two of [`GREATEST_INTERVAL`], so that one such pause
/// lengthens the mean by half only, while persistent overruns are found within a second.
const PACE_WINDOW: f64 = 2.0 * GREATEST_INTERVAL;

/// Limits of the inputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watchdog {
    /// T (s).
    period: f64,
    /// Greatest speed of each joint that is taken for motion (rad/s or m/s).
    speed_limit: JointVector,
}

/// How the ticks have come lately: their number n, older ones weighing less (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickRate(f64);

impl TickRate {
    /// Mean time between ticks (s).
    #[must_use]
    pub fn mean(self) -> f64 {
        PACE_WINDOW / (self.0 - 1.0)
    }
}

impl Watchdog {
    /// A watchdog for ticks every `period` (s) and joints no faster than `speed_limit` (rad/s or m/s).
    #[must_use]
    pub fn new(period: f64, speed_limit: JointVector) -> Self {
        Self { period, speed_limit }
    }

    /// Whether `inputs` are good, the position before having been `before`.
    ///
    /// # Errors
    /// The first fault of the inputs.
    pub fn check(&self, inputs: &Inputs, before: &JointVector) -> Result<(), Fault> {
        self.check_position(&inputs.position)?;
        // A position from the future tells of clocks of which one is wrong. False for what is not a number.
        if !(0.0..=GREATEST_POSITION_AGE).contains(&inputs.age) {
            return Err(Fault::Stale);
        }
        if !(is_interval(inputs.elapsed) && is_interval(inputs.interval)) {
            return Err(Fault::Late);
        }
        let time = inputs.elapsed.max(self.period);
        let reached = |a: usize| (inputs.position[a] - before[a]).abs() <= self.speed_limit[a] * time;
        if (0..before.len()).all(reached) { Ok(()) } else { Err(Fault::Leap) }
    }

    /// The pace before the first tick: the nominal one.
    #[must_use]
    pub fn start(&self) -> TickRate {
        TickRate(PACE_WINDOW / self.period + 1.0)
    }

    /// Takes in that `elapsed` (s), which can lie between two ticks, lay before this one.
    ///
    /// # Errors
    /// When deadlines are missed persistently.
    pub fn follow(&self, pace: &mut TickRate, elapsed: f64) -> Result<(), Fault> {
        pace.0 = pace.0 / (1.0 + elapsed / PACE_WINDOW) + 1.0;
        if pace.mean() > self.greatest_mean() { Err(Fault::Overrun) } else { Ok(()) }
    }

    /// Longest mean time between ticks that may persist (s).
    #[must_use]
    pub fn greatest_mean(&self) -> f64 {
        GREATEST_POSITION_AGE.max(2.0 * self.period)
    }

    /// Whether `position` can be one of the device.
    ///
    /// # Errors
    /// Why not.
    pub fn check_position(&self, position: &JointVector) -> Result<(), Fault> {
        if position.len() != self.speed_limit.len() {
            return Err(Fault::Joints);
        }
        // Comparisons are false for what is not a number.
        if position.iter().all(|y| y.abs() <= GREATEST_INPUT) { Ok(()) } else { Err(Fault::NotFinite) }
    }
}

/// Whether `seconds` can lie between two ticks.
#[must_use]
pub fn is_interval(seconds: f64) -> bool {
    (LEAST_INTERVAL..=GREATEST_INTERVAL).contains(&seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_position_of_an_age_that_cannot_be_is_stale() {
        let watchdog = Watchdog::new(1e-3, JointVector::from_slice(&[1.0]));
        let at = JointVector::zeros(1);
        let check = |age| watchdog.check(&Inputs { position: at, age, elapsed: 1e-3, interval: 1e-3 }, &at);
        for age in [0.0, -0.0, 1e-3, GREATEST_POSITION_AGE] {
            assert_eq!(check(age), Ok(()), "{age}");
        }
        for age in [-1e-9, -1.0, f64::NEG_INFINITY, f64::NAN, f64::INFINITY, 0.0101] {
            assert_eq!(check(age), Err(Fault::Stale), "{age}");
        }
    }

    /// Time until persistent overruns are found, and the mean then (s); none within a minute.
    fn found(period: f64, time: impl Fn(usize) -> f64) -> Option<(f64, f64)> {
        let watchdog = Watchdog::new(period, JointVector::zeros(1));
        let (mut pace, mut passed, mut k) = (watchdog.start(), 0.0, 0);
        while passed < 60.0 {
            let elapsed = time(k);
            (passed, k) = (passed + elapsed, k + 1);
            if let Err(fault) = watchdog.follow(&mut pace, elapsed) {
                assert_eq!(fault, Fault::Overrun);
                return Some((passed, pace.mean()));
            }
        }
        None
    }

    #[test]
    fn what_the_rule_allows_may_last_and_what_it_does_not_ends_soon() {
        for period in [1e-4, 1e-3, 2e-2] {
            let greatest = f64::max(1e-2, 2.0 * period);
            assert_eq!(found(period, |_| period), None, "{period} s, on time");
            assert_eq!(found(period, |_| 0.99 * greatest), None, "{period} s, just within");
            // Unevenly, half as long and half as long again.
            assert_eq!(
                found(period, |k| if k % 2 == 0 { 0.45 * greatest } else { 1.35 * greatest }),
                None,
                "{period} s"
            );
            let (when, mean) = found(period, |_| 1.2 * greatest).unwrap();
            assert!(when < 8.0 * PACE_WINDOW && mean > greatest, "{period} s: {when} s, {mean} s");
            let (when, _) = found(period, |_| GREATEST_INTERVAL).unwrap();
            assert!(when < 6.0 * PACE_WINDOW, "{period} s: {when} s");
        }
    }

    #[test]
    fn a_pause_alone_is_no_overrun() {
        for period in [1e-3, 2e-2, 4.9e-2] {
            let once = (1.0 / period) as usize;
            assert_eq!(
                found(period, |k| if k % once == once - 1 { GREATEST_INTERVAL } else { period }),
                None,
                "{period} s"
            );
        }
    }
}
