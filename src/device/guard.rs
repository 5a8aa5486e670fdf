//! The safety layer around any device: the only way from a torque of ours to a motor.
//!
//! Efforts are clamped to [`LIMIT_SHARE`] of the device's own limit and in their rate of change (but for a command of
//! zero, which is carried out at once), rise from zero over [`RAMP_TIME`] after the start and after each interruption,
//! and are zero
//! - while the last measurement is older than [`LONGEST_AGE`](super::halt::LONGEST_AGE), the dead-man key is released,
//!   or the device is not ready;
//! - from the first error, unplugging, answer that is none, or effort that is no number on ([`Halt::is_final`]);
//! - once motors have been warm for [`WARM_TIME`], over which efforts are scaled down;
//! - once a flag is raised that [ends](Guard::end_with) the session, by a signal, say;
//! - when the layer is dropped, be it by a panic or the end of the session.
//!
//! A stop takes effect at the very tick that finds it. Every clamp and every stop is part of the [`Held`] that each
//! tick returns.

use super::{
    Clamps, Coordinates, Halt, Hardware, Key, Limits, Measurement, Scheduler, halt::LONGEST_AGE, hardware::Command,
};
use crate::{Error, JointVector, error, names::counted, scene::GREATEST_INTERVAL};
use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

/// Part of the device's own limit that is used (1). Larger: rounding in a device's units may trip the device's own
/// protection.
pub const LIMIT_SHARE: f64 = 0.9;

/// Time over which efforts rise to what is asked for (s): long enough for a hand to let go of a device that pulls the
/// wrong way.
pub const RAMP_TIME: f64 = 0.5;

/// Time in which an effort may go from zero to its limit (s): three ticks at 1 kHz, as the loop's own default. Shorter:
/// a look-up that jumps is felt as a knock.
pub const RISE_TIME: f64 = 3e-3;

/// Time over which efforts of warm motors are scaled down to zero (s).
pub const WARM_TIME: f64 = 2.0;

/// A device behind its safety layer.
pub struct Guard {
    hardware: Box<dyn Hardware>,
    coordinates: Coordinates,
    limits: Limits,
    /// Clamp of each effort (N m or N).
    most: JointVector,
    key: Option<Key>,
    /// Raised when the session is to end.
    over: Option<&'static AtomicBool>,
    latest: Measurement,
    /// Before the last reading (s).
    elapsed: f64,
    /// Part of the ramp that has passed, 0 to 1.
    ramp: f64,
    /// Part of [`WARM_TIME`] for which motors have been warm, 0 to 1.
    heat: f64,
    /// The first reason that is final.
    stopped: Option<Halt>,
    /// On the device now (N m or N).
    effort: JointVector,
    enabled: bool,
}

/// The effort that a tick left the device with, in the device's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// On the device until the next tick (N m or N).
    pub effort: JointVector,
    /// Clamps that acted.
    pub clamps: Clamps,
    /// Why the effort is zero, if it was brought there.
    pub halt: Option<Halt>,
}

impl Guard {
    /// Puts the layer around `hardware`, its motors still off, and takes the first measurement. With `key`, torque
    /// needs it held.
    ///
    /// # Errors
    /// Returns the reason if the device reports no position, or limits that are none.
    pub fn new(mut hardware: Box<dyn Hardware>, key: Option<Key>) -> Result<Self, Halt> {
        let (coordinates, limits) = (hardware.coordinates(), hardware.limits());
        let latest = hardware.read(0.0)?;
        let driven = limits.effort.len() == coordinates.count() && limits.effort.iter().all(|most| *most >= 0.0);
        if !(driven && limits.effort.is_finite() && is_position(&latest.position, coordinates)) {
            return Err(Halt::Garbage);
        }
        let mut guard = Self {
            hardware,
            coordinates,
            limits,
            most: limits.effort,
            key,
            over: None,
            latest,
            elapsed: 0.0,
            ramp: 0.0,
            heat: 0.0,
            stopped: None,
            effort: JointVector::zeros(coordinates.count()),
            enabled: false,
        };
        guard.limit_to(LIMIT_SHARE);
        Ok(guard)
    }

    /// Lowers each clamp to `share` of the device's limit, at most [`LIMIT_SHARE`], where that is less.
    pub fn limit_to(&mut self, share: f64) {
        for (most, limit) in self.most.iter_mut().zip(self.limits.effort.iter()) {
            *most = most.min(share.clamp(0.0, LIMIT_SHARE) * limit);
        }
    }

    /// Lowers each clamp to `limits` (N m or N) where that is less.
    ///
    /// # Errors
    /// When there is not one for each coordinate.
    pub fn limit_each(&mut self, limits: &JointVector) -> Result<(), Error> {
        let (given, device) = (limits.len(), self.most.len());
        if given != device {
            return Err(error!(
                "[device] in the scene: effort_limit has {} for {} of the device",
                counted(given, ["number", "numbers"]),
                counted(device, ["coordinate", "coordinates"])
            ));
        }
        self.most.iter_mut().zip(limits.iter()).for_each(|(most, limit)| *most = most.min(limit.max(0.0)));
        Ok(())
    }

    /// Ends all torque at the first tick after `over` is raised, whatever else the program still has to do.
    pub fn end_with(&mut self, over: &'static AtomicBool) {
        self.over = Some(over);
    }

    /// Switches motors and watchdog on, at zero torque. Before it no effort reaches the device.
    ///
    /// # Errors
    /// Returns the reason if the device refuses.
    pub fn enable(&mut self) -> Result<(), Halt> {
        self.hardware.enable()?;
        self.enabled = true;
        // However long ago the device was opened: the session begins where it is now.
        self.read(0.0);
        self.stopped.map_or(Ok(()), Err)
    }

