//! Sweeps: the dataset depends on nothing but scene and backend, and an interruption leaves no trace in it.

#![allow(clippy::unwrap_used, clippy::panic)]

use glam::DVec3;
use haptize::{
    JointVector,
    contact::{Equilibrium, Model, NodeForce, Solver, Status},
    dataset::Dataset,
    haptize::{
        Backend, CpuBackend, FreeSpace, Inspection, Progress, Run, Sweep, SweepError, SweepReport, WithFallback,
    },
    object::Object,
    proxy::Chain,
    scene::Scene,
};
use std::{
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

const SCENE: &str = r#"
name = "small sphere"
graphics = {}
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
const POINTS: usize = 7 * 9;

fn scene() -> Scene {
    Scene::parse(SCENE, "small.toml").unwrap()
}

fn sweep_of(scene: &Scene, adapter: &str, date: &str) -> Sweep {
    Sweep::new(scene, &Object::build(&scene.object).unwrap(), "cpu", adapter, date).unwrap()
}

fn sweep() -> Sweep {
    sweep_of(&scene(), "none", "2012-03-04T00:00:00Z")
}

/// Answers with made-up numbers that depend on the configuration alone; breaks down after some configurations.
struct MadeUp {
    solved: usize,
    breaks_after: usize,
    answer: fn(&[f64]) -> Equilibrium,
}

#[derive(Debug, thiserror::Error)]
#[error("device lost")]
struct DeviceLost;

impl Default for MadeUp {
    fn default() -> Self {
        Self { solved: 0, breaks_after: usize::MAX, answer }
    }
}

impl Backend for MadeUp {
    type Error = DeviceLost;
    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, DeviceLost> {
        self.solved += configurations.len();
        if self.solved > self.breaks_after {
            return Err(DeviceLost);
        }
        Ok(configurations.iter().map(|q| (self.answer)(q)).collect())
    }
}

fn answer(q: &[f64]) -> Equilibrium {
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
        touches: Vec::new(),
    }
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }
    fn output(&self) -> PathBuf {
        self.0.path().join("a.haptize")
    }
    fn part(&self) -> PathBuf {
        Sweep::part_of(&self.output())
    }
    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

/// Bakes in chunks of `chunk`, stopping once `stop_at` points are done.
fn bake(
    sweep: &Sweep,
    backend: &mut impl Backend,
    output: &Path,
    resume: bool,
    chunk: usize,
    stop_at: usize,
) -> Result<SweepReport, SweepError> {
    let stop = AtomicBool::new(false);
    let mut progress = |progress: Progress| stop.store(progress.done >= stop_at, Ordering::Relaxed);
    sweep.bake(backend, output, resume, Run { chunk, stop: &stop, progress: &mut progress }).map(|(_, report)| report)
}

/// The whole file, baked without interruption.
fn uninterrupted() -> Vec<u8> {
    let folder = Folder::new();
    bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, 10, usize::MAX).unwrap();
    assert_eq!(folder.names(), ["a.haptize"], "the part is gone");
    std::fs::read(folder.output()).unwrap()
}

/// A folder with the part of a sweep that was stopped after `done` points.
fn stopped_after(done: usize) -> Folder {
    let folder = Folder::new();
    let stopped = bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, 1, done);
    let error = stopped.unwrap_err();
    assert!(error.to_string().contains("--resume"), "{error}");
    assert!(matches!(error, SweepError::Stopped { done: found, points: POINTS, .. } if found == done));
    assert_eq!(folder.names(), ["a.haptize.part"]);
    folder
}

