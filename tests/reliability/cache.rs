//! Compliances that commands keep for each other: used, and never those of another body; what is damaged is told and
//! mended, and without a cache nothing but time is lost.

use crate::common::program::{command, message, text};
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

const SCENE: &str = r#"
[object]
mesh = { file = "body.obj", scale = 0.02, refine = 0.012 }
elasticity = { young = 1e4, poisson = 0.4, cell = 0.02 }
ground = { clamp = true, below = -0.0199 }
skin = { tension = 2.0 }
[contact]
stiffness = 1000.0
[grid]
axes = [{ start = 0.0, stop = 0.004, count = 3 }]
[[proxy.joint]]
kind = "prismatic"
axis = [0.0, 0.0, -1.0]
limits = [0.0, 0.1]
nodes = [{ at = [0.003, 0.002, 0.02] }]
"#;

/// A folder with the scene, its mesh, and a place for the cache.
struct Home(tempfile::TempDir);

impl Home {
    fn new() -> Self {
        let home = Self(tempfile::tempdir().unwrap());
        home.write(SCENE);
        fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/cube.obj"), home.0.path().join("body.obj"))
            .unwrap();
        home
    }

    fn write(&self, scene: &str) {
        fs::write(self.0.path().join("scene.toml"), scene).unwrap();
    }

    fn inspect(&self, options: &[&str]) -> Command {
        let mut inspect = command(self.0.path(), &["inspect", "scene.toml", "--q", "0.002", "--json"]);
        inspect.env("XDG_CACHE_HOME", self.0.path().join("cache")).args(options);
        inspect
    }

    /// What a run that must succeed prints, and what it tells.
    fn inspected(&self, options: &[&str]) -> (String, String) {
        let output = self.inspect(options).output().unwrap();
        assert!(output.status.success(), "{}", message(&output));
        (text(&output.stdout), message(&output))
    }

    /// The files of the cache, the compliances, which are larger, first.
    fn kept(&self) -> Vec<PathBuf> {
        let files = fs::read_dir(self.0.path().join("cache/haptize"));
        let mut files: Vec<PathBuf> = files.into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
        files.sort_by_key(|file| std::cmp::Reverse(fs::metadata(file).unwrap().len()));
        files
    }
}

#[test]
fn the_second_command_takes_what_the_first_has_kept() {
    let home = Home::new();
    let (plain, _) = home.inspected(&["--no-cache"]);
    assert!(home.kept().is_empty(), "--no-cache keeps nothing");
    assert_eq!(home.inspected(&[]).0, plain);
    assert_eq!(home.inspected(&[]).0, plain);
    let kept = home.kept();
    assert_eq!(kept.len(), 3, "{kept:?}: a compliance, that it is definite, and how a coarser lattice differs");
    // A compliance that is half as large again, under a right checksum.
    let mut bytes = fs::read(&kept[0]).unwrap();
    let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let value = 32 + number(16) + number(24);
    let end = bytes.len() - 4;
    for entry in bytes[value..end].as_chunks_mut().0 {
        *entry = (1.5 * f64::from_le_bytes(*entry)).to_le_bytes();
    }
    let sum = crc32fast::hash(&bytes[..end]).to_le_bytes();
    bytes[end..].copy_from_slice(&sum);
    fs::write(&kept[0], &bytes).unwrap();
    assert_ne!(home.inspected(&[]).0, plain, "what is kept is used");
    assert_eq!(home.inspected(&["--no-cache"]).0, plain);
}

#[test]
fn another_body_is_never_taken_for_the_same() {
    let home = Home::new();
    home.inspected(&[]);
    let changes = [
        ("refine = 0.012", "refine = 0.02"),
        ("scale = 0.02", "scale = 0.0201"),
        ("young = 1e4", "young = 1.0001e4"),
        ("poisson = 0.4", "poisson = 0.41"),
        ("cell = 0.02", "cell = 0.018"),
        ("clamp = true", "per_area = 1e6"),
        ("below = -0.0199", "below = -0.01"),
        ("tension = 2.0", "tension = 2.1"),
        (
            "cell = 0.02 }",
            "cell = 0.02, inclusion = [{ sphere = { centre = [0, 0, 0], radius = 0.01 }, young = 1e5 }] }",
        ),
    ];
    for (from, to) in changes {
        let before = home.kept().len();
        home.write(&SCENE.replace(from, to));
        let (found, _) = home.inspected(&[]);
        assert!(home.kept().len() >= before + 3, "{to}: it is kept beside the others");
        assert_eq!(found, home.inspected(&["--no-cache"]).0, "{to}");
    }
    // Another mesh in the same file; and what resists nothing.
    let kept = home.kept().len();
    home.write(&SCENE.replace("[object]", "[object]\nnode_mass = 0.5"));
    home.inspected(&[]);
    assert_eq!(home.kept().len(), kept, "mass is no matter");
    let file = home.0.path().join("body.obj");
    let mesh = fs::read_to_string(&file).unwrap().replace("v 1 1 1\n", "v 1 1 1.01\n");
    fs::write(&file, mesh).unwrap();
    home.write(SCENE);
    let (found, _) = home.inspected(&[]);
    assert!(home.kept().len() >= kept + 3);
    assert_eq!(found, home.inspected(&["--no-cache"]).0);
}

#[test]
fn a_damaged_file_is_told_and_written_anew() {
    let home = Home::new();
    let (plain, said) = home.inspected(&[]);
    assert!(!said.contains("damaged"), "{said}");
    let file = &home.kept()[0];
    let whole = fs::read(file).unwrap();
    let mut turned = whole.clone();
    turned[whole.len() / 2] ^= 0x10;
    for bytes in [&whole[..whole.len() / 2], &whole[..10], &[], &turned] {
        fs::write(file, bytes).unwrap();
        let (found, said) = home.inspected(&[]);
        assert_eq!(found, plain);
        assert!(said.contains("damaged") && said.contains(&file.display().to_string()), "{said}");
        assert_eq!(fs::read(file).unwrap(), whole);
    }
}

#[test]
fn commands_at_once_and_folders_that_cannot_be_written_do_no_harm() {
    let home = Home::new();
    let started: Vec<_> =
        (0..4).map(|_| home.inspect(&[]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()).collect();
    let outputs: Vec<_> = started.into_iter().map(|child| child.wait_with_output().unwrap()).collect();
    let (plain, said) = home.inspected(&["--no-cache"]);
    for output in outputs {
        assert_eq!((text(&output.stdout), message(&output)), (plain.clone(), said.clone()));
    }
    assert_eq!(home.kept().len(), 3);
    fs::remove_dir_all(home.0.path().join("cache")).unwrap();
    fs::write(home.0.path().join("cache"), "a file in its place").unwrap();
    assert_eq!(home.inspected(&[]), (plain, said));
}
