//! The program: `haptize device`, and `play` with a device.

use serde_json::Value;
use std::{
    path::Path,
    process::{Command, Output},
};

/// A finger of one joint above a ball, at eight angles.
pub const FINGER: &str = r#"name = "finger"
[object]
node_mass = 0.005
sphere = { radius = 0.05, rings = 10, segments = 10 }
springs = { kind = "isotropic", stiffness = 300.0 }
ground = { stiffness = 100.0 }
[[proxy.joint]]
kind = "revolute"
origin = [-0.1, 0.0, 0.06]
axis = [0.0, 1.0, 0.0]
limits = [-0.5, 0.5]
nodes = [{ at = [0.1, 0.0, 0.0] }]
[contact]
stiffness = 1000.0
[grid]
axes = [{ start = 0.0, stop = 0.28, count = 8 }]
[motion]
press = [{ time = 0.0, q = [0.05] }, { time = 0.4, q = [0.22] }, { time = 1.0, q = [0.22] }]
"#;

fn haptize(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_haptize")).args(arguments).current_dir(folder).output().unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)))
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
    std::fs::write(path.join("finger.toml"), FINGER).unwrap();
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
