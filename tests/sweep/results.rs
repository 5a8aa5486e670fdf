//! What a sweep's dataset holds.

use crate::fixture::{Folder, MadeUp, POINTS, SCENE, answer, bake, scene, sweep, sweep_of, uninterrupted};
use glam::DVec3;
use haptize::{
    JointVector,
    contact::{Equilibrium, Model, NodeForce, Slip, Solver, Status},
    dataset::Dataset,
    fixtures::Random,
    object::Object,
    proxy::Chain,
    scene::{ContactLaw, ContactSpec, JointKind, LEVER_ARM, Scene},
    sweep::{Backend, BackendChoice, Bake, CpuBackend, FreeSpace, Run, Sweep},
};
use std::sync::atomic::AtomicBool;

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
    assert_eq!(dataset.provenance.algorithm, "rest");

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
    assert!(json["iterations"]["mean"].is_number() && json["iterations"]["max"].is_number());
}

#[test]
fn a_sweep_in_memory_saves_the_same_file() {
    let folder = Folder::new();
    let blind = Scene::parse(&SCENE.replace("graphics = {}", "graphics = false"), "small.toml").unwrap();
    for scene in [scene(), blind] {
        let sweep = sweep_of(&scene, "none", "2012-03-04T00:00:00Z");
        let run = Run { chunk: 10, stop: &AtomicBool::new(false), progress: &mut |_| () };
        let (dataset, in_memory) = sweep.run(&mut MadeUp::default(), run).unwrap();
        dataset.save(&folder.output()).unwrap();
        let saved = std::fs::read(folder.output()).unwrap();
        let report = bake(&sweep, &mut MadeUp::default(), &folder.output(), false, 7, usize::MAX).unwrap();
        assert!(std::fs::read(folder.output()).unwrap() == saved);
        assert_eq!((report.iterations, report.max_residual), (in_memory.iterations, in_memory.max_residual));
    }
}