#[test]
fn the_dataset_is_what_the_backend_answered_at_every_grid_point() {
    let folder = Folder::new();
    let report = bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, 10, usize::MAX).unwrap();
    let dataset = Dataset::open(&folder.output()).unwrap();
    assert_eq!(dataset.grid.points(), POINTS);
    assert_eq!([&*dataset.grid.axes[0].unit, &*dataset.grid.axes[1].unit], ["rad", "m"]);
    for point in 0..POINTS {
        let (turn, slide) = (point / 9, point % 9);
        let q = [-0.3 + turn as f64 * 0.1, 0.01 + slide as f64 * 0.004];
        assert_eq!(dataset.grid.configuration(point)[..], q);
        let expected = answer(&q);
        assert_eq!(dataset.torque(point), &expected.torque[..]);
        assert_eq!(dataset.status(point), expected.status);
        assert_eq!(dataset.energy.as_ref().unwrap()[point], expected.energy);
        assert_eq!(dataset.gap.as_ref().unwrap()[point], expected.gap as f32);
        assert_eq!(dataset.residual.as_ref().unwrap()[point], expected.residual as f32);
        assert_eq!(dataset.iterations.as_ref().unwrap()[point], expected.iterations);
        let forces: Vec<_> = dataset.forces(point).map(|contact| (contact.node, contact.force.as_vec3())).collect();
        let expected: Vec<_> = expected.forces.iter().map(|contact| (contact.node, contact.force.as_vec3())).collect();
        assert_eq!(forces, expected);
    }
    assert_eq!(dataset.scene, SCENE);
    assert_eq!(dataset.provenance.algorithm, "energy");

    let answers: Vec<_> = (0..POINTS).map(|point| answer(&dataset.grid.configuration(point))).collect();
    let count = |status| answers.iter().filter(|answer| answer.status == status).count();
    let in_contact: Vec<_> = answers.iter().filter(|answer| answer.status != Status::Free).collect();
    assert_eq!(report.points, POINTS);
    assert_eq!(report.contact_points, in_contact.len());
    assert_eq!(report.unconverged, count(Status::Unconverged));
    assert_eq!(report.overflowed, count(Status::Overflow));
    assert!(report.unconverged > 0 && report.overflowed > 0);
    assert_eq!(report.iterations.max, in_contact.iter().map(|answer| answer.iterations).max().unwrap());
    let sum: u32 = in_contact.iter().map(|answer| answer.iterations).sum();
    assert_eq!(report.iterations.mean, f64::from(sum) / in_contact.len() as f64);
    assert_eq!(report.max_residual, f64::from(3e-9_f32));
    let json = serde_json::to_value(&report).unwrap();
    for key in [
        "points",
        "contact_points",
        "unconverged",
        "overflowed",
        "max_residual",
        "iterations",
        "seconds",
        "configurations_per_second",
        "backend",
        "adapter",
        "algorithm",
    ] {
        assert!(!json[key].is_null(), "{key}");
    }
    assert!(json["iterations"]["mean"].is_number() && json["iterations"]["max"].is_number());
}

#[test]
fn chunk_size_leaves_no_trace() {
    let whole = uninterrupted();
    for chunk in [0, 1, 7, POINTS, 1000] {
        let folder = Folder::new();
        bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, chunk, usize::MAX).unwrap();
        assert!(std::fs::read(folder.output()).unwrap() == whole, "chunk {chunk}");
    }
    let mut other =
        MadeUp { answer: |q| Equilibrium { energy: answer(q).energy + 1e-16, ..answer(q) }, ..MadeUp::default() };
    let folder = Folder::new();
    bake(&sweep(), &mut other, &folder.output(), false, 10, usize::MAX).unwrap();
    assert!(std::fs::read(folder.output()).unwrap() != whole, "the comparison sees the last bit");
}

#[test]
fn a_stopped_sweep_continues_to_the_same_file() {
    let whole = uninterrupted();
    for done in [0, 1, 30, POINTS - 1] {
        let folder = stopped_after(done);
        let mut backend = MadeUp::default();
        // Another date, as on another day, and another chunk.
        let later = sweep_of(&scene(), "none", "2013-01-01T00:00:00Z");
        let report = bake(&later, &mut backend, &folder.output(), true, 5, usize::MAX).unwrap();
        assert_eq!((report.resumed_points, backend.solved), (done, POINTS - done));
        assert!(std::fs::read(folder.output()).unwrap() == whole, "stopped after {done}");
        assert_eq!(folder.names(), ["a.haptize"]);
    }
}

