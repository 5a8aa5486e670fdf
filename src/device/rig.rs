//! A real device as the rig of a scan (section 2.2), behind the same safety layer as in a session.
//!
//! The torque that the controller commands is taken for the measured one. So a scan ends with an error when the device
//! holds less than that: by a clamp in size, warm motors, or a stop. The ramp at the start is over long before the
//! first measurement.

use super::{Applied, Clamps, Device, Key};
use crate::{
    JointVector,
    scan::{Rig, RigError, RigReading},
};
use std::sync::atomic::{AtomicBool, Ordering};

/// A joint-true device that scans.
pub struct DeviceRig<'a> {
    device: Box<dyn Device + 'a>,
    description: String,
    simulated: bool,
    /// Says that a hand holds the device.
    hand: Option<Key>,
    /// Waits until `period` (s) after the last tick; returns the time since then (s).
    wait: Box<dyn FnMut(f64) -> f64 + 'a>,
    /// Ends the scan at once, not after the current point: motors are on.
    stop: &'a AtomicBool,
    time: f64,
}

impl<'a> DeviceRig<'a> {
    /// Returns the joint-true `device` as a rig. While the key `hand` is held, a hand is taken to lead the device.
    /// `wait` waits until so many seconds after the last tick, and returns how many there were. Raising `stop` ends the
    /// scan with an error at the next tick.
    #[must_use]
    pub fn new(
        device: impl Device + 'a,
        description: String,
        simulated: bool,
        hand: Option<Key>,
        stop: &'a AtomicBool,
        wait: impl FnMut(f64) -> f64 + 'a,
    ) -> Self {
        Self { device: Box::new(device), description, simulated, hand, wait: Box::new(wait), stop, time: 0.0 }
    }
}

impl Rig for DeviceRig<'_> {
    fn hold(&mut self, torque: &JointVector, period: f64) -> Result<RigReading, RigError> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(RigError("interrupted; --resume goes on after the last point in the log".into()));
        }
        let Applied { clamps, halt, .. } = self.device.apply(torque);
        if let Some(halt) = halt {
            return Err(RigError(halt.to_string()));
        }
        if clamps.intersects(Clamps::SIZE | Clamps::WARM) {
            let why =
                if clamps.contains(Clamps::WARM) { "its motors are warm" } else { "it is beyond the device's limit" };
            return Err(RigError(format!(
                "the device cannot hold {torque:.3?} (N m or N, joint by joint), {why}: what it would measure is not \
                 the contact's torque; press less deep or lower the gains of [scan.control]"
            )));
        }
        let elapsed = (self.wait)(period);
        let reading = self.device.read(elapsed);
        self.time += elapsed;
        if let Some(hand) = &mut self.hand {
            hand.pass(elapsed);
        }
        let held = self.hand.as_ref().is_some_and(Key::is_held);
        Ok(RigReading { time: self.time, position: reading.position, held })
    }

    fn description(&self) -> String {
        self.description.clone()
    }

    fn is_simulated(&self) -> bool {
        self.simulated
    }
}
