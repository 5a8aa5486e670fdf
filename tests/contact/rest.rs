//! Contact with the surface at rest: the torque is the gradient of the energy, on every kind of body, at every stiffness
//! and depth.

use crate::fixture::{arm, random_configurations, sphere, torus};
use haptize::contact::{Equilibrium, Model, Solver, Status};
use haptize::fixtures::Random;
use haptize::object::Object;
use haptize::proxy::Chain;
use haptize::scene::{Algorithm, ContactSpec, ContactSurface, ElasticSpec, Material, Scene, SpringKind};

/// Contact at rest of stiffness kc at a contact point (N/m).
fn contact(kc: f64) -> ContactSpec {
    ContactSpec { surface: ContactSurface::Smooth, ..crate::fixture::contact(Algorithm::Rest, kc / 3.0) }
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

fn samples() -> Vec<Sample> {
    let of = |name, object, radius| Sample {
        name,
        object,
        chain: Chain::new(&arm(radius)),
        places: random_configurations(7, 24),
    };
    vec![
        of("springs", sphere(SpringKind::Isotropic), 0.0),
        of("springs along their length, balls", sphere(SpringKind::Axial), 0.008),
        of("torus", torus(), 0.0),
        of("solid", solid(), 0.0),
        shipped("mesh", 60),
        shipped("touch", 2000),
        shipped("organ", 200),
    ]
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
fn gradient_error(solver: &mut Solver<'_>, q: &[f64], here: &Equilibrium) -> Option<f64> {
    let mut worst: Option<f64> = None;
    for joint in 0..q.len() {
        let [before, after] = [-STEP, STEP].map(|step| {
            let mut moved = q.to_vec();
            moved[joint] += step;
            solver.solve(&moved)
        });
        if touched(&before) == touched(here) && touched(&after) == touched(here) {
            let slope = (before.energy - after.energy) / (2.0 * STEP);
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
                if let Some(error) = gradient_error(&mut solver, q, &here) {
                    worst = worst.max(error);
                    checked += 1;
                }
                most = most.max(here.touches.len());
            }
            println!("{name}, {kc:e} N/m: {checked} checked, up to {most} contacts, worst {worst:.1e}");
            assert!(checked > 3, "{name}, {kc} N/m: {checked}");
        }
    }
}
