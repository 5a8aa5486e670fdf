//! The program: `haptize device`, and `play` with a device.

use crate::common::program::{command, haptize, message};
use haptize::scan::{RowStatus, ScanLog};
#[cfg(unix)]
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::{
    io::{BufRead, BufReader},
    path::Path,
    process::Output,
    time::{Duration, Instant},
};

/// A finger of one joint above a ball, at eight angles, and a press.
pub fn finger() -> String {
    let press = "press = [{ time = 0.0, q = [0.05] }, { time = 0.4, q = [0.22] }, { time = 1.0, q = [0.22] }]";
    format!("{}[motion]\n{press}\n", include_str!("../scenes/finger.toml"))
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {}", message(output)))
}

#[test]
fn devices_are_listed_with_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let listed = json(&haptize(folder.path(), &["device", "list", "--json"]));
    let devices = listed["devices"].as_array().unwrap();
    let named = |name: &str| devices.iter().find(|device| device["kind"] == name).unwrap();
    assert_eq!(named("simulated")["found"]["places"][0], "simulated");
    for device in devices {
        let (places, missing) = (&device["found"]["places"], &device["found"]["missing"]);
        assert!(!places.as_array().unwrap().is_empty() || !missing.as_array().unwrap().is_empty(), "{device}");
    }
}

