//! Gamepads as Linux lists them: the kernel's list, which everybody may read, says which devices are gamepads, and
//! /dev/input what they report (kernel's documentation: input/event-codes, input/gamepad).

use super::{
    background::spawn,
    gamepad::{Found, Gamepad},
    pad::{Axis, Button, Pad, Range},
};
use std::{
    fs::{self, File, OpenOptions},
    io::{self, ErrorKind, Read},
    mem::{offset_of, size_of},
    os::{fd::AsRawFd, unix::fs::OpenOptionsExt},
    path::{Path, PathBuf},
    time::Duration,
};

/// How often a gamepad that is not there is looked for, and one that is there is read.
const SEARCH_PERIOD: Duration = Duration::from_secs(1);
const READ_PERIOD: Duration = Duration::from_millis(4);

/// Where the kernel lists what it reads events from.
const LIST: &str = "/sys/class/input";

// Kinds of events: what happens to all, to keys, to axes; and that some were lost.
const SYNCHRONIZATION: u16 = 0;
const KEY: u16 = 1;
const ABSOLUTE: u16 = 3;
const DROPPED: u16 = 3;

// Axes, and the keys by which gamepads are known.
const X: u16 = 0x00;
const Y: u16 = 0x01;
const Z: u16 = 0x02;
const RX: u16 = 0x03;
const RY: u16 = 0x04;
const RZ: u16 = 0x05;
const GAS: u16 = 0x09;
const BRAKE: u16 = 0x0a;
const AXES: u16 = 0x40;
const SOUTH: u16 = 0x130;
const LEFT_BUMPER: u16 = 0x136;
const RIGHT_BUMPER: u16 = 0x137;

/// Size of an event as it is read [B], and how many are read at once.
const EVENT: usize = size_of::<libc::input_event>();
const EVENTS: usize = 64;

/// Begins to look for a gamepad and to read it for `gamepad`. Without a thread there is none.
pub fn read(gamepad: &Gamepad) {
    let alive = gamepad.weak();
    let _ = spawn("gamepad", move || {
        while let Some(gamepad) = alive() {
            let opened = candidates(Path::new(LIST)).into_iter().map(|entry| (open(&device(&entry)), entry));
            match opened.min_by_key(|(opened, _)| opened.is_err()) {
                None => gamepad.tell(Found::None),
                Some((Err(error), entry)) => gamepad.tell(refused(&device(&entry), &error)),
                Some((Ok(file), entry)) => {
                    drop(gamepad);
                    // It ends when the gamepad is unplugged, or nobody listens any more.
                    let _ = follow(file, &entry, &alive);
                    alive().inspect(|gamepad| gamepad.tell(Found::None));
                }
            }
            std::thread::sleep(SEARCH_PERIOD);
        }
    });
}

/// Entries of `list` that are gamepads: that have the lowest button under the right thumb.
fn candidates(list: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(list) else { return Vec::new() };
    let mut found: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"event")))
        .filter(|path| has(path, "key", SOUTH))
        .collect();
    found.sort();
    found
}

/// Whether the device of `entry` reports `code` among its `kind`: hexadecimal words of the kernel's own width, the highest
/// first.
fn has(entry: &Path, kind: &str, code: u16) -> bool {
    let Ok(words) = fs::read_to_string(entry.join("device/capabilities").join(kind)) else { return false };
    let (word, bit) = (usize::from(code) / usize::BITS as usize, u32::from(code) % usize::BITS);
    let word = words.split_whitespace().rev().nth(word).and_then(|word| usize::from_str_radix(word, 16).ok());
    word.is_some_and(|word| word >> bit & 1 == 1)
}

/// Where the device of `entry` is read.
fn device(entry: &Path) -> PathBuf {
    Path::new("/dev/input").join(entry.file_name().unwrap_or_default())
}

/// A reader that never waits.
fn open(device: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK).open(device)
}

/// Returns the message for a gamepad that cannot be opened; none if it was just unplugged.
fn refused(device: &Path, error: &io::Error) -> Found {
    let remedy = match error.kind() {
        ErrorKind::NotFound => return Found::None,
        ErrorKind::PermissionDenied => "sudo usermod -aG input $USER lets you, once you have logged in again",
        _ => "unplug it and plug it in again",
    };
    Found::Refused(format!("The gamepad {} cannot be read: {error}; {remedy}", device.display()))
}

