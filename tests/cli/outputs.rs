//! What a command leaves on disk: nothing of its inputs, nor of other programs, is lost.

use crate::{
    commands::FINGER,
    common::program::{command, haptize, json, text},
};
use serde_json::Value;

/// No command writes over what it reads, over a file of another kind, or over what is no file; `--json` says so in one
/// object.
#[test]
fn no_output_destroys_an_input() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let motion = "\n[motion]\npress = [{ time = 0.0, q = [0.0] }, { time = 0.2, q = [0.25] }]\n";
    std::fs::write(path("finger.toml"), format!("{FINGER}{motion}")).unwrap();
    json(folder.path(), &["bake", "finger.toml", "--json"]);
    json(folder.path(), &["play", "finger.haptize", "--seconds", "0.1", "--exact", "--record", "kept.csv", "--json"]);
    assert!(path("out/finger-press/trace.csv").is_file(), "a folder named after dataset and motion");
    std::fs::write(path("move.csv"), "0,0\n0.1,0\n").unwrap();
    std::fs::write(path("walk.csv"), "time [s],finger [rad]\n0,0\n0.1,0\n").unwrap();
    std::fs::write(path("touch.py"), "import haptize\nprint(haptize.__version__)\n").unwrap();
    let weights = r#"{"w":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}    "#;
    std::fs::write(path("weights.safetensors"), [&58_u64.to_le_bytes()[..], weights.as_bytes(), &[0; 4]].concat())
        .unwrap();
    std::fs::write(path("mine.npz"), b"PK\x03\x04 torque.npy").unwrap();
    std::fs::write(path("scanned.csv"), "# haptize scan log, version 1\n").unwrap();
    std::fs::create_dir(path("o")).unwrap();
    std::fs::copy(path("move.csv"), path("o/trace.csv")).unwrap();
    std::fs::hard_link(path("finger.haptize"), path("hard.haptize")).unwrap();
    let long = "x".repeat(300);
    let all = [
        "finger.toml",
        "finger.haptize",
        "kept.csv",
        "move.csv",
        "walk.csv",
        "touch.py",
        "weights.safetensors",
        "mine.npz",
        "scanned.csv",
        "o/trace.csv",
        "hard.haptize",
    ];
    let contents = || all.map(|name| std::fs::read(path(name)).unwrap());
    let before = contents();
    for (arguments, expected) in [
        (&["bake", "finger.toml", "-o", "finger.toml"][..], "also an input"),
        (&["bake", "finger.toml", "-o", "./o/../finger.toml"], "also an input"),
        (&["bake", "finger.toml", "-o", "kept.csv"], "not a dataset"),
        (&["bake", "finger.toml", "-o", "o"], "no regular file"),
        (&["export", "finger.haptize", "--format", "csv", "-o", "hard.haptize"], "also an input"),
        (&["export", "finger.haptize", "--format", "csv", "-o", "kept.csv"], "not a table or figure"),
        (&["export", "finger.haptize", "--format", "csv", "-o", "finger.toml"], "not a table or figure"),
        (&["export", "finger.haptize", "--format", "csv", "-o", "touch.py"], "not a table or figure"),
        (
            &["export", "finger.haptize", "--format", "npz", "-o", "new.csv"],
            "give --format csv, or a file whose name ends in .npz",
        ),
        (&["export", "finger.haptize", "--format", "csv", "-o", "walk.csv"], "not a table or figure"),
        (&["bake", "finger.toml", "-o", "weights.safetensors"], "not a dataset"),
        (&["export", "finger.haptize", "--format", "npz", "-o", "mine.npz"], "not a table or figure"),
        (&["play", "finger.haptize", "--record", "touch.py"], "not the record of a session"),
        (&["play", "finger.haptize", "--record", "scanned.csv"], "not the record of a session"),
        (&["play", "finger.haptize", "--record", long.as_str()], "choose a shorter name"),
        (&["play", "finger.haptize", "--record", "finger.haptize"], "also an input"),
        (&["play", "finger.haptize", "--motion", "o/trace.csv", "-o", "o"], "also an input"),
        (&["gridize", "move.csv", "--step", "0.1", "-o", "move.csv"], "also an input"),
    ] {
        let output = haptize(folder.path(), &[arguments, &["--json"]].concat());
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", text(&output.stderr));
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(told["error"].as_str().unwrap().contains(expected), "{arguments:?}: {told}");
        assert!(contents() == before, "{arguments:?}");
    }
    assert_eq!(haptize(folder.path(), &["bake", "finger.toml"]).status.code(), Some(0), "its own output is replaced");
    let forced = ["export", "finger.haptize", "--format", "csv", "-o", "kept.csv", "--force"];
    json(folder.path(), &[&forced[..], &["--json"]].concat());
    assert!(!std::fs::read_to_string(path("kept.csv")).unwrap().starts_with("# a session"));
    let forced = haptize(folder.path(), &["bake", "finger.toml", "-o", "finger.toml", "--force"]);
    assert_eq!(forced.status.code(), Some(1), "an input is no output, whatever is asked");
}

/// Nobody need listen: with standard error full, a bake goes on.
#[cfg(target_os = "linux")]
#[test]
fn a_full_standard_error_stops_no_bake() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("finger.toml"), FINGER).unwrap();
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let status = command(folder.path(), &["bake", "finger.toml"]).stderr(full).status().unwrap();
    assert_eq!(status.code(), Some(0));
    assert!(folder.path().join("finger.haptize").is_file());
}
