//! Devices that drive the haptic loop: a device that reports joint positions and takes joint torques.
//!
//! Simulated devices implement [`Device`] themselves. A real one is a [`Hardware`], its protocol in its own
//! coordinates; a [`Guard`] around it is the safety layer, the same for all; [`JointDevice`] or [`TipDevice`] makes of
//! it a [`Device`] in the scene's joints.
//!
//! | file | holds |
//! |---|---|
//! | `hand`, `motion`, `pointer`, `recorded` | simulated devices, and what leads them |
//! | `hardware` | what a protocol implements |
//! | `guard`, `halt`, `key`, `tally` | the safety layer, its reasons, the dead-man key, counts |
//! | `linear_map`, `joints`, `tip` | from a device's coordinates to the scene's joints |
//! | `catalogue` | kinds of devices, by name |
//! | `inverse3` | Haply Inverse3, through the maker's service |
//! | `serial` | Haply 2DIY and WoodenHaptics |
//! | `vendor` | Force Dimension and 3D Systems, through their makers' libraries |
//! | `simulated` | a simulated device that fails on command |

mod catalogue;
mod guard;
mod halt;
mod hand;
mod hardware;
pub mod inverse3;
mod joints;
mod key;
mod linear_map;
mod motion;
mod pointer;
mod recorded;
pub mod serial;
mod simulated;
mod tally;
mod tip;
pub mod vendor;

pub use catalogue::{Address, Finding, Kind, attach, attach_joints, open};
pub use guard::{Guard, Held, LIMIT_SHARE, RAMP_TIME, RISE_TIME, WARM_TIME};
pub use halt::{Clamps, Halt, LONGEST_AGE};
pub use hardware::{Command, Coordinates, Hardware, Limits, Measurement, Scheduler, Watchdog};
pub use inverse3::{Inverse3, STALE_COMMAND};
pub use joints::JointDevice;
pub use key::{Key, KeyInput};
pub use linear_map::LinearMap;
pub use simulated::{Failure, Script, Simulated};
pub use tally::Tally;
pub use tip::TipDevice;

pub use hand::SimulatedHand;
pub use motion::Motion;
pub use pointer::{Pointer, PointerInput};
pub use recorded::Recorded;

use crate::JointVector;
use std::sync::Arc;

/// A haptic device, real or simulated. Both calls come from the real-time thread: they must not allocate, lock or wait.
pub trait Device: Send {
    /// Position now, `elapsed` (s) after the last reading (0 at the first). Simulated devices move on by it, under the
    /// torque applied last; for real ones time passes by itself.
    fn read(&mut self, elapsed: f64) -> Reading;

    /// Holds `torque` (N m or N) until the next call, or as much of it as the device can. Returns what it holds.
    fn apply(&mut self, torque: &JointVector) -> Applied;

    /// Returns what calls the loop, if the device owns the thread in which it may be driven.
    fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
        None
    }
}

/// The torque that a device made of one that it was given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Applied {
    /// Torque that it holds until the next tick (N m or N).
    pub torque: JointVector,
    /// Why that is less than what was asked for.
    pub clamps: Clamps,
    /// Why it is zero, if it was brought there.
    pub halt: Option<Halt>,
}

impl Applied {
    /// Returns `torque`, held as it was given.
    #[must_use]
    pub fn whole(torque: &JointVector) -> Self {
        Self { torque: *torque, clamps: Clamps::empty(), halt: None }
    }
}

/// A report of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// y (rad or m).
    pub position: JointVector,
    /// Time since the position was measured (s).
    pub age: f64,
    /// Where the hand wants the device, if that is known; else the position (rad or m).
    pub hand: JointVector,
    /// Whether a hand holds a device that is scanned with: a button on its handle. What is read meanwhile is not the
    /// object's torque alone. False where there is no such button.
    pub held: bool,
}

impl Reading {
    /// A reading of `position` (rad or m) as it is now, of a device without a button.
    #[must_use]
    pub fn at(position: JointVector) -> Self {
        Self { position, age: 0.0, hand: position, held: false }
    }
}
