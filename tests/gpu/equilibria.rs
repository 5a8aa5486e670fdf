//! Equilibria of the GPU backend against the CPU's, and by the laws that they obey.

use crate::fixture::{context, load, load_of};
use glam::DVec3;
use haptize::{
    JointVector,
    contact::{Equilibrium, Model, Solver, Status, Touch},
    gpu::{AdapterChoice, BatchCapacity, Context, GPU_SETTLED_RESIDUAL, GpuError, GpuSolver},
    object::{Compliance, Object},
    proxy::Chain,
    scene::{Algorithm, ContactSpec, ContactSurface, ElasticSpec, Material, Scene, SpringKind, SpringSpec},
    sweep::Backend,
};
use std::sync::Arc;

/// Springs along their rest direction, and a solid: of both, unlike isotropic springs, the compliance has blocks of
/// nine numbers.
const AXIAL: Material = Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness: 300.0 });
const SOLID: Material =
    Material::Elastic(ElasticSpec { young: 1e4, poisson: 0.3, cell: Some(0.01), inclusions: Vec::new() });

/// Every `stride`-th configuration of the scene's grid, from number `first` on.
fn configurations(scene: &Scene, first: usize, stride: usize) -> Vec<JointVector> {
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
    (first..points).step_by(stride).map(configuration).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Relative agreement of U and of the torque (1): a hundred times the residual to which results are settled in f64, for
/// soft directions.
const AGREEMENT: f64 = 100.0 * GPU_SETTLED_RESIDUAL;

/// Agreement of gaps (m): coordinates of about 0.2 m rounded a few times by 6e-8.
const GAP_AGREEMENT: f64 = 1e-7;

/// What differs between the CPU's and the GPU's result beyond what they owe each other, or `None`.
fn difference(cpu: &Equilibrium, gpu: &Equilibrium) -> Option<String> {
    let gap = (cpu.gap - gpu.gap).abs();
    if cpu.status != gpu.status || gap > GAP_AGREEMENT {
        return Some(format!("status {:?}, {:?}; gap {gap:.1e} m", cpu.status, gpu.status));
    }
    if cpu.status != Status::Contact {
        return None;
    }
    let energy = (cpu.energy - gpu.energy).abs() / cpu.energy;
    let torque = distance(&cpu.torque, &gpu.torque) / cpu.torque.norm();
    (!(energy <= AGREEMENT && torque <= AGREEMENT)).then(|| format!("U {energy:.1e}, tau {torque:.1e}"))
}

/// Share by which f32 may miss an invariant that is recomputed in f64 (1).
const INVARIANT_AGREEMENT: f64 = 1e-4;

/// What is rounded of a depth recomputed in f64 at the exact proxy position (m).
const DEPTH_AGREEMENT: f64 = 1e-7;

/// Which law a result of the energy form breaks, recomputed in f64 from its forces alone, or `None`.
fn broken_law(model: &Model, q: &JointVector, result: &Equilibrium) -> Option<String> {
    let pose = {
        let mut pose = model.chain.new_pose();
        model.chain.pose(q, &mut pose);
        pose
    };
    // Force balance: u = K^-1 f.
    let displacement = |node: u32| -> DVec3 {
        let compliance = &model.compliance;
        result.forces.iter().map(|f| compliance.block(node as usize, f.node as usize) * f.force).sum()
    };
    let mut torque = JointVector::zeros(q.len());
    let mut energy = 0.0;
    for touch in &result.touches {
        model.chain.add_torque(&pose, touch.proxy_node as usize, touch.force, &mut torque);
        let magnitude = touch.force.length();
        // Contact law: lambda = kc depth, and compression: lambda > 0 outwards.
        let foot: DVec3 = (touch.carriers.iter())
            .map(|&(node, weight)| (model.object.rest[node as usize] + displacement(node)) * weight)
            .sum();
        let radius = model.chain.nodes[touch.proxy_node as usize].radius;
        let toward = foot - pose.nodes[touch.proxy_node as usize];
        let normal = touch.force / magnitude;
        let push = |touch: &Touch| touch.force.length() / model.kc;
        let depth = radius + normal.dot(toward);
        if (depth - push(touch)).abs() > DEPTH_AGREEMENT + INVARIANT_AGREEMENT * depth.abs() {
            return Some(format!("contact law: depth {depth:e} m, force {magnitude:e} N"));
        }
        let outward =
            model.object.triangles.iter().find(|t| t.iter().all(|n| touch.carriers.iter().any(|(node, _)| node == n)));
        let corners = outward.map(|t| t.map(|n| model.object.rest[n as usize] + displacement(n)));
        let Some([a, b, c]) = corners else { return Some(format!("no triangle {:?}", touch.carriers)) };
        if (b - a).cross(c - a).dot(normal) < 0.0 {
            return Some("tension".into());
        }
        energy += 0.5 * model.kc * push(touch) * depth;
    }
    for force in &result.forces {
        // The object's nodes carry what the touches press on them.
        let pressed: DVec3 = (result.touches.iter())
            .flat_map(|touch| touch.carriers.iter().map(|&(node, weight)| (node, touch.force * -weight)))
            .filter_map(|(node, part)| (node == force.node).then_some(part))
            .sum();
        if force.force.distance(pressed) > 1e-5 * pressed.length() {
            return Some(format!("node {} carries {} N of {pressed} N", force.node, force.force));
        }
        energy += 0.5 * force.force.dot(displacement(force.node));
    }
    if distance(&torque, &result.torque) > 1e-12 * torque.norm() {
        return Some(format!("tau {:?} is not J^T f {torque:?}", result.torque));
    }
    if (energy - result.energy).abs() > INVARIANT_AGREEMENT * energy {
        return Some(format!("U {:e}, by its forces {energy:e}", result.energy));
    }
    None
}

/// Room for all, with f64 on the device where that is asked for and there.
fn room(double: bool) -> BatchCapacity {
    BatchCapacity { double, ..BatchCapacity::default() }
}

/// Whether f64 on the device is used.
const PRECISIONS: [bool; 2] = [true, false];

/// Solves a part of a scene on both sides; asserts agreement and, of the energy form, its laws.
fn check_scene(name: &str, material: Option<Material>, stride: usize) {
    let (scene, object, chain) = load_of(name, material.clone());
    let configurations = configurations(&scene, 11, stride);
    let model = Model::new(&object, &chain, scene.contact);
    assert_eq!(model.compliance.rows_per_node, if material.is_some() { 3 } else { 1 });
    for double in PRECISIONS {
        let gpu = GpuSolver::with_room(context(), &model, room(double)).unwrap();
        check_solver(name, &model, gpu, &configurations);
    }
}

/// The same by one solver.
fn check_solver(name: &str, model: &Model, mut gpu: GpuSolver, configurations: &[JointVector]) {
    let mut cpu = Solver::new(model);
    let results = gpu.solve(configurations).unwrap();
    assert_eq!(results.len(), configurations.len());
    let (mut touching, mut unlike) = (0, Vec::new());
    for (q, result) in configurations.iter().zip(&results) {
        let reference = cpu.solve(q);
        if reference.status == Status::Contact {
            touching += 1;
            if result.status == Status::Contact {
                assert_eq!(broken_law(model, q, result), None, "{name}, {q:?}");
            }
        }
        unlike.extend(difference(&reference, result).map(|difference| format!("{q:?}: {difference}")));
    }
    assert!(touching >= 15, "{name}: only {touching} configurations in contact");
    assert!(unlike.is_empty(), "{name}: {unlike:#?}");
    // Left to the CPU: what lies within rounding of no contact, about 1e-6 of all, and what does not settle: about one
    // in twenty.
    println!("{name}: {touching} touch, {} by the CPU", gpu.left_to_cpu());
    assert!(gpu.left_to_cpu() * 5 <= touching, "{name}: {} left to the CPU", gpu.left_to_cpu());
}

#[test]
fn the_sphere_has_the_same_equilibria_on_gpu_and_cpu() {
    check_scene("sphere.toml", None, 131);
}

#[test]
fn the_mesh_has_the_same_equilibria_on_gpu_and_cpu() {
    check_scene("mesh.toml", None, 101);
}

#[test]
fn the_smooth_surface_has_the_same_equilibria_on_gpu_and_cpu() {
    let scenes = [("sphere.toml", 131), ("mesh.toml", 101)];
    for ((name, stride), double) in scenes.into_iter().flat_map(|scene| [(scene, true), (scene, false)]) {
        let (scene, object, chain) = load(name);
        let contact = ContactSpec { surface: ContactSurface::Smooth, ..scene.contact };
        let model = Model::new(&object, &chain, contact);
        let configurations = configurations(&scene, 11, stride);
        let mut cpu = Solver::new(&model);
        let mut gpu = GpuSolver::with_room(context(), &model, room(double)).unwrap();
        let results = gpu.solve(&configurations).unwrap();
        let mut touching = 0;
        for (q, result) in configurations.iter().zip(&results) {
            let reference = cpu.solve(q);
            touching += usize::from(reference.status == Status::Contact);
            assert_eq!(difference(&reference, result), None, "{name}, {q:?}");
        }
        println!("{name}, smooth: {touching} touch, {} by the CPU", gpu.left_to_cpu());
        assert!(touching >= 15, "{touching} touch");
        assert!(gpu.left_to_cpu() * 5 <= touching, "{touching} touch, {}", gpu.left_to_cpu());
    }
}

#[test]
fn objects_that_are_not_isotropic_have_the_same_equilibria_on_gpu_and_cpu() {
    for material in [AXIAL, SOLID] {
        check_scene("sphere.toml", Some(material), 131);
    }
}

/// The model of the sphere that covers the nodes about its top.
fn part<'a>((scene, object, chain): &'a (Scene, Object, Chain)) -> Model<'a> {
    let mut model = Model::new(object, chain, scene.contact);
    let reached = |node: &u32| model.surface.positions[*node as usize].dot(DVec3::new(-0.3, 0.0, 1.0)) > 0.015;
    let nodes = (0..object.surface_nodes as u32).filter(reached).collect();
    model.take_compliance(Compliance::on(object, nodes).unwrap());
    model
}