#[test]
fn a_part_cut_or_altered_anywhere_costs_work_but_never_a_wrong_number() {
    let whole = uninterrupted();
    let folder = stopped_after(6);
    let part = std::fs::read(folder.part()).unwrap();
    let resumed = |bytes: &[u8]| {
        std::fs::write(folder.part(), bytes).unwrap();
        bake(&sweep(), &mut MadeUp::default(), &folder.output(), true, POINTS, usize::MAX)
    };
    let mut resumed_points = std::collections::BTreeSet::new();
    for length in (0..part.len()).step_by(3) {
        resumed_points.insert(resumed(&part[..length]).unwrap().resumed_points);
        assert!(std::fs::read(folder.output()).unwrap() == whole, "cut to {length} bytes");
    }
    assert_eq!(resumed_points, (0..6).collect(), "cutting loses one point after the other");
    for at in (0..part.len()).step_by(3) {
        let mut altered = part.clone();
        altered[at] ^= 1 << (at % 8);
        match resumed(&altered) {
            Ok(_) => assert!(std::fs::read(folder.output()).unwrap() == whole, "byte {at} altered"),
            Err(error) => assert!(matches!(error, SweepError::ForeignPart { .. }), "byte {at}: {error}"),
        }
    }
    assert_eq!(resumed(&part).unwrap().resumed_points, 6);
    // Rubbish behind the last whole frame, with a length that no memory holds.
    let hostile = [&part[..], &(u64::MAX - 3).to_le_bytes(), &[0; 40]].concat();
    assert_eq!(resumed(&hostile).unwrap().resumed_points, 6);
    assert!(std::fs::read(folder.output()).unwrap() == whole);
}

#[test]
fn a_part_of_another_sweep_is_refused_with_the_difference() {
    let folder = stopped_after(3);
    let refused = |sweep: &Sweep| {
        let error = bake(sweep, &mut MadeUp::default(), &folder.output(), true, 10, usize::MAX).unwrap_err();
        assert!(error.to_string().contains("a.haptize.part"), "{error}");
        match error {
            SweepError::OtherPart { difference, .. } => difference,
            other => panic!("{other}"),
        }
    };
    let date = "2012-03-04T00:00:00Z";
    let changed = |from: &str, to: &str| Scene::parse(&SCENE.replace(from, to), "small.toml").unwrap();
    assert_eq!(refused(&sweep_of(&scene(), "other", date)), "another adapter");
    assert_eq!(
        refused(&sweep_of(&changed("stiffness = 300.0", "stiffness = 300.1"), "none", date)),
        "another text of the scene"
    );
    assert_eq!(refused(&sweep_of(&changed("count = 7", "count = 6"), "none", date)), "another grid");
    assert_eq!(refused(&sweep_of(&changed("radius = 0.05", "radius = 0.051"), "none", date)), "another mesh");
    let mut paper = scene();
    paper.contact.algorithm = haptize::scene::Algorithm::Paper;
    assert_eq!(refused(&sweep_of(&paper, "none", date)), "another algorithm");
    // A refusal changes nothing; baking anew replaces.
    assert_eq!(
        bake(&sweep(), &mut MadeUp::default(), &folder.output(), true, 9, usize::MAX).unwrap().resumed_points,
        3
    );
    let folder = stopped_after(3);
    let anew = sweep_of(&scene(), "other", date);
    assert_eq!(bake(&anew, &mut MadeUp::default(), &folder.output(), false, 9, usize::MAX).unwrap().resumed_points, 0);
}

