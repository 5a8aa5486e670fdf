//! Emulators of serial devices behind pseudo-terminals: a line that may misbehave, the device's firmware, and a
//! simulated hand.

use haptize::{
    JointVector,
    device::{Device, SimulatedHand},
};
use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{OptionalActions, tcgetattr, tcsetattr},
};
use std::{
    fs::{File, OpenOptions},
    io::{Read, Write},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

/// How the line treats the next reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    None,
    /// The first bytes now, the rest a tick later.
    Split(usize),
    /// One byte is lost.
    Dropped(usize),
    /// The reply comes so many ticks later.
    Late(u32),
    /// No reply.
    Mute,
    /// Goes on with the same reply.
    Flood,
    /// Bytes that are no reply.
    Noise,
    /// Another device's reply.
    OtherDevice,
}

/// The device's end of a line.
pub struct Line {
    master: File,
    /// The host's end, kept open so that the line is there before and after the driver.
    slave: File,
    pub path: String,
    /// Whether the host reads only after `send` has returned, as it does when one thread plays both.
    in_step: bool,
}

impl Line {
    pub fn new() -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let path = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let slave = OpenOptions::new().read(true).write(true).open(&path).unwrap();
        let mut settings = tcgetattr(&slave).unwrap();
        settings.make_raw();
        tcsetattr(&slave, OptionalActions::Now, &settings).unwrap();
        Self { master: File::from(master), slave, path, in_step: true }
    }

    /// What the host has sent, waiting a little for it.
    fn receive(&mut self) -> Vec<u8> {
        let time = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
        if poll(&mut [PollFd::new(&self.master, PollFlags::IN)], Some(&time)).unwrap() == 0 {
            return Vec::new();
        }
        let mut bytes = [0; 256];
        self.master.read(&mut bytes).map_or(Vec::new(), |count| bytes[..count].to_vec())
    }

    /// Sends `bytes`, and waits until they have arrived at the host's end. A host in another thread may have taken them
    /// before they can be counted there: then nothing waits, or the next request would be answered late.
    pub fn send(&mut self, bytes: &[u8]) {
        let before = rustix::io::ioctl_fionread(&self.slave).unwrap();
        self.master.write_all(bytes).unwrap();
        if !self.in_step {
            return;
        }
        let since = Instant::now();
        while rustix::io::ioctl_fionread(&self.slave).unwrap() < before + bytes.len() as u64
            && since.elapsed() < Duration::from_millis(20)
        {
            thread::yield_now();
        }
    }
}

/// A device's firmware: what it makes of bytes that come, and its replies.
pub trait Firmware: Send {
    /// Takes in bytes; answers with the reply to each command, for a device at `angles`.
    fn take(&mut self, bytes: &[u8], angles: &JointVector) -> Vec<Vec<u8>>;
    /// Torque on the joints (N m).
    fn torque(&self) -> JointVector;
    /// The reply of another device.
    fn other(&self) -> Vec<u8>;
}

/// A device with a firmware, in a simulated hand, at the end of a line.
pub struct Emulator<F> {
    pub line: Line,
    pub firmware: F,
    hand: SimulatedHand,
    pub angles: JointVector,
    pub fault: Fault,
    /// What is sent in later ticks: ticks left, and bytes.
    queue: Vec<(u32, Vec<u8>)>,
}

impl<F: Firmware + 'static> Emulator<F> {
    pub fn new(firmware: F, mut hand: SimulatedHand) -> Self {
        let angles = hand.read(0.0).position;
        Self { line: Line::new(), firmware, hand, angles, fault: Fault::None, queue: Vec::new() }
    }

    /// One tick of the device's time.
    pub fn step(&mut self, elapsed: f64) {
        self.hand.apply(&self.firmware.torque());
        self.angles = self.hand.read(elapsed).position;
        for (ticks, bytes) in std::mem::take(&mut self.queue) {
            if ticks <= 1 { self.line.send(&bytes) } else { self.queue.push((ticks - 1, bytes)) }
        }
        let received = self.line.receive();
        for reply in self.firmware.take(&received, &self.angles) {
            match self.fault {
                Fault::None => self.line.send(&reply),
                Fault::Split(count) => {
                    let count = count.min(reply.len() - 1);
                    self.line.send(&reply[..count]);
                    self.queue.push((1, reply[count..].to_vec()));
                }
                Fault::Dropped(at) => {
                    let mut reply = reply;
                    reply.remove(at.min(reply.len() - 1));
                    self.line.send(&reply);
                }
                Fault::Late(ticks) => self.queue.push((ticks, reply)),
                Fault::Mute => {}
                // Not more than a pseudo-terminal holds.
                Fault::Flood => self.line.send(&reply.repeat(3000 / reply.len())),
                Fault::Noise => {
                    self.line.send(&[5, 0xff, 0xff, 0xff, 0x7f, b'[', b'x', b']', b'\n'][..reply.len().min(9)])
                }
                Fault::OtherDevice => {
                    let other = self.firmware.other();
                    self.line.send(&other);
                }
            }
        }
    }

    /// Runs beside `open`, which waits for replies, and gives both back.
    pub fn while_opening<T>(self, open: impl FnOnce(&str) -> T) -> (Self, T) {
        self.beside(false, open)
    }

    /// Runs beside `open`, which waits for replies, and gives both back; the hand moves with the clock if it is
    /// `alive`.
    pub fn beside<T>(mut self, alive: bool, open: impl FnOnce(&str) -> T) -> (Self, T) {
        let over = Arc::new(AtomicBool::new(false));
        let (ends, path) = (Arc::clone(&over), self.line.path.clone());
        let body = thread::spawn(move || {
            self.line.in_step = false;
            if alive {
                run_like_a_device();
            }
            let mut last = Instant::now();
            while !ends.load(Ordering::Relaxed) {
                let now = Instant::now();
                let elapsed = (now - std::mem::replace(&mut last, now)).as_secs_f64();
                self.step(if alive { elapsed } else { 0.0 });
            }
            self.line.in_step = true;
            self
        });
        let opened = open(&path);
        over.store(true, Ordering::Relaxed);
        (body.join().unwrap(), opened)
    }
}