/// Of a large object only the compliance within reach is formed: equilibria are the CPU's, and so is what reaches
/// beyond.
#[test]
fn a_part_of_the_compliance_gives_the_cpus_equilibria() {
    let [isotropic, axial] = [None, Some(AXIAL)].map(|material| load_of("sphere.toml", material));
    let configurations = configurations(&isotropic.0, 11, 131);
    for of in [&isotropic, &axial] {
        let model = part(of);
        let mut cpu = Solver::new(&model);
        let (mut touching, mut beyond) = (0, 0);
        for double in PRECISIONS {
            let mut gpu = GpuSolver::with_room(context(), &model, room(double)).unwrap();
            let results = gpu.solve(&configurations).unwrap();
            (touching, beyond) = (0, 0);
            for (q, result) in configurations.iter().zip(&results) {
                let reference = cpu.solve(q);
                assert_eq!(difference(&reference, result), None, "{q:?}");
                touching += usize::from(reference.status == Status::Contact);
                beyond += usize::from(reference.status == Status::Overflow);
            }
        }
        println!("{touching} touch, {beyond} reach beyond");
        assert!(touching >= 3 && beyond >= 3, "{touching}, {beyond}");
    }
}

/// Configurations whose gap at rest is `wanted` (m) by f64, each between one in contact and a free one next to it in
/// `path`.
fn grazing(cpu: &mut Solver, path: &[JointVector], wanted: f64) -> Vec<JointVector> {
    let mut over = |q: &JointVector| cpu.gap(q) - wanted;
    let mut found = Vec::new();
    for pair in path.windows(2) {
        let (mut low, mut high) = (pair[0], pair[1]);
        if (over(&low) < 0.0) == (over(&high) < 0.0) {
            continue;
        }
        if over(&low) >= 0.0 {
            std::mem::swap(&mut low, &mut high);
        }
        // Steps of 2^-50 of the way: gaps to the last bit of some 0.1 m.
        for _ in 0..50 {
            let mut middle = low;
            middle.iter_mut().zip(high.iter()).for_each(|(middle, high)| *middle = 0.5 * (*middle + high));
            if over(&middle) < 0.0 { low = middle } else { high = middle }
        }
        found.push(high);
    }
    found
}