#[test]
fn a_failing_backend_leaves_a_part_and_the_earlier_file() {
    let whole = uninterrupted();
    let folder = Folder::new();
    std::fs::write(folder.output(), "earlier").unwrap();
    let mut broken = MadeUp { breaks_after: 25, ..MadeUp::default() };
    let error = bake(&sweep(), &mut broken, &folder.output(), false, 10, usize::MAX).unwrap_err();
    assert_eq!(error.to_string(), "the backend failed at grid points 20 to 29: device lost");
    assert_eq!(std::fs::read(folder.output()).unwrap(), b"earlier");
    let report = bake(&sweep(), &mut MadeUp::default(), &folder.output(), true, 10, usize::MAX).unwrap();
    assert_eq!(report.resumed_points, 20);
    assert!(std::fs::read(folder.output()).unwrap() == whole);
}

/// The device breaks down for good in the third batch of ten; the sweep goes on, and says so in report and file, also when it
/// is killed later on and resumed.
#[test]
fn a_sweep_whose_device_is_lost_goes_on_with_the_cpu() {
    let scene = scene();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let lossy = || WithFallback::new(MadeUp { breaks_after: 25, ..MadeUp::default() }, "a made-up device", &model);
    let folder = Folder::new();
    let report = bake(&sweep(), &mut lossy(), &folder.output(), false, 10, usize::MAX).unwrap();
    let dataset = Dataset::open(&folder.output()).unwrap();
    let [notice] = &dataset.provenance.notices[..] else { panic!("{:?}", dataset.provenance) };
    assert!(notice.starts_with("from grid point 20 on: solved by "), "{notice}");
    assert!(notice.ends_with("since a made-up device failed: device lost"), "{notice}");
    assert_eq!(&report.warnings, &dataset.provenance.notices);
    let mut solver = Solver::new(&model);
    for point in 0..POINTS {
        let q = dataset.grid.configuration(point);
        let expected = if point < 20 { answer(&q) } else { solver.solve(&q) };
        assert_eq!(dataset.torque(point), &expected.torque[..], "point {point}");
        assert_eq!(dataset.status(point), expected.status, "point {point}");
    }

    let stopped = bake(&sweep(), &mut lossy(), &folder.output(), false, 10, 40).unwrap_err();
    assert!(matches!(stopped, SweepError::Stopped { done: 40, .. }), "{stopped}");
    bake(&sweep(), &mut MadeUp::default(), &folder.output(), true, 10, usize::MAX).unwrap();
    let resumed = Dataset::open(&folder.output()).unwrap().provenance.notices;
    assert_eq!(&resumed[..], [notice.as_str(), "from grid point 40 on: resumed on cpu (none)"]);
}

/// Skipping changes nothing but gaps far from contact, and those are then lower bounds.
#[test]
fn skipping_free_space_changes_no_more_than_far_gaps() {
    let fine = SCENE.replace("step = 0.1, count = 7", "step = 0.01, count = 70");
    let fine = fine.replace("start = 0.01, step = 0.004, count = 9", "start = 0.0, step = 0.0005, count = 100");
    let scene = Scene::parse(&fine, "fine.toml").unwrap();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let run = |skip: bool| {
        let mut sweep = Sweep::new(&scene, &object, "cpu", "none", "").unwrap();
        if skip {
            sweep.skip_free_space(&model).unwrap();
        }
        let run = Run { chunk: 300, stop: &AtomicBool::new(false), progress: &mut |_| () };
        sweep.run(&mut CpuBackend::new(&model, 2).unwrap(), run).unwrap()
    };
    let ((whole, all), (skipping, some)) = (run(false), run(true));
    assert_eq!((all.skipped_points, all.contact_points), (0, some.contact_points));
    assert!(some.skipped_points > 2000 && some.contact_points > 500, "{some:?}");
    assert!(*whole.torque == *skipping.torque && *whole.status == *skipping.status);
    assert!(*whole.iterations.unwrap() == *skipping.iterations.unwrap());
    assert!(*whole.contacts.unwrap().forces == *skipping.contacts.unwrap().forces);
    let (whole_gap, gap) = (whole.gap.unwrap(), skipping.gap.unwrap());
    let place = |point: usize| [point / 100, point % 100];
    let touching: Vec<[usize; 2]> = (0..7000).filter(|&p| whole.status[p] != 0).map(place).collect();
    let mut bounds = 0;
    for point in 0..7000 {
        if gap[point] != whole_gap[point] {
            bounds += 1;
            assert!(0.0 < gap[point] && gap[point] < whole_gap[point]);
            let far = |[a, b]: &[usize; 2]| a.abs_diff(point / 100).max(b.abs_diff(point % 100)) > FreeSpace::MARGIN;
            assert!(touching.iter().all(far), "point {point} is near contact");
        }
    }
    assert!(bounds > 1000);
}