/// What the geometry at rest leaves out, stated with the error of a bake, beside other random configurations of the grid.
#[test]
fn the_error_of_the_geometry_at_rest_is_stated() {
    let mut scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/mesh.toml")).unwrap();
    let stated = |scene: &Scene| {
        let (backend, stop) = (BackendChoice::Auto, AtomicBool::new(false));
        let measured = Some(400);
        let bake = Bake { scene, backend, measured, aim: None, date: "", stop: &stop, progress: &mut |_| () };
        let (dataset, _) = bake.in_memory().unwrap();
        (dataset.provenance.backend, dataset.provenance.error.unwrap())
    };
    scene.contact.law = ContactLaw::Rest;
    // No GPU takes it.
    let (backend, error) = stated(&scene);
    let geometry = error.geometry.unwrap();
    assert_eq!(backend, "cpu");

    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let rest = Model::new(&object, &chain, scene.contact);
    let following = rest.with_contact(ContactSpec { law: ContactLaw::Following, ..scene.contact });
    let (mut at_rest, mut deformed, mut random) = (Solver::new(&rest), Solver::new(&following), Random::new(4));
    let (mut square, mut off, mut deepest) = (0.0, 0.0, 0.0_f64);
    for _ in 0..1500 {
        let axes = scene.grid.axes.iter();
        let q: Vec<f64> =
            axes.map(|axis| axis.start + random.between(0.0, axis.step * (axis.count - 1) as f64)).collect();
        let (here, there) = (at_rest.solve(&q), deformed.solve(&q));
        for ((a, b), joint) in here.torque.iter().zip(there.torque.iter()).zip(&chain.joints) {
            let lever = if joint.kind == JointKind::Prismatic { LEVER_ARM } else { 1.0 };
            square += (lever * a).powi(2);
            off += (lever * (a - b)).powi(2);
        }
        deepest = deepest.max(-here.gap);
    }
    let (found, expected) = (geometry.rms / error.torque, (off / square).sqrt());
    println!("{found} {expected}, {} {deepest}", geometry.depth);
    // The difference grows as the square of the depth: few deep places make most of it.
    assert!(found > 0.4 * expected && found < 2.5 * expected, "{found} {expected}");
    assert!(geometry.depth > 0.6 * deepest && geometry.depth < 1.6 * deepest, "{} {deepest}", geometry.depth);

    scene.contact.law = ContactLaw::Following;
    assert!(stated(&scene).1.geometry.is_none());
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

/// A grid of several pieces that threads write side by side, in chunks that do not end where pieces do.
#[test]
fn a_file_is_the_same_whichever_number_of_threads_put_it_together() {
    let friction = SCENE.to_owned() + "\n[haptics.friction]\ncoefficient = 0.4\n";
    let mut scene = Scene::parse(&friction, "small.toml").unwrap();
    for (axis, count) in scene.grid.axes.iter_mut().zip([100, 130]) {
        (axis.step, axis.count) = (axis.step * axis.count as f64 / count as f64, count);
    }
    let sweep = sweep_of(&scene, "none", "");
    let touching = |q: &[f64]| {
        let equilibrium = answer(q);
        let mut slip = Slip { normal_force: 1.0 + q[0], ..Slip::default() };
        (slip.jacobian[0][0], slip.jacobian[1][0], slip.jacobian[1][1]) = (q[0], q[1], q[0] * q[1]);
        Equilibrium { slip: equilibrium.status.is_in_contact().then_some(slip), ..equilibrium }
    };
    let put_together = |threads| {
        let folder = Folder::new();
        let mut backend = MadeUp { answer: touching, ..MadeUp::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bake(&sweep, &mut backend, &folder.output(), false, 777, usize::MAX)).unwrap();
        std::fs::read(folder.output()).unwrap()
    };
    let one = put_together(1);
    for threads in [2, 3, 7] {
        assert!(put_together(threads) == one, "{threads} threads");
    }
    let folder = Folder::new();
    std::fs::write(folder.output(), one).unwrap();
    let dataset = Dataset::open(&folder.output()).unwrap();
    let slips = dataset.slip.as_ref().unwrap();
    let mut touched = 0;
    for point in 0..dataset.grid.points() {
        let expected = touching(&dataset.grid.configuration(point));
        assert_eq!(dataset.torque(point), &expected.torque[..]);
        let forces: Vec<_> = dataset.forces(point).map(|on| (on.node, on.force.as_vec3())).collect();
        assert_eq!(forces, expected.forces.iter().map(|on| (on.node, on.force.as_vec3())).collect::<Vec<_>>());
        let Slip { normal_force, jacobian } = expected.slip.unwrap_or_default();
        let triangle = [jacobian[0][0], jacobian[1][0], jacobian[1][1]].map(|entry| entry as f32);
        assert_eq!(
            (slips.normal_force[point], &slips.jacobian[3 * point..][..3]),
            (normal_force as f32, &triangle[..])
        );
        touched += usize::from(normal_force > 0.0);
    }
    assert!(touched > 4096, "{touched}");
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
    let sick: [fn(&[f64]) -> Equilibrium; 7] = [
        |q| Equilibrium { torque: JointVector::from_slice(&[f64::NAN, 0.0]), status: Status::Contact, ..answer(q) },
        |q| Equilibrium { torque: JointVector::zeros(1), status: Status::Contact, ..answer(q) },
        |q| Equilibrium { energy: f64::INFINITY, status: Status::Contact, ..answer(q) },
        |q| Equilibrium { gap: f64::NAN, status: Status::Free, ..answer(q) },
        |q| Equilibrium {
            forces: vec![NodeForce { node: 0, force: DVec3::splat(1e39) }],
            status: Status::Contact,
            ..answer(q)
        },
        |q| Equilibrium { forces: vec![NodeForce { node: 22, force: DVec3::X }], status: Status::Contact, ..answer(q) },
        |q| Equilibrium {
            forces: [3, 1].map(|node| NodeForce { node, force: DVec3::X }).to_vec(),
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
    let blind = Scene::parse(&SCENE.replace("graphics = {}", "graphics = false"), "small.toml").unwrap();
    assert!(run(&scene()).contacts.is_some());
    assert!(run(&blind).contacts.is_none());
}

/// A backend of so many threads, which keeps the sizes of its batches.
struct Threaded {
    threads: usize,
    batches: Vec<usize>,
}

impl Backend for Threaded {
    type Error = std::convert::Infallible;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Self::Error> {
        self.batches.push(configurations.len());
        Ok(configurations.iter().map(|q| answer(q)).collect())
    }

    fn threads(&self) -> usize {
        self.threads
    }
}

#[test]
fn the_least_batch_leaves_no_thread_of_the_backend_idle_whatever_the_machine_has() {
    let first = |threads: usize| {
        let mut backend = Threaded { threads, batches: Vec::new() };
        bake(&sweep(), &mut backend, &Folder::new().output(), false, POINTS, usize::MAX).unwrap();
        backend.batches[0]
    };
    assert_eq!(first(3), 3 * first(1));
    let scene = scene();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    assert_eq!(CpuBackend::new(&model, 3).unwrap().threads(), 3);
}
