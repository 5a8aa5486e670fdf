//! A device that is simulated behind the protocol of a real one, and fails on command: what rehearses the safety
//! layer.

use super::{Command, Coordinates, Device, Halt, Hardware, Limits, LinearMap, Measurement};
use crate::JointVector;
use std::str::FromStr;

/// A way to fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Measurements stop coming.
    Silent,
    /// The connection is gone.
    Unplugged,
    /// Positions are no numbers.
    Garbage,
    /// Motors are warm.
    Warm,
    /// The device's dead-man switch is released.
    Released,
    /// Power is off.
    Unready,
    /// The device reports an error of its own.
    Error,
    /// Commands are refused.
    Refused,
}

impl Failure {
    /// All of them, with their names.
    pub const NAMED: [(Self, &'static str); 8] = [
        (Self::Silent, "silent"),
        (Self::Unplugged, "unplugged"),
        (Self::Garbage, "garbage"),
        (Self::Warm, "warm"),
        (Self::Released, "released"),
        (Self::Unready, "unready"),
        (Self::Error, "error"),
        (Self::Refused, "refused"),
    ];
}

/// When a device fails, and how. In words: `unplugged@1.5`, at 1.5 s, or `silent@0.5-0.6`, for a tenth of a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Script {
    /// How.
    pub failure: Failure,
    /// From this time on (s).
    pub from: f64,
    /// Until this time (s).
    pub until: f64,
}

impl FromStr for Script {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = || Failure::NAMED.map(|(_, name)| name).join(", ");
        let wrong = || format!("\"{text}\" is no failure: give one of {} with its time, as in unplugged@1.5", known());
        let (name, time) = text.split_once('@').ok_or_else(wrong)?;
        let (failure, _) = Failure::NAMED.into_iter().find(|(_, known)| *known == name).ok_or_else(wrong)?;
        let (from, until) = time.split_once('-').unwrap_or((time, "inf"));
        match (from.parse::<f64>(), until.parse::<f64>()) {
            (Ok(from), Ok(until)) if from >= 0.0 && until > from => Ok(Self { failure, from, until }),
            _ => Err(wrong()),
        }
    }
}

/// A simulated device as hardware: its joints, or three of them as the position of a tip.
pub struct Simulated<D> {
    device: D,
    /// From the hardware's coordinates to those of `device`.
    map: LinearMap,
    coordinates: Coordinates,
    limits: Limits,
    scripts: Vec<Script>,
    latest: Measurement,
    time: f64,
}

impl<D: Device> Simulated<D> {
    /// Returns `device` as hardware with `limits`; the length of its positions must be that of `coordinates`.
    #[must_use]
    pub fn new(device: D, coordinates: Coordinates, limits: Limits, scripts: Vec<Script>) -> Self {
        let latest = Measurement::plain(JointVector::zeros(coordinates.count()), 0.0);
        let map = LinearMap::identity(coordinates.count());
        Self { device, map, coordinates, limits, scripts, latest, time: 0.0 }
    }

    /// Returns the same hardware in coordinates of its own, from which `map` leads to those of its device.
    #[must_use]
    pub fn mapped(self, map: LinearMap) -> Self {
        Self { map, ..self }
    }

    fn fails(&self, failure: Failure) -> bool {
        self.scripts.iter().any(|script| script.failure == failure && (script.from..script.until).contains(&self.time))
    }
}

impl<D: Device> Hardware for Simulated<D> {
    fn description(&self) -> String {
        "SIMULATED device in a simulated hand; no motor turns".into()
    }

    fn coordinates(&self) -> Coordinates {
        self.coordinates
    }

    fn limits(&self) -> Limits {
        self.limits
    }

    fn enable(&mut self) -> Result<(), Halt> {
        Ok(())
    }

    fn read(&mut self, elapsed: f64) -> Result<Measurement, Halt> {
        self.time += elapsed;
        let reading = self.device.read(elapsed);
        if self.fails(Failure::Unplugged) {
            return Err(Halt::Unplugged);
        }
        if self.fails(Failure::Error) {
            return Err(Halt::DeviceError(1));
        }
        if self.fails(Failure::Silent) {
            self.latest.age += elapsed;
            return Ok(self.latest);
        }
        let mut position = self.map.measured(&reading.position);
        if self.fails(Failure::Garbage) {
            position.iter_mut().for_each(|x| *x = f64::NAN);
        }
        self.latest = Measurement {
            position,
            age: reading.age,
            warm: self.fails(Failure::Warm),
            ready: !self.fails(Failure::Unready),
            held: !self.fails(Failure::Released),
        };
        Ok(self.latest)
    }

    fn write(&mut self, effort: &JointVector) -> Result<Command, Halt> {
        if self.fails(Failure::Refused) {
            return Err(Halt::DeviceError(2));
        }
        if !self.fails(Failure::Unplugged) {
            self.device.apply(&self.map.torque(effort));
        }
        Ok(Command::Whole)
    }

    fn release(&mut self) {
        self.device.apply(&JointVector::zeros(self.coordinates.count()));
    }
}