/// A gap that f32 cannot tell from none, points and balls, where shaders have no f64: contact or not, and what comes of
/// it, is the CPU's.
#[test]
fn contact_within_rounding_of_none_is_decided_in_f64() {
    for name in ["sphere.toml", "mesh.toml"] {
        let (scene, object, chain) = load(name);
        let path = configurations(&scene, 11, 101);
        let model = Model::new(&object, &chain, scene.contact);
        let mut cpu = Solver::new(&model);
        for wanted in [-1e-9, -1e-11, 1e-11, 1e-9] {
            let near = grazing(&mut cpu, &path, wanted);
            assert!(near.len() >= 5, "{name}: only {} configurations", near.len());
            let mut gpu = GpuSolver::with_room(context(), &model, room(false)).unwrap();
            for (q, result) in near.iter().zip(gpu.solve(&near).unwrap()) {
                let reference = cpu.solve(q);
                let status = if wanted < 0.0 { Status::Contact } else { Status::Free };
                assert_eq!((reference.status, result.status), (status, status), "{name}, {q:?}, {wanted:e}");
                assert!((result.gap - wanted).abs() < 1e-14, "{name}: gap {:e} for {wanted:e}", result.gap);
                assert_eq!(format!("{result:?}"), format!("{reference:?}"), "the f64 result itself");
            }
            assert_eq!(gpu.left_to_cpu(), near.len(), "{name}, {wanted:e}");
        }
    }
}

