//! The program as a user meets it: exit codes, messages, `--json`, and what is left on disk.

use serde_json::Value;
use std::{
    path::Path,
    process::{Command, Output},
};

/// Runs the program in `folder`.
fn haptize(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_haptize")).args(arguments).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// The one JSON object on standard output of a run that succeeded.
fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = haptize(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
    let value: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(value.is_object(), "{value}");
    value
}

#[test]
fn doctor_says_what_the_machine_offers() {
    let folder = tempfile::tempdir().unwrap();
    let found = json(folder.path(), &["doctor", "--json"]);
    assert_eq!(found["version"], env!("CARGO_PKG_VERSION"));
    assert!(found["threads"].as_u64().unwrap() >= 1);
    let hardware = found["adapters"].as_array().unwrap().iter().any(|adapter| adapter["hardware"] == true);
    assert_eq!(found["automatic_backend"], if hardware { "gpu" } else { "cpu" });

    let output = haptize(folder.path(), &["doctor"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stdout).contains("--backend auto"), "{}", text(&output.stdout));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "doctor leaves nothing behind");
}

#[test]
fn an_unknown_command_is_a_usage_error() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [&["bark"][..], &["doctor", "--loud"]] {
        let output = haptize(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(text(&output.stderr).contains("--help"), "{}", text(&output.stderr));
        assert!(output.stdout.is_empty());
    }
}