    /// Returns what calls the loop, if the device owns the thread in which it may be driven.
    #[must_use]
    pub fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
        self.hardware.scheduler()
    }

    /// Returns what the device is, in one line.
    #[must_use]
    pub fn description(&self) -> String {
        self.hardware.description()
    }

    /// Returns the device's coordinates.
    #[must_use]
    pub fn coordinates(&self) -> Coordinates {
        self.coordinates
    }

    /// Returns the device's own limits.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Returns the clamp of each effort (N m or N).
    #[must_use]
    pub fn most(&self) -> &JointVector {
        &self.most
    }

    /// Returns the last measurement.
    #[must_use]
    pub fn latest(&self) -> &Measurement {
        &self.latest
    }

    /// Returns the reason that keeps torque off until the device is opened again, if there is one.
    #[must_use]
    pub fn stopped(&self) -> Option<Halt> {
        self.stopped
    }

    /// Takes a measurement, `elapsed` (s) after the last. If there is none, the last one grows old.
    pub fn read(&mut self, elapsed: f64) -> &Measurement {
        // Also false for what is not a number.
        self.elapsed = if elapsed > 0.0 { elapsed.min(GREATEST_INTERVAL) } else { 0.0 };
        let measured = match self.stopped {
            None => self.hardware.read(self.elapsed),
            Some(halt) => Err(halt),
        };
        match measured {
            Ok(measured) if is_position(&measured.position, self.coordinates) => self.latest = measured,
            other => {
                self.stop(other.err().unwrap_or(Halt::Garbage));
                self.latest.age += self.elapsed;
            }
        }
        if let Some(key) = &mut self.key {
            key.pass(self.elapsed);
        }
        let warming = self.elapsed / WARM_TIME;
        self.heat = (self.heat + if self.latest.warm { warming } else { -warming }).clamp(0.0, 1.0);
        &self.latest
    }

    /// Holds as much of `wanted` (N m or N) as is safe, until the next call.
    pub fn write(&mut self, wanted: &JointVector) -> Held {
        let zero = JointVector::zeros(self.coordinates.count());
        let (mut effort, mut clamps) = (zero, Clamps::empty());
        let mut halt = self.reason(wanted);
        match halt {
            Some(reason) => {
                self.stop(reason);
                self.ramp = 0.0;
            }
            None => (effort, clamps) = self.clamped(wanted),
        }
        if self.enabled {
            match self.hardware.write(&effort) {
                Ok(Command::Whole) => {}
                Ok(Command::Reduced) => clamps |= Clamps::DEVICE,
                Ok(Command::Kept) => {
                    clamps |= Clamps::DEVICE;
                    effort = self.effort;
                }
                Err(reason) => {
                    self.stop(reason);
                    halt = halt.or(Some(reason));
                    // One more try, at zero: what was refused may have been the effort.
                    if effort != zero {
                        let _ = self.hardware.write(&zero);
                        effort = zero;
                    }
                }
            }
        } else {
            effort = zero;
        }
        self.effort = effort;
        Held { effort, clamps, halt }
    }

    /// Returns why there may be no torque now.
    fn reason(&self, wanted: &JointVector) -> Option<Halt> {
        let fresh = self.latest.age <= LONGEST_AGE;
        let held = self.latest.held && self.key.as_ref().is_none_or(Key::is_held);
        let over = self.over.is_some_and(|over| over.load(Ordering::Relaxed));
        self.stopped
            .or(over.then_some(Halt::Over))
            .or((wanted.len() != self.coordinates.count() || !wanted.is_finite()).then_some(Halt::NotFinite))
            .or((self.heat >= 1.0).then_some(Halt::Hot))
            .or((!fresh).then_some(Halt::Stale))
            .or((!self.latest.ready).then_some(Halt::NotReady))
            .or((!held).then_some(Halt::KeyReleased))
    }

    fn clamped(&mut self, wanted: &JointVector) -> (JointVector, Clamps) {
        self.ramp = (self.ramp + self.elapsed / RAMP_TIME).min(1.0);
        let (mut effort, mut clamps) = (*wanted, Clamps::empty());
        for (a, effort) in effort.iter_mut().enumerate() {
            let most = self.most[a];
            let size = effort.clamp(-most, most);
            if size != *effort {
                clamps |= Clamps::SIZE;
            }
            let scaled = size * self.ramp * (1.0 - self.heat);
            if scaled != size {
                clamps.set(Clamps::RAMP, self.ramp < 1.0);
                clamps.set(Clamps::WARM, self.heat > 0.0);
            }
            let change = most * self.elapsed / RISE_TIME;
            // The way to zero is always free.
            let moved = scaled.clamp(self.effort[a] - change, self.effort[a] + change);
            *effort = if scaled == 0.0 { 0.0 } else { moved };
            clamps.set(Clamps::RATE, clamps.contains(Clamps::RATE) || *effort != scaled);
        }
        (effort, clamps)
    }

    fn stop(&mut self, halt: Halt) {
        if halt.is_final() && self.stopped.is_none() {
            self.stopped = Some(halt);
        }
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        if self.enabled {
            // Whatever it answers: the motors are switched off next.
            let _ = self.hardware.write(&JointVector::zeros(self.coordinates.count()));
        }
        self.hardware.release();
    }
}

fn is_position(position: &JointVector, coordinates: Coordinates) -> bool {
    position.len() == coordinates.count() && position.is_finite()
}
