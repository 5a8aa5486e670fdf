//! How often a device was clamped and stopped, and by what.

use super::{Clamps, Halt};
use serde::Serialize;
use std::collections::BTreeMap;

/// Counts of ticks.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Tally {
    /// All ticks.
    pub ticks: u64,
    /// Ticks with each clamp, by name.
    pub clamped: BTreeMap<&'static str, u64>,
    /// Ticks without torque for each reason, in words.
    pub halted: BTreeMap<String, u64>,
    /// The first reason that keeps torque off until the device is opened again, in words.
    pub stopped: Option<String>,
}

impl Tally {
    /// Counts a tick.
    pub fn add(&mut self, clamps: Clamps, halt: Option<Halt>) {
        self.ticks += 1;
        for (_, name) in Clamps::NAMED.into_iter().filter(|(clamp, _)| clamps.contains(*clamp)) {
            *self.clamped.entry(name).or_default() += 1;
        }
        if let Some(halt) = halt {
            *self.halted.entry(halt.to_string()).or_default() += 1;
            if halt.is_final() && self.stopped.is_none() {
                self.stopped = Some(halt.to_string());
            }
        }
    }
}