/// Where shaders have f64 contact or not is decided on the device, to the last bits, on flat facets and on the smooth
/// surface; none of those that are free is left to the CPU.
#[test]
fn contact_or_not_is_exact_on_a_device_with_f64() {
    for (name, surface) in [
        ("sphere.toml", ContactSurface::Facets),
        ("sphere.toml", ContactSurface::Smooth),
        ("mesh.toml", ContactSurface::Smooth),
    ] {
        let (scene, object, chain) = load(name);
        let contact = ContactSpec { surface, ..scene.contact };
        let model = Model::new(&object, &chain, contact);
        let mut gpu = GpuSolver::new(context(), &model).unwrap();
        assert_eq!(gpu.is_exact(), context().adapter().double);
        if !gpu.is_exact() {
            return;
        }
        let path = configurations(&scene, 11, 101);
        let mut cpu = Solver::new(&model);
        for wanted in [-1e-9, -1e-13, 1e-13, 1e-9] {
            let near = grazing(&mut cpu, &path, wanted);
            assert!(near.len() >= 5, "{name}: only {} configurations", near.len());
            let before = gpu.left_to_cpu();
            for (q, result) in near.iter().zip(gpu.solve(&near).unwrap()) {
                let status = if wanted < 0.0 { Status::Contact } else { Status::Free };
                assert_eq!(result.status, status, "{name}, {surface:?}, {q:?}, {wanted:e}");
                assert!((result.gap - wanted).abs() < 1e-14, "{name}: gap {:e} for {wanted:e}", result.gap);
            }
            if wanted > 0.0 {
                assert_eq!(gpu.left_to_cpu(), before, "{name}, {surface:?}, {wanted:e}");
            }
        }
        // And of all that are free the gap is the CPU's.
        let results = gpu.solve(&path).unwrap();
        let free: Vec<_> = path.iter().zip(&results).filter(|(_, result)| result.status == Status::Free).collect();
        assert!(free.len() >= 5, "{name}: {}", free.len());
        for (q, result) in free {
            let gap = cpu.gap(q);
            assert!((result.gap - gap).abs() < 1e-14, "{name}, {surface:?}, {q:?}: {:e}, {gap:e}", result.gap);
        }
    }
}

