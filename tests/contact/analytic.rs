//! Closed forms.

use crate::fixture::{contact, models, octahedron, probe, searches};
use glam::DVec3;
use haptize::contact::{Model, Solver, Status};
use haptize::object::Compliance;
use haptize::scene::ContactLaw;

/// A node pressed into the middle of a face of a regular octahedron: by its threefold symmetry the face moves along its
/// normal N and stays flat, so lambda = kc d / (1 + kc c) exactly, c = N . C N of the mean displacement of the three
/// corners under a force shared by them, and U = lambda d / 2. Frozen and deformed geometry agree.
#[test]
fn a_node_on_the_middle_of_a_symmetric_face_feels_two_springs_in_series() {
    let object = octahedron();
    let normal = DVec3::ONE.normalize();
    let middle = (object.rest[0] + object.rest[1] + object.rest[2]) / 3.0;
    let chain = probe(middle, -normal);
    let compliance = Compliance::new(&object);
    let mut c = 0.0;
    for i in 0..3 {
        for j in 0..3 {
            c += normal.dot(compliance.block(i, j) * normal) / 9.0;
        }
    }
    for law in [ContactLaw::Following, ContactLaw::Rest] {
        for stiffness in [1.0, 1e2, 1e4, 1e6] {
            for depth in [1e-9, 1e-6, 1e-3, 1e-2] {
                let model = Model::new(&object, &chain, contact(law, stiffness));
                let kc = 3.0 * stiffness;
                let equilibrium = Solver::new(&model).solve(&[depth]);
                assert_eq!(equilibrium.status, Status::Contact, "{law:?} {stiffness} {depth}");
                let lambda = kc * depth / (1.0 + kc * c);
                // The torque of a sliding joint is the force along it; coordinates are rounded at 1e-17 m.
                let tolerance = 1e-8 * lambda + kc * 1e-16;
                assert!((equilibrium.torque[0] + lambda).abs() < tolerance, "{} {lambda}", equilibrium.torque[0]);
                assert!((equilibrium.energy - 0.5 * lambda * depth).abs() < 1e-6 * lambda * depth);
                assert!((equilibrium.gap + depth).abs() < 1e-15);
                for touch in &equilibrium.touches {
                    assert!(touch.carriers.iter().all(|(_, w)| (w - 1.0 / 3.0).abs() < 1e-6));
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
    let model = Model::new(&object, &chain, contact(ContactLaw::Following, 500.0));
    let mut solver = Solver::new(&model);
    assert_eq!(solver.solve(&[0.01 - 1e-12]).status, Status::Free);
    assert_eq!(solver.solve(&[0.01 + 1e-12]).status, Status::Contact);
    let far = solver.solve(&[-1.0]);
    assert!(far.status == Status::Free && (far.gap - 1.01).abs() < 1e-12);
}

/// Exactly over a vertex, an edge and at the object's centre: where the closest point jumps, numbers stay finite, and
/// what is called converged is balanced.
#[test]
fn symmetric_positions_give_finite_numbers() {
    let object = octahedron();
    for axis in [DVec3::Z, DVec3::X + DVec3::Z, DVec3::ONE] {
        let axis = axis.normalize();
        let chain = probe(axis * 0.1, -axis);
        let models = models(&object, &chain, 500.0);
        for mut solve in searches(&models) {
            for k in 0..=100 {
                let equilibrium = solve(&[0.2 * f64::from(k) / 100.0]);
                assert!(equilibrium.torque.is_finite() && equilibrium.energy.is_finite());
                assert!(equilibrium.energy >= 0.0 && equilibrium.residual.is_finite());
                assert_eq!(equilibrium.gap >= 0.0, equilibrium.status == Status::Free);
            }
        }
    }
}

/// The stored energy and the force on a ball of radius 20 mm at `centre`, slid along x, in an almost rigid trough: a
/// block with a groove of 90 degrees along y, edges at z = 0, bottom 50 mm below.
fn in_the_trough(height: f64, aside: f64) -> (f64, f64, Status) {
    let profile = [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.0), (0.05, 0.0), (0.0, -0.05), (-0.05, 0.0), (-0.1, 0.0)];
    let mut nodes = Vec::new();
    for y in [-0.2, 0.2] {
        nodes.extend(profile.map(|(x, z)| DVec3::new(x, y, z)));
    }
    let count = profile.len() as u32;
    let mut triangles = Vec::new();
    for k in 0..count {
        let next = (k + 1) % count;
        triangles.extend([[k, k + count, next], [next, k + count, next + count]]);
    }
    for [a, b, c] in [[0, 1, 4], [1, 2, 3], [1, 3, 4], [0, 4, 5], [0, 5, 6]] {
        triangles.extend([[a, b, c], [a + count, c + count, b + count]]);
    }
    let mut object = crate::fixture::object(nodes, triangles);
    // Almost rigid: what is tested is the ball's law, not the block's springs.
    let rigid = object.rest.len();
    object = crate::fixture::grounded(&object, 1e12);
    assert_eq!(object.rest.len(), rigid);
    let chain = crate::fixture::ball(DVec3::new(0.0, 0.185, height), DVec3::X, 0.02);
    let model = Model::new(&object, &chain, contact(ContactLaw::Following, 1e3));
    let equilibrium = Solver::new(&model).solve(&[aside]);
    (equilibrium.energy, equilibrium.torque[0], equilibrium.status)
}

/// The nearer wall of a groove pushes a ball: aside of the middle by any amount, since the depth is that of the closest
/// point.
#[test]
fn a_ball_in_a_groove_is_pushed_by_the_nearer_wall() {
    let (kc, r) = (3e3, 0.02f64);
    for height in [-0.0245, -0.025, -0.03, -0.035] {
        for aside in [1e-5, 1e-4, 0.002, 0.006] {
            let above = height + 0.05;
            let root = 2.0f64.sqrt();
            let depth = r - (above - aside) / root;
            let energy = 0.5 * kc * depth * depth;
            let torque = -kc * depth / root;
            let (found, along, status) = in_the_trough(height, aside);
            assert_eq!(status, Status::Contact, "{height} {aside}");
            assert!((found - energy).abs() < 1e-6 * energy, "{height} {aside}: U {found}, expected {energy}");
            assert!((along - torque).abs() < 1e-6 * kc * r, "{height} {aside}: {along}, expected {torque}");
        }
    }
    assert_eq!(in_the_trough(-0.0, 0.0).2, Status::Free);
}