#[test]
fn a_check_reads_then_holds_zero_torque_and_finds_what_fails() {
    let folder = tempfile::tempdir().unwrap();
    let output = haptize(folder.path(), &["device", "check", "simulated", "--seconds", "0.2", "--json"]);
    assert_eq!(output.status.code(), Some(0));
    let report = json(&output);
    assert_eq!(report["phases"][0]["phase"], "reading");
    assert_eq!(report["phases"][1]["phase"], "zero-torque");
    assert!(report["phases"][1]["fresh"].as_u64().unwrap() > 20, "{report}");
    assert_eq!(report["watchdog"], "none");
    // A scene lowers what is used of the device's limit, and names as many coordinates.
    let limited = |count: usize| {
        let limits = vec!["0.001"; count].join(", ");
        let scene = format!("{}[device]\neffort_limit = [{limits}]\n", finger());
        std::fs::write(folder.path().join("limited.toml"), scene).unwrap();
        let check = ["device", "check", "simulated", "--seconds", "0.1", "--json", "--scene", "limited.toml"];
        haptize(folder.path(), &check)
    };
    let used = |report: &serde_json::Value| report["most"][0].as_f64().unwrap();
    let count = report["limit"].as_array().unwrap().len();
    assert!(used(&report) > 0.001, "{report}");
    assert_eq!(used(&json(&limited(count))), 0.001);
    let refused = limited(count + 1);
    assert_eq!(refused.status.code(), Some(1), "{}", String::from_utf8_lossy(&refused.stdout));

    let output = haptize(folder.path(), &["device", "check", "simulated:unplugged@0.1", "--seconds", "0.2", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let report = json(&output);
    assert!(report["phases"][0]["tally"]["stopped"].as_str().unwrap().contains("unplugged"), "{report}");

    for wrong in ["omega9", "", ":", "simulated:asleep"] {
        let output = haptize(folder.path(), &["device", "check", wrong]);
        assert_ne!(output.status.code(), Some(0), "{wrong}");
        assert!(!output.stderr.is_empty());
    }
    // The key needs a terminal.
    let output = haptize(folder.path(), &["device", "check", "simulated", "--push"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("terminal"));
}

#[test]
fn play_drives_a_device_and_records_its_clamps_and_stops() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    std::fs::write(path.join("finger.toml"), finger()).unwrap();
    assert_eq!(haptize(path, &["bake", "finger.toml", "-o", "f.haptize", "--backend", "cpu"]).status.code(), Some(0));
    let played =
        haptize(path, &["play", "f.haptize", "--device", "simulated", "--json", "-o", "felt", "--record", "r.csv"]);
    let report = json(&played);
    let tally = &report["device"]["tally"];
    assert!(tally["clamped"]["ramp"].as_u64().unwrap() > 100, "{report}");
    let trace = std::fs::read_to_string(path.join("felt/trace.csv")).unwrap();
    assert!(trace.lines().next().unwrap().contains(",clamps,halt"));
    if report["fault"].is_null() {
        assert_eq!(played.status.code(), Some(0));
        let replayed = json(&haptize(path, &["play", "f.haptize", "--replay", "r.csv", "--json", "-o", "again"]));
        assert_eq!(replayed["replayed"], true, "{replayed}");
    }

    let played = haptize(path, &["play", "f.haptize", "--device", "simulated:unplugged@0.5", "--json", "-o", "felt2"]);
    assert_eq!(played.status.code(), Some(1));
    let report = json(&played);
    assert!(report["device"]["tally"]["stopped"].as_str().unwrap().contains("unplugged"), "{report}");
    assert!(report["seconds"].as_f64().unwrap() < 0.9, "the session ends with the device");
}

#[test]
fn a_hand_that_loses_its_torque_is_told_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    std::fs::write(path.join("finger.toml"), finger()).unwrap();
    assert_eq!(haptize(path, &["bake", "finger.toml", "-o", "f.haptize", "--backend", "cpu"]).status.code(), Some(0));
    let device = "simulated:silent@0.3-0.4";
    let mut play = command(path, &["play", "f.haptize", "--device", device, "--seconds", "60", "-o", "felt"])
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(play.stderr.take().unwrap()).lines().map_while(Result::ok);
    let told = lines.take_while(|line| !line.contains("the torque went to zero")).count();
    let runs = play.try_wait().unwrap().is_none();
    let _ = play.kill();
    play.wait().unwrap();
    assert!(runs, "told at the end only, after {told} other lines");
}

/// The Touch's arm without weight, and a plan of 3 x 4 x 2 configurations around those of the stand-in, half of them
/// behind its wall.
const PLAN: &str = r#"name = "plan"
[[proxy.joint]]
name = "waist"
kind = "revolute"
axis = [0.0, 0.0, 1.0]
limits = [-0.98, 0.98]
rotor_inertia = 5e-4
[[proxy.joint]]
name = "shoulder"
kind = "revolute"
origin = [0.0, 0.0, 0.125]
axis = [1.0, 0.0, 0.0]
limits = [0.0, 1.75]
rotor_inertia = 5e-4
[[proxy.joint]]
name = "elbow"
kind = "revolute"
origin = [0.0, 0.134, 0.0]
axis = [1.0, 0.0, 0.0]
limits = [-0.739, 1.32]
rotor_inertia = 5e-4
nodes = [{ at = [0.0, 0.0, -0.1325] }]
[scan.joints]
axes = [
    { start = -0.12, stop = -0.06, count = 3 },
    { start = 0.18, stop = 0.36, count = 4 },
    { start = 0.08, stop = 0.12, count = 2 },
]
[scan.control]
stiffness = 4.0
damping = 0.15
window = 0.05
average = 0.05
still = 5e-4
drift = 1e-3
epsilon = 0.005
[scan.limits]
torque = 0.19
workspace = [[-0.3, -0.1, -0.3], [0.3, 0.3, 0.3]]
[scan.simulated]
corner = [0.0, 0.0, 0.0]
size = [0.1, 0.1, 0.1]
[device]
map = [[-1, 0, 0], [0, 1, 0], [0, -1, 1]]
"#;

/// A user's whole way: plan, log, dataset. The library's thread drives the scan; what it measures is the wall.
#[cfg(target_os = "linux")]
#[test]
fn a_whole_plan_is_scanned_with_a_touch_by_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    std::fs::write(path.join("plan.toml"), PLAN).unwrap();
    let device = format!("touch:{}", crate::vendor::built("hd").display());
    let scan = |more: &[&str]| {
        let mut command = command(path, &["scan", "plan.toml", "--device", &device, "--json"]);
        command.args(more).env("STAND_IN_FREE", "1").output().unwrap()
    };
    let mut output = scan(&[]);
    // Where other programs, or those of the machine's owner, held the scan up, its user continues it.
    let begin = Instant::now();
    while json(&output)["error"].as_str().is_some_and(|error| error.contains("busy") || error.contains("5 ms"))
        && begin.elapsed() < LONGEST_UNREST
    {
        output = scan(&["--resume"]);
    }
    let report = json(&output);
    assert_eq!(output.status.code(), Some(0), "{report} {}", String::from_utf8_lossy(&output.stderr));
    assert!(report["whole"] == true && report["points"] == 24 && report["simulated"] == false, "{report}");
    let rows = ScanLog::read(&path.join("plan.csv")).unwrap().rows;
    assert_eq!(rows.len(), 24);
    let mut pressed = 0;
    for row in &rows {
        assert_eq!(row.status, RowStatus::Steady, "{row:?}");
        // Only the shoulder meets the wall, of 1 N m/rad at 0.3 rad; what counts as still moves it by 4 N m/rad times
        // 5e-4 rad, and half the drift.
        let expected = [0.0, -(row.q[1] - 0.3).max(0.0), 0.0];
        assert!((0..3).all(|a| (row.torque[a] - expected[a]).abs() < 2.5e-3), "{row:?}: {expected:?}");
        pressed += usize::from(row.torque[1] < -0.02);
    }
    assert!(pressed >= 6, "{pressed} points behind the wall");
    // Nothing is left to do, and nothing is measured twice.
    let again = json(&scan(&["--resume"]));
    assert!(again["whole"] == true && ScanLog::read(&path.join("plan.csv")).unwrap().rows.len() == 24, "{again}");
    let gridized = haptize(path, &["gridize", "plan.csv", "--step", "0.03,0.02,0.04", "--epsilon", "0.005", "--json"]);
    assert_eq!(gridized.status.code(), Some(0), "{}", String::from_utf8_lossy(&gridized.stderr));
}