#[test]
fn results_that_no_file_may_hold_become_unconverged_points() {
    let sick: [fn(&[f64]) -> Equilibrium; 5] = [
        |q| Equilibrium { torque: JointVector::from_slice(&[f64::NAN, 0.0]), status: Status::Contact, ..answer(q) },
        |q| Equilibrium { torque: JointVector::zeros(1), status: Status::Contact, ..answer(q) },
        |q| Equilibrium { energy: f64::INFINITY, status: Status::Contact, ..answer(q) },
        |q| Equilibrium { gap: f64::NAN, status: Status::Free, ..answer(q) },
        |q| Equilibrium {
            forces: vec![NodeForce { node: 0, force: DVec3::splat(1e39) }],
            status: Status::Contact,
            ..answer(q)
        },
    ];
    for answer in sick {
        let folder = Folder::new();
        let mut backend = MadeUp { answer, ..MadeUp::default() };
        let report = bake(&sweep(), &mut backend, &folder.output(), false, 10, usize::MAX).unwrap();
        assert_eq!(report.unconverged, POINTS);
        let dataset = Dataset::open(&folder.output()).unwrap();
        assert!(dataset.torque.iter().all(|&tau| tau == 0.0));
        assert!(dataset.contacts.as_ref().unwrap().nodes.is_empty());
    }
}

#[test]
fn forces_are_stored_only_for_a_scene_with_graphics() {
    let run = |scene: &Scene| {
        let stop = AtomicBool::new(false);
        let run = Run { chunk: 10, stop: &stop, progress: &mut |_| () };
        sweep_of(scene, "none", "").run(&mut MadeUp::default(), run).unwrap().0
    };
    let blind = Scene::parse(&SCENE.replace("graphics = {}", ""), "small.toml").unwrap();
    assert!(run(&scene()).contacts.is_some());
    assert!(run(&blind).contacts.is_none());
    assert!(sweep_of(&blind, "none", "").memory_needed(9) < sweep().memory_needed(9));
}

#[test]
fn the_memory_stated_is_the_memory_of_the_columns() {
    let stop = AtomicBool::new(false);
    let run = Run { chunk: 10, stop: &stop, progress: &mut |_| () };
    let sweep = sweep();
    let (dataset, _) = sweep.run(&mut MadeUp::default(), run).unwrap();
    let summary = dataset.summary();
    let surface = dataset.surface.as_ref().unwrap();
    let fixed = size_of_val(&*surface.nodes) + size_of_val(&*surface.triangles) + 8;
    assert_eq!(sweep.memory_needed(0) + 16 * summary.contacts.unwrap() + fixed, summary.bytes);
}

#[test]
fn a_grid_that_no_memory_holds_is_refused_at_once() {
    let mut scene = scene();
    scene.grid.axes[0].count = 1 << 30;
    scene.grid.axes[0].step = 1e-9;
    scene.grid.axes[1].count = 1 << 20;
    scene.grid.axes[1].step = 1e-9;
    let folder = Folder::new();
    let error = bake(&sweep_of(&scene, "none", ""), &mut MadeUp::default(), &folder.output(), false, 10, usize::MAX)
        .unwrap_err();
    assert!(matches!(error, SweepError::Memory { .. }), "{error}");
    assert!(folder.names().is_empty());
}

