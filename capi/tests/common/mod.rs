//! A small scene and its dataset, in a folder of their own.

use haptize::{
    scene::Scene,
    sweep::{BackendChoice, Bake},
};
use std::{path::PathBuf, sync::atomic::AtomicBool};

/// A finger of two joints beside a soft ball.
pub const SCENE: &str = include_str!("../../../tests/scenes/small.toml");

/// A configuration in contact.
pub const PRESSED: [f64; 2] = [-0.18, 0.0415];

/// The folder, which is removed at the end.
pub struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    /// Writes the scene and bakes its dataset.
    pub fn new() -> Self {
        let files = Self { folder: tempfile::tempdir().unwrap() };
        std::fs::write(files.path("small.toml"), SCENE).unwrap();
        let bake = Bake {
            scene: &Scene::load(files.path("small.toml")).unwrap(),
            backend: BackendChoice::Cpu,
            measured: Some(0),
            aim: None,
            date: "2000-01-01T00:00:00Z",
            stop: &AtomicBool::new(false),
            progress: &mut |_| (),
        };
        bake.to_file(&files.path("small.haptize"), false).unwrap();
        files
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}
