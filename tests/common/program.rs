//! The program, run in a folder.

use serde_json::Value;
use std::{
    path::Path,
    process::{Command, Output},
};

/// The program's file.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_haptize");

/// A command of the program in `folder`, with a cache apart from the user's.
pub fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.args(arguments).current_dir(folder).env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
    command
}

/// Runs the program in `folder`.
pub fn haptize(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().unwrap()
}

/// Standard output of a run that must succeed.
pub fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = haptize(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", message(&output));
    text(&output.stdout)
}

/// The one JSON object on standard output of a run that must succeed.
pub fn json(folder: &Path, arguments: &[&str]) -> Value {
    let value: Value = serde_json::from_str(&succeed(folder, arguments)).unwrap();
    assert!(value.is_object(), "{value}");
    value
}

/// What a run printed on standard error.
pub fn message(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// What was printed.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}
