//! What commands write: never over an input, over a file of another kind, or to what is no regular file; nothing of
//! another run is left beside it, and what was replaced is told.

use super::objects::{OBJECTS, write_scene};
use crate::common::program::{command, message, succeed};
use serde_json::Value;
use std::{
    collections::BTreeSet,
    path::Path,
    process::{Command, Output, Stdio},
    time::{Duration, Instant},
};

/// A folder with a scene, its meshes and its dataset `x.haptize`.
fn home() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path(), OBJECTS[0].1, 4);
    succeed(folder.path(), &["bake", "scene.toml", "-o", "x.haptize", "--backend", "cpu"]);
    folder
}

fn run(folder: &Path, arguments: &[&str]) -> (Output, Value) {
    let output = command(folder, &[arguments, &["--json"]].concat()).output().unwrap();
    let json = serde_json::from_slice(&output.stdout).unwrap_or_else(|why| panic!("{arguments:?}: {why}"));
    (output, json)
}

fn refused(folder: &Path, arguments: &[&str], expected: &str) {
    let (output, json) = run(folder, arguments);
    let why = json["error"].as_str().unwrap_or_default();
    assert!(output.status.code() == Some(1) && why.contains(expected), "{arguments:?}: {json}");
}

fn names(folder: &Path) -> BTreeSet<String> {
    std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[cfg(unix)]
#[test]
fn a_bake_through_a_link_replaces_the_file_on_its_own_disk() {
    let home = home();
    let memory = Path::new("/dev/shm");
    let away = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.unwrap();
    std::fs::copy(home.path().join("x.haptize"), away.path().join("far.haptize")).unwrap();
    let link = home.path().join("link.haptize");
    std::os::unix::fs::symlink(away.path().join("far.haptize"), &link).unwrap();
    let before = names(home.path());
    let (output, json) = run(home.path(), &["bake", "scene.toml", "-o", "link.haptize", "--backend", "cpu"]);
    assert!(output.status.success(), "{}", message(&output));
    assert!(json["replaced"]["bytes"].as_u64() > Some(0), "{json}");
    assert!(link.is_symlink());
    assert_eq!((names(home.path()), names(away.path())), (before, BTreeSet::from(["far.haptize".into()])));
    // A link to nothing is told before the work, not after it.
    std::fs::remove_file(away.path().join("far.haptize")).unwrap();
    let before = names(home.path());
    refused(home.path(), &["bake", "scene.toml", "-o", "link.haptize"], "a link to a file that is not there");
    assert_eq!(names(home.path()), before);
}

/// Opened, a pipe that nobody writes to is waited for without end.
#[cfg(unix)]
#[test]
fn a_pipe_in_the_way_is_refused_and_not_waited_for() {
    let home = home();
    for name in ["pipe.toml", "y.haptize.part"] {
        assert!(Command::new("mkfifo").arg(home.path().join(name)).status().unwrap().success());
    }
    for (arguments, expected) in [
        (&["new", "-o", "pipe.toml"][..], "exists already"),
        (&["bake", "scene.toml", "-o", "y.haptize", "--backend", "cpu"], "no regular file"),
        (&["bake", "scene.toml", "-o", "y.haptize", "--backend", "cpu", "--resume"], "no regular file"),
    ] {
        let mut child = command(home.path(), arguments).stderr(Stdio::piped()).spawn().unwrap();
        let patience = Instant::now() + Duration::from_secs(60);
        while child.try_wait().unwrap().is_none() && Instant::now() < patience {
            std::thread::sleep(Duration::from_millis(10));
        }
        let waits = child.try_wait().unwrap().is_none();
        // One that has ended is not there to be killed.
        let _ = child.kill();
        let output = child.wait_with_output().unwrap();
        assert!(!waits && message(&output).contains(expected), "{arguments:?}: {}", message(&output));
    }
}

/// A pipe, and where it may be made a device that swallows everything.
#[cfg(unix)]
fn irregular(folder: &Path, name: &str) {
    let path = folder.join(name);
    let device = Command::new("mknod").arg(&path).args(["c", "1", "3"]).output().unwrap();
    if !device.status.success() {
        assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    }
}

#[cfg(unix)]
#[test]
fn nothing_is_written_to_devices_and_pipes() {
    let home = home();
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/sponge.toml"), home.path().join("sponge.toml"))
        .unwrap();
    for name in ["device", "device.png", "out.csv"] {
        irregular(home.path(), name);
    }
    std::fs::create_dir(home.path().join("o")).unwrap();
    for name in
        ["cspace.png", "gridized.svg", "accuracy.csv", "table.md", "sponge.csv", "out.contacts.csv", "haptize.1"]
    {
        irregular(&home.path().join("o"), name);
    }
    std::fs::write(home.path().join("t.csv"), "a,b\n1,2\n").unwrap();
    for arguments in [
        &["bake", "scene.toml", "-o", "device"][..],
        &["export", "x.haptize", "--format", "csv", "-o", "device"],
        &["export", "x.haptize", "--format", "npz", "-o", "device"],
        &["export", "x.haptize", "--format", "csv", "-o", "o/out.csv"],
        &["gridize", "t.csv", "--step", "1", "-o", "device"],
        &["gridize", "t.csv", "--step", "1", "--figures", "o"],
        &["scan", "sponge.toml", "-o", "device"],
        &["scan", "sponge.toml", "-o", "device", "--resume"],
        &["play", "x.haptize", "--seconds", "0.1", "--record", "device"],
        &["play", "x.haptize", "--seconds", "0.1", "-o", "o"],
        &["accuracy", "scene.toml", "-o", "o"],
        &["paper", "-o", "o"],
        &["man", "-o", "o"],
        &["scan", "sponge.toml", "--plan-out", "device"],
        &["view", "x.haptize", "--screenshot", "device.png"],
    ] {
        refused(home.path(), arguments, "no regular file");
    }
    use std::os::unix::fs::FileTypeExt;
    let irregular = |path: &Path| {
        let kind = std::fs::symlink_metadata(path).unwrap().file_type();
        kind.is_char_device() || kind.is_fifo()
    };
    assert!(
        ["device", "device.png", "o/cspace.png", "o/table.md"].iter().all(|name| irregular(&home.path().join(name)))
    );
    assert_eq!(names(&home.path().join("o")).len(), 7);
}

/// Twice into one folder: every file of the first run must be one that the second knows, and replaces.
#[test]
fn a_folder_holds_the_files_of_one_run_and_it_is_told_what_was_replaced() {
    let home = home();
    std::fs::create_dir(home.path().join("o")).unwrap();
    std::fs::write(home.path().join("o/notes.txt"), "mine").unwrap();
    let files = |json: &Value| -> BTreeSet<String> {
        let names = json["files"].as_array().unwrap().iter().map(|file| file.as_str().unwrap());
        names.map(|name| Path::new(name).file_name().unwrap().to_str().unwrap().to_owned()).collect()
    };
    let told = |json: &Value, key: &str| -> BTreeSet<String> {
        json[key].as_array().unwrap().iter().map(|name| name.as_str().unwrap().to_owned()).collect()
    };
    let realtime = ["play", "x.haptize", "--realtime", "--seconds", "0.1", "-o", "o"];
    let first = run(home.path(), &realtime).1;
    assert!(told(&first, "replaced").is_empty() && told(&first, "removed").is_empty());
    let second = run(home.path(), &realtime).1;
    assert_eq!(told(&second, "replaced"), files(&first));
    let offline = run(home.path(), &realtime[..2].iter().chain(&realtime[3..]).copied().collect::<Vec<_>>()).1;
    assert_eq!(told(&offline, "removed"), BTreeSet::from(["jitter.png".into(), "jitter.svg".into()]));
    let mut left = files(&offline);
    left.insert("notes.txt".into());
    assert_eq!(names(&home.path().join("o")), left);
    refused(
        home.path(),
        &["play", "x.haptize", "--record", "o/../o/trace.csv", "-o", "o"],
        "is not the record of a session",
    );
    refused(home.path(), &["play", "x.haptize", "--record", "new/motion.svg", "-o", "new"], "cannot be written");
    for again in [
        &["man", "-o", "m"][..],
        &["accuracy", "scene.toml", "--points", "16", "--configurations", "8", "--rounds", "1", "-o", "a"],
    ] {
        let first = run(home.path(), again).1;
        assert_eq!(told(&run(home.path(), again).1, "replaced"), files(&first), "{again:?}");
    }
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/sponge.toml"), home.path().join("sponge.toml"))
        .unwrap();
    let plan = ["scan", "sponge.toml", "--plan-out", "plan.csv"];
    assert!(run(home.path(), &plan).1["replaced"].is_null());
    assert!(run(home.path(), &plan).1["replaced"]["bytes"].as_u64() > Some(0));
}

#[test]
fn an_export_writes_over_no_dataset_of_its_second_name_and_leaves_no_stale_one() {
    let home = home();
    let path = |name: &str| home.path().join(name);
    std::fs::copy(path("x.haptize"), path("y.contacts.csv")).unwrap();
    refused(home.path(), &["export", "y.contacts.csv", "--format", "csv", "-o", "y.csv"], "also an input");
    refused(home.path(), &["export", "x.haptize", "--format", "csv", "-o", "y.csv"], "not a table or figure");
    // Once with contact forces, once without.
    succeed(home.path(), &["export", "x.haptize", "--format", "csv", "-o", "z.csv"]);
    assert!(path("z.contacts.csv").exists());
    let scene = std::fs::read_to_string(path("scene.toml")).unwrap();
    std::fs::write(path("bare.toml"), format!("graphics = false\n{}", scene.replace("[graphics]\nrate = 60.0\n", "")))
        .unwrap();
    succeed(home.path(), &["bake", "bare.toml", "-o", "bare.haptize", "--backend", "cpu"]);
    let json = run(home.path(), &["export", "bare.haptize", "--format", "csv", "-o", "z.csv"]).1;
    assert!(json["removed"] == "z.contacts.csv" && !path("z.contacts.csv").exists(), "{json}");
}

#[test]
fn a_place_that_cannot_be_written_is_told_before_the_work() {
    let home = home();
    std::fs::write(home.path().join("file"), "x,y\n").unwrap();
    std::fs::write(home.path().join("t.csv"), "a,b\n1,2\n").unwrap();
    std::fs::write(home.path().join("sponge.csv"), "measured for years, 1\n").unwrap();
    let before = names(home.path());
    for arguments in [
        &["bake", "scene.toml", "-o", "none/x.haptize"][..],
        &["export", "x.haptize", "--format", "npz", "-o", "none/x.npz"],
        &["gridize", "t.csv", "--step", "1", "-o", "none/x.haptize"],
        &["play", "x.haptize", "--seconds", "3000", "--realtime", "--record", "none/r.csv"],
        &["play", "x.haptize", "--seconds", "3000", "--realtime", "-o", "file/o"],
        &["accuracy", "scene.toml", "-o", "file/o"],
        &["view", "x.haptize", "--screenshot", "none/x.png"],
    ] {
        refused(home.path(), arguments, "cannot be written");
    }
    refused(home.path(), &["paper", "-o", "."], "sponge.csv: is no log of a simulated scan");
    assert_eq!(names(home.path()), before);
}

#[cfg(unix)]
#[test]
fn a_file_that_is_replaced_keeps_its_permissions_and_a_read_only_one_stays() {
    use std::{fs::Permissions, os::unix::fs::PermissionsExt};
    let home = home();
    let bake = ["bake", "scene.toml", "-o", "x.haptize", "--backend", "cpu"];
    let export = ["export", "x.haptize", "--format", "csv", "-o", "x.csv"];
    succeed(home.path(), &export);
    for (name, again) in [("x.haptize", &bake[..]), ("x.csv", &export)] {
        let file = home.path().join(name);
        for mode in [0o600, 0o640, 0o664] {
            std::fs::set_permissions(&file, Permissions::from_mode(mode)).unwrap();
            succeed(home.path(), again);
            assert_eq!(std::fs::metadata(&file).unwrap().permissions().mode() & 0o7777, mode, "{name}");
        }
        std::fs::set_permissions(&file, Permissions::from_mode(0o444)).unwrap();
        let before = std::fs::read(&file).unwrap();
        refused(home.path(), again, "may not be written to");
        assert!(std::fs::read(&file).unwrap() == before);
    }
}

/// The rename has been done by then: that the folder cannot be read, and so not flushed, is no failure.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_may_be_written_but_not_read_takes_a_dataset() {
    use std::os::unix::{fs::PermissionsExt, process::CommandExt};
    const NOBODY: u32 = 65_534;
    let home = home();
    let shut = home.path().join("shut");
    std::fs::create_dir(&shut).unwrap();
    let mut bake = command(home.path(), &["bake", "scene.toml", "-o", "shut/y.haptize", "--backend", "cpu"]);
    if std::os::unix::fs::chown(&shut, Some(NOBODY), None).is_ok() {
        // The superuser may read everything.
        bake.uid(NOBODY);
        std::fs::set_permissions(home.path(), std::fs::Permissions::from_mode(0o755)).unwrap();
    }
    std::fs::set_permissions(&shut, std::fs::Permissions::from_mode(0o300)).unwrap();
    let output = bake.output();
    std::fs::set_permissions(&shut, std::fs::Permissions::from_mode(0o700)).unwrap();
    match output {
        // A build folder that others may not enter.
        Err(why) => eprintln!("not run: {why}"),
        Ok(output) => {
            assert!(output.status.success(), "{}", message(&output));
            assert_eq!(names(&shut), BTreeSet::from(["y.haptize".into()]));
        }
    }
}
