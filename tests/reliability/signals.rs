//! Signals: every command ends within a second, however long what it does takes; nothing half written is left, and
//! `nohup` is honoured.

#![cfg(unix)]

use super::objects::{OBJECTS, scene, write_scene};
use crate::common::program::{command, message};
use std::{
    path::Path,
    process::{Child, Command, Output, Stdio},
    time::{Duration, Instant},
};

/// Longest time from a signal to the end of the program: a second, and what a busy machine adds to it.
const LONGEST: Duration = Duration::from_millis(2500);

fn send(child: &Child, signal: &str) {
    assert!(Command::new("kill").args(["-s", signal, &child.id().to_string()]).status().unwrap().success());
}

/// Signals that the program listens for: not those that this process, and so the program, was started to ignore.
fn listened() -> Vec<&'static str> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.map_or(0, |mask| u64::from_str_radix(mask.trim(), 16).unwrap());
    let signals = [("HUP", 1), ("INT", 2), ("TERM", 15)];
    signals.into_iter().filter(|(_, number)| ignored >> (number - 1) & 1 == 0).map(|(name, _)| name).collect()
}

/// Starts the program, sends `signal` once it has worked for `time`, and returns what it said and how long it went on.
fn interrupted(folder: &Path, arguments: &[&str], time: Duration, signal: &str) -> (Output, Duration) {
    interrupted_after(folder, arguments, |_| std::thread::sleep(time), signal)
}

/// The same with a `wait` for the program.
fn interrupted_after(folder: &Path, arguments: &[&str], wait: impl FnOnce(&Child), signal: &str) -> (Output, Duration) {
    let mut child = command(folder, arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait(&child);
    assert!(child.try_wait().unwrap().is_none(), "{arguments:?} ended before it was interrupted");
    let sent = Instant::now();
    send(&child, signal);
    let output = child.wait_with_output().unwrap();
    (output, sent.elapsed())
}

/// A skin of so many nodes that its compliance takes many seconds.
const SLOW: &str =
    "sphere = { radius = 0.04, edge = 0.0015 }\nskin = { thickness = 0.002, young = 1e5, foundation = 1e6 }";

#[test]
fn every_command_ends_within_a_second_of_a_signal() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path(), OBJECTS[0].1, 4);
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("slow.toml"), scene(SLOW, 4)).unwrap();
    std::fs::write(path("long.toml"), scene(OBJECTS[0].1, 1200)).unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::copy(root.join("datasets/sponge.toml"), path("sponge.toml")).unwrap();
    let baked =
        command(folder.path(), &["bake", "scene.toml", "-o", "x.haptize", "--backend", "cpu"]).output().unwrap();
    assert!(baked.status.success(), "{}", message(&baked));
    let time = Duration::from_millis(900);
    let mut slowest = Duration::ZERO;
    for (arguments, code) in [
        // Work that looks at the signal: a bake says itself that it has stopped.
        (&["bake", "long.toml", "-o", "long.haptize", "--backend", "cpu"][..], 1),
        // Work that does not within its grace, and work that cannot.
        (&["bake", "slow.toml", "-o", "slow.haptize", "--backend", "cpu"], 130),
        (&["bake", "long.toml", "--max-error", "0.01%", "--refine", "3", "-o", "fine.haptize"], 130),
        (&["inspect", "slow.toml", "--q=0,0.01"], 130),
        (&["accuracy", "slow.toml", "-o", "a"], 130),
        (&["play", "x.haptize", "--realtime", "--seconds", "60", "-o", "p"], 130),
    ] {
        for signal in listened() {
            let (output, took) = interrupted(folder.path(), &[arguments, &["--json"]].concat(), time, signal);
            assert_eq!(output.status.code(), Some(code), "{arguments:?}, {signal}: {}", message(&output));
            assert!(took < LONGEST, "{arguments:?}, {signal}: went on for {took:?}");
            let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
            let error = told["error"].as_str().unwrap();
            // What is said to continue the work is an option that the command has.
            let resumes = arguments[0] == "bake" && !arguments.contains(&"--refine");
            assert!(!error.is_empty() && (resumes || !error.contains("--resume")), "{arguments:?}: {error}");
            slowest = slowest.max(took);
            let _ = std::fs::remove_file(path("long.haptize.part"));
        }
    }
    eprintln!("a signal took {slowest:?} at most");
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    let is_half = |name: &&std::ffi::OsString| name.to_string_lossy().contains(".tmp");
    assert!(left.iter().find(is_half).is_none(), "{left:?}");
}

