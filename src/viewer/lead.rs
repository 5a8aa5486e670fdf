//! A haptic device that leads the arm in the place of pointer, keys and motions.

use super::loaded::Loaded;
use crate::device::{Address, Device, Guard, Key, KeyInput, Kind, attach, open};
use std::sync::atomic::AtomicBool;

/// The device that the window is driven by.
#[derive(Clone, Debug)]
pub struct DeviceChoice {
    /// Which one.
    pub address: Address,
    /// Whether there is torque only while the space bar is held.
    pub hold_key: bool,
    /// Raised when the program is to end: the torque does so at the next tick, and the window is closed.
    pub stop: &'static AtomicBool,
}

/// Description of the device that leads, for the window.
pub struct Lead {
    /// Its name, in one line.
    pub description: String,
    /// Caution for its user.
    pub caution: Option<&'static str>,
    /// The dead-man key, where it is asked for.
    pub key: Option<KeyInput>,
}

impl DeviceChoice {
    /// Opens the device behind its safety layer and switches its motors on, for the arm of `loaded`. The simulated one
    /// is led along the first motion of the scene.
    ///
    /// # Errors
    /// In words, when it cannot be opened or does not fit the arm.
    pub fn open(&self, loaded: &Loaded) -> Result<(Box<dyn Device>, Lead), String> {
        let address = &self.address;
        let hand = match loaded.motions().into_iter().next() {
            Some((_, motion)) if address.kind == Kind::Simulated => {
                Some(loaded.setup.hand(motion).map_err(|error| error.to_string())?)
            }
            _ => None,
        };
        let (key, input) = Key::new();
        let held = hand.map(|hand| (hand, &loaded.setup.scene.device));
        let hardware = open(address, held).map_err(|error| error.to_string())?;
        let mut guard =
            Guard::new(hardware, self.hold_key.then_some(key)).map_err(|halt| format!("{address}: {halt}"))?;
        guard.end_with(self.stop);
        let lead = Lead {
            description: guard.description(),
            caution: address.caution(guard.limits()),
            key: self.hold_key.then_some(input),
        };
        let device = attach(guard, address, loaded.setup.chain.clone(), &loaded.setup.scene);
        Ok((device.map_err(|error| error.to_string())?, lead))
    }
}
