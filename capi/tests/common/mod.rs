//! A small scene and its dataset, in a folder of their own.

use haptize::{
    haptize::{BackendChoice, Bake},
    scene::Scene,
};
use std::{path::PathBuf, sync::atomic::AtomicBool};

/// A finger of two joints beside a soft ball.
pub const SCENE: &str = r#"
name = "small sphere"
[object]
sphere = { radius = 0.05, rings = 4, segments = 5 }
springs = { kind = "isotropic", stiffness = 300.0 }
ground = { stiffness = 100.0 }
[contact]
stiffness = 1000.0
[grid]
axes = [{ start = -0.3, step = 0.1, count = 7 }, { start = 0.01, step = 0.004, count = 9 }]
[[proxy.joint]]
name = "turn"
kind = "revolute"
axis = [0, 0, 1]
limits = [-1, 1]
[[proxy.joint]]
name = "slide"
kind = "prismatic"
axis = [-1, 0, 0]
limits = [0, 0.1]
nodes = [{ from = [0.08, -0.01, 0.002], to = [0.08, 0.01, 0.002], count = 3 }]
"#;

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
