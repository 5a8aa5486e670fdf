//! WoodenHaptics: a desktop device of three joints driven by capstans, on the USB serial line of a Teensy 4.0.
//!
//! The host sends `[a,b,c]\n`, motor currents (mA); the device answers `[model,n0,n1,n2,n3,n4,n5,error]\n`, encoder
//! counts. A current beyond 6000 mA counts as zero. Amplifiers are off 100 ms after the last message. A second message
//! before the reply is an error.
//!
//! Joint i turns by `theta_i = 2 pi (n_i + home_i) / 2000 * capstan / drum_i`, its torque takes the current
//! `1000 tau_i capstan / (drum_i k_t)`. The third angle is measured against the ground, not against the second link.
//! The counts are zero where the calibration button was pressed: hold the device in its home position for that.
//!
//! Source: the published firmware `woody_teensy_mini`, and numbers of the model `woodenhaptics_v2015` of its makers'
//! software. Not tried on hardware.

use super::{LONGEST, Limits, Port, Protocol, Reply, SerialDevice};
use crate::{
    JointVector,
    device::{Halt, Watchdog},
};
use std::{f64::consts::TAU, io::Write};

/// Model that the device calls itself.
const MODEL: i32 = 3;

/// Counts of a motor's revolution.
const COUNTS: f64 = 2000.0;

/// Counts in the home position.
const HOME: [i32; 3] = [0, 0, 6000];

/// Radius of each motor's capstan over that of its drum (1).
const RATIO: [f64; 3] = [0.010 / 0.160, 0.010 / 0.120, 0.010 / 0.120];

/// Torque of a motor per current (N m/A).
const TORQUE_CONSTANT: f64 = 0.0259;

/// Maximum torque of each joint (N m): the device is specified for 5 N at its tip, whose lever arms are at most 0.205 +
/// 0.245 m about the first joint, and the length of the own link about the others.
const MOST_TORQUE: [f64; 3] = [5.0 * 0.450, 5.0 * 0.205, 5.0 * 0.245];

/// Time after which the amplifiers are off (s).
const WATCHDOG: f64 = 0.1;

/// Errors of the line that the device reports: a message was mangled or came too early. Others are of sensors that are
/// not used.
const LINE_ERRORS: i32 = 8 | 128 | 256 | 512 | 1024;

/// The messages of a WoodenHaptics.
#[derive(Clone, Copy, Debug)]
pub struct WoodenHaptics;

impl WoodenHaptics {
    /// Opens the device on the line at `place`.
    ///
    /// # Errors
    /// In words, with the remedy.
    pub fn open(place: &str) -> Result<SerialDevice<Self>, String> {
        SerialDevice::start(Self, Port::open(place)?, place)
    }
}

impl Protocol for WoodenHaptics {
    fn description(&self) -> String {
        "WoodenHaptics".into()
    }

    fn limits(&self) -> Limits {
        Limits { effort: JointVector::from_slice(&MOST_TORQUE), watchdog: Watchdog::After(WATCHDOG) }
    }

    fn request(&self, torque: &JointVector, message: &mut [u8; LONGEST]) -> usize {
        let current = |joint: usize| (1000.0 * torque[joint] * RATIO[joint] / TORQUE_CONSTANT).round() as i32;
        let mut rest = &mut message[..];
        // Three numbers have far fewer digits than there is room.
        let _ = writeln!(rest, "[{},{},{}]", current(0), current(1), current(2));
        LONGEST - rest.len()
    }

    fn reply(&self, bytes: &[u8]) -> Reply {
        let Some(end) = bytes.iter().position(|byte| *byte == b'\n') else { return Reply::Partial };
        let Some(numbers) = numbers(&bytes[..end]) else { return Reply::Wrong(Halt::Garbage) };
        let [model, counts @ .., _, _, _, error] = numbers;
        if model != MODEL {
            return Reply::Wrong(Halt::WrongDevice);
        }
        if error & LINE_ERRORS != 0 {
            return Reply::Wrong(Halt::DeviceError(error));
        }
        let mut position = JointVector::zeros(3);
        for (joint, angle) in position.iter_mut().enumerate() {
            *angle = TAU * f64::from(counts[joint]) / COUNTS * RATIO[joint] + HOME_ANGLE[joint];
        }
        Reply::Position { position, length: end + 1 }
    }
}

/// Angles in the home position (rad).
const HOME_ANGLE: [f64; 3] = [
    TAU * HOME[0] as f64 / COUNTS * RATIO[0],
    TAU * HOME[1] as f64 / COUNTS * RATIO[1],
    TAU * HOME[2] as f64 / COUNTS * RATIO[2],
];

/// Returns the eight numbers of a line `[...]`.
fn numbers(line: &[u8]) -> Option<[i32; 8]> {
    let text = std::str::from_utf8(line).ok()?.trim().strip_prefix('[')?.strip_suffix(']')?;
    let mut numbers = [0; 8];
    let mut fields = text.split(',');
    for number in &mut numbers {
        *number = fields.next()?.trim().parse().ok()?;
    }
    fields.next().is_none().then_some(numbers)
}