/// An arm whose placement f32 rounds by more than the object's size suggests: contact that is shallower than that
/// rounding is found all the same.
#[test]
fn an_arm_much_longer_than_the_object_touches_where_the_cpus_does() {
    let scene = Scene::parse(LONG_ARM, "long_arm.toml").unwrap();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let mut cpu = Solver::new(&model);
    let mut gpu = GpuSolver::new(context(), &model).unwrap();
    let path = configurations(&scene, 0, 1);
    for wanted in [-4e-8, -1.5e-8, 1.5e-8, 4e-8] {
        let near = grazing(&mut cpu, &path, wanted);
        assert!(near.len() >= 100, "only {} configurations", near.len());
        let results = gpu.solve(&near).unwrap();
        let wrong = results.iter().filter(|result| (result.status == Status::Free) != (wanted > 0.0)).count();
        assert_eq!(wrong, 0, "of {} at {wanted:e} m", near.len());
    }
}

/// Two links of half a metre over a sphere of 20 mm.
const LONG_ARM: &str = r#"
    [object]
    sphere = { centre = [0.7, 0.5, 0.3], radius = 0.01, rings = 8, segments = 10 }
    springs = { kind = "isotropic", stiffness = 300.0 }
    ground = { stiffness = 100.0 }
    [contact]
    stiffness = 300.0
    [grid]
    axes = [{ start = 0.60, stop = 0.64, count = 101 }, { start = -0.03, stop = 0.03, count = 31 }]
    [[proxy.joint]]
    kind = "revolute"
    axis = [0.0, 0.0, 1.0]
    limits = [-3.0, 3.0]
    [[proxy.joint]]
    kind = "revolute"
    origin = [0.5, 0.0, 0.3]
    axis = [0.0, 1.0, 0.0]
    limits = [-3.0, 3.0]
    nodes = [{ from = [0.34, 0.0, 0.0], to = [0.38, 0.0, 0.0], count = 9 }]
"#;

#[test]
fn the_comparators_reject_perturbed_results() {
    let (scene, object, chain) = load("sphere.toml");
    let model = Model::new(&object, &chain, scene.contact);
    let mut cpu = Solver::new(&model);
    let (q, good) = configurations(&scene, 11, 131)
        .into_iter()
        .map(|q| (q, cpu.solve(&q)))
        .find(|(_, result)| result.touches.len() >= 2)
        .unwrap();
    assert_eq!(difference(&good, &good), None);
    assert_eq!(broken_law(&model, &q, &good), None);
    let perturbed = |change: &dyn Fn(&mut Equilibrium)| {
        let mut bad = good.clone();
        change(&mut bad);
        bad
    };
    assert!(difference(&good, &perturbed(&|bad| bad.torque.iter_mut().for_each(|tau| *tau *= 1.0 + 3e-5))).is_some());
    assert!(difference(&good, &perturbed(&|bad| bad.energy *= 1.0 + 3e-5)).is_some());
    assert!(difference(&good, &perturbed(&|bad| bad.gap += 1e-6)).is_some());
    assert!(difference(&good, &perturbed(&|bad| bad.status = Status::Unconverged)).is_some());
    assert!(
        broken_law(&model, &q, &perturbed(&|bad| bad.torque.iter_mut().for_each(|tau| *tau *= 1.0 + 1e-9))).is_some()
    );
    assert!(broken_law(&model, &q, &perturbed(&|bad| bad.energy *= 1.0 + 3e-4)).is_some());
    assert!(broken_law(&model, &q, &perturbed(&|bad| bad.forces[0].force *= 1.01)).is_some());
    assert!(broken_law(&model, &q, &perturbed(&|bad| bad.touches[0].force *= -1.0)).is_some());
    let swap = |bad: &mut Equilibrium| {
        let carriers = &mut bad.touches[0].carriers;
        (carriers[0].1, carriers[1].1) = (carriers[1].1, carriers[0].1);
    };
    assert!(broken_law(&model, &q, &perturbed(&swap)).is_some());
}

