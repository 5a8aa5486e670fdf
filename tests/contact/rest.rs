//! Contact with the surface at rest: the torque is the gradient of the energy, on every kind of body, at every
//! stiffness and depth.

use crate::fixture::{SPHERE_CENTRE, arm, arm_of_followers, random_configurations, sphere, torus};
use crate::rounded::{cuboid, rounded};
use glam::DVec3;
use haptize::JointVector;
use haptize::contact::{Backend, Equilibrium, Model, Solver, Status};
use haptize::fixtures::Random;
use haptize::fixtures::bodies::{self, PAPER};
use haptize::joint_matrix::lower;
use haptize::object::{Compliance, Object};
use haptize::proxy::Chain;
use haptize::scene::{
    ContactLaw, ContactSpec, ContactSurface, ElasticSpec, GroundNodes, GroundSpec, GroundStiffness, Material,
    ObjectSpec, Scene, Shape, SkinSpec, SpringKind,
};
use haptize::sweep::CpuBackend;

/// Contact at rest of stiffness kc at a contact point (N/m).
pub fn contact(kc: f64) -> ContactSpec {
    ContactSpec { surface: ContactSurface::Smooth, ..crate::fixture::contact(ContactLaw::Rest, kc / 3.0) }
}

/// An object, an arm, and configurations of it, most of which touch.
struct Sample {
    name: &'static str,
    object: Object,
    chain: Chain,
    places: Vec<Vec<f64>>,
}

/// The shipped scene of this name, with random configurations on its grid.
fn shipped(name: &'static str, count: usize) -> Sample {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("datasets/{name}.toml"));
    let scene = Scene::load(path).unwrap();
    let mut random = Random::new(5);
    let mut place = || {
        let axes = scene.grid.axes.iter();
        axes.map(|axis| random.between(axis.start, axis.start + axis.step * (axis.count - 1) as f64)).collect()
    };
    let places = (0..count).map(|_| place()).collect();
    Sample { name, object: Object::build(&scene.object).unwrap(), chain: Chain::new(&scene.proxy), places }
}

/// The paper's sphere of an elastic solid.
fn solid() -> Object {
    let mut spec = crate::fixture::spec(
        haptize::scene::Shape::Sphere { centre: crate::fixture::SPHERE_CENTRE, radius: 0.05, rings: 9, segments: 10 },
        SpringKind::Isotropic,
    );
    spec.material =
        Material::Elastic(ElasticSpec { young: 1e4, poisson: 0.3, cell: Some(0.01), inclusions: Vec::new() });
    Object::build(&spec).unwrap()
}

/// Bodies of every kind before an arm, each with as many random configurations.
fn bodies_of_all_kinds(count: usize) -> [Sample; 4] {
    let of = |name, object, radius| Sample {
        name,
        object,
        chain: Chain::new(&arm(radius)),
        places: random_configurations(7, count),
    };
    [
        of("springs", sphere(SpringKind::Isotropic), 0.0),
        of("springs along their length, balls", sphere(SpringKind::Axial), 0.008),
        of("torus", torus(), 0.0),
        of("solid", solid(), 0.0),
    ]
}

fn samples() -> Vec<Sample> {
    let mut samples = Vec::from(bodies_of_all_kinds(24));
    let places = random_configurations(7, 24).into_iter().map(|q| q[..2].to_vec()).collect();
    let chain = Chain::new(&arm_of_followers());
    samples.push(Sample { name: "followers", object: sphere(SpringKind::Isotropic), chain, places });
    samples.extend([shipped("mesh", 60), shipped("touch", 8000), shipped("organ", 200)]);
    samples
}

/// Proxy nodes that push, with the object's nodes that they push on.
fn touched(equilibrium: &Equilibrium) -> Vec<(u32, Vec<u32>)> {
    let carriers = |touch: &haptize::contact::Touch| touch.carriers.iter().map(|(node, _)| *node).collect();
    equilibrium.touches.iter().map(|touch| (touch.proxy_node, carriers(touch))).collect()
}

/// Step of central differences of the energy (rad or m): the third derivative leaves about its square, rounding of the
/// energy its 1e-16 over it.
const STEP: f64 = 1e-6;

