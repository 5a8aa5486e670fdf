//! The demo, `haptize` alone.

use crate::common::program::{command, haptize, text};
use serde_json::Value;
use std::{
    path::{Path, PathBuf},
    process::Output,
    sync::LazyLock,
};

/// One run of the demo in an empty folder, as on a fresh machine: no Vulkan driver, no display.
pub struct Demo {
    folder: PathBuf,
    pub output: Output,
}

impl Demo {
    fn run(name: &str, arguments: &[&str]) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        let _ = std::fs::remove_dir_all(&folder); // What an earlier run left.
        std::fs::create_dir_all(&folder).unwrap();
        let mut command = command(&folder, arguments);
        command.env("VK_DRIVER_FILES", "/none").env("VK_ICD_FILENAMES", "/none");
        let output = command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").output().unwrap();
        Self { folder, output }
    }
}

/// As text and as JSON: what it printed is compared, too.
pub static FOR_PEOPLE: LazyLock<Demo> = LazyLock::new(|| Demo::run("demo", &[]));
pub static FOR_PROGRAMS: LazyLock<Demo> = LazyLock::new(|| Demo::run("demo-json", &["--json"]));

#[test]
fn the_demo_needs_nothing_and_leaves_dataset_traces_and_figures() {
    let Demo { folder, output } = &*FOR_PROGRAMS;
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(!text(&output.stderr).contains("error"), "{}", text(&output.stderr));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let number =
        |pointer: &str| told.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer}: {told}"));

    assert_eq!(told.pointer("/bake/backend").unwrap(), "cpu");
    assert_eq!(number("/bake/points"), 8064.0);
    assert!(number("/bake/contact_points") > 1000.0);
    assert_eq!(number("/bake/unconverged"), 0.0);
    assert!(number("/press/max_contact_nodes") > 1.0, "several nodes touch at once");
    assert!(number("/press/max_contact_torque") > 0.1, "the press is felt");
    assert!(number("/press/max_contact_torque") < 2.0, "as a desktop device may render it");
    assert!(number("/press/max_relative_account_residual") < 1e-12, "energy accounts close to rounding");
    assert!(number("/timing/tick_cost/count") > 1000.0);
    assert!(number("/timing/lateness/p50") >= 0.0);

    let files: Vec<_> = told["files"].as_array().unwrap().iter().map(|file| file.as_str().unwrap()).collect();
    for name in ["sphere.haptize", "trace.csv", "cspace.png", "torque.svg", "motion.svg", "object.png"] {
        assert!(files.iter().any(|file| Path::new(file).ends_with(name)), "{name} in {files:?}");
    }
    for file in &files {
        assert!(std::fs::metadata(folder.join(file)).unwrap().len() > 100, "{file}");
    }
    let trace = std::fs::read_to_string(folder.join("out/trace.csv")).unwrap();
    assert_eq!(trace.lines().count(), 1 + number("/press/ticks") as usize);
}

#[test]
fn the_demo_says_where_it_cannot_write() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("out"), "a file, not a folder").unwrap();
    let output = haptize(folder.path(), &[]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("./out"), "{}", text(&output.stderr));
}