#[test]
fn sizes_of_sections_leave_no_trace() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = configurations(&scene, 5, 211);
    let model = Model::new(&object, &chain, scene.contact);
    let solve = |room| GpuSolver::with_room(context(), &model, room).unwrap().solve(&configurations).unwrap();
    let whole = solve(BatchCapacity::default());
    let pieces = solve(BatchCapacity { chunk: 7, ..BatchCapacity::default() });
    assert!(whole.iter().any(|result| result.status == Status::Contact));
    assert_eq!(format!("{whole:?}"), format!("{pieces:?}"), "bit for bit");
    // One section after the other, and more lanes than sections.
    for in_flight in [1, 8] {
        let results = solve(BatchCapacity { chunk: 7, in_flight, ..BatchCapacity::default() });
        assert_eq!(format!("{whole:?}"), format!("{results:?}"), "{in_flight} in flight");
    }
    // Fewer searches together than a section has in contact.
    let results = solve(BatchCapacity { searches: 3, ..BatchCapacity::default() });
    assert_eq!(format!("{whole:?}"), format!("{results:?}"), "three searches together");
}

/// One adapter opened twice is two devices to the solver.
#[test]
fn two_devices_find_what_one_finds() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = configurations(&scene, 5, 211);
    let model = Model::new(&object, &chain, scene.contact);
    let room = BatchCapacity { chunk: 16, ..BatchCapacity::default() };
    let one = GpuSolver::with_room(context(), &model, room).unwrap().solve(&configurations).unwrap();
    let other = Arc::new(Context::open(AdapterChoice::Any).unwrap());
    let mut solver = GpuSolver::on(vec![context(), other], &model, room).unwrap();
    assert_eq!(solver.adapters().count(), 2);
    assert_eq!(format!("{one:?}"), format!("{:?}", solver.solve(&configurations).unwrap()), "bit for bit");
}

/// What is recorded of a device and returned at once leaves the host the same work, and the same results.
#[test]
fn a_recording_stands_for_its_device() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = configurations(&scene, 5, 211);
    let model = Model::new(&object, &chain, scene.contact);
    let mut solver = GpuSolver::new(context(), &model).unwrap();
    let found = solver.solve(&configurations).unwrap();
    let mut replayed = GpuSolver::of(vec![solver.record(&configurations).unwrap()], &model);
    for turn in 0..2 {
        assert_eq!(format!("{found:?}"), format!("{:?}", replayed.solve(&configurations).unwrap()), "turn {turn}");
    }
    let time = replayed.host_time();
    assert!(!time.settling.is_zero() && !time.reading.is_zero());
}

#[test]
fn contacts_beyond_the_kernels_room_are_solved_on_the_cpu() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = configurations(&scene, 11, 131);
    let model = Model::new(&object, &chain, scene.contact);
    let mut cpu = Solver::new(&model);
    for double in PRECISIONS {
        let mut gpu = GpuSolver::with_room(context(), &model, BatchCapacity { contacts: 2, ..room(double) }).unwrap();
        let results = gpu.solve(&configurations).unwrap();
        let mut crowded = 0;
        for (q, result) in configurations.iter().zip(&results) {
            assert_ne!(result.status, Status::Overflow);
            let reference = cpu.solve(q);
            if reference.touches.len() > 2 {
                crowded += 1;
                assert_eq!(format!("{result:?}"), format!("{reference:?}"), "the f64 result itself");
            }
        }
        assert!(crowded > 1, "only {crowded}");
        assert!(gpu.left_to_cpu() >= crowded);
    }
}