/// How long a machine may go on holding up what is tried again (s): virtual machines of one owner share processors.
#[cfg(unix)]
const LONGEST_UNREST: Duration = Duration::from_secs(120);

/// Two slides above a ball, led by the two joints of a 2DIY.
#[cfg(unix)]
const SLIDES: &str = r#"name = "slides"
[object]
node_mass = 0.005
sphere = { radius = 0.05, rings = 10, segments = 10 }
springs = { kind = "isotropic", stiffness = 300.0 }
ground = { stiffness = 100.0 }
[[proxy.joint]]
name = "slide"
kind = "prismatic"
axis = [1.0, 0.0, 0.0]
limits = [-0.05, 0.05]
mass = 0.1
[[proxy.joint]]
name = "press"
kind = "prismatic"
axis = [0.0, 0.0, -1.0]
origin = [0.0, 0.0, 0.06]
limits = [-0.03, 0.05]
mass = 0.1
nodes = [{ at = [0.0, 0.0, 0.0] }]
[contact]
stiffness = 1000.0
[grid]
axes = [{ start = -0.03, stop = 0.04, count = 8 }, { start = 0.0, stop = 0.04, count = 9 }]
[device]
map = [[0.1, 0.0], [0.0, 0.1]]
offset = [-0.29365, -0.021817]
"#;

/// The torque that a firmware was sent with each command, and when.
#[cfg(unix)]
type Sent = std::sync::Arc<std::sync::Mutex<Vec<(Instant, f64)>>>;

/// A firmware that keeps what it was sent.
#[cfg(unix)]
struct Watched {
    firmware: crate::emulator::TwoDiyFirmware,
    sent: Sent,
}

#[cfg(unix)]
impl crate::emulator::Firmware for Watched {
    fn take(&mut self, bytes: &[u8], angles: &haptize::JointVector) -> Vec<Vec<u8>> {
        let replies = self.firmware.take(bytes, angles);
        let sent = (Instant::now(), self.firmware.torque().norm());
        self.sent.lock().unwrap().extend(replies.iter().map(|_| sent));
        replies
    }

    fn torque(&self) -> haptize::JointVector {
        self.firmware.torque()
    }

    fn other(&self) -> Vec<u8> {
        self.firmware.other()
    }
}

/// A folder with the dataset of an arm of two slides.
#[cfg(unix)]
fn slides() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), SLIDES).unwrap();
    let baked = haptize(folder.path(), &["bake", "s.toml", "-o", "s.haptize", "--backend", "cpu"]);
    assert_eq!(baked.status.code(), Some(0));
    folder
}

/// Plays in `folder` with an emulated 2DIY, and sends `signals` once it is pushed, all at once. Returns what came of
/// it, when the signal was sent, and the commands.
#[cfg(unix)]
fn signalled(folder: &Path, signals: &'static [Signal]) -> (std::process::Output, Instant, Sent) {
    use std::{os::unix::process::CommandExt, process::Stdio};
    let middle = haptize::JointVector::from_slice(&[168.25_f64.to_radians(), 12.5_f64.to_radians()]);
    let sent = Sent::default();
    let firmware = Watched { firmware: crate::emulator::TwoDiyFirmware::default(), sent: sent.clone() };
    let emulator = crate::emulator::Emulator::new(firmware, crate::felt::pressing(2, &middle));
    let (_, (output, signalled)) = emulator.beside(true, |line| {
        let mut play =
            command(folder, &["play", "s.haptize", "--seconds", "60", "--record", "r.csv", "-o", "felt", "--json"]);
        play.args(["--device", &format!("2diy:{line}")]).stdout(Stdio::piped()).stderr(Stdio::piped());
        // As from a terminal, whoever has started this process to ignore the signal.
        // SAFETY: the call is one that may be made between fork and exec.
        unsafe {
            play.pre_exec(move || {
                for signal in signals {
                    libc::signal(signal.as_raw(), libc::SIG_DFL);
                }
                Ok(())
            })
        };
        let mut play = play.spawn().unwrap();
        // Less than the session lasts, and many times what the hand takes to the contact.
        let patience = Instant::now() + Duration::from_secs(10);
        while !sent.lock().unwrap().last().is_some_and(|(_, torque)| *torque > 0.02)
            && play.try_wait().unwrap().is_none()
            && Instant::now() < patience
        {
            std::thread::sleep(Duration::from_millis(1));
        }
        let signalled = Instant::now();
        // It may have ended by itself: below.
        for signal in signals {
            let _ = kill_process(Pid::from_child(&play), *signal);
        }
        (play.wait_with_output().unwrap(), signalled)
    });
    (output, signalled, sent)
}

