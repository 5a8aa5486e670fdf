//! Why a device is without torque, and what was clamped on the way to it.

use crate::Error;
use serde::Serialize;

/// Longest age of a measurement on which torque may rest (s). Longer: torque follows a hand that has moved on. Shorter:
/// a pause of the operating system, some milliseconds without real-time priority, ends the feeling of contact.
pub const LONGEST_AGE: f64 = 5e-3;

/// Reason why a device is without torque. Messages hold no comma: they are fields of a CSV file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, thiserror::Error)]
#[serde(rename_all = "kebab-case")]
pub enum Halt {
    /// The last measurement is older than [`LONGEST_AGE`].
    #[error("the device's last position is older than 5 ms")]
    Stale,
    /// Nobody holds the dead-man key, or the device's own switch.
    #[error("the dead-man key is not held")]
    KeyReleased,
    /// The device reports that it may not be driven now.
    #[error("the device is not ready: calibrate it and switch its power on")]
    NotReady,
    /// Motors have been warm for as long as it takes to scale their torque down to nothing.
    #[error("the motors are too warm: let them cool")]
    Hot,
    /// The connection is gone.
    #[error("the device is unplugged or switched off")]
    Unplugged,
    /// Nothing answers, though the connection is there.
    #[error("the device does not answer in time: start its service again, or open it again")]
    Silent,
    /// The device sends what its protocol does not know.
    #[error("the device answers what its protocol does not know: check kind and port of the device")]
    Garbage,
    /// Another device answers than the one that was opened.
    #[error("another device answers than the one that was opened")]
    WrongDevice,
    /// The device reports an error of its own, by its number.
    #[error("the device reports error {0}")]
    DeviceError(i32),
    /// The device has switched its forces off.
    #[error("the device has switched its forces off: its own watchdog or brake")]
    ForcesOff,
    /// The loop asks for a torque that is not a number.
    #[error("the torque that was asked for is not a number")]
    NotFinite,
    /// The session is over.
    #[error("the session is over")]
    Over,
}

impl Halt {
    /// Returns whether torque stays off until the device is opened again. After the other reasons it comes back, from
    /// zero, when they are gone.
    #[must_use]
    pub fn is_final(self) -> bool {
        !matches!(self, Self::Stale | Self::KeyReleased | Self::NotReady)
    }
}

impl From<Halt> for Error {
    fn from(halt: Halt) -> Self {
        Self::new(halt.to_string())
    }
}

bitflags::bitflags! {
    /// How the torque that was asked for was reduced before the device got it.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Clamps: u8 {
        /// In size, below the device's limit.
        const SIZE = 1;
        /// In its rate of change.
        const RATE = 1 << 1;
        /// By the ramp from zero, after the start or an interruption.
        const RAMP = 1 << 2;
        /// Because motors are warm.
        const WARM = 1 << 3;
        /// By the device itself.
        const DEVICE = 1 << 4;
    }
}

impl Clamps {
    /// All clamps, with the names that reports use.
    pub const NAMED: [(Self, &'static str); 5] = [
        (Self::SIZE, "size"),
        (Self::RATE, "rate"),
        (Self::RAMP, "ramp"),
        (Self::WARM, "warm"),
        (Self::DEVICE, "device"),
    ];
}