#[cfg(unix)]
#[test]
fn two_bakes_into_one_file_do_not_mix() {
    let folder = Folder::new();
    let mut tried = false;
    let stop = AtomicBool::new(false);
    let sweep = sweep();
    let mut progress = |_| {
        if !std::mem::replace(&mut tried, true) {
            let second = bake(&sweep, &mut MadeUp::default(), &folder.output(), true, 10, usize::MAX);
            assert!(matches!(second, Err(SweepError::Busy { .. })));
        }
    };
    sweep
        .bake(&mut MadeUp::default(), &folder.output(), false, Run { chunk: 10, stop: &stop, progress: &mut progress })
        .unwrap();
    assert!(tried);
}

#[test]
fn the_number_of_threads_leaves_no_trace() {
    let scene = scene();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let baked = |threads, chunk| {
        let folder = Folder::new();
        let mut backend = CpuBackend::new(&model, threads).unwrap();
        let report = bake(&sweep(), &mut backend, &folder.output(), false, chunk, usize::MAX).unwrap();
        assert!(report.contact_points > 5 && report.contact_points < POINTS, "{report:?}");
        std::fs::read(folder.output()).unwrap()
    };
    let one = baked(1, POINTS);
    for (threads, chunk) in [(2, POINTS), (3, 17), (5, 1)] {
        assert!(baked(threads, chunk) == one, "{threads} threads, chunks of {chunk}");
    }
}

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
#[cfg(unix)]
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

#[cfg(unix)]
fn program(folder: &Folder, more: &[&str]) -> std::process::Command {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_haptize"));
    command.current_dir(folder.0.path()).args(["bake", "fine.toml", "--backend", "cpu", "--json"]).args(more);
    command
}

#[cfg(unix)]
#[test]
fn a_killed_program_is_resumed_to_the_same_numbers() {
    let folder = Folder::new();
    let mut killed = program_at_work(&folder, 350);
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert_eq!(folder.names(), ["fine.haptize.part", "fine.toml"]);
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

#[cfg(unix)]
#[test]
fn an_interrupted_program_says_how_to_resume() {
    let folder = Folder::new();
    let interrupted = program_at_work(&folder, 10_000);
    // SAFETY: kill(2) has no conditions; the process is our child and not yet waited for.
    assert_eq!(unsafe { libc::kill(interrupted.id() as i32, libc::SIGINT) }, 0);
    let output = interrupted.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("fine.haptize.part") && message.contains("--resume"), "{message}");
    assert_eq!(folder.names(), ["fine.haptize.part", "fine.toml"]);
}

/// Largest entry of the difference over the largest entry of `expected`.
fn relative_error(found: &[f64], expected: &[f64]) -> f64 {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.map(f64::abs).fold(0.0, f64::max);
    largest(&mut found.iter().zip(expected).map(|(a, b)| a - b)) / largest(&mut expected.iter().copied())
}

