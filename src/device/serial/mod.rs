//! Devices on a serial line: the line itself, and the rhythm of request and reply that such devices share.
//!
//! A device answers each command with what it measured. A new request waits for the reply to the last, for `PATIENCE`
//! ticks at most; the first command of zero never waits. Replies come in the order of requests and carry no number:
//! each is taken for that to the oldest request without one. A measurement's age counts from that request, so that a
//! line that loses replies looks older than it is, never younger. Where that makes it stale, nothing is asked for
//! `LATEST_REPLY`: a reply that has not come by then is lost, and not late. Positions that no hand could have reached
//! since the last one are no positions: such lines have no check sum.

#[cfg(unix)]
mod last_command;
#[cfg(unix)]
mod port;
#[cfg(not(unix))]
#[path = "no_port.rs"]
mod port;
mod two_diy;
mod wooden_haptics;

#[cfg(unix)]
pub use last_command::let_go;
#[cfg(not(unix))]
pub use port::let_go;
pub use port::{Port, ports};
pub use two_diy::{TwoDiy, Version};
pub use wooden_haptics::WoodenHaptics;

use super::{Command, Coordinates, Halt, Hardware, LONGEST_AGE, Limits, Measurement};
use crate::JointVector;
use std::time::Instant;

/// Ticks for which a new request waits for a reply.
const PATIENCE: u32 = 3;

/// Most requests without a reply that are remembered; the oldest is then given up.
const REMEMBERED: usize = 8;

/// Speed that no joint reaches in a hand (rad/s). Bytes of two replies that are taken for one give leaps far beyond it.
const FASTEST: f64 = 100.0;

/// Time without a valid reply after which the device is given up (s): long enough for a USB hub to reset.
const LONGEST_SILENCE: f64 = 0.1;

/// Time without requests after which a reply is lost and not late (s): many times what a USB line delays, and short of
/// [`LONGEST_SILENCE`].
const LATEST_REPLY: f64 = 0.05;

/// Longest message of any protocol (bytes).
const LONGEST: usize = 128;

/// Most bytes that are taken in a tick: the longest replies to all requests that are remembered. More: a line
/// that floods holds up the loop. What comes beyond them is dropped, so that the last position ages and the torque
/// goes.
const MOST_RECEIVED: usize = REMEMBERED * LONGEST;

/// The reading by a protocol of the bytes that have come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reply {
    /// Not yet a whole reply.
    Partial,
    /// A whole reply.
    Position {
        /// Joint coordinates (rad).
        position: JointVector,
        /// Bytes of it.
        length: usize,
    },
    /// Not a reply to the request; `Halt` says what it seems to be.
    Wrong(Halt),
}

/// The messages of one kind of device.
pub trait Protocol: Send {
    /// Returns what the device is, in one line.
    fn description(&self) -> String;

    /// Returns what the device can do; its coordinates are joints, as many as there are limits.
    fn limits(&self) -> Limits;

    /// Writes the message that commands `torque` (N m) into `message`, and returns its length.
    fn request(&self, torque: &JointVector, message: &mut [u8; LONGEST]) -> usize;

    /// Reads the first reply in `bytes`, of which there is one at least.
    fn reply(&self, bytes: &[u8]) -> Reply;
}

/// A device that speaks `P` on a serial line.
pub struct SerialDevice<P> {
    protocol: P,
    port: Port,
    place: String,
    received: [u8; LONGEST],
    length: usize,
    /// A message that the line did not take at once.
    unsent: [u8; LONGEST],
    unsent_range: std::ops::Range<usize>,
    /// Whether the last request commanded a torque.
    pushes: bool,
    /// Whether commands come, so that none has to be made up to get measurements.
    driven: bool,
    /// Since each request that has not been answered (s), the oldest first, and how many there are.
    asked: [f64; REMEMBERED],
    unanswered: usize,
    /// Whether the last request waits for its reply, and for how many ticks.
    waits: bool,
    waited: u32,
    /// Since the last valid reply (s), and what was wrong since.
    silence: f64,
    wrong: Option<Halt>,
    latest: Measurement,
}

