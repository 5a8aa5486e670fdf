//! Equilibria of the GPU backend against the CPU's.

use super::fixture::{context, load, load_of, on_grid};
use glam::DVec3;
use haptize::{
    JointVector,
    contact::{Equilibrium, Model, Solver, Status},
    fixtures::Random,
    gpu::{AdapterChoice, BatchCapacity, Context, GpuError, GpuSolver},
    joint_matrix::lower,
    object::{Compliance, Object},
    proxy::Chain,
    scene::{
        ContactLaw, ContactSpec, ContactSurface, ElasticSpec, Follows, Material, ProxySpec, Scene, SpringKind,
        SpringSpec,
    },
    sweep::Backend,
};
use std::sync::Arc;

/// Springs along their rest direction, and a solid: of both, unlike isotropic springs, the compliance has blocks of
/// nine numbers.
const AXIAL: Material = Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness: 300.0 });
const SOLID: Material =
    Material::Elastic(ElasticSpec { young: 1e4, poisson: 0.3, cell: Some(0.01), inclusions: Vec::new() });

/// Agreement of energies, torques and forces, over the greatest of all configurations (1). Places in f32 are off by up
/// to 5e-8 m, about 1e-5 of the depths of some millimetres; energies and torques follow by the second and first power.
const AGREEMENT: f64 = 3e-5;

/// The same of tangents, whose curvatures are differences: within a tenth of an edge of where
/// the closest point leaps they leave this much out.
const TANGENT_AGREEMENT: f64 = 4e-3;

/// Agreement of gaps (m): coordinates of up to half a metre rounded a few times by 6e-8.
const GAP_AGREEMENT: f64 = 3e-7;

/// Greatest differences between the results of both, over the greatest result: of U, torque, forces on the object, and
/// tangents.
#[derive(Debug, Default)]
struct Off {
    energy: f64,
    torque: f64,
    force: f64,
    tangent: f64,
}

fn worst(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, f64::max)
}

/// The forces on all nodes of the object.
fn by_node(equilibrium: &Equilibrium, nodes: usize) -> Vec<DVec3> {
    let mut all = vec![DVec3::ZERO; nodes];
    equilibrium.forces.iter().for_each(|force| all[force.node as usize] = force.force);
    all
}

/// The lower triangle of a tangent; empty where there is none.
fn entries(equilibrium: &Equilibrium) -> Vec<f64> {
    equilibrium.tangent.iter().flat_map(|tangent| lower(tangent, equilibrium.torque.len())).collect()
}

/// Compares results; statuses and gaps must be alike.
fn compare(cpu: &[Equilibrium], gpu: &[Equilibrium], nodes: usize) -> Result<Off, String> {
    let mut off = Off::default();
    let mut size = Off::default();
    for (k, (cpu, gpu)) in cpu.iter().zip(gpu).enumerate() {
        let gap = (cpu.gap - gpu.gap).abs();
        if cpu.status != gpu.status || gap.is_nan() || gap > GAP_AGREEMENT {
            return Err(format!("{k}: status {:?}, {:?}; gap {gap:.1e} m", cpu.status, gpu.status));
        }
        let difference = |a: &[f64], b: &[f64]| worst(a.iter().zip(b).map(|(a, b)| (a - b).abs()));
        let greatest = |a: &[f64]| worst(a.iter().map(|a| a.abs()));
        off.energy = off.energy.max((cpu.energy - gpu.energy).abs());
        size.energy = size.energy.max(cpu.energy);
        off.torque = off.torque.max(difference(&cpu.torque, &gpu.torque));
        size.torque = size.torque.max(greatest(&cpu.torque));
        let forces = [cpu, gpu].map(|it| by_node(it, nodes));
        off.force = off.force.max(worst(forces[0].iter().zip(&forces[1]).map(|(a, b)| a.distance(*b))));
        size.force = size.force.max(worst(forces[0].iter().map(|force| force.length())));
        if cpu.tangent.is_some() != gpu.tangent.is_some() {
            return Err(format!("{k}: one tangent"));
        }
        off.tangent = off.tangent.max(difference(&entries(cpu), &entries(gpu)));
        size.tangent = size.tangent.max(greatest(&entries(cpu)));
        let pushed = [cpu, gpu].map(|it| it.on_proxy().map(|(_, force)| force).sum::<DVec3>());
        off.force = off.force.max(pushed[0].distance(pushed[1]));
    }
    let over = |off: f64, size: f64| if size > 0.0 { off / size } else { off };
    Ok(Off {
        energy: over(off.energy, size.energy),
        torque: over(off.torque, size.torque),
        force: over(off.force, size.force),
        tangent: over(off.tangent, size.tangent),
    })
}