/// The largest difference between the torque and minus the central difference of the energy, over the largest entry of
/// the torque, where contacts neither come nor go nor change facets: there U has no third derivative. None where that
/// is so along no joint.
pub fn gradient_error(solver: &mut Solver<'_>, q: &[f64], here: &Equilibrium, step: f64) -> Option<f64> {
    let mut worst: Option<f64> = None;
    for joint in 0..q.len() {
        let [before, after] = [-step, step].map(|step| {
            let mut moved = q.to_vec();
            moved[joint] += step;
            solver.solve(&moved)
        });
        if touched(&before) == touched(here) && touched(&after) == touched(here) {
            let slope = (before.energy - after.energy) / (2.0 * step);
            worst = Some(worst.unwrap_or(0.0).max((slope - here.torque[joint]).abs()));
        }
    }
    let size = here.torque.iter().fold(0.0_f64, |size, entry| size.max(entry.abs()));
    worst.map(|worst| worst / size)
}

#[test]
fn the_torque_is_the_gradient_of_the_energy() {
    for Sample { name, object, chain, places } in samples() {
        for kc in [10.0, 1e3, 1e7, 1e8] {
            let model = Model::new(&object, &chain, contact(kc));
            let mut solver = Solver::new(&model);
            let (mut checked, mut most, mut worst) = (0, 0, 0.0_f64);
            for q in &places {
                let here = solver.solve(q);
                if here.status == Status::Free {
                    continue;
                }
                assert_eq!(here.status, Status::Contact, "{name}, {kc} N/m, {q:?}");
                if let Some(error) = gradient_error(&mut solver, q, &here, STEP) {
                    worst = worst.max(error);
                    checked += 1;
                }
                most = most.max(here.touches.len());
            }
            println!("{name}, {kc:e} N/m: {checked} checked, up to {most} contacts, worst {worst:.1e}");
            assert!(checked > 3, "{name}, {kc} N/m: {checked}");
            assert!(worst < 1e-7, "{name}, {kc} N/m: {worst}");
        }
    }
}

/// The greatest difference between the tangent and the central differences of the torque, over the tangent's greatest
/// entry, where contacts neither come nor go nor change facets. None where that is so along no joint.
pub fn tangent_error(solver: &mut Solver<'_>, q: &[f64], here: &Equilibrium, step: f64) -> Option<f64> {
    let tangent = here.tangent.unwrap();
    let entries = lower(&tangent, q.len());
    let size = entries.fold(0.0_f64, |size, entry| size.max(entry.abs()));
    let mut worst: Option<f64> = None;
    for l in 0..q.len() {
        let [before, after] = [-step, step].map(|step| {
            let mut moved = q.to_vec();
            moved[l] += step;
            solver.solve(&moved)
        });
        if touched(&before) == touched(here) && touched(&after) == touched(here) {
            for (k, row) in tangent.iter().enumerate().take(q.len()) {
                assert_eq!(row[l], tangent[l][k]);
                let slope = (after.torque[k] - before.torque[k]) / (2.0 * step);
                worst = Some(worst.unwrap_or(0.0).max((slope - row[l]).abs() / size));
            }
        }
    }
    worst
}

#[test]
fn the_tangent_is_the_derivative_of_the_torque() {
    let others = samples().into_iter().filter(|sample| sample.name != "organ");
    for Sample { name, object, chain, places } in others.chain([shipped("sphere", 24)]) {
        for kc in [10.0, 1e3, 1e8] {
            let mut model = Model::new(&object, &chain, contact(kc));
            model.with_tangent = true;
            let mut solver = Solver::new(&model);
            let (mut checked, mut worst) = (0, 0.0_f64);
            for q in &places {
                let here = solver.solve(q);
                if here.status == Status::Contact
                    && let Some(error) = tangent_error(&mut solver, q, &here, STEP)
                {
                    worst = worst.max(error);
                    checked += 1;
                }
            }
            println!("{name}, {kc:e} N/m: {checked} checked, worst {worst:.1e}");
            assert!(checked > 3, "{name}, {kc} N/m: {checked}");
            // Coarse bodies are touched next to where the closest point leaps: there the differences err more.
            let limit = if ["mesh", "touch", "sphere"].contains(&name) { 1e-6 } else { 1e-5 };
            assert!(worst < limit, "{name}, {kc} N/m: {worst}");
        }
    }
}

/// Step of central differences by the logarithm of a stiffness: its square is what they leave.
const LOG_STEP: f64 = 1e-4;

