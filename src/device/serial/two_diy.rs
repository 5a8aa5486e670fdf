//! Haply 2DIY: a five-bar pantograph with two motors at its base, on a USB serial line.
//!
//! Messages, little-endian, without length or check sum:
//!
//! | message | bytes |
//! |---|---|
//! | reset | `00 00` |
//! | setup | `01 id`, motors, encoders, `0` sensors, `0` pwm pins, scales |
//! | motors, encoders | `mask`, a direction each |
//! | scales, of each encoder in the order of ports | `f32` offset (deg), `f32` counts per revolution |
//! | torques | `02 id`, `f32` torque of each motor in the order of ports (N m) |
//! | reply to torques | `id`, `f32` angle of each encoder in the order of ports (deg) |
//!
//! Bit k - 1 of a mask is port k; directions are in the order of ports, 1 for counter-clockwise. Joint 1 is on port 2
//! and joint 2 on port 1. The firmware clamps torques to 0.123 N m and **has no watchdog**: it holds the last torque
//! until another one comes.
//!
//! Source: the maker's published firmware 1.5 and Python package HaplyHAPI 1.0.1, whose bytes the tests compare with.
//! Not tried on hardware.

use super::{LONGEST, Limits, Port, Protocol, Reply, SerialDevice};
use crate::{
    JointVector,
    device::{Halt, Watchdog},
};

/// Number that the device answers with, as the maker's examples have it.
const ID: u8 = 5;

/// Maximum torque of a motor (N m).
const MOST_TORQUE: f64 = 0.123;

/// Largest angle that can be one (deg): two turns from the offset of either version.
const LARGEST_ANGLE: f32 = 1000.0;

/// Length of a reply (bytes).
const REPLY: usize = 9;

/// Which 2DIY: motors and encoders are mounted differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// Metal arms, bases in one place.
    V2,
    /// Bases 38 mm apart.
    V3,
}

impl Version {
    /// Returns the directions of both motors, in the order of ports; those of the encoders are all 1.
    fn directions(self) -> [u8; 2] {
        match self {
            Self::V2 => [0, 1],
            Self::V3 => [1, 1],
        }
    }

    /// Returns offset (deg) and counts per revolution of the encoders, in the order of ports.
    fn encoders(self) -> [[f32; 2]; 2] {
        match self {
            Self::V2 => [[-61.0, 10752.0], [241.0, 10752.0]],
            Self::V3 => [[12.0, 4880.0], [168.0, 4880.0]],
        }
    }

    /// Returns the setup message.
    #[must_use]
    pub fn setup(self) -> Vec<u8> {
        let [first, second] = self.directions();
        let mut message = vec![1, ID, 0b11, first, second, 0b11, 1, 1, 0, 0];
        message.extend(self.encoders().iter().flatten().flat_map(|value| value.to_le_bytes()));
        message
    }
}

/// The messages of a 2DIY.
#[derive(Clone, Copy, Debug)]
pub struct TwoDiy(Version);

impl TwoDiy {
    /// The messages of such a device.
    #[must_use]
    pub fn new(version: Version) -> Self {
        Self(version)
    }

    /// Opens and sets up the device on the line at `place`.
    ///
    /// # Errors
    /// In words, with the remedy.
    pub fn open(place: &str, version: Version) -> Result<SerialDevice<Self>, String> {
        let mut port = Port::open(place)?;
        port.clear();
        for message in [&[0, 0][..], &version.setup()] {
            if port.send(message).map_err(|halt| halt.to_string())? != message.len() {
                return Err(format!("{place} takes no bytes: unplug the device and plug it in again"));
            }
        }
        SerialDevice::start(Self::new(version), port, place)
    }
}

impl Protocol for TwoDiy {
    fn description(&self) -> String {
        format!("Haply 2DIY {:?}", self.0)
    }

    fn limits(&self) -> Limits {
        Limits { effort: JointVector::from_slice(&[MOST_TORQUE; 2]), watchdog: Watchdog::None }
    }

    fn request(&self, torque: &JointVector, message: &mut [u8; LONGEST]) -> usize {
        message[..2].copy_from_slice(&[2, ID]);
        for (port, joint) in [1, 0].into_iter().enumerate() {
            message[2 + 4 * port..][..4].copy_from_slice(&(torque[joint] as f32).to_le_bytes());
        }
        10
    }

    fn reply(&self, bytes: &[u8]) -> Reply {
        if bytes[0] != ID {
            return Reply::Wrong(Halt::WrongDevice);
        }
        if bytes.len() < REPLY {
            return Reply::Partial;
        }
        let angle = |port: usize| {
            let mut four = [0; 4];
            four.copy_from_slice(&bytes[1 + 4 * port..][..4]);
            f32::from_le_bytes(four)
        };
        let angles = [angle(1), angle(0)];
        // Also true for what is not a number.
        if !angles.iter().all(|angle| angle.abs() <= LARGEST_ANGLE) {
            return Reply::Wrong(Halt::Garbage);
        }
        let position = JointVector::from_slice(&angles.map(|angle| f64::from(angle).to_radians()));
        Reply::Position { position, length: REPLY }
    }
}