/// What differs beyond what is owed to f32, or `None`.
fn difference(cpu: &[Equilibrium], gpu: &[Equilibrium], nodes: usize) -> Option<String> {
    match compare(cpu, gpu, nodes) {
        Err(unlike) => Some(unlike),
        Ok(off) => {
            let agrees = off.energy <= AGREEMENT && off.torque <= AGREEMENT && off.force <= 10.0 * AGREEMENT;
            (!(agrees && off.tangent <= TANGENT_AGREEMENT)).then(|| format!("{off:?}"))
        }
    }
}

/// Solves `configurations` on both sides; asserts agreement, and that at most one in `share` of those in contact is left
/// to the CPU.
fn check(what: &str, model: &Model, configurations: &[JointVector], share: usize) {
    let mut cpu = Solver::new(model);
    let reference: Vec<Equilibrium> = configurations.iter().map(|q| cpu.solve(q)).collect();
    let mut gpu = GpuSolver::new(context(), model).unwrap();
    let results = gpu.solve(configurations).unwrap();
    assert_eq!(results.len(), configurations.len());
    let touching = reference.iter().filter(|result| result.status == Status::Contact).count();
    println!("{what}: {touching} touch, {} by the CPU", gpu.left_to_cpu());
    println!("  {:?}", compare(&reference, &results, model.object.rest.len()));
    assert!(touching >= 15, "{what}: only {touching} configurations in contact");
    assert_eq!(difference(&reference, &results, model.object.rest.len()), None, "{what}");
    assert!(gpu.left_to_cpu() * share <= touching, "{what}: {} left to the CPU", gpu.left_to_cpu());
}

/// Flat and bent facets, points and balls, springs and a solid, with tangents and without.
#[test]
fn all_scenes_have_the_same_equilibria_on_gpu_and_cpu() {
    for (name, material, surface, stride) in [
        ("sphere.toml", None, ContactSurface::Facets, 131),
        ("sphere.toml", None, ContactSurface::Smooth, 131),
        ("sphere.toml", Some(SOLID), ContactSurface::Smooth, 131),
        ("mesh.toml", None, ContactSurface::Smooth, 101),
        ("touch.toml", None, ContactSurface::Smooth, 19),
        ("organ.toml", None, ContactSurface::Smooth, 7),
    ] {
        let (scene, object, chain) = load_of(name, material);
        let mut model = Model::new(&object, &chain, ContactSpec { surface, ..scene.contact });
        model.with_tangent = surface == ContactSurface::Smooth;
        // Beside the grid: on it symmetric arms touch edges of symmetric meshes, and rounding decides on which facet.
        let mut configurations = on_grid(&scene, 11, stride);
        for q in &mut configurations {
            q.iter_mut().zip(&scene.grid.axes).for_each(|(x, axis)| *x += 0.37 * axis.step);
        }
        let what = format!("{name}, {surface:?}, {} a node", model.compliance.rows_per_node);
        check(&what, &model, &configurations, 20);
    }
}

/// The kernel moves links, whose torques and tangents are gathered by the joints that move them.
#[test]
fn joints_that_follow_others_have_the_same_equilibria_on_gpu_and_cpu() {
    let (scene, object, chain) = load("sphere.toml");
    let mut joints = chain.joints;
    // As the second joint goes through its range, the third goes about its middle, the other way.
    let [turn, lift, bend] = [0, 1, 2].map(|k| joints[k].limits);
    let [middle_lift, middle_bend] = [lift, bend].map(|[least, greatest]| 0.5 * (least + greatest));
    let multiplier = -0.5;
    let offset = middle_bend - multiplier * middle_lift;
    joints[2].follows = Some(Follows { joint: joints[1].name.clone(), multiplier, offset });
    let chain = Chain::new(&ProxySpec::new(joints).unwrap());
    let surface = ContactSurface::Smooth;
    let mut model = Model::new(&object, &chain, ContactSpec { surface, ..scene.contact });
    model.with_tangent = true;
    let mut random = Random::new(3);
    let mut place = |[least, greatest]: [f64; 2]| random.between(least, greatest);
    let configurations: Vec<JointVector> =
        (0..200).map(|_| [turn, lift].map(&mut place).into_iter().collect()).collect();
    check("followers", &model, &configurations, 20);
}