impl<P: Protocol> SerialDevice<P> {
    /// Returns the device on `port`, opened and set up, after one exchange at zero torque.
    ///
    /// # Errors
    /// In words, if nothing valid answers in time.
    fn start(protocol: P, mut port: Port, place: &str) -> Result<Self, String> {
        let joints = protocol.limits().effort.len();
        let mut zero = [0; LONGEST];
        let length = protocol.request(&JointVector::zeros(joints), &mut zero);
        port.end_with(&zero[..length])?;
        let mut device = Self {
            protocol,
            port,
            place: place.to_owned(),
            received: [0; LONGEST],
            length: 0,
            unsent: [0; LONGEST],
            unsent_range: 0..0,
            pushes: false,
            driven: false,
            asked: [0.0; REMEMBERED],
            unanswered: 0,
            waits: false,
            waited: 0,
            silence: 0.0,
            wrong: None,
            latest: Measurement::plain(JointVector::zeros(joints), f64::INFINITY),
        };
        device.exchange().map_err(|halt| match halt {
            Halt::Stale => {
                "it does not answer in time: check the kind of the device, its cable and that no other program uses it"
                    .into()
            }
            other => other.to_string(),
        })?;
        Ok(device)
    }

    /// Commands zero torque until a reply comes that is in time for a loop. Waits: not for the real-time thread.
    fn exchange(&mut self) -> Result<(), Halt> {
        // Some tries: a device that has just been plugged in may still say something else.
        for _ in 0..TRIES {
            self.port.clear();
            (self.length, self.unanswered, self.latest.age) = (0, 0, f64::INFINITY);
            self.send(&JointVector::zeros(self.latest.position.len()))?;
            let mut last = Instant::now();
            for _ in 0..TRY_READS {
                self.port.wait(READ_TIME);
                let now = Instant::now();
                let replied = self.receive((now - std::mem::replace(&mut last, now)).as_secs_f64())?;
                if replied && self.latest.age <= LONGEST_AGE {
                    return Ok(());
                }
                if replied {
                    break;
                }
            }
        }
        Err(self.wrong.unwrap_or(Halt::Stale))
    }

    /// Takes in what has come, `elapsed` (s) after the last call; true if it made a whole reply.
    fn receive(&mut self, elapsed: f64) -> Result<bool, Halt> {
        self.asked.iter_mut().for_each(|asked| *asked += elapsed);
        self.latest.age += elapsed;
        self.silence += elapsed;
        let mut taken = 0;
        loop {
            let count = self.port.receive(&mut self.received[self.length..])?;
            if count == 0 {
                break;
            }
            taken += count;
            if taken > MOST_RECEIVED {
                // A device answers, and does not go on by itself.
                self.refuse(Halt::Garbage);
                return Ok(false);
            }
            self.length += count;
            if self.length == LONGEST {
                // No replies are so long.
                self.refuse(Halt::Garbage);
            }
        }
        let mut whole = false;
        while self.length > 0 {
            match self.protocol.reply(&self.received[..self.length]) {
                Reply::Partial => break,
                Reply::Wrong(halt) => self.refuse(halt),
                Reply::Position { position, length } => {
                    let Some(age) = self.answered() else {
                        // What nobody asked for.
                        self.length = 0;
                        break;
                    };
                    if self.is_reached(&position) {
                        self.latest = Measurement::plain(position, age);
                        (self.silence, self.wrong, whole) = (0.0, None, true);
                        self.received.copy_within(length..self.length, 0);
                        self.length -= length;
                    } else {
                        self.refuse(Halt::Garbage);
                    }
                }
            }
        }
        Ok(whole)
    }

    /// Takes the oldest request as answered; returns how long ago it was sent (s).
    fn answered(&mut self) -> Option<f64> {
        self.waits = false;
        self.unanswered = self.unanswered.checked_sub(1)?;
        self.asked.rotate_left(1);
        Some(self.asked[REMEMBERED - 1])
    }

