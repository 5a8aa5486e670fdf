//! Bakes that are killed, that fill the disk, and that run out of memory: what was written is never lost, and the
//! dataset is the one of an undisturbed bake.
//!
//! `HAPTIZE_KILLS` sets the number of bakes that are killed on each backend.

use super::{
    fuzz::Random,
    objects::{BLOCK, OBJECTS, write_scene},
};
use crate::common::program::{command, message, succeed};
use haptize::{
    dataset::{Axis, Grid, Provenance},
    store::{Space, Store},
};
use std::{
    path::Path,
    process::{Command, Output, Stdio},
    time::{Duration, Instant},
};

/// Killed bakes of each backend unless the environment says otherwise.
const KILLS: usize = 4;

/// A bake of `scene.toml` into `x.haptize`, continued if there is anything.
fn bake(backend: &str) -> [&str; 9] {
    ["bake", "scene.toml", "-o", "x.haptize", "--backend", backend, "--law", "rest", "--resume"]
}

/// Header without date and checksum, and data.
fn contents(file: &[u8]) -> (serde_json::Value, Vec<u8>) {
    let length = u64::from_le_bytes(*file.first_chunk().unwrap()) as usize;
    let mut header: serde_json::Value = serde_json::from_slice(&file[8..8 + length]).unwrap();
    let metadata = &mut header["__metadata__"];
    metadata["checksum"].take();
    let mut provenance: serde_json::Value = serde_json::from_str(metadata["provenance"].as_str().unwrap()).unwrap();
    provenance["date"].take();
    metadata["provenance"] = provenance;
    (header, file[8 + length..].to_vec())
}

/// A scene of `lines` times `lines` points in a folder, its dataset, and how long its bake takes.
struct Undisturbed {
    folder: tempfile::TempDir,
    contents: (serde_json::Value, Vec<u8>),
    seconds: f64,
    bytes: u64,
}

impl Undisturbed {
    fn new(backend: &str, lines: usize) -> Self {
        let folder = tempfile::tempdir().unwrap();
        write_scene(folder.path(), OBJECTS[0].1, lines);
        let began = Instant::now();
        succeed(folder.path(), &bake(backend));
        let seconds = began.elapsed().as_secs_f64();
        let bytes = std::fs::read(folder.path().join("x.haptize")).unwrap();
        std::fs::remove_file(folder.path().join("x.haptize")).unwrap();
        Self { folder, contents: contents(&bytes), seconds, bytes: bytes.len() as u64 }
    }

    /// Continues what is there, compares it with the undisturbed dataset, and clears the folder.
    fn finish(&self, backend: &str, what: &str) {
        succeed(self.folder.path(), &bake(backend));
        let file = self.folder.path().join("x.haptize");
        let found = contents(&std::fs::read(&file).unwrap());
        assert!(found == self.contents, "{what}: the continued bake differs");
        std::fs::remove_file(file).unwrap();
        let mut left: Vec<_> =
            std::fs::read_dir(self.folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["block.msh", "cube.obj", "scene.toml"], "{what}: nothing is left over");
    }
}

/// What kills met.
#[derive(Debug, Default)]
struct Met {
    before: usize,
    baking: usize,
    assembling: usize,
}

fn kill_at_random(backend: &str, lines: usize) {
    let kills = std::env::var("HAPTIZE_KILLS").map_or(KILLS, |count| count.parse().unwrap());
    let whole = Undisturbed::new(backend, lines);
    let (folder, mut longest) = (whole.folder.path(), whole.seconds);
    let (mut random, mut met) = (Random::new(7), Met::default());
    let mut killed = 0;
    while killed < kills {
        let mut bake = command(folder, &bake(backend)).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        let (began, life) = (Instant::now(), Duration::from_secs_f64(longest * random.below(1000) as f64 / 1000.0));
        while began.elapsed() < life && bake.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        if bake.try_wait().unwrap().is_some() {
            // It was faster than the undisturbed one, which may have had kernels to compile.
            longest = longest.min(began.elapsed().as_secs_f64());
        } else {
            bake.kill().unwrap();
            bake.wait().unwrap();
            killed += 1;
            let is_temporary = |entry: std::fs::DirEntry| entry.file_name().to_string_lossy().ends_with(".tmp");
            *if std::fs::read_dir(folder).unwrap().flatten().any(is_temporary) {
                &mut met.assembling
            } else if folder.join("x.haptize.part").exists() {
                &mut met.baking
            } else {
                &mut met.before
            } += 1;
        }
        // Now and then a bake is killed again while it continues.
        if random.below(3) > 0 {
            whole.finish(backend, &format!("kill {killed}"));
        }
    }
    whole.finish(backend, "the last kill");
    eprintln!("{backend}: {kills} kills of bakes of {:.1} s: {met:?}", whole.seconds);
}

#[test]
fn a_bake_killed_at_any_moment_continues_to_the_same_dataset_on_the_cpu() {
    kill_at_random("cpu", 120);
}