/// In stiff contact the matrix of the program is nearly singular where nodes are closer than the body resolves.
#[test]
fn stiff_contact_is_as_accurate_as_soft_contact() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = on_grid(&scene, 11, 131);
    for stiffness in [1e4, 3e5, f64::INFINITY] {
        let model = Model::new(&object, &chain, ContactSpec { stiffness, ..scene.contact });
        check(&format!("Kc {stiffness}"), &model, &configurations, 4);
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
    for of in [None, Some(AXIAL)].map(|material| load_of("sphere.toml", material)) {
        let (model, configurations) = (part(&of), on_grid(&of.0, 11, 131));
        let mut cpu = Solver::new(&model);
        let reference: Vec<Equilibrium> = configurations.iter().map(|q| cpu.solve(q)).collect();
        let results = GpuSolver::new(context(), &model).unwrap().solve(&configurations).unwrap();
        assert_eq!(difference(&reference, &results, of.1.rest.len()), None);
        let count = |status| reference.iter().filter(|result| result.status == status).count();
        let (touching, beyond) = (count(Status::Contact), count(Status::Overflow));
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

/// A gap that f32 cannot tell from none, points and balls: contact or not, and what comes of it, is the CPU's.
#[test]
fn contact_within_rounding_of_none_is_decided_in_f64() {
    for name in ["sphere.toml", "mesh.toml"] {
        let (scene, object, chain) = load(name);
        let path = on_grid(&scene, 11, 101);
        let mut model = Model::new(&object, &chain, scene.contact);
        model.with_tangent = name == "mesh.toml";
        let mut cpu = Solver::new(&model);
        for wanted in [-1e-9, -1e-11, 1e-11, 1e-9] {
            let near = grazing(&mut cpu, &path, wanted);
            assert!(near.len() >= 5, "{name}: only {} configurations", near.len());
            let mut gpu = GpuSolver::new(context(), &model).unwrap();
            for (q, result) in near.iter().zip(gpu.solve(&near).unwrap()) {
                let reference = cpu.solve(q);
                let status = if wanted < 0.0 { Status::Contact } else { Status::Free };
                assert_eq!((reference.status, result.status), (status, status), "{name}, {q:?}, {wanted:e}");
                assert_eq!(format!("{result:?}"), format!("{reference:?}"), "the f64 result itself");
            }
            assert_eq!(gpu.left_to_cpu(), near.len(), "{name}, {wanted:e}");
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
    let path = on_grid(&scene, 0, 1);
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
    law = "rest"
    surface = "facets"
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
fn the_comparator_rejects_perturbed_results() {
    let (scene, object, chain) = load("sphere.toml");
    let mut model = Model::new(&object, &chain, scene.contact);
    model.with_tangent = true;
    let mut cpu = Solver::new(&model);
    let good: Vec<Equilibrium> = on_grid(&scene, 11, 131).iter().map(|q| cpu.solve(q)).collect();
    let nodes = object.rest.len();
    let greatest = |of: &dyn Fn(&Equilibrium) -> f64| {
        (0..good.len()).max_by(|&a, &b| of(&good[a]).total_cmp(&of(&good[b]))).unwrap()
    };
    assert_eq!(difference(&good, &good, nodes), None);
    let perturbed = |k: usize, change: &dyn Fn(&mut Equilibrium)| {
        let mut bad = good.clone();
        change(&mut bad[k]);
        difference(&good, &bad, nodes)
    };
    let strongest = greatest(&|it| worst(it.torque.iter().map(|torque| torque.abs())));
    assert!(perturbed(strongest, &|bad| bad.torque.iter_mut().for_each(|tau| *tau *= 1.0 + 1e-4)).is_some());
    assert!(perturbed(greatest(&|it| it.energy), &|bad| bad.energy *= 1.0 + 1e-4).is_some());
    assert!(perturbed(0, &|bad| bad.gap += 1e-6).is_some());
    assert!(perturbed(strongest, &|bad| bad.status = Status::Unconverged).is_some());
    assert!(perturbed(strongest, &|bad| bad.tangent = None).is_some());
    let stiffest = greatest(&|it| worst(entries(it).into_iter().map(f64::abs)));
    let stiffen =
        |bad: &mut Equilibrium| bad.tangent.iter_mut().for_each(|it| it.iter_mut().flatten().for_each(|x| *x *= 1.01));
    assert!(perturbed(stiffest, &stiffen).is_some());
    let pressed = greatest(&|it| worst(it.forces.iter().map(|force| force.force.length())));
    assert!(perturbed(pressed, &|bad| bad.forces.iter_mut().for_each(|it| it.force *= 1.001)).is_some());
    assert!(perturbed(pressed, &|bad| bad.touches[0].force *= -1.0).is_some());
}

#[test]
fn sizes_of_sections_leave_no_trace() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = on_grid(&scene, 5, 211);
    let model = Model::new(&object, &chain, scene.contact);
    let solve = |capacity| GpuSolver::on(vec![context()], &model, capacity).unwrap().solve(&configurations).unwrap();
    let whole = solve(BatchCapacity::default());
    assert!(whole.iter().any(|result| result.status == Status::Contact));
    for section in [7, 1] {
        let pieces = solve(BatchCapacity { section, ..BatchCapacity::default() });
        assert_eq!(format!("{whole:?}"), format!("{pieces:?}"), "bit for bit");
    }
}

/// One adapter opened twice is two devices to the solver.
#[test]
fn two_devices_find_what_one_finds() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = on_grid(&scene, 5, 211);
    let model = Model::new(&object, &chain, scene.contact);
    let capacity = BatchCapacity { section: 4, ..BatchCapacity::default() };
    let one = GpuSolver::on(vec![context()], &model, capacity).unwrap().solve(&configurations).unwrap();
    let other = Arc::new(Context::open(AdapterChoice::Any).unwrap());
    let mut solver = GpuSolver::on(vec![context(), other], &model, capacity).unwrap();
    assert_eq!(solver.adapters().count(), 2);
    assert_eq!(format!("{one:?}"), format!("{:?}", solver.solve(&configurations).unwrap()), "bit for bit");
}

#[test]
fn contacts_beyond_the_kernels_room_are_solved_on_the_cpu() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = on_grid(&scene, 11, 131);
    let model = Model::new(&object, &chain, scene.contact);
    let mut cpu = Solver::new(&model);
    let capacity = BatchCapacity { rows: 2, ..BatchCapacity::default() };
    let mut gpu = GpuSolver::on(vec![context()], &model, capacity).unwrap();
    let mut crowded = 0;
    for (q, result) in configurations.iter().zip(gpu.solve(&configurations).unwrap()) {
        let reference = cpu.solve(q);
        if reference.touches.len() > 2 {
            crowded += 1;
            assert_eq!(format!("{result:?}"), format!("{reference:?}"), "the f64 result itself");
        }
    }
    assert!(crowded > 1, "only {crowded}");
    assert!(gpu.left_to_cpu() >= crowded);
}

#[test]
fn no_configuration_is_no_work() {
    let (scene, object, chain) = load("sphere.toml");
    let model = Model::new(&object, &chain, scene.contact);
    assert!(GpuSolver::new(context(), &model).unwrap().solve(&[]).unwrap().is_empty());
}

/// What the kernel does not solve is refused, with the remedy.
#[test]
fn the_following_law_is_refused() {
    let (scene, object, chain) = load("sphere.toml");
    let mut model = Model::new(&object, &chain, scene.contact);
    assert!(GpuSolver::new(context(), &model).is_ok());
    model.contact.law = ContactLaw::Following;
    let refusal = GpuSolver::new(context(), &model).err().unwrap();
    assert!(matches!(refusal, GpuError::Law(_)), "{refusal}");
    let said = refusal.to_string();
    assert!(said.contains("following") && said.contains("law = \"rest\""), "{said}");
}
