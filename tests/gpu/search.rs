//! The search for equilibria in f64 on the device against the CPU's: one algorithm on both.

use crate::fixture::{context, load, load_of};
use glam::DVec3;
use haptize::{
    JointVector,
    contact::{Equilibrium, Model, Solver, Status},
    gpu::{BatchCapacity, GpuSolver},
    joint_matrix::lower,
    object::{Compliance, Object},
    proxy::Chain,
    scene::{ContactSpec, ContactSurface, Material, Scene, SpringKind, SpringSpec},
    sweep::Backend,
};

/// Every `stride`-th configuration of the scene's grid.
fn configurations(scene: &Scene, stride: usize) -> Vec<JointVector> {
    let axes = &scene.grid.axes;
    let points: usize = axes.iter().map(|axis| axis.count).product();
    let configuration = |mut point: usize| {
        let mut q = JointVector::zeros(axes.len());
        for (axis, value) in axes.iter().zip(q.iter_mut()).rev() {
            *value = axis.start + (point % axis.count) as f64 * axis.step;
            point /= axis.count;
        }
        q
    };
    (11..points).step_by(stride).map(configuration).collect()
}

/// Agreement of energies, torques and tangents, relative to the greatest of all configurations (1): both solve to 1e-8
/// and take the same steps, which differ by rounding.
const AGREEMENT: f64 = 1e-9;

/// What differs between results of both that is owed to more than rounding, or `None`.
fn difference(cpu: &[Equilibrium], gpu: &[Equilibrium]) -> Option<String> {
    let greatest = |of: &dyn Fn(&Equilibrium) -> f64| cpu.iter().map(of).fold(0.0, f64::max);
    let torque = greatest(&|e| e.torque.norm());
    let energy = greatest(&|e| e.energy);
    let size = |e: &Equilibrium| {
        e.tangent.iter().flat_map(|tangent| lower(tangent, e.torque.len()).map(f64::abs)).fold(0.0, f64::max)
    };
    let tangent = greatest(&size);
    for (k, (a, b)) in cpu.iter().zip(gpu).enumerate() {
        if (a.status, a.iterations, a.tangent.is_some()) != (b.status, b.iterations, b.tangent.is_some()) {
            return Some(format!("{k}: {:?} in {} steps, {:?} in {}", a.status, a.iterations, b.status, b.iterations));
        }
        let nodes = |e: &Equilibrium| e.touches.iter().map(|touch| touch.proxy_node).collect::<Vec<_>>();
        if nodes(a) != nodes(b) {
            return Some(format!("{k}: touches of {:?}, {:?}", nodes(a), nodes(b)));
        }
        let off: f64 = a.torque.iter().zip(b.torque.iter()).map(|(a, b)| (a - b).powi(2)).sum();
        let lower = |e: &Equilibrium| {
            e.tangent.iter().flat_map(|t| lower(t, e.torque.len()).collect::<Vec<_>>()).collect::<Vec<_>>()
        };
        let bent = lower(a).iter().zip(lower(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let stored = (a.energy - b.energy).abs();
        if off.sqrt() > AGREEMENT * torque || stored > AGREEMENT * energy || bent > AGREEMENT * tangent {
            return Some(format!("{k}: torque off by {:e}, energy by {stored:e}, tangent by {bent:e}", off.sqrt()));
        }
    }
    None
}

/// Solves on both sides, with tangents; asserts that the device needs no help, where it has f64.
fn check(what: &str, model: &Model, configurations: &[JointVector]) {
    let mut gpu = GpuSolver::new(context(), model).unwrap();
    let found = gpu.solve(configurations).unwrap();
    let mut cpu = Solver::new(model);
    let expected: Vec<Equilibrium> = configurations.iter().map(|q| cpu.solve(q)).collect();
    let touching = expected.iter().filter(|e| e.status == Status::Contact).count();
    assert!(touching >= 15, "{what}: {touching} in contact");
    if !context().adapter().double {
        return;
    }
    assert_eq!(difference(&expected, &found), None, "{what}");
    assert_eq!(gpu.left_to_cpu(), 0, "{what}");
}

#[test]
fn the_device_takes_the_steps_of_the_cpu() {
    let axial = Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness: 300.0 });
    for (material, surface) in
        [(None, ContactSurface::Facets), (None, ContactSurface::Smooth), (Some(axial), ContactSurface::Smooth)]
    {
        let (mut scene, object, chain) = load_of("sphere.toml", material.clone());
        scene.contact.surface = surface;
        let mut model = Model::new(&object, &chain, scene.contact);
        model.with_tangent = true;
        check(&format!("{material:?}, {surface:?}"), &model, &configurations(&scene, 131));
    }
}

