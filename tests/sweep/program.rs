//! The program killed, interrupted, and without room on the disk.

use crate::{
    common::program::{PROGRAM, command},
    fixture::{Folder, SCENE},
};
use haptize::dataset::Dataset;
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;

/// Everything but the date, bit for bit.
fn columns(path: &Path) -> Vec<Vec<u8>> {
    let dataset = Dataset::open(path).unwrap();
    let contacts = dataset.contacts.as_ref().unwrap();
    vec![
        bytemuck::cast_slice(&dataset.torque).to_vec(),
        dataset.status.to_vec(),
        bytemuck::cast_slice(dataset.energy.as_ref().unwrap()).to_vec(),
        bytemuck::cast_slice(dataset.gap.as_ref().unwrap()).to_vec(),
        bytemuck::cast_slice(&contacts.nodes).to_vec(),
        bytemuck::cast_slice(&contacts.forces).to_vec(),
        dataset.scene.into_bytes(),
    ]
}

/// The program, started in `folder` on a scene of `turns` times 90 configurations, once its part holds some of them.
fn program_at_work(folder: &Folder, turns: usize) -> std::process::Child {
    let fine = SCENE
        .replace("step = 0.1, count = 7", &format!("stop = 0.3, count = {turns}"))
        .replace("step = 0.004, count = 9", "step = 0.0004, count = 90");
    std::fs::write(folder.0.path().join("fine.toml"), fine).unwrap();
    let mut program = program(folder, &[]).stderr(std::process::Stdio::piped()).spawn().unwrap();
    let part = folder.0.path().join("fine.haptize.part");
    while std::fs::metadata(&part).map_or(0, |part| part.len()) < 50_000 {
        assert!(program.try_wait().unwrap().is_none(), "ended before its part was seen");
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    program
}

fn program(folder: &Folder, more: &[&str]) -> std::process::Command {
    let mut command = command(folder.0.path(), &["bake", "fine.toml", "--backend", "cpu", "--json"]);
    command.args(more);
    command
}

#[test]
fn a_killed_program_is_resumed_to_the_same_numbers() {
    let folder = Folder::new();
    let mut killed = program_at_work(&folder, 350);
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert_eq!(folder.names(), ["fine.haptize.part", "fine.toml"]);
    // As if it had been killed once more, while it put the file together.
    std::fs::write(folder.0.path().join(".haptize-left.tmp"), b"\x02\0\0\0\0\0\0\0{").unwrap();
    let output = program(&folder, &["--resume"]).output().unwrap();
    assert!(output.status.success());
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["resumed_points"].as_u64().unwrap() > 0);
    assert_eq!(report["points"], 31_500);
    assert_eq!(folder.names(), ["fine.haptize", "fine.toml"]);
    let path = folder.0.path().join("fine.haptize");
    let resumed = columns(&path);
    assert!(program(&folder, &[]).output().unwrap().status.success());
    assert!(columns(&path) == resumed);
}

#[test]
fn an_interrupted_program_says_how_to_resume() {
    let folder = Folder::new();
    let interrupted = program_at_work(&folder, 10_000);
    // Not an interrupt from the keyboard, which what is started in the background of a script is made to ignore.
    kill_process(Pid::from_child(&interrupted), Signal::TERM).unwrap();
    let output = interrupted.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("fine.haptize.part") && message.contains("--resume"), "{message}");
    assert_eq!(folder.names(), ["fine.haptize.part", "fine.toml"]);
}

/// A file size limit stands in for a full disk: writing beyond it fails.
#[test]
fn a_full_disk_leaves_the_earlier_file_and_no_rubbish() {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("small.toml"), SCENE).unwrap();
    let haptize = |prelude: &str, arguments: &str| {
        let line = format!("{prelude} exec '{}' {arguments}", PROGRAM);
        std::process::Command::new("sh").current_dir(folder.0.path()).args(["-c", &line]).output().unwrap()
    };
    assert!(haptize("", "bake small.toml --backend cpu").status.success());
    let before = std::fs::read(folder.0.path().join("small.haptize")).unwrap();
    for arguments in
        ["export small.haptize --format npz", "export small.haptize --format csv", "bake small.toml --backend cpu"]
    {
        let output = haptize("trap '' XFSZ; ulimit -f 1;", arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments}");
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(message.contains("free some space") && message.contains("small."), "{message}");
    }
    assert_eq!(folder.names(), ["small.haptize", "small.haptize.part", "small.toml"]);
    assert!(std::fs::read(folder.0.path().join("small.haptize")).unwrap() == before);
    assert!(haptize("", "bake small.toml --backend cpu --resume").status.success());
    assert_eq!(folder.names(), ["small.haptize", "small.toml"]);
}

/// Task `index` of an array of Slurm.
fn task(folder: &Folder, index: usize) -> std::process::Command {
    let mut command = program(folder, &["--shard", "auto/3", "-o", "parts"]);
    for other in ["HQ_TASK_ID", "PBS_ARRAY_INDEX", "SGE_TASK_ID", "JOB_COMPLETION_INDEX", "PMI_RANK", "PMIX_RANK"] {
        command.env_remove(other);
    }
    command.env("SLURM_ARRAY_TASK_ID", index.to_string());
    command
}

#[test]
fn killed_shards_are_continued_and_merged_to_the_numbers_of_one_bake() {
    let folder = Folder::new();
    let fine = SCENE
        .replace("step = 0.1, count = 7", "stop = 0.3, count = 350")
        .replace("step = 0.004, count = 9", "step = 0.0004, count = 90");
    std::fs::write(folder.0.path().join("fine.toml"), fine).unwrap();
    let parts = folder.0.path().join("parts");
    let largest = || {
        let files = std::fs::read_dir(&parts).into_iter().flatten().flatten();
        files.filter_map(|file| Some(file.metadata().ok()?.len())).max().unwrap_or(0)
    };
    let mut killed = task(&folder, 1).spawn().unwrap();
    while largest() < 50_000 {
        assert!(killed.try_wait().unwrap().is_none(), "ended before its part was seen");
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    let json = |output: &std::process::Output| serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap();
    assert!(task(&folder, 0).output().unwrap().status.success());
    let merge = || {
        let mut command = std::process::Command::new(PROGRAM);
        command
            .current_dir(folder.0.path())
            .args(["merge", "parts", "-o", "merged.haptize", "--json"])
            .output()
            .unwrap()
    };
    let lacking = merge();
    assert_eq!((lacking.status.code(), &json(&lacking)["missing"]), (Some(1), &"1-2".into()));
    let said = String::from_utf8(lacking.stderr).unwrap();
    assert!(said.contains("--array=1-2") && !folder.0.path().join("merged.haptize").exists(), "{said}");
    assert!(task(&folder, 2).output().unwrap().status.success());
    let continued = task(&folder, 1).output().unwrap();
    assert!(json(&continued)["resumed_points"].as_u64() > Some(0), "{continued:?}");
    let again = task(&folder, 1).output().unwrap();
    assert!(again.status.success() && json(&again).get("points").is_none(), "{again:?}");
    assert!(!task(&folder, 3).output().unwrap().status.success(), "there is no such shard");
    assert!(merge().status.success());
    assert!(program(&folder, &[]).output().unwrap().status.success());
    assert!(columns(&folder.0.path().join("merged.haptize")) == columns(&folder.0.path().join("fine.haptize")));
}