/// With how many commands a device is still pushed after `signal`; nothing where it did not answer in time, or the loop
/// faulted, as they do when the machine holds one of the two processes up for 10 ms.
#[cfg(unix)]
fn pushed_after(folder: &Path, signal: &'static [Signal]) -> Option<usize> {
    let (output, signalled, sent) = signalled(folder, signal);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    let report = json(&output);
    if !report["fault"].is_null() {
        assert!(told.contains("the torque went to zero"), "{told}");
        return None;
    }
    if report["error"].as_str().is_some_and(|error| error.contains("does not answer in time")) {
        return None;
    }
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert!(report["seconds"].as_f64().unwrap() < 50.0 && report["device"]["tally"]["stopped"].is_null(), "{report}");
    for file in report["files"].as_array().unwrap() {
        assert!(folder.join(file.as_str().unwrap()).is_file(), "{file}");
    }
    assert!(folder.join("felt/trace.csv").is_file() && folder.join("r.csv").is_file(), "{report}");
    let replayed = haptize(folder, &["play", "s.haptize", "--replay", "r.csv", "--json", "-o", "again"]);
    assert_eq!(json(&replayed)["replayed"], true);
    let sent = sent.lock().unwrap();
    let after: Vec<f64> = sent.iter().filter(|(at, _)| *at > signalled).map(|(_, torque)| *torque).collect();
    let pushed = after.iter().position(|torque| *torque == 0.0).expect("zero torque is sent");
    assert!(after[pushed..].iter().all(|torque| *torque == 0.0), "{after:?}");
    Some(pushed)
}

/// Of some sessions the one counts in which nobody held up the loop, nor the thread that hears signals: the machine may
/// be busy.
#[cfg(unix)]
#[test]
fn a_signal_ends_the_torque_within_two_ticks_and_the_session_keeps_its_files() {
    let folder = slides();
    let path = folder.path();
    const SIGNALS: [Signal; 6] = [Signal::INT, Signal::TERM, Signal::QUIT, Signal::TSTP, Signal::USR1, Signal::SYS];
    for signal in SIGNALS.chunks(1) {
        let (mut ticks, begin) = (Vec::new(), Instant::now());
        while begin.elapsed() < LONGEST_UNREST && !ticks.iter().any(|ticks| *ticks <= 2) {
            ticks.extend(pushed_after(path, signal));
        }
        eprintln!("signal {signal:?}: torque for {ticks:?} more commands");
        assert!(ticks.iter().any(|ticks| *ticks <= 2), "signal {signal:?}: torque for {ticks:?} more commands");
    }
}

/// The 2DIY has no watchdog: it keeps the last torque. A crash leaves the guard no time, nor do signals that come
/// together, of which the second ends the program at once.
#[cfg(unix)]
#[test]
fn the_last_command_of_a_program_that_ends_at_once_is_zero_torque() {
    use std::os::unix::process::ExitStatusExt;
    let folder = slides();
    let together: &'static [Signal] = &[Signal::HUP, Signal::TERM, Signal::HUP];
    for signals in [&[Signal::SEGV][..], &[Signal::ABORT], together] {
        let begin = Instant::now();
        // Once at least it is pushed when the signals come, and not let go of before.
        let was_pushed = loop {
            let (output, at, sent) = signalled(folder.path(), signals);
            let sent = sent.lock().unwrap();
            let before = sent.iter().take_while(|(sent, _)| *sent <= at).last();
            let ended = match signals {
                [signal] => output.status.signal() == Some(signal.as_raw()),
                _ => output.status.code() == Some(130),
            };
            if before.is_some_and(|(_, torque)| *torque > 0.02) && ended {
                assert_eq!(sent.last().unwrap().1, 0.0, "signals {signals:?}");
                break true;
            }
            if begin.elapsed() > LONGEST_UNREST {
                break false;
            }
        };
        assert!(was_pushed, "signals {signals:?}");
    }
}