/// Reads `file`, of `entry`, until it is gone, or nobody is `alive`.
fn follow(mut file: File, entry: &Path, alive: &impl Fn() -> Option<Gamepad>) -> io::Result<()> {
    // Drivers that report the right stick as it is now agreed report triggers where older ones report that stick.
    let newer = has(entry, "abs", RX);
    let mut pad = held(&file, newer);
    let name = fs::read_to_string(entry.join("device/name")).unwrap_or_default();
    alive().inspect(|gamepad| gamepad.tell(Found::Connected(name.trim().to_owned())));
    let mut bytes = [0; EVENTS * EVENT];
    while let Some(gamepad) = alive() {
        let read = match file.read(&mut bytes) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Err(error) if error.kind() == ErrorKind::WouldBlock => 0,
            other => other?,
        };
        let (reset, dropped) = take(&mut pad, newer, &bytes[..read]);
        if dropped {
            pad = held(&file, newer);
        }
        gamepad.hold(&pad, reset);
        drop(gamepad);
        if read < bytes.len() {
            std::thread::sleep(READ_PERIOD);
        }
    }
    Ok(())
}

/// The gamepad as it is held now; bumpers count as let go.
fn held(file: &File, newer: bool) -> Pad {
    let mut pad = Pad::default();
    for code in 0..AXES {
        let Some(axis) = axis(code, newer) else { continue };
        let mut info = libc::input_absinfo { value: 0, minimum: 0, maximum: 0, fuzz: 0, flat: 0, resolution: 0 };
        let ask = libc::_IOR::<libc::input_absinfo>(u32::from(b'E'), u32::from(AXES + code));
        // SAFETY: the request writes one such structure, for which `info` has room. Where it fails the range has no width.
        unsafe { libc::ioctl(file.as_raw_fd(), ask, &raw mut info) };
        pad.set_up(axis, Range { least: info.minimum, greatest: info.maximum }, info.value);
    }
    pad
}

/// Does to `pad` what the events in `bytes` say; answers whether they ask for a reset, and whether some were lost.
fn take(pad: &mut Pad, newer: bool, bytes: &[u8]) -> (bool, bool) {
    let (mut reset, mut dropped) = (false, false);
    for event in bytes.chunks_exact(EVENT) {
        let number = |at: usize| u16::from_ne_bytes([event[at], event[at + 1]]);
        let at = offset_of!(libc::input_event, value);
        let value = i32::from_ne_bytes([event[at], event[at + 1], event[at + 2], event[at + 3]]);
        match (number(offset_of!(libc::input_event, type_)), number(offset_of!(libc::input_event, code))) {
            (SYNCHRONIZATION, DROPPED) => dropped = true,
            (ABSOLUTE, code) => drop(axis(code, newer).map(|axis| pad.turn(axis, value))),
            (KEY, LEFT_BUMPER) => drop(pad.press(Button::LeftBumper, value != 0)),
            (KEY, RIGHT_BUMPER) => drop(pad.press(Button::RightBumper, value != 0)),
            (KEY, SOUTH) => reset |= pad.press(Button::South, value != 0),
            _ => {}
        }
    }
    (reset, dropped)
}