    /// Drops all that has come, which `halt` says is no reply.
    fn refuse(&mut self, halt: Halt) {
        self.wrong = Some(halt);
        self.answered();
        self.port.clear();
        self.length = 0;
    }

    /// Whether a hand could have moved the joints to `position` since the last measurement.
    fn is_reached(&self, position: &JointVector) -> bool {
        let way = FASTEST * self.latest.age;
        position.iter().zip(self.latest.position.iter()).all(|(to, from)| (to - from).abs() <= way)
    }

    /// Sends the command of `torque`, unless the last request still waits for its reply.
    fn ask(&mut self, torque: &JointVector) -> Result<Command, Halt> {
        let rests = !self.pushes && !is_torque(torque) && self.unsent_range.is_empty();
        if rests && self.unanswered > 1 && self.latest.age > LONGEST_AGE {
            if self.asked[self.unanswered - 1] <= LATEST_REPLY {
                return Ok(Command::Kept);
            }
            self.port.clear();
            (self.length, self.unanswered, self.waits) = (0, 0, false);
        }
        let urgent = self.pushes && !is_torque(torque);
        if self.waits && !urgent {
            self.waited += 1;
            if self.waited < PATIENCE {
                return Ok(Command::Kept);
            }
            // What has come of its reply in part stays no reply.
            self.port.clear();
            self.length = 0;
        }
        Ok(if self.send(torque)? { Command::Whole } else { Command::Kept })
    }

    /// Sends the command of `torque`, or what is left of the one before; true if it was the former.
    fn send(&mut self, torque: &JointVector) -> Result<bool, Halt> {
        let new = self.unsent_range.is_empty();
        if new {
            self.pushes = is_torque(torque);
            let length = self.protocol.request(torque, &mut self.unsent);
            self.unsent_range = 0..length;
            if self.unanswered == REMEMBERED {
                self.answered();
            }
            self.asked[self.unanswered] = 0.0;
            self.unanswered += 1;
            (self.waits, self.waited) = (true, 0);
        }
        let sent = self.port.send(&self.unsent[self.unsent_range.clone()])?;
        self.unsent_range.start += sent;
        Ok(new)
    }
}

/// Tries to get a first reply, reads of each, and time between them (s).
const TRIES: usize = 20;
const TRY_READS: usize = 10;
const READ_TIME: f64 = 5e-3;

impl<P: Protocol> Hardware for SerialDevice<P> {
    fn description(&self) -> String {
        format!("{} on {}", self.protocol.description(), self.place)
    }

    fn coordinates(&self) -> Coordinates {
        Coordinates::Joints(self.protocol.limits().effort.len())
    }

    fn limits(&self) -> Limits {
        self.protocol.limits()
    }

    fn enable(&mut self) -> Result<(), Halt> {
        // These devices have no switch: commands do it. The position is a new one, however long ago the device was
        // opened.
        self.driven = true;
        self.exchange()
    }

    fn read(&mut self, elapsed: f64) -> Result<Measurement, Halt> {
        self.receive(elapsed)?;
        if self.silence > LONGEST_SILENCE
            && let Some(halt) = self.wrong
        {
            return Err(halt);
        }
        // Before motors are enabled nothing else asks.
        if elapsed > 0.0 && !self.driven {
            self.ask(&JointVector::zeros(self.latest.position.len()))?;
        }
        Ok(self.latest)
    }

    fn write(&mut self, effort: &JointVector) -> Result<Command, Halt> {
        self.ask(effort)
    }

    fn release(&mut self) {
        // Twice, with a pause: the first may complete a message that was cut off.
        for _ in 0..2 {
            let _ = self.send(&JointVector::zeros(self.latest.position.len()));
            self.port.wait(READ_TIME);
        }
    }
}

fn is_torque(torque: &JointVector) -> bool {
    torque.iter().any(|torque| *torque != 0.0)
}