#[test]
fn no_configuration_is_no_work() {
    let (scene, object, chain) = load("sphere.toml");
    let model = Model::new(&object, &chain, scene.contact);
    assert!(GpuSolver::new(context(), &model).unwrap().solve(&[]).unwrap().is_empty());
}

/// What the kernels do not solve is refused, and left to the CPU where the choice is free.
#[test]
fn other_algorithms_are_refused() {
    let (scene, object, chain) = load("sphere.toml");
    let mut model = Model::new(&object, &chain, scene.contact);
    assert!(GpuSolver::new(context(), &model).is_ok());
    for algorithm in [Algorithm::Rest, Algorithm::Paper] {
        model.contact.algorithm = algorithm;
        let refusal = GpuSolver::new(context(), &model).err().unwrap();
        assert!(matches!(refusal, GpuError::Algorithm(_)), "{refusal}");
        assert!(
            refusal.to_string().contains(algorithm.name()) && refusal.to_string().contains("--backend cpu"),
            "{refusal}"
        );
    }
}

/// The scene's tolerance is what accuracy costs on the GPU too: the rougher it is the fewer steps are taken, in f32 and
/// f64.
#[test]
fn a_rougher_tolerance_takes_fewer_steps_and_is_kept() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = configurations(&scene, 11, 131);
    let [fine, rough] = [1e-8, 1e-4].map(|tolerance| {
        let model = Model::new(&object, &chain, ContactSpec { tolerance, ..scene.contact });
        GpuSolver::with_room(context(), &model, room(false)).unwrap().solve(&configurations).unwrap()
    });
    let steps = |results: &[Equilibrium]| results.iter().map(|result| result.iterations).sum::<u32>();
    assert!(20 * steps(&rough) < 17 * steps(&fine), "{} and {}", steps(&rough), steps(&fine));
    let worst = |results: &[Equilibrium]| results.iter().map(|result| result.residual).fold(0.0, f64::max);
    assert!(worst(&fine) <= GPU_SETTLED_RESIDUAL && worst(&rough) <= 1e-4, "{:e}, {:e}", worst(&fine), worst(&rough));
    assert!(worst(&rough) > GPU_SETTLED_RESIDUAL);
}

/// At 600 times the paper's stiffness, where a depth in f32 says little: whatever is called converged is that.
#[test]
fn stiff_contact_is_as_accurate_as_soft_contact() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = configurations(&scene, 11, 131);
    for stiffness in [1e4, 3e5, f64::INFINITY] {
        let model = Model::new(&object, &chain, ContactSpec { stiffness, ..scene.contact });
        let mut cpu = Solver::new(&model);
        let mut gpu = GpuSolver::new(context(), &model).unwrap();
        let (mut touching, mut worst) = (0, 0.0f64);
        for (q, result) in configurations.iter().zip(gpu.solve(&configurations).unwrap()) {
            if result.status == Status::Contact {
                touching += 1;
                worst = worst.max(result.residual);
                // From the f32 result f64 finds the CPU's own, unless there are two equilibria.
                let reference = cpu.solve(q);
                let same = (result.energy - reference.energy).abs() <= 1e-3 * reference.energy;
                if same && reference.status == Status::Contact {
                    let off = distance(&result.torque, &reference.torque) / reference.torque.norm();
                    assert!(
                        off < 1e-3,
                        "Kc {stiffness}, {q:?}: tau off by {off:.1e}, residual {:.1e}",
                        result.residual
                    );
                }
            }
        }
        println!("Kc {stiffness}: {touching} touch, residual {worst:.1e}, {} by the CPU", gpu.left_to_cpu());
        assert!(touching > 20 && worst <= 1e-4);
        // Found at the stiffness that f32 resolves, and stiffened in f64; at its own, three quarters of the rigid ones
        // are left.
        assert!(gpu.left_to_cpu() * 2 <= touching, "Kc {stiffness}: {} left to the CPU", gpu.left_to_cpu());
    }
}