/// Whatever changes the object's compliance, and the stiffness of contact, changes the torque as its sensitivity says.
#[test]
fn the_sensitivity_is_the_derivative_of_the_torque_by_what_the_object_is_made_of() {
    let spec = |[young, ground, bending]: [f64; 3]| ObjectSpec {
        material: Material::Elastic(ElasticSpec {
            young: 1e4 * young,
            poisson: 0.3,
            cell: Some(0.02),
            inclusions: Vec::new(),
        }),
        ground: Some(GroundSpec {
            stiffness: GroundStiffness::PerArea(1e6 * ground),
            nodes: GroundNodes::Below(SPHERE_CENTRE.z - 0.02),
        }),
        skin: Some(SkinSpec { tension: 0.0, bending: 0.01 * bending, foundation: 0.0 }),
        ..crate::fixture::spec(
            Shape::Sphere { centre: SPHERE_CENTRE, radius: 0.05, rings: 9, segments: 10 },
            SpringKind::Isotropic,
        )
    };
    let chain = Chain::new(&arm(0.008));
    let built = |k: usize, log: f64| {
        let mut factors = [1.0; 3];
        if k < 3 {
            factors[k] = log.exp()
        } else {
            factors.fill(log.exp())
        }
        Object::build(&spec(factors)).unwrap()
    };
    let here = built(0, 0.0);
    let model = Model::new(&here, &chain, contact(1e3));
    let mut solver = Solver::new(&model);
    let torque = |object: &Object, kc: f64, q: &[f64]| Solver::new(&Model::new(object, &chain, contact(kc))).solve(q);
    let places: Vec<Vec<f64>> = random_configurations(7, 40)
        .into_iter()
        .filter(|q| solver.solve(q).status == Status::Contact)
        .take(6)
        .collect();
    assert_eq!(places.len(), 6);
    let mut worst = [0.0_f64; 5];
    for (k, worst) in worst.iter_mut().enumerate() {
        // Of each stiffness of the object, of all of them, and of contact.
        let [before, after] = [-LOG_STEP, LOG_STEP].map(|log| built(k, if k < 4 { log } else { 0.0 }));
        let compliances = [&before, &after].map(Compliance::new);
        for q in &places {
            let equilibrium = solver.solve(q);
            let sensitivity = solver.sensitivity().unwrap();
            let kc = |log: f64| if k < 4 { 1e3 } else { 1e3 * log.exp() };
            let ends = [torque(&before, kc(-LOG_STEP), q), torque(&after, kc(LOG_STEP), q)];
            if ends.iter().any(|end| touched(end) != touched(&equilibrium)) {
                continue;
            }
            let load = |b: usize| DVec3::from_slice(&sensitivity.load[3 * b..]);
            let by_compliance = |adjoint: &Vec<f64>| -> f64 {
                let nodes = sensitivity.nodes.iter().enumerate();
                let pairs = nodes.clone().flat_map(|a| nodes.clone().map(move |b| (a, b)));
                pairs
                    .map(|((a, &i), (b, &j))| {
                        let [before, after] = compliances.each_ref().map(|c| c.block(i as usize, j as usize));
                        DVec3::from_slice(&adjoint[3 * a..]).dot((after - before) * load(b)) / (2.0 * LOG_STEP)
                    })
                    .sum()
            };
            for joint in 0..q.len() {
                let slope = (ends[1].torque[joint] - ends[0].torque[joint]) / (2.0 * LOG_STEP);
                let said = match k {
                    4 => sensitivity.by_contact[joint],
                    _ => by_compliance(&sensitivity.adjoints[joint]),
                };
                *worst = worst.max((slope - said).abs() / equilibrium.torque.norm());
                if k == 3 {
                    *worst = worst.max((slope - sensitivity.by_modulus()[joint]).abs() / equilibrium.torque.norm());
                }
            }
        }
    }
    println!("by modulus, ground, skin, all of these, contact: {worst:?}");
    assert!(worst.iter().all(|worst| (0.0..1e-6).contains(worst) && *worst > 0.0), "{worst:?}");
}

/// Step of central differences along an edge (rad): the torque bends over some 0.1 rad, which leaves 1e-8 of it.
const ALONG: f64 = 1e-5;