/// Waits until the loop of `child` has run for a second: where the system lists threads by name, however busy it is.
fn wait_for_loop(child: &Child) {
    let tasks = format!("/proc/{}/task", child.id());
    let is_haptic = |task: std::fs::DirEntry| {
        std::fs::read_to_string(task.path().join("comm")).is_ok_and(|name| name.trim() == "haptic")
    };
    let longest = Duration::from_secs(if Path::new(&tasks).exists() { 60 } else { 5 });
    let begun = Instant::now();
    while begun.elapsed() < longest && !std::fs::read_dir(&tasks).is_ok_and(|all| all.flatten().any(is_haptic)) {
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(Duration::from_secs(1));
}

/// Waits until rows of the trace are on their way to the disk: of a session of any length little is left for the end.
fn wait_for_rows(folder: &Path) {
    let begun = Instant::now();
    let is_growing = |entry: std::fs::DirEntry| {
        entry.file_name().to_string_lossy().ends_with(".tmp") && entry.metadata().is_ok_and(|file| file.len() > 0)
    };
    while !std::fs::read_dir(folder).is_ok_and(|all| all.flatten().any(is_growing)) {
        assert!(begun.elapsed() < Duration::from_secs(60), "nothing is written to {} meanwhile", folder.display());
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A signal ends a session as its time does: the trace is kept. Each figure is there, or told to
/// be left out, for want of time.
#[test]
fn a_live_session_ends_within_a_second_of_a_signal_and_keeps_what_it_has() {
    let folder = tempfile::tempdir().unwrap();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/organ.toml").display().to_string();
    for signal in listened() {
        let play = ["play", &scene, "--device", "simulated", "--seconds", "60", "-o", "p", "--json"];
        let wait = |child: &Child| {
            wait_for_loop(child);
            wait_for_rows(&folder.path().join("p"));
        };
        let (output, took) = interrupted_after(folder.path(), &play, wait, signal);
        assert!(took < LONGEST, "{signal}: went on for {took:?}");
        let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        // A machine too busy for the loop gives it a fault.
        let code = i32::from(!told["fault"].is_null());
        assert_eq!(output.status.code(), Some(code), "{signal}: {told} {}", message(&output));
        assert!(told["seconds"].as_f64().unwrap() > 0.0, "{told}");
        let files: Vec<&str> = told["files"].as_array().unwrap().iter().map(|file| file.as_str().unwrap()).collect();
        assert!(files.contains(&"p/trace.csv"), "{files:?}");
        assert!(files.iter().all(|file| folder.path().join(file).exists()), "{files:?}");
        // A session of six joints has no force at an end, and one whose contact is solved live no stored torques.
        let is_none = |name: &&str| ["cspace", "torque", "force"].iter().any(|none| name.starts_with(none));
        assert!(!files.iter().any(|file| is_none(&file.trim_start_matches("p/"))), "{files:?}");
        let figures = haptize::report::FIGURES.into_iter().filter(|name| !is_none(name));
        for figure in figures.chain(["jitter.svg", "jitter.png"]) {
            let left_out = message(&output).split_once("left out").is_some_and(|(_, names)| names.contains(figure));
            let is_there = files.contains(&format!("p/{figure}").as_str());
            assert!(is_there != left_out, "{signal}: {figure}: {}", message(&output));
        }
        let names = std::fs::read_dir(folder.path().join("p")).unwrap();
        let names: Vec<String> = names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        assert!(!names.iter().any(|name| name.ends_with(".tmp")), "{names:?}");
        eprintln!("{signal} took {took:?}, {} files", files.len());
    }
}

#[test]
fn a_scan_that_is_interrupted_keeps_its_rows() {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::copy(root.join("datasets/sponge.toml"), folder.path().join("sponge.toml")).unwrap();
    let scan = ["scan", "sponge.toml", "-o", "s.csv"];
    let (output, took) = interrupted(folder.path(), &scan, Duration::from_millis(700), "TERM");
    assert!(took < LONGEST && matches!(output.status.code(), Some(1 | 130)), "{took:?}: {}", message(&output));
    let rows = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap().lines().count();
    let kept = rows("s.csv");
    let (_, took) =
        interrupted(folder.path(), &[&scan[..], &["--resume"]].concat(), Duration::from_millis(700), "TERM");
    assert!(took < LONGEST && rows("s.csv") > kept, "{kept} rows, then {}", rows("s.csv"));
}

#[test]
fn a_signal_that_was_ignored_from_the_start_stays_ignored() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path(), OBJECTS[0].1, 700);
    let program = command(folder.path(), &["bake", "scene.toml", "-o", "x.haptize", "--backend", "cpu"]);
    let line: Vec<&str> =
        std::iter::once(program.get_program()).chain(program.get_args()).map(|word| word.to_str().unwrap()).collect();
    // As nohup does it.
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(format!("trap '' HUP; exec {}", line.join(" "))).current_dir(folder.path());
    let mut bake = shell.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(800));
    assert!(bake.try_wait().unwrap().is_none(), "ended before the signal");
    send(&bake, "HUP");
    let output = bake.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", message(&output));
    assert!(folder.path().join("x.haptize").exists());
}
