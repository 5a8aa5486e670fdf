//! Stored forces and torques, against what object and proxy say themselves.

use crate::fixture::{Folder, bake, scene};
use glam::DVec3;
use haptize::{
    JointVector,
    contact::{Model, Solver, Status},
    dataset::Dataset,
    object::Object,
    proxy::Chain,
    scene::Scene,
    sweep::{CpuBackend, Sweep},
};

/// Largest entry of the difference over the largest entry of `expected`.
pub fn relative_error(found: &[f64], expected: &[f64]) -> f64 {
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
        object.mechanics().unwrap().stiffness.apply(&u, &mut elastic);
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
            let outwards = model.object.rest[touch.carriers[0].0 as usize] - centre;
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
    let sphere = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml");
    assert!(check_equilibria(&Scene::load(sphere).unwrap()) > 1000);
}