/// To any tolerance, and where contact is stiff, so that it is reached in stages.
#[test]
fn other_tolerances_and_stiff_contact_take_the_steps_of_the_cpu() {
    let (scene, object, chain) = load("sphere.toml");
    for (tolerance, stiffness) in [(1e-4, scene.contact.stiffness), (1e-8, 1e5)] {
        let contact = ContactSpec { tolerance, stiffness, ..scene.contact };
        let model = Model::new(&object, &chain, contact);
        check(&format!("{tolerance:e}, {stiffness} N/m"), &model, &configurations(&scene, 131));
    }
}

/// The scene that is shipped, on its 2,562 nodes.
#[test]
fn the_shipped_sphere_needs_no_cpu() {
    let scene =
        Scene::load(std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sphere.toml"))).unwrap();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let configurations = configurations(&scene, 257);
    let model = Model::reaching(&object, &chain, scene.contact, &configurations).unwrap();
    check("the shipped sphere", &model, &configurations);
}

/// What touches more often than there is room for, or reaches beyond what the compliance covers, is the CPU's.
#[test]
fn what_the_device_has_no_room_for_is_solved_on_the_cpu() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = configurations(&scene, 131);
    let whole = Model::new(&object, &chain, scene.contact);
    let mut part = Model::new(&object, &chain, scene.contact);
    let reached = |node: &u32| whole.surface.positions[*node as usize].dot(DVec3::new(-0.3, 0.0, 1.0)) > 0.015;
    let nodes = (0..object.surface_nodes as u32).filter(reached);
    part.take_compliance(Compliance::on(&object, nodes.collect()).unwrap());
    for (model, contacts) in [(&whole, 2), (&part, 64)] {
        let mut cpu = Solver::new(model);
        let expected: Vec<Equilibrium> = configurations.iter().map(|q| cpu.solve(q)).collect();
        let room = BatchCapacity { contacts, ..BatchCapacity::default() };
        let mut gpu = GpuSolver::with_room(context(), model, room).unwrap();
        let found = gpu.solve(&configurations).unwrap();
        let overflown = expected.iter().filter(|e| e.status == Status::Overflow).count();
        if context().adapter().double {
            assert_eq!(difference(&expected, &found), None);
        }
        assert!(gpu.left_to_cpu() >= overflown.max(3), "{} left, {overflown} overflown", gpu.left_to_cpu());
    }
}

/// A device that returns at once what was recorded gives the same results, in sections of other sizes.
#[test]
fn what_was_recorded_is_replayed() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = configurations(&scene, 97);
    let model = Model::new(&object, &chain, scene.contact);
    let mut gpu = GpuSolver::new(context(), &model).unwrap();
    let expected = gpu.solve(&configurations).unwrap();
    let recorded = gpu.record(&configurations).unwrap();
    let mut replayed = GpuSolver::of(vec![recorded], &model);
    for _ in 0..2 {
        assert_eq!(format!("{:?}", replayed.solve(&configurations).unwrap()), format!("{expected:?}"));
    }
}

#[test]
fn the_comparator_rejects_what_differs() {
    let (scene, object, chain) = load("sphere.toml");
    let mut model = Model::new(&object, &chain, scene.contact);
    model.with_tangent = true;
    let mut cpu = Solver::new(&model);
    let good: Vec<Equilibrium> = configurations(&scene, 131).iter().map(|q| cpu.solve(q)).collect();
    let greatest = |e: &Equilibrium| e.energy;
    let most = (0..good.len()).max_by(|&a, &b| greatest(&good[a]).total_cmp(&greatest(&good[b]))).unwrap();
    assert_eq!(difference(&good, &good), None);
    let changes: [&dyn Fn(&mut Equilibrium); 6] = [
        &|e| e.torque.iter_mut().for_each(|tau| *tau *= 1.0 + 1e-8),
        &|e| e.energy *= 1.0 + 1e-8,
        &|e| e.iterations += 1,
        &|e| e.status = Status::Unconverged,
        &|e| e.tangent = None,
        &|e| e.touches.truncate(1),
    ];
    for (k, change) in changes.iter().enumerate() {
        let mut bad = good.clone();
        change(&mut bad[most]);
        assert!(difference(&good, &bad).is_some(), "change {k}");
    }
}