/// Which axis `code` is.
fn axis(code: u16, newer: bool) -> Option<Axis> {
    match (code, newer) {
        (X, _) => Some(Axis::LeftX),
        (Y, _) => Some(Axis::LeftY),
        (RX, true) | (Z, false) => Some(Axis::RightX),
        (RY, true) | (RZ, false) => Some(Axis::RightY),
        (Z, true) | (BRAKE, false) => Some(Axis::LeftTrigger),
        (RZ, true) | (GAS, false) => Some(Axis::RightTrigger),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::{collections::HashSet, io::Write, os::fd::OwnedFd};

    #[test]
    fn gamepads_are_told_from_keyboards_by_their_keys() {
        let folder = tempfile::tempdir().unwrap();
        for (name, keys) in [
            ("event3", "402000000 3803078f800d001 feffffdfffefffff fffffffffffffffe"),
            ("event7", "7cdb000000000000 0 0 0 0"),
            ("event9", "not a number 0 0 0 0"),
            ("js0", "7cdb000000000000 0 0 0 0"),
        ] {
            let device = folder.path().join(name).join("device/capabilities");
            fs::create_dir_all(&device).unwrap();
            fs::write(device.join("key"), format!("{keys}\n")).unwrap();
        }
        fs::create_dir(folder.path().join("event11")).unwrap();
        let found: Vec<PathBuf> = candidates(folder.path()).iter().map(|entry| device(entry)).collect();
        // Words as wide as the kernel writes them on machines of 64 bits.
        let expected: &[&Path] = if usize::BITS == 64 { &[Path::new("/dev/input/event7")] } else { &[] };
        assert_eq!(found, expected);
        assert!(candidates(&folder.path().join("none")).is_empty());
    }

    #[test]
    fn a_refusal_is_told_with_its_remedy() {
        let told = |kind: ErrorKind| refused(Path::new("/dev/input/event7"), &kind.into());
        let Found::Refused(words) = told(ErrorKind::PermissionDenied) else { panic!("it is not refused") };
        for part in ["/dev/input/event7", "permission denied", "usermod -aG input", "logged in again"] {
            assert!(words.contains(part), "{words}");
        }
        assert_eq!(told(ErrorKind::NotFound), Found::None);
    }

    #[test]
    fn older_and_newer_drivers_have_two_sticks_and_two_triggers() {
        for newer in [false, true] {
            let all: HashSet<Axis> = (0..AXES).filter_map(|code| axis(code, newer)).collect();
            assert_eq!(all.len(), 6);
        }
        assert_eq!((axis(Z, true), axis(Z, false)), (Some(Axis::LeftTrigger), Some(Axis::RightX)));
    }

    fn event(kind: u16, code: u16, value: i32) -> Vec<u8> {
        let mut bytes = vec![0; EVENT];
        bytes[offset_of!(libc::input_event, type_)..][..2].copy_from_slice(&kind.to_ne_bytes());
        bytes[offset_of!(libc::input_event, code)..][..2].copy_from_slice(&code.to_ne_bytes());
        bytes[offset_of!(libc::input_event, value)..][..4].copy_from_slice(&value.to_ne_bytes());
        bytes
    }

    #[test]
    fn events_move_what_they_name() {
        let mut pad = Pad::default();
        pad.set_up(Axis::RightX, Range { least: -100, greatest: 100 }, 0);
        let mut bytes = event(ABSOLUTE, RX, 100);
        bytes.extend(event(KEY, LEFT_BUMPER, 1));
        bytes.extend(event(KEY, 0x131, 1));
        assert_eq!(take(&mut pad, true, &bytes), (false, false));
        assert_eq!(pad.speeds(), [0.0, 0.0, 0.0, 1.0, 0.0, -1.0]);
        // The end of an event that was cut short is none.
        let torn = event(ABSOLUTE, RX, -100);
        take(&mut pad, true, &torn[..EVENT - 1]);
        assert_eq!(pad.speeds()[3], 1.0);
        assert_eq!(take(&mut pad, true, &event(KEY, SOUTH, 1)), (true, false));
        assert_eq!(take(&mut pad, true, &event(SYNCHRONIZATION, DROPPED, 0)), (false, true));
    }

    /// A pipe stands for a gamepad that is pulled out: it reports, then ends.
    #[test]
    fn one_that_is_pulled_out_in_mid_motion_moves_nothing_any_more() {
        let (reader, mut writer) = io::pipe().unwrap();
        let gamepad = Gamepad::default();
        let listening = gamepad.clone();
        let entry = tempfile::tempdir().unwrap();
        let thread = std::thread::spawn({
            let (alive, place) = (gamepad.weak(), entry.path().to_owned());
            move || {
                let ended = follow(File::from(OwnedFd::from(reader)), &place, &alive);
                alive().inspect(|gamepad| gamepad.tell(Found::None));
                ended
            }
        });
        writer.write_all(&event(KEY, RIGHT_BUMPER, 1)).unwrap();
        while listening.wish().speeds[5] != 1.0 {
            std::thread::sleep(READ_PERIOD);
        }
        assert!(matches!(listening.found(), Found::Connected(_)));
        drop(writer);
        assert!(thread.join().unwrap().is_err());
        assert_eq!((listening.wish().speeds, listening.found()), ([0.0; 6], Found::None));
    }

    proptest! {
        #[test]
        fn no_events_whatever_move_a_joint_faster_than_a_key(bytes: Vec<u8>, least: i32, greatest: i32, newer: bool) {
            let mut pad = Pad::default();
            pad.set_up(Axis::LeftX, Range { least, greatest }, 0);
            take(&mut pad, newer, &bytes);
            prop_assert!(pad.speeds().iter().all(|speed| speed.abs() <= 1.0));
        }
    }
}
