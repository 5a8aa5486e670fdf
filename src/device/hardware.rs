//! The protocol of a device, in coordinates of its own. A module that implements [`Hardware`] holds a protocol and
//! nothing else: clamps, ramps and stops are those of [`super::Guard`], the scene's coordinates those of
//! [`super::LinearMap`].

use super::Halt;
use crate::JointVector;
use serde::Serialize;
use std::sync::Arc;

/// Coordinates in which a device measures and is driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinates {
    /// Joint coordinates (rad or m), driven by joint torques (N m or N).
    Joints(usize),
    /// Position of its tip along three axes (m), driven by a force (N).
    Tip,
}

impl Coordinates {
    /// Returns the number of coordinates.
    #[must_use]
    pub fn count(self) -> usize {
        match self {
            Self::Joints(count) => count,
            Self::Tip => 3,
        }
    }

    /// Returns the unit of a coordinate, for messages.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Joints(_) => "rad",
            Self::Tip => "m",
        }
    }

    /// Returns the unit of an effort, for messages.
    #[must_use]
    pub fn effort_unit(self) -> &'static str {
        match self {
            Self::Joints(_) => "N m",
            Self::Tip => "N",
        }
    }
}

/// The limits of a device, and the watchdog over it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Maximum size of each effort (N m or N).
    pub effort: JointVector,
    /// The reaction of the device when commands stop.
    pub watchdog: Watchdog,
}

/// The reaction of a device by itself when commands stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Watchdog {
    /// Nothing: a host that dies leaves the last torque on.
    None,
    /// It switches its motors off after this time (s).
    After(f64),
    /// It switches its motors off, after a time that its maker does not state.
    Unstated,
}

/// A measurement of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measurement {
    /// In the device's coordinates (rad or m).
    pub position: JointVector,
    /// Time since the position was measured (s).
    pub age: f64,
    /// Whether motors are warm.
    pub warm: bool,
    /// False while a switch of the device forbids torque, or it is not ready. True if there is no such thing.
    pub ready: bool,
    /// False while the device's own dead-man switch is released. True if it has none.
    pub held: bool,
}

impl Measurement {
    /// Returns a measurement of a device that has neither switches nor thermometers.
    #[must_use]
    pub fn plain(position: JointVector, age: f64) -> Self {
        Self { position, age, warm: false, ready: true, held: true }
    }
}

/// How a command was carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// As it was given.
    Whole,
    /// Reduced by the device.
    Reduced,
    /// Not yet: the effort before it stays on for now.
    Kept,
}

/// A thread that is not ours and calls the loop: that of a maker's library.
pub trait Scheduler: Send + Sync {
    /// Calls `tick` at the device's rate until it returns false; returns after the last call. A panic of `tick` goes on
    /// from here.
    ///
    /// # Errors
    /// Returns the reason if the thread stops calling; `tick` is then not called any more.
    fn run(&self, tick: &mut (dyn FnMut() -> bool + Send)) -> Result<(), Halt>;

    /// Returns how often it calls (Hz).
    fn rate(&self) -> f64;
}

/// One open device. Between opening and [`Hardware::enable`] it is read with its motors off or at zero torque. `read`
/// and `write` come from the real-time thread: they must not allocate, lock or wait.
pub trait Hardware: Send {
    /// Returns what the device is, in one line. Simulated devices say so.
    fn description(&self) -> String;

    /// Returns the coordinates of all measurements and efforts.
    fn coordinates(&self) -> Coordinates;

    /// Returns what the device can do.
    fn limits(&self) -> Limits;

    /// Switches motors and watchdog on, at zero torque.
    ///
    /// # Errors
    /// Returns the reason if the device refuses.
    fn enable(&mut self) -> Result<(), Halt>;

    /// Returns the newest measurement, `elapsed` (s) after the last call (0 at the first).
    ///
    /// # Errors
    /// Returns the reason if nothing can be measured any more. A reply that is merely late is no error: the age grows.
    fn read(&mut self, elapsed: f64) -> Result<Measurement, Halt>;

    /// Commands `effort` (N m or N) until the next call.
    ///
    /// # Errors
    /// Returns the reason if the device cannot be driven any more.
    fn write(&mut self, effort: &JointVector) -> Result<Command, Halt>;

    /// Returns what calls the loop, if the device's library owns the thread in which it may be driven.
    fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
        None
    }

    /// Switches the motors off, waiting for it if need be. Called once, at the end, from whatever thread drops the
    /// device.
    fn release(&mut self);
}