/// In the plane of symmetry of the touch scene a closest point lies exactly on an edge, where the surface need not be
/// smooth across: the tangent is that of one side, and along the edge the derivative of the torque.
#[test]
fn the_tangent_holds_along_an_edge_that_the_closest_point_lies_on() {
    // A ball of rings, which has such edges: the joints turn in a plane through its poles.
    let text = include_str!("../../datasets/touch.toml").replace("subdivisions = 3", "edge = 0.006");
    let scene = Scene::parse(&text, "touch.toml").unwrap();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let mut model = Model::new(&object, &chain, contact(1e3));
    model.with_tangent = true;
    let mut solver = Solver::new(&model);
    let (mut compared, mut worst) = (0, 0.0_f64);
    for shoulder in 0..6 {
        for elbow in 18..26 {
            let q = [0.0, 0.025 * f64::from(shoulder), -0.739 + 0.038_13 * f64::from(elbow)];
            let Equilibrium { status: Status::Contact, tangent: Some(tangent), .. } = solver.solve(&q) else {
                continue;
            };
            for k in 1..3 {
                let mut torque = |step: f64| {
                    let mut moved = q;
                    moved[k] += step;
                    solver.solve(&moved).torque
                };
                let (after, before) = (torque(ALONG), torque(-ALONG));
                for l in 1..3 {
                    let difference = (after[l] - before[l]) / (2.0 * ALONG);
                    worst = worst.max((tangent[k][l] - difference).abs() / (1.0 + difference.abs()));
                }
            }
            compared += 1;
        }
    }
    assert!(compared > 20 && worst < 1e-3, "{compared} {worst}");
}

#[test]
fn results_have_the_same_bits_on_any_number_of_threads() {
    let Sample { object, chain, places, .. } = shipped("mesh", 200);
    let mut model = Model::new(&object, &chain, contact(1e3));
    model.with_tangent = true;
    let places: Vec<JointVector> = places.iter().map(|q| JointVector::from_slice(q)).collect();
    let [one, three] = [1, 3].map(|threads| CpuBackend::new(&model, threads).unwrap().solve(&places).unwrap());
    for (one, three) in one.iter().zip(&three) {
        assert_eq!(
            (one.energy.to_bits(), &one.torque, &one.forces),
            (three.energy.to_bits(), &three.torque, &three.forces)
        );
        assert_eq!((one.status, one.tangent), (three.status, three.tangent));
    }
    assert!(one.iter().filter(|equilibrium| equilibrium.tangent.is_some()).count() > 30);
}

/// The forces along the normals alone, which push back on the object, are not the gradient: rows change along the
/// surface, and the comparison notices that.
#[test]
fn the_sideways_part_of_the_force_is_needed() {
    let (object, chain) = (torus(), Chain::new(&arm(0.0)));
    let model = Model::new(&object, &chain, contact(1e3));
    let mut solver = Solver::new(&model);
    let mut worst = 0.0_f64;
    for q in random_configurations(7, 60) {
        let mut here = solver.solve(&q);
        if here.touches.len() != 1 {
            continue;
        }
        here.torque = haptize::JointVector::zeros(q.len());
        let node = here.touches[0].proxy_node as usize;
        let normal: glam::DVec3 = here.forces.iter().map(|force| -force.force).sum();
        chain.add_torque(solver.pose(), node, normal, &mut here.torque);
        worst = worst.max(gradient_error(&mut solver, &q, &here, STEP).unwrap_or(0.0));
    }
    assert!(worst > 1e-3, "{worst}");
}

/// Sides of the closed loops are cut into so many parts.
const PARTS: usize = 800;

/// Work of the torque around a square of three degrees of the last two joints from `q` on, by the trapezoidal rule, with
/// the greatest energy (J) and depth (m) on the way.
pub fn work_around(solver: &mut Solver<'_>, q: &[f64]) -> (f64, f64, f64) {
    let step = 3_f64.to_radians() / PARTS as f64;
    let (mut at, mut sum) = (q.to_vec(), (0.0, 0.0_f64, 0.0_f64));
    for (joint, step) in [(q.len() - 2, step), (q.len() - 1, step), (q.len() - 2, -step), (q.len() - 1, -step)] {
        for part in 0..=PARTS {
            let here = solver.solve(&at);
            let share = if part == 0 || part == PARTS { 0.5 } else { 1.0 };
            sum = (sum.0 + share * step * here.torque[joint], sum.1.max(here.energy), sum.2.max(-here.gap));
            if part < PARTS {
                at[joint] += step;
            }
        }
    }
    sum
}

