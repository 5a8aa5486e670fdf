//! Closed forms.

use crate::fixture::{contact, octahedron, probe};
use glam::DVec3;
use haptize::contact::{Model, Solver, Status};
use haptize::scene::Algorithm;

/// A node pressed into the middle of a face of a regular octahedron: by its threefold symmetry the face moves along its normal
/// N and stays flat, so lambda = kc d / (1 + kc c) exactly, c = N . C N of the mean displacement of the three corners under
/// a force shared by them, and U = lambda d / 2. Frozen and deformed geometry agree.
#[test]
fn a_node_on_the_middle_of_a_symmetric_face_feels_two_springs_in_series() {
    let object = octahedron();
    let normal = DVec3::ONE.normalize();
    let middle = (object.rest[0] + object.rest[1] + object.rest[2]) / 3.0;
    let chain = probe(middle, -normal);
    let mut c = 0.0;
    for i in 0..3 {
        for j in 0..3 {
            c += normal.dot(object.compliance.block(i, j) * normal) / 9.0;
        }
    }
    for algorithm in [Algorithm::Energy, Algorithm::Linearised] {
        for stiffness in [1.0, 1e2, 1e4, 1e6] {
            for depth in [1e-9, 1e-6, 1e-3, 1e-2] {
                let model = Model::new(&object, &chain, contact(algorithm, stiffness));
                let kc = 3.0 * stiffness;
                let equilibrium = Solver::new(&model).solve(&[depth]);
                assert_eq!(equilibrium.status, Status::Contact, "{algorithm:?} {stiffness} {depth}");
                let lambda = kc * depth / (1.0 + kc * c);
                // The torque of a sliding joint is the force along it; coordinates are rounded at 1e-17 m.
                let tolerance = 1e-8 * lambda + kc * 1e-16;
                assert!((equilibrium.torque[0] + lambda).abs() < tolerance, "{} {lambda}", equilibrium.torque[0]);
                assert!((equilibrium.energy - 0.5 * lambda * depth).abs() < 1e-6 * lambda * depth);
                assert!((equilibrium.gap + depth).abs() < 1e-15);
                for touch in &equilibrium.touches {
                    assert!(touch.weights.iter().all(|w| (w - 1.0 / 3.0).abs() < 1e-6));
                }
            }
        }
    }
}

/// Just outside there is nothing; on the surface itself too.
#[test]
fn touching_without_depth_is_free() {
    let object = octahedron();
    let normal = DVec3::ONE.normalize();
    let middle = (object.rest[0] + object.rest[1] + object.rest[2]) / 3.0;
    let chain = probe(middle + normal * 0.01, -normal);
    let model = Model::new(&object, &chain, contact(Algorithm::Energy, 500.0));
    let mut solver = Solver::new(&model);
    assert_eq!(solver.solve(&[0.01 - 1e-12]).status, Status::Free);
    assert_eq!(solver.solve(&[0.01 + 1e-12]).status, Status::Contact);
    let far = solver.solve(&[-1.0]);
    assert!(far.status == Status::Free && (far.gap - 1.01).abs() < 1e-12);
}

/// Exactly over a vertex, an edge and at the object's centre: where the closest point jumps, numbers stay finite, and what is
/// called converged is balanced.
#[test]
fn symmetric_positions_give_finite_numbers() {
    let object = octahedron();
    for algorithm in [Algorithm::Energy, Algorithm::Linearised, Algorithm::Paper] {
        for axis in [DVec3::Z, DVec3::X + DVec3::Z, DVec3::ONE] {
            let axis = axis.normalize();
            let chain = probe(axis * 0.1, -axis);
            let model = Model::new(&object, &chain, contact(algorithm, 500.0));
            let mut solver = Solver::new(&model);
            for k in 0..=100 {
                let equilibrium = solver.solve(&[0.2 * f64::from(k) / 100.0]);
                assert!(equilibrium.torque.is_finite() && equilibrium.energy.is_finite());
                assert!(equilibrium.energy >= 0.0 && equilibrium.residual.is_finite());
                assert_eq!(equilibrium.gap >= 0.0, equilibrium.status == Status::Free);
            }
        }
    }
}
