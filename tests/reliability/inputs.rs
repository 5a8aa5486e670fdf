//! What commands read: files. A pipe would be waited for, a device may have no end, and a folder holds nothing.

#![cfg(unix)]

use super::objects::{OBJECTS, scene, write_scene};
use crate::common::program::{command, message, succeed};
use std::{
    path::Path,
    process::{Command, Stdio},
    time::{Duration, Instant},
};

/// What Git LFS leaves in the place of a file that it has not fetched.
const POINTER: &str = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 749611\n";

/// Runs the program, which must end by itself, with exit code 1, and say `expected` of `name`.
fn refused(folder: &Path, arguments: &[&str], name: &str, expected: &str) {
    let mut child = command(folder, arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let patience = Instant::now() + Duration::from_secs(30);
    while child.try_wait().unwrap().is_none() && Instant::now() < patience {
        std::thread::sleep(Duration::from_millis(5));
    }
    let waits = child.try_wait().unwrap().is_none();
    // One that has ended is not there to be killed.
    let _ = child.kill();
    let output = child.wait_with_output().unwrap();
    let said = message(&output);
    assert!(!waits && output.status.code() == Some(1), "{arguments:?}: goes on: {said}");
    assert!(said.contains(name) && said.contains(expected), "{arguments:?}: {said}");
}

/// Every argument by which a command reads a file; `@` stands for it.
const READERS: [&[&str]; 25] = [
    &["bake", "@"],
    &["bake", "@", "--max-error", "5%", "--refine", "2"],
    &["bake", "@", "--shard", "1/2"],
    &["plan", "@", "--shards", "2"],
    &["merge", "@", "-o", "y.haptize"],
    &["reach", "@"],
    &["place", "@"],
    &["accuracy", "@"],
    &["info", "@"],
    &["inspect", "@", "--q=0,0"],
    &["export", "@", "--format", "csv"],
    &["play", "@"],
    &["play", "x.haptize", "--motion", "@"],
    &["play", "x.haptize", "--replay", "@"],
    &["play", "x.haptize", "--beside", "@"],
    &["view", "@"],
    &["view", "@", "--screenshot", "y.png"],
    &["import", "@", "--tip", "hand"],
    &["scan", "@"],
    &["shape", "@"],
    &["twin", "@"],
    &["gridize", "@", "--step", "0.03"],
    &["gridize", "log.csv", "--step", "0.03", "--columns", "@"],
    &["gridize", "log.csv", "--step", "0.03", "--columns", "columns.toml", "--scene", "@"],
    &["gridize", "log.csv", "--step", "0.03", "--columns", "columns.toml", "--against", "@"],
];

#[test]
fn what_is_no_file_is_refused_at_once_by_every_reader() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    write_scene(home, OBJECTS[0].1, 4);
    succeed(home, &["bake", "scene.toml", "-o", "x.haptize", "--backend", "cpu"]);
    let columns = "[table]\nheader = true\n[time]\nperiod = 0.001\n[[joint]]\nname = \"a\"\n\
     position = { column = \"a\" }\ntorque = { column = \"b\" }\n";
    std::fs::write(home.join("columns.toml"), columns).unwrap();
    std::fs::write(home.join("log.csv"), "a,b\n0,0\n0.1,0.1\n0.2,0.2\n0.3,0.3\n").unwrap();
    std::fs::create_dir(home.join("folder")).unwrap();
    std::fs::write(home.join("pointer"), POINTER).unwrap();
    assert!(Command::new("mkfifo").arg(home.join("pipe")).status().unwrap().success());
    for reader in READERS {
        let kinds = [
            ("pipe", "this is a pipe"),
            ("/dev/zero", "a device"),
            ("folder", "this is a folder"),
            ("pointer", "git lfs pull"),
        ];
        for (name, expected) in kinds {
            // Of a folder merge takes the shards in it.
            if !(reader[0] == "merge" && name == "folder") {
                let arguments: Vec<&str> = reader.iter().map(|word| if *word == "@" { name } else { word }).collect();
                refused(home, &arguments, name, expected);
            }
        }
    }
    let left = ["pipe", "folder"].map(|name| home.join(name).exists());
    assert!(left == [true; 2] && !home.join("y.haptize").exists());
}

/// Meshes are read by their extension.
#[test]
fn a_mesh_that_is_no_file_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    let springs = "springs = { kind = \"isotropic\", stiffness = 300.0 }";
    for extension in ["obj", "ply", "stl", "msh"] {
        let kinds = [
            ("pipe", "this is a pipe"),
            ("device", "a device"),
            ("folder", "this is a folder"),
            ("pointer", "git lfs pull"),
        ];
        for (kind, expected) in kinds {
            let name = format!("{kind}.{extension}");
            let path = home.join(&name);
            match kind {
                "pipe" => assert!(Command::new("mkfifo").arg(&path).status().unwrap().success()),
                "device" => std::os::unix::fs::symlink("/dev/zero", &path).unwrap(),
                "pointer" => std::fs::write(&path, POINTER).unwrap(),
                _ => std::fs::create_dir(&path).unwrap(),
            }
            let key = if extension == "msh" { "tetrahedra" } else { "mesh" };
            std::fs::write(home.join("s.toml"), scene(&format!("{key} = {{ file = \"{name}\" }}\n{springs}"), 4))
                .unwrap();
            for command in [&["bake", "s.toml"][..], &["reach", "s.toml"], &["play", "s.toml"]] {
                refused(home, command, &name, expected);
            }
        }
    }
}