/// The torus is twice continuously differentiable: all its nodes have six neighbours. Away from its middle, where
/// directions turn round, what is left of a loop's work is the error of the quadrature, where contacts come and go.
#[test]
fn no_closed_loop_makes_work() {
    let (object, chain) = (torus(), Chain::new(&arm(0.0)));
    let model = Model::new(&object, &chain, contact(1e3));
    let mut solver = Solver::new(&model);
    let (mut loops, mut worst) = (0, 0.0_f64);
    for q in random_configurations(7, 60) {
        let (work, greatest, deepest) = work_around(&mut solver, &q);
        if greatest > 0.0 && deepest < 0.01 {
            loops += 1;
            worst = worst.max(work.abs() / greatest);
        }
    }
    println!("{loops} loops, at most {worst:.1e} of the greatest energy");
    assert!(loops > 3 && worst < 1e-4, "{loops} {worst}");
}

/// The greatest change of a joint's torque over its lever from one of `count` places to the next on the way from `from`
/// to `to`, over the greatest such force (1).
pub fn greatest_step(solver: &mut Solver<'_>, [from, to]: [&[f64]; 2], levers: &[f64], count: u32) -> f64 {
    let forces: Vec<Vec<f64>> = (0..=count)
        .map(|k| {
            let along = |(from, to): (&f64, &f64)| from + f64::from(k) / f64::from(count) * (to - from);
            let torque = solver.solve(&from.iter().zip(to).map(along).collect::<Vec<f64>>()).torque;
            torque.iter().zip(levers).map(|(entry, lever)| entry / lever).collect()
        })
        .collect();
    let size = forces.iter().flatten().fold(0.0, |size: f64, force| size.max(force.abs()));
    let step = |pair: &[Vec<f64>]| pair[0].iter().zip(&pair[1]).fold(0.0, |step: f64, (a, b)| step.max((b - a).abs()));
    forces.windows(2).map(step).fold(0.0, f64::max) / size
}

/// A leap does not shrink with the steps, as that of a box in `rounded.rs`; a slope does, to a quarter, and to less than
/// a half where it bends within a step. All nodes of the torus have six neighbours; below others, such as a sphere has,
/// the foot of a deep node may leap.
#[test]
fn no_torque_leaps_along_a_thousand_lines_on_a_smooth_body() {
    // The bar is 100 mm long.
    const LEVERS: [f64; 6] = [1.0, 1.0, 1.0, 0.05, 0.05, 0.05];
    let object = bodies::torus(DVec3::ZERO).unwrap();
    let (mut lines, mut worst) = (0, 0.0_f64);
    for radius in [0.0, 0.004] {
        let chain = bodies::floating_bar(radius);
        let model = Model::new(&object, &chain, contact(1e4));
        let mut solver = Solver::new(&model);
        let mut random = Random::new(41);
        for from in bodies::pressed(&model, 43, 500, 0.001, 0.006) {
            let along =
                |(joint, q): (usize, &f64)| q + random.between(-1.0, 1.0) * if joint < 3 { 0.001 } else { 0.05 };
            let to: Vec<f64> = from.iter().enumerate().map(along).collect();
            let mut step = |count| greatest_step(&mut solver, [&from, &to], &LEVERS, count);
            let [coarse, fine] = [20, 80].map(&mut step);
            worst = worst.max(fine / coarse);
            lines += 1;
        }
    }
    println!("{lines} lines: with a quarter of the step at most {worst:.3} of the greatest change");
    assert!(lines == 1000 && worst < 0.5, "{lines} {worst}");
}

/// Hard configurations: a bent bar pressed into the sphere, as deep as its middle, from soft to rigid.
#[test]
fn every_configuration_has_its_equilibrium_within_few_steps() {
    let object = bodies::sphere(PAPER).unwrap();
    for radius in [0.0, 0.004] {
        let chain = bodies::floating_bar(radius);
        for kc in [10.0, 1e4, 1e7, 1e8] {
            let model = Model::new(&object, &chain, contact(kc));
            let mut solver = Solver::new(&model);
            let (mut most, mut touching, mut residual) = (0, 0, 0.0_f64);
            for q in bodies::pressed(&model, 31, 200, 0.002, 0.045) {
                let here = solver.solve(&q);
                assert_eq!(here.status, Status::Contact, "{kc} N/m, {q:?}");
                most = most.max(here.iterations);
                touching = touching.max(here.touches.len());
                residual = residual.max(here.residual);
            }
            println!("radius {radius}, {kc:e} N/m: {most} steps, {touching} contacts, residual {residual:.1e}");
            assert!(most <= 40 && touching > 8 && residual < 1e-12, "{kc} N/m: {most} {touching} {residual}");
        }
    }
}