/// Bakes `scene` and holds what was stored against what the object and the proxy themselves say; returns the number of
/// points checked.
fn check_equilibria(scene: &Scene) -> usize {
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let folder = Folder::new();
    let mut backend = CpuBackend::new(&model, 0).unwrap();
    let sweep = Sweep::new(scene, &object, "cpu", "none", "").unwrap();
    bake(&sweep, &mut backend, &folder.output(), false, 1000, usize::MAX).unwrap();
    let dataset = Dataset::open(&folder.output()).unwrap();
    let centre = object.rest.iter().sum::<DVec3>() / object.rest.len() as f64;
    let mut solver = Solver::new(&model);
    let flat = |vectors: &[DVec3]| vectors.iter().flat_map(|v| v.to_array()).collect::<Vec<f64>>();
    let mut checked = 0;
    for point in (0..dataset.grid.points()).filter(|&point| dataset.status(point) == Status::Contact) {
        let equilibrium = solver.solve(&dataset.grid.configuration(point));
        // K u of the displacement, against the forces as they went through the file.
        let u: Vec<DVec3> = solver.displacement().chunks_exact(3).map(DVec3::from_slice).collect();
        let mut elastic = vec![DVec3::ZERO; u.len()];
        object.stiffness.apply(&u, &mut elastic);
        let mut stored = vec![DVec3::ZERO; u.len()];
        for contact in dataset.forces(point) {
            stored[contact.node as usize] = contact.force;
        }
        let imbalance = relative_error(&flat(&stored), &flat(&elastic));
        assert!(imbalance < 1e-6, "{imbalance} at point {point}, residual {}", equilibrium.residual);
        let perturbed: Vec<f64> = flat(&stored).iter().map(|f| f * 1.00001).collect();
        assert!(relative_error(&perturbed, &flat(&elastic)) > 1e-6, "the comparison sees an error of 1e-5");
        let mut torque = JointVector::zeros(chain.joints.len());
        for touch in &equilibrium.touches {
            let outwards = model.object.rest[touch.nodes[0] as usize] - centre;
            assert!(touch.force.dot(outwards) > 0.0, "a force pulls the proxy in at point {point}");
            chain.add_torque(solver.pose(), touch.proxy_node as usize, touch.force, &mut torque);
        }
        assert!(relative_error(dataset.torque(point), &torque) < 1e-12, "point {point}");
        checked += 1;
    }
    checked
}

#[test]
fn stored_forces_balance_the_object_and_make_the_torque() {
    assert!(check_equilibria(&scene()) > 5);
    let sphere = concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sphere.toml");
    assert!(check_equilibria(&Scene::load(sphere).unwrap()) > 1000);
}

/// A file size limit stands in for a full disk: writing beyond it fails.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_earlier_file_and_no_rubbish() {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("small.toml"), SCENE).unwrap();
    let haptize = |prelude: &str, arguments: &str| {
        let line = format!("{prelude} exec '{}' {arguments}", env!("CARGO_BIN_EXE_haptize"));
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

#[test]
fn an_inspection_tells_the_same_from_scene_and_dataset() {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("small.toml"), SCENE).unwrap();
    let haptize = |arguments: &[&str]| {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_haptize"));
        let output = command.current_dir(folder.0.path()).args(arguments).arg("--json").output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    haptize(&["bake", "small.toml", "--backend", "cpu"]);
    std::fs::remove_file(folder.0.path().join("small.toml")).unwrap();
    let from_dataset = haptize(&["inspect", "small.haptize", "--q", "-0.2,0.042"]);
    std::fs::write(folder.0.path().join("small.toml"), SCENE).unwrap();
    let mut from_scene = haptize(&["inspect", "small.toml", "--q=-0.2,0.042"]);
    assert_eq!(from_scene["status"], "contact");
    // The grid point 1 x 8, as it was stored and as it is solved anew.
    assert_eq!(from_dataset["stored"]["point"], 9 + 8);
    let torque = |value: &serde_json::Value| serde_json::from_value::<Vec<f64>>(value["torque"].clone()).unwrap();
    assert!(relative_error(&torque(&from_dataset["stored"]), &torque(&from_dataset)) < 1e-6);
    from_scene["stored"] = from_dataset["stored"].clone();
    assert_eq!(from_scene, from_dataset);
}

#[test]
fn an_inspection_is_complete_enough_to_recompute_the_torque() {
    let scene = scene();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let inspection = Inspection::new(&model, &[0.05, 0.045]);
    assert_eq!((inspection.status.as_str(), inspection.proxy_nodes.len()), ("contact", 3));
    assert_eq!(inspection.object_nodes.len(), object.surface_nodes);
    assert!(relative_error(&inspection.torque_of_contacts(), &inspection.torque) < 1e-12);
    let pushed: DVec3 = inspection.object_nodes.iter().map(|node| node.force).sum();
    let pushing: DVec3 =
        inspection.proxy_nodes.iter().filter_map(|node| node.contact).map(|contact| contact.force).sum();
    assert!((pushed + pushing).length() < 1e-12 * pushed.length());
}