#[test]
fn a_bake_killed_at_any_moment_continues_to_the_same_dataset_on_software_vulkan() {
    kill_at_random("gpu", 40);
}

/// Nothing that is seen of a body changes when a node inside of it moves, but its stiffness does.
#[test]
fn a_part_is_not_continued_after_only_an_inner_node_has_moved() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let moved = BLOCK.replace("9 0.01 -0.02 0.03", "9 0.01 -0.02 0.06");
    let bodies = [BLOCK, &moved].map(|mesh| {
        write_scene(folder.path(), OBJECTS[2].1, 4);
        std::fs::write(path("block.msh"), mesh).unwrap();
        succeed(folder.path(), &["bake", "scene.toml", "-o", "y.haptize", "--backend", "cpu"]);
        let dataset = haptize::dataset::Dataset::load(&path("y.haptize")).unwrap();
        (dataset.surface.as_ref().unwrap().nodes.to_vec(), dataset.torque.to_vec())
    });
    assert!(bodies[0].0 == bodies[1].0 && bodies[0].1 != bodies[1].1, "the same surface, another torque");
    write_scene(folder.path(), OBJECTS[2].1, 300);
    let mut begun = command(folder.path(), &bake("cpu")).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    while std::fs::metadata(path("x.haptize.part")).map_or(0, |part| part.len()) < 100_000 {
        assert!(begun.try_wait().unwrap().is_none(), "ended before it was killed");
        std::thread::sleep(Duration::from_millis(1));
    }
    begun.kill().unwrap();
    begun.wait().unwrap();
    let part = std::fs::read(path("x.haptize.part")).unwrap();
    std::fs::write(path("block.msh"), moved).unwrap();
    let refused = command(folder.path(), &bake("cpu")).output().unwrap();
    assert!(refused.status.code() == Some(1) && message(&refused).contains("another object"), "{}", message(&refused));
    assert!(std::fs::read(path("x.haptize.part")).unwrap() == part && !path("x.haptize").exists());
    // The part of the body that it was begun with goes on.
    std::fs::write(path("block.msh"), BLOCK).unwrap();
    let told = succeed(folder.path(), &[&bake("cpu")[..], &["--json"]].concat());
    let told: serde_json::Value = serde_json::from_str(&told).unwrap();
    assert!(told["resumed_points"].as_u64().unwrap() > 0, "{told}");
}

#[test]
fn a_killed_command_leaves_one_file_at_most_which_the_next_removes() {
    let whole = Undisturbed::new("cpu", 60);
    let folder = whole.folder.path();
    succeed(folder, &bake("cpu"));
    std::fs::create_dir(folder.join("o")).unwrap();
    let export = ["export", "x.haptize", "--format", "csv", "-o", "o/x.csv"];
    let began = Instant::now();
    succeed(folder, &export);
    let longest = began.elapsed().as_secs_f64();
    let unfinished = || {
        let names = std::fs::read_dir(folder.join("o")).unwrap().map(|entry| entry.unwrap().file_name());
        names.filter(|name| name.to_string_lossy().starts_with(".haptize-")).count()
    };
    let mut random = Random::new(4);
    for _ in 0..20 {
        let mut killed = command(folder, &export).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_secs_f64(longest * random.below(1000) as f64 / 1000.0));
        // One that was faster has ended by itself.
        let _ = killed.kill();
        killed.wait().unwrap();
        assert!(unfinished() <= 1);
    }
    succeed(folder, &export);
    assert_eq!(unfinished(), 0);
}

#[test]
fn the_comparison_sees_one_bit() {
    let whole = Undisturbed::new("cpu", 4);
    succeed(whole.folder.path(), &bake("cpu"));
    let mut bytes = std::fs::read(whole.folder.path().join("x.haptize")).unwrap();
    assert!(contents(&bytes) == whole.contents);
    *bytes.last_mut().unwrap() ^= 1;
    assert!(contents(&bytes) != whole.contents);
}

/// Runs a bake on the CPU under a limit of the shell.
#[cfg(unix)]
fn limited(folder: &Path, limit: &str) -> Output {
    run_limited(folder, &bake("cpu"), limit)
}

/// Runs the program under a limit of the shell.
#[cfg(unix)]
fn run_limited(folder: &Path, arguments: &[&str], limit: &str) -> Output {
    let program = command(folder, arguments);
    let arguments = program.get_args().map(|argument| argument.to_str().unwrap());
    let line: Vec<&str> = std::iter::once(program.get_program().to_str().unwrap()).chain(arguments).collect();
    Command::new("sh")
        .arg("-c")
        .arg(format!("{limit} && exec {}", line.join(" ")))
        .current_dir(folder)
        .output()
        .unwrap()
}

