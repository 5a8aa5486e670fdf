//! What must not change a result: where the world's origin is, how it is turned, what was solved before; and broken
//! numbers.

use crate::fixture::{arm, models, object, random_configurations, searches, sphere};
use glam::{DMat3, DVec3};
use haptize::contact::{Equilibrium, Status};
use haptize::object::Object;
use haptize::proxy::Chain;
use haptize::scene::{ProxySpec, SpringKind};

/// Object and proxy turned by `rotation`, then moved by `shift`.
fn moved(original: &Object, proxy: &ProxySpec, rotation: DMat3, shift: DVec3) -> (Object, Chain) {
    let nodes = original.rest.iter().map(|&node| rotation * node + shift).collect();
    let mut proxy = proxy.clone();
    for (k, joint) in proxy.joints.iter_mut().enumerate() {
        joint.origin = rotation * joint.origin + if k == 0 { shift } else { DVec3::ZERO };
        joint.axis = rotation * joint.axis;
        for node in &mut joint.nodes {
            node.position = rotation * node.position;
        }
    }
    (object(nodes, original.triangles.clone()), Chain::new(&proxy))
}

/// What each search finds at random configurations.
fn solve_all(object: &Object, chain: &Chain) -> [Vec<Equilibrium>; 3] {
    let models = models(object, chain, 500.0);
    searches(&models).map(|mut search| random_configurations(11, 80).iter().map(|q| search(q)).collect())
}

fn largest_difference(a: &[Equilibrium], b: &[Equilibrium]) -> f64 {
    let mut largest = 0.0f64;
    for (a, b) in a.iter().zip(b) {
        assert_eq!(a.status, b.status);
        for (x, y) in a.torque.iter().zip(b.torque.iter()) {
            largest = largest.max((x - y).abs());
        }
        largest = largest.max((a.energy - b.energy).abs());
    }
    largest
}

#[test]
fn turning_and_moving_the_world_changes_nothing() {
    let original = sphere(SpringKind::Isotropic);
    let rotation = DMat3::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 1.1);
    let here = solve_all(&original, &Chain::new(&arm(0.0)));
    for found in &here {
        assert!(found.iter().filter(|e| e.status == Status::Contact).count() > 8);
    }
    let compare = |(moved, chain): (Object, Chain), bound: f64| {
        for (here, there) in here.iter().zip(&solve_all(&moved, &chain)) {
            assert!(largest_difference(here, there) < bound);
        }
    };
    compare(moved(&original, &arm(0.0), rotation, DVec3::new(0.3, -0.2, 0.1)), 1e-7);
    // A kilometre away coordinates are rounded at 1e-13 m: 1e-10 of a depth of a millimetre.
    compare(moved(&original, &arm(0.0), DMat3::IDENTITY, DVec3::new(1000.0, -700.0, 300.0)), 1e-6);
}

/// The start is the rest state: nothing is carried from one configuration to the next, to the last bit; also where just
/// the last joint turns, and the nodes that hang on the others stay.
#[test]
fn results_do_not_depend_on_what_was_solved_before() {
    let object = sphere(SpringKind::Axial);
    let mut staying = 0;
    for radius in [0.0, 0.008] {
        let chain = Chain::new(&arm(radius));
        let models = models(&object, &chain, 2e3);
        for (k, together) in searches(&models).iter_mut().enumerate() {
            for q in random_configurations(12, 30) {
                for turn in [0.0, 0.03, -0.03] {
                    let q = [q[0], q[1], q[2] + turn];
                    let (a, b) = (together(&q), searches(&models)[k](&q));
                    assert_eq!(a.status, b.status);
                    assert_eq!(a.torque, b.torque);
                    assert_eq!(a.energy.to_bits(), b.energy.to_bits());
                    assert_eq!(a.gap.to_bits(), b.gap.to_bits());
                    assert_eq!(a.forces, b.forces);
                    staying += usize::from(a.touches.iter().any(|touch| touch.proxy_node < 12));
                }
            }
        }
    }
    assert!(staying > 40, "nodes that stay touch in {staying} configurations only");
}

fn assert_harmless(equilibrium: &Equilibrium) {
    assert_eq!(equilibrium.status, Status::Unconverged);
    assert!(equilibrium.energy == 0.0 && equilibrium.residual == 1.0 && equilibrium.gap.is_finite());
    assert!(equilibrium.torque.iter().all(|&t| t == 0.0));
    assert!(equilibrium.forces.is_empty() && equilibrium.touches.is_empty());
}

#[test]
fn broken_numbers_are_flagged_and_never_come_out() {
    let object = sphere(SpringKind::Isotropic);
    let chain = Chain::new(&arm(0.0));
    let q = [0.0, 0.25, 0.1];
    let mut models = models(&object, &chain, 500.0);
    for mut solve in searches(&models) {
        let right = solve(&q);
        assert!(right.gap < 0.0);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_harmless(&solve(&[0.0, bad, 0.1]));
        }
        assert_harmless(&solve(&[0.0, 0.1]));
        assert_harmless(&solve(&[]));
        let again = solve(&q);
        assert_eq!(again.torque, right.torque, "the solver recovers");
        let absurd = solve(&[1e300, -1e300, 1e300]);
        assert!(absurd.torque.is_finite() && absurd.energy.is_finite() && absurd.gap.is_finite());
    }
    for model in &mut models {
        std::sync::Arc::make_mut(&mut model.compliance).entries.fill(f64::NAN);
    }
    searches(&models).iter_mut().for_each(|solve| assert_harmless(&solve(&q)));
}