/// Random configurations of bodies of every kind, of shipped scenes and of a bar that is pressed as deep as a body's
/// middle, into a rounded box, too, with contact from soft to rigid.
#[test]
fn a_hundred_thousand_random_configurations_are_solved_in_few_steps() {
    const COUNT: usize = 120_000;
    const STIFFNESSES: [f64; 8] = [10.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8];
    let each = COUNT / (12 * STIFFNESSES.len());
    let mut samples = Vec::from(bodies_of_all_kinds(each));
    samples.extend(["sphere", "mesh", "touch", "organ", "woodenhaptics"].map(|name| shipped(name, each)));
    let mut samples: Vec<(Sample, ContactSpec)> = samples.into_iter().map(|sample| (sample, contact(1e3))).collect();
    let sphere = || bodies::sphere(PAPER).unwrap();
    for (name, object, radius, contact) in [
        ("bar", sphere(), 0.0, contact(1e3)),
        ("bar of balls", sphere(), 0.004, contact(1e3)),
        ("bar in a rounded box", cuboid(), 0.0, rounded(1e3)),
    ] {
        let chain = bodies::floating_bar(radius);
        let model = Model::new(&object, &chain, contact);
        let places = bodies::pressed(&model, 37, each, 0.0, 0.05).into_iter().map(|q| q.to_vec()).collect();
        drop(model);
        samples.push((Sample { name, object, chain, places }, contact));
    }
    let (mut solved, mut in_contact, mut most, mut residual) = (0, 0, 0, 0.0_f64);
    for (Sample { name, object, chain, places }, contact) in samples {
        let places: Vec<JointVector> = places.iter().map(|q| JointVector::from_slice(q)).collect();
        let mut model = Model::new(&object, &chain, contact);
        for kc in STIFFNESSES {
            model.set_stiffness(kc / 3.0);
            for (q, found) in places.iter().zip(CpuBackend::new(&model, 0).unwrap().solve(&places).unwrap()) {
                assert!(matches!(found.status, Status::Free | Status::Contact), "{name}, {kc} N/m, {q:?}: {found:?}");
                assert!(found.energy >= 0.0 && found.torque.is_finite(), "{name}, {kc} N/m, {q:?}");
                solved += 1;
                in_contact += usize::from(found.status == Status::Contact);
                (most, residual) = (most.max(found.iterations), residual.max(found.residual));
            }
        }
    }
    println!("{solved} solved, {in_contact} in contact: at most {most} steps, residual {residual:.1e}");
    assert!(solved * 10 > COUNT * 9 && in_contact * 4 > solved, "{solved} {in_contact}");
    assert!(most <= 60 && residual < 1e-11, "{most} {residual}");
}

/// At the depths of the shipped scenes both laws agree, the better the shallower: of the torque, rms over rms.
#[test]
fn contact_at_rest_agrees_with_the_energy_form_at_ordinary_depths() {
    for (name, count, most) in [("mesh", 60, 0.03), ("touch", 8000, 0.001), ("organ", 200, 0.03)] {
        let Sample { object, chain, places, .. } = shipped(name, count);
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("datasets/{name}.toml"));
        let rest = Model::new(&object, &chain, Scene::load(path).unwrap().contact);
        let energy = rest.with_contact(ContactSpec { law: ContactLaw::Following, ..rest.contact });
        let (mut following, mut at_rest) = (Solver::new(&energy), Solver::new(&rest));
        let (mut off, mut size) = (0.0, 0.0);
        for q in &places {
            let (a, b) = (following.solve(q), at_rest.solve(q));
            off += a.torque.iter().zip(b.torque.iter()).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            size += a.torque.iter().map(|a| a.powi(2)).sum::<f64>();
        }
        let ratio = (off / size).sqrt();
        println!("{name}: {ratio:.5}");
        assert!(size > 0.0 && ratio > 1e-6 && ratio < most, "{name}: {ratio}");
    }
}
