//! A device whose joints are those of the scene, through a linear map.

use super::{Applied, Device, Guard, Key, LinearMap, Reading, Scheduler};
use crate::JointVector;
use std::sync::Arc;

/// A joint-true device behind its safety layer, in the scene's coordinates.
pub struct JointDevice {
    guard: Guard,
    map: LinearMap,
    /// Says that a hand holds the device.
    hand: Option<Key>,
}

impl JointDevice {
    /// Returns the device of `guard`; `map` must have as many coordinates.
    #[must_use]
    pub fn new(guard: Guard, map: LinearMap) -> Self {
        Self { guard, map, hand: None }
    }

    /// Returns the same device, which a hand is taken to hold while `key` is held.
    #[must_use]
    pub fn led_by(self, key: Option<Key>) -> Self {
        Self { hand: key, ..self }
    }
}

impl Device for JointDevice {
    fn read(&mut self, elapsed: f64) -> Reading {
        let measured = self.guard.read(elapsed);
        let position = self.map.position(&measured.position);
        let held = self.hand.as_mut().is_some_and(|key| {
            key.pass(elapsed);
            key.is_held()
        });
        Reading { age: measured.age, held, ..Reading::at(position) }
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        let held = self.guard.write(&self.map.effort(torque));
        // What was not reduced is passed on to the last bit.
        let whole = held.clamps.is_empty() && held.halt.is_none();
        let torque = if whole { *torque } else { self.map.torque(&held.effort) };
        Applied { torque, clamps: held.clamps, halt: held.halt }
    }

    fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
        self.guard.scheduler()
    }
}