/// Lets this thread run before the host's: a device does not wait for the host's other programs. Left as it is where
/// the system refuses.
fn run_like_a_device() {
    let priority = libc::sched_param { sched_priority: 90 };
    // SAFETY: the call reads the number, and concerns this thread alone.
    unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const priority) };
}

/// The firmware of a 2DIY, version 3.
#[derive(Default)]
pub struct TwoDiyFirmware {
    pub setup: Vec<u8>,
    received: Vec<u8>,
    pub requests: Vec<Vec<u8>>,
    /// By joint.
    torque: [f64; 2],
}

impl Firmware for TwoDiyFirmware {
    fn take(&mut self, bytes: &[u8], angles: &JointVector) -> Vec<Vec<u8>> {
        self.received.extend_from_slice(bytes);
        let mut replies = Vec::new();
        loop {
            let length = match self.received.first() {
                Some(0) => 2,
                Some(1) => 26,
                Some(2) => 10,
                Some(other) => panic!("a command {other} in {:?}", self.received),
                None => break,
            };
            if self.received.len() < length {
                break;
            }
            let message: Vec<u8> = self.received.drain(..length).collect();
            let number = |at: usize| f32::from_le_bytes(message[at..at + 4].try_into().unwrap());
            match message[0] {
                0 => self.torque = [0.0; 2],
                1 => self.setup = message,
                _ => {
                    // Ports 1 and 2 are joints 2 and 1.
                    self.torque = [f64::from(number(6)), f64::from(number(2))];
                    let mut reply = vec![message[1]];
                    for joint in [1, 0] {
                        reply.extend((angles[joint].to_degrees() as f32).to_le_bytes());
                    }
                    self.requests.push(message);
                    replies.push(reply);
                }
            }
        }
        replies
    }

    fn torque(&self) -> JointVector {
        JointVector::from_slice(&self.torque)
    }

    fn other(&self) -> Vec<u8> {
        vec![9; 9]
    }
}

/// The firmware of a WoodenHaptics.
#[derive(Default)]
pub struct WoodenFirmware {
    received: Vec<u8>,
    pub milliamps: [f64; 3],
}

const RATIO: [f64; 3] = [0.010 / 0.160, 0.010 / 0.120, 0.010 / 0.120];

impl Firmware for WoodenFirmware {
    fn take(&mut self, bytes: &[u8], angles: &JointVector) -> Vec<Vec<u8>> {
        self.received.extend_from_slice(bytes);
        let mut replies = Vec::new();
        while let Some(end) = self.received.iter().position(|byte| *byte == b'\n') {
            let message: Vec<u8> = self.received.drain(..=end).collect();
            let text = String::from_utf8(message).unwrap();
            let inside = text.trim().strip_prefix('[').unwrap().strip_suffix(']').unwrap();
            let values: Vec<f64> = inside.split(',').map(|field| f64::from(field.parse::<i32>().unwrap())).collect();
            // Beyond the range a current counts as zero.
            self.milliamps = [0, 1, 2].map(|k| if values[k].abs() <= 6000.0 { values[k] } else { 0.0 });
            let count = |k: usize| {
                let home = [0.0, 0.0, 6000.0][k];
                (angles[k] / (std::f64::consts::TAU / 2000.0 * RATIO[k]) - home).round() as i32
            };
            replies.push(format!("[3,{},{},{},0,0,0,0]\n", count(0), count(1), count(2)).into_bytes());
        }
        replies
    }

    fn torque(&self) -> JointVector {
        let torque = |k: usize| 1e-3 * self.milliamps[k] * 0.0259 / RATIO[k];
        JointVector::from_slice(&[torque(0), torque(1), torque(2)])
    }

    fn other(&self) -> Vec<u8> {
        b"[1,0,0,0,0,0,0,0]\n".to_vec()
    }
}
