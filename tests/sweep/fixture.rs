//! A small scene, a backend with made-up answers, folders to bake into, and memory counted.

use glam::DVec3;
use haptize::{
    Error, JointVector,
    contact::{Equilibrium, NodeForce, Status},
    object::Object,
    scene::Scene,
    sweep::{Backend, Progress, Run, Sweep, SweepReport},
};
use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

pub const SCENE: &str = include_str!("../scenes/small.toml");

/// Of [`scene`].
pub const POINTS: usize = 7 * 9;

pub fn scene() -> Scene {
    Scene::parse(SCENE, "small.toml").unwrap()
}

pub fn sweep_of(scene: &Scene, adapter: &str, date: &str) -> Sweep<'static> {
    Sweep::new(scene, &Object::build(&scene.object).unwrap(), "cpu", adapter, date).unwrap()
}

pub fn sweep() -> Sweep<'static> {
    sweep_of(&scene(), "none", "2012-03-04T00:00:00Z")
}

/// Answers with made-up numbers that depend on the configuration alone, half of them by the CPU; breaks down after some
/// configurations, and tells then that a part of it broke down before.
pub struct MadeUp {
    pub solved: usize,
    pub left_to_cpu: usize,
    pub breaks_after: usize,
    pub answer: fn(&[f64]) -> Equilibrium,
}

#[derive(Debug, thiserror::Error)]
#[error("device lost")]
pub struct DeviceLost;

impl Default for MadeUp {
    fn default() -> Self {
        Self { solved: 0, left_to_cpu: 0, breaks_after: usize::MAX, answer }
    }
}

impl Backend for MadeUp {
    type Error = DeviceLost;
    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, DeviceLost> {
        self.solved += configurations.len();
        if self.solved > self.breaks_after {
            return Err(DeviceLost);
        }
        self.left_to_cpu += configurations.len() / 2;
        Ok(configurations.iter().map(|q| (self.answer)(q)).collect())
    }

    fn notices(&mut self) -> Vec<String> {
        let part = (self.solved > self.breaks_after).then(|| "went on without a part of it".to_owned());
        part.into_iter().collect()
    }

    fn left_to_cpu(&self) -> usize {
        self.left_to_cpu
    }
}

pub fn answer(q: &[f64]) -> Equilibrium {
    let seed = (q[0] * 10.0 + q[1] * 1e3).round() as i64;
    let status = [Status::Free, Status::Contact, Status::Contact, Status::Unconverged, Status::Overflow]
        [seed.rem_euclid(5) as usize];
    let touched = if status == Status::Free { 0 } else { seed.rem_euclid(4) as u32 };
    Equilibrium {
        status,
        iterations: touched * 3 + 1,
        residual: 1e-9 * f64::from(touched),
        energy: q[0].sin() / 3.0,
        gap: q[1].cos() - 1.0,
        torque: JointVector::from_slice(&[q[1] / 7.0, q[0] / 3.0]),
        forces: (0..touched).map(|node| NodeForce { node, force: DVec3::new(q[0], q[1], f64::from(node)) }).collect(),
        tangent: None,
        slip: None,
        touches: Vec::new(),
    }
}

pub struct Folder(pub tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }
    pub fn output(&self) -> PathBuf {
        self.0.path().join("a.haptize")
    }
    pub fn part(&self) -> PathBuf {
        Sweep::part_of(&self.output())
    }
    pub fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

/// Bakes in chunks of `chunk`, stopping once `stop_at` points are done.
pub fn bake(
    sweep: &Sweep,
    backend: &mut impl Backend,
    output: &Path,
    resume: bool,
    chunk: usize,
    stop_at: usize,
) -> Result<SweepReport, Error> {
    let stop = AtomicBool::new(false);
    let mut progress = |progress: Progress| stop.store(progress.done >= stop_at, Ordering::Relaxed);
    sweep.bake(backend, output, resume, Run { chunk, stop: &stop, progress: &mut progress })
}

/// The whole file, baked without interruption.
pub fn uninterrupted() -> Vec<u8> {
    let folder = Folder::new();
    bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, 10, usize::MAX).unwrap();
    assert_eq!(folder.names(), ["a.haptize"], "the part is gone");
    std::fs::read(folder.output()).unwrap()
}

/// A folder with the part of a sweep that was stopped after `done` points.
pub fn stopped_after(done: usize) -> Folder {
    let folder = Folder::new();
    let stopped = bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, 1, done);
    let error = stopped.unwrap_err();
    assert!(error.to_string().contains("--resume"), "{error}");
    assert!(error.to_string().starts_with(&format!("stopped after {done} of {POINTS} ")), "{error}");
    assert_eq!(folder.names(), ["a.haptize.part"]);
    folder
}

thread_local! {
    /// Memory that this thread holds, and the most it held since it was asked (bytes).
    static HELD: Cell<[isize; 2]> = const { Cell::new([0; 2]) };
}

struct Counted;

fn count(bytes: isize) {
    // A thread that ends counts no more.
    let _ = HELD.try_with(|held| {
        let [now, peak] = held.get();
        held.set([now + bytes, peak.max(now + bytes)]);
    });
}

// SAFETY: hands every call on to the system's allocator.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counted = Counted;

/// What `work` returns, and the most memory that it held on this thread (bytes).
pub fn peak<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let [before, _] = HELD.get();
    HELD.set([before; 2]);
    let result = work();
    (result, HELD.get()[1].abs_diff(before))
}