#[test]
#[cfg(unix)]
fn a_full_disk_is_an_error_and_the_bake_continues_when_there_is_room() {
    let whole = Undisturbed::new("cpu", 100);
    for share in [1, 40, 70, 99] {
        let old = whole.folder.path().join("x.haptize");
        // As much of an earlier dataset as tells it apart from other files.
        let earlier = br#"........{"__metadata__":{"checksum":"00000000","format":"haptize 1"}}"#;
        std::fs::write(&old, earlier).unwrap();
        // Blocks of 512 bytes. Writing beyond the limit is an error, not a signal.
        let blocks = whole.bytes * share / 100 / 512;
        let output = limited(whole.folder.path(), &format!("trap '' XFSZ; ulimit -f {blocks}"));
        let said = message(&output);
        assert_eq!(output.status.code(), Some(1), "{share} %: {said}");
        assert!(said.contains("x.haptize") && said.contains("--resume"), "{share} %: {said}");
        assert_eq!(std::fs::read(&old).unwrap(), earlier);
        std::fs::remove_file(old).unwrap();
        whole.finish("cpu", &format!("{share} % of the room"));
    }
}

#[test]
#[cfg(unix)]
fn an_export_to_a_full_disk_says_so_once_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path(), OBJECTS[0].1, 40);
    succeed(folder.path(), &bake("cpu"));
    let names = || std::fs::read_dir(folder.path()).unwrap().count();
    let before = names();
    for format in ["npz", "hdf5", "csv"] {
        for blocks in [1, 8, 40] {
            let limit = format!("trap '' XFSZ; ulimit -f {blocks}");
            let output = run_limited(folder.path(), &["export", "x.haptize", "--format", format], &limit);
            let said = message(&output);
            assert_eq!(output.status.code(), Some(1), "{format}, {blocks} blocks: {said}");
            assert!(said.starts_with("haptize: ") && said.lines().count() == 1, "{format}, {blocks} blocks: {said}");
            assert_eq!(names(), before);
        }
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_bake_without_memory_ends_and_continues_where_there_is_some() {
    let whole = Undisturbed::new("cpu", 200);
    let mut failures = 0;
    for kilobytes in (40_000..64_000).step_by(3_000) {
        if limited(whole.folder.path(), &format!("ulimit -v {kilobytes}")).status.success() {
            std::fs::remove_file(whole.folder.path().join("x.haptize")).unwrap();
        } else {
            failures += 1;
        }
        whole.finish("cpu", &format!("{kilobytes} kB of memory"));
    }
    assert!(failures > 3, "the limits are felt");
}

#[test]
#[cfg(target_os = "linux")]
fn work_for_which_there_is_no_memory_is_refused_before_it_begins() {
    let whole = Undisturbed::new("cpu", 4);
    let folder = whole.folder.path();
    succeed(folder, &bake("cpu"));
    // Larger than what is allowed below: known before anything is read.
    let large = std::fs::File::create(folder.join("large.haptize")).unwrap();
    large.set_len(1 << 32).unwrap();
    // Some kilobytes whose base has eight million points.
    let axis = |name: &str| Axis { name: name.into(), unit: "rad".into(), start: 0.0, step: 0.01, count: 200 };
    let grid = Grid { axes: ["a", "b", "c"].map(axis).to_vec() };
    let store = Store::new(Space::new(&grid, 2).unwrap());
    store.save(&grid, None, "", &Provenance::default(), &folder.join("sparse.haptize")).unwrap();
    assert!(std::fs::metadata(folder.join("sparse.haptize")).unwrap().len() < 20_000);
    let sphere = |edge: &str, springs: &str| {
        let object = format!(
            "sphere = {{ radius = 0.04, edge = {edge} }}\nsprings = {{ kind = \"{springs}\", stiffness = 300.0 }}"
        );
        super::objects::scene(&object, 4)
    };
    std::fs::write(folder.join("dense.toml"), sphere("0.0035", "axial")).unwrap();
    std::fs::write(folder.join("fine.toml"), sphere("0.0002", "isotropic")).unwrap();
    for (arguments, expected) in [
        (&["play", "large.haptize"][..], "4295 MB of memory are needed"),
        (&["info", "large.haptize"], "4295 MB of memory are needed"),
        (&["info", "sparse.haptize"], "296 MB of memory are needed"),
        (&["play", "x.haptize", "--seconds", "3600"], "ticks"),
        (&["inspect", "dense.toml", "--q=0,0"], "MB of compliance"),
        (&["bake", "fine.toml", "--backend", "cpu", "-o", "y.haptize"], "MB of memory are needed"),
    ] {
        let arguments = [arguments, &["--json"]].concat();
        let output = run_limited(folder, &arguments, "ulimit -v 150000");
        let (told, said) = (String::from_utf8_lossy(&output.stdout), message(&output));
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
        let json: serde_json::Value = serde_json::from_str(&told).unwrap();
        let error = json["error"].as_str().unwrap();
        assert!(said.contains(expected) && error.contains("memory"), "{arguments:?}: {said} {error}");
        assert!(said.contains("ulimit -v"), "{arguments:?}: a remedy: {said}");
    }
}
