//! A device that moves as recorded, whatever torque it is given.

use super::{Applied, Device, Motion, Reading};
use crate::JointVector;

/// A device that follows a motion exactly.
#[derive(Clone, Debug)]
pub struct Recorded {
    motion: Motion,
    time: f64,
}

impl Recorded {
    /// A device that follows `motion` from time zero on.
    #[must_use]
    pub fn new(motion: Motion) -> Self {
        Self { motion, time: 0.0 }
    }
}

impl Device for Recorded {
    fn read(&mut self, elapsed: f64) -> Reading {
        self.time += elapsed;
        Reading::at(self.motion.at(self.time).0)
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        Applied::whole(torque)
    }
}
