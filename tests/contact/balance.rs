//! Force balance, contact law, torque and energy of the energy form on random configurations.

use crate::fixture::{Random, arm, arm_of_six, contact, random_configurations, sphere, torus};
use crate::oracle::{check_account, check_contact_law, gap, pose};
use glam::DVec3;
use haptize::contact::{Equilibrium, Model, Solver, Status, Touch};
use haptize::fixtures::bodies::{self, BALL, RADIUS, floating_bar, pressed};
use haptize::object::Object;
use haptize::proxy::Chain;
use haptize::scene::{ContactLaw, ContactSurface, SpringKind};

/// Solves all configurations, checks those in contact, and returns how many were and how many of them converged.
fn check(object: &Object, chain: &Chain, stiffness: f64, configurations: &[Vec<f64>]) -> (usize, usize) {
    let model = Model::new(object, chain, contact(ContactLaw::Following, stiffness));
    let mut solver = Solver::new(&model);
    let (mut touching, mut converged) = (0, 0);
    for q in configurations {
        let equilibrium = solver.solve(q);
        let expected = gap(object, chain, &pose(chain, q));
        assert!((equilibrium.gap - expected).abs() < 1e-12, "gap {} against {expected}", equilibrium.gap);
        if expected >= 0.0 {
            assert_eq!(equilibrium.status, Status::Free);
            assert!(equilibrium.touches.is_empty() && equilibrium.forces.is_empty());
            assert!(equilibrium.energy == 0.0 && equilibrium.torque.iter().all(|&t| t == 0.0));
            continue;
        }
        touching += 1;
        converged += usize::from(check_one(object, chain, &model, &mut solver, q));
    }
    (touching, converged)
}

/// Solves a configuration in contact and checks it; whether it converged.
fn check_one(object: &Object, chain: &Chain, model: &Model, solver: &mut Solver, q: &[f64]) -> bool {
    let equilibrium = solver.solve(q);
    assert_ne!(equilibrium.status, Status::Free);
    let history = solver.energy_history();
    let rounding = 1e-13 * history[0];
    assert!(history.windows(2).all(|pair| pair[1] <= pair[0] + rounding), "E rose: {history:?}");
    if equilibrium.status != Status::Contact {
        return false;
    }
    assert!(equilibrium.residual <= model.contact.tolerance);
    check_account(object, chain, q, &equilibrium).unwrap();
    // Stored forces that are off by a residual r displace the surface by C r, and the law there by kc C r.
    let tolerance = (10.0 * equilibrium.residual * model.kc * model.max_nodal_compliance).max(1e-6);
    // The oracle knows the triangles alone.
    if model.contact.surface == ContactSurface::Facets {
        check_contact_law(object, chain, q, model.kc, &equilibrium, tolerance).unwrap();
    }
    true
}

/// As [`check`], asserting the least number of contacts and the least share that converges.
fn check_share(object: &Object, chain: &Chain, stiffness: f64, configurations: &[Vec<f64>], least: usize, share: f64) {
    let (touching, converged) = check(object, chain, stiffness, configurations);
    assert!(touching >= least, "only {touching} configurations touch");
    assert!(converged as f64 >= share * touching as f64, "{converged} of {touching} converged");
}

#[test]
fn balance_and_contact_law_hold_on_the_sphere() {
    let chain = Chain::new(&arm(0.0));
    for kind in [SpringKind::Isotropic, SpringKind::Axial] {
        check_share(&sphere(kind), &chain, 500.0, &random_configurations(1, 120), 30, 1.0);
    }
}

#[test]
fn balance_and_contact_law_hold_on_a_concave_mesh() {
    check_share(&torus(), &Chain::new(&arm(0.0)), 500.0, &random_configurations(2, 120), 20, 0.95);
}

/// From much softer to much stiffer than the object.
#[test]
fn balance_and_contact_law_hold_at_every_contact_stiffness() {
    let object = sphere(SpringKind::Isotropic);
    let chain = Chain::new(&arm(0.0));
    let configurations = random_configurations(3, 60);
    for stiffness in [1.0, 10.0, 1e2, 1e3, 1e4] {
        check_share(&object, &chain, stiffness, &configurations, 15, 1.0);
    }
    for stiffness in [1e5, 1e6] {
        check_share(&object, &chain, stiffness, &configurations, 15, 0.95);
    }
}

/// Spheres instead of points.
#[test]
fn balance_and_contact_law_hold_for_nodes_with_a_radius() {
    for radius in [0.003, 0.008] {
        for stiffness in [100.0, 1e4] {
            let chain = Chain::new(&arm(radius));
            let object = sphere(SpringKind::Isotropic);
            let model = Model::new(&object, &chain, bodies::contact_of(&chain, stiffness));
            let mut solver = Solver::new(&model);
            let (mut touching, mut missed) = (0, 0);
            for q in random_configurations(4, 100) {
                if solver.solve(&q).status != Status::Free {
                    touching += 1;
                    missed += usize::from(!check_one(&object, &chain, &model, &mut solver, &q));
                }
            }
            assert!(touching > 30 && missed <= 2, "{missed} of {touching} have not converged");
        }
    }
}

/// A sphere of springs pressed by a bar of points or balls that once failed: what converges is balanced, the others say
/// that they have not converged. Returns how many of `places` converge.
fn hard(object: &Object, radius: f64, stiffness: f64, depths: [f64; 2], places: &[usize]) -> usize {
    let chain = floating_bar(radius);
    let model = Model::new(object, &chain, bodies::contact_of(&chain, stiffness));
    let [least, most] = depths.map(|depth| depth * RADIUS);
    let configurations = pressed(&model, 1, 1 + places.iter().max().unwrap(), least, most);
    let mut solver = Solver::new(&model);
    places.iter().filter(|&&place| check_one(object, &chain, &model, &mut solver, &configurations[place])).count()
}

const HELD_PATCH: bodies::Ball = bodies::Ball { rings: 10, springs: SpringKind::Axial, ground: 1e4, patch: true };

#[test]
fn rigid_balls_that_start_inside_leave_to_different_sides() {
    let object = bodies::sphere(HELD_PATCH).unwrap();
    assert!(hard(&object, BALL, f64::INFINITY, [0.2, 0.5], &[12, 48, 51]) >= 1);
}

#[test]
fn stiff_balls_do_not_rattle_between_facets() {
    let isotropic = bodies::sphere(bodies::Ball { springs: SpringKind::Isotropic, ..HELD_PATCH }).unwrap();
    assert!(hard(&isotropic, BALL, 1e5, [0.2, 0.5], &[12, 13]) >= 1);
    assert_eq!(hard(&bodies::sphere(bodies::PAPER).unwrap(), BALL, 1e5, [0.0, 0.2], &[88]), 1);
}

#[test]
fn rigid_points_follow_a_curved_valley_of_energy() {
    let axial = bodies::sphere(bodies::Ball { springs: SpringKind::Axial, ..bodies::PAPER }).unwrap();
    assert_eq!(hard(&axial, 0.0, f64::INFINITY, [0.0, 0.2], &[92]), 1);
    let everywhere = bodies::sphere(bodies::Ball { patch: false, ..HELD_PATCH }).unwrap();
    assert_eq!(hard(&everywhere, 0.0, f64::INFINITY, [0.0, 0.2], &[84]), 1);
    assert_eq!(hard(&bodies::sphere(HELD_PATCH).unwrap(), 0.0, 1e6, [0.0, 0.2], &[131]), 1);
}

/// On springs such balls crumple the facets and are flagged; a skin keeps these smooth.
#[test]
fn rigid_balls_on_facets_finer_than_themselves_balance_on_a_skin() {
    let springs = bodies::sphere(bodies::Ball { rings: 20, ..bodies::PAPER }).unwrap();
    assert!(hard(&springs, BALL, f64::INFINITY, [0.2, 0.5], &[5, 14]) < 2);
    assert_eq!(hard(&bodies::skinned(16).unwrap(), BALL, f64::INFINITY, [0.2, 0.5], &[5, 14]), 2);
}

/// Between rigid contact forces c and the forces K u that hold the displacement, in the energy norm: recomputed from u
/// by the stiffness itself.
#[test]
fn the_residual_of_rigid_contact_is_the_imbalance_of_forces() {
    let object = sphere(SpringKind::Isotropic);
    let chain = Chain::new(&arm(0.0));
    let model = Model::new(&object, &chain, contact(ContactLaw::Following, f64::INFINITY));
    let mut solver = Solver::new(&model);
    let mut compared = 0;
    for q in random_configurations(3, 60) {
        let found = solver.solve(&q);
        if found.status != Status::Contact {
            continue;
        }
        let u: Vec<DVec3> = solver.displacement().chunks_exact(3).map(DVec3::from_slice).collect();
        let mut held_by = vec![DVec3::ZERO; u.len()];
        object.mechanics().unwrap().stiffness.apply(&u, &mut held_by);
        let mut pushed = vec![DVec3::ZERO; u.len()];
        found.forces.iter().for_each(|force| pushed[force.node as usize] = force.force);
        let respond = |j: usize| -> DVec3 {
            (0..u.len()).filter(|&i| pushed[i] != DVec3::ZERO).map(|i| model.compliance.block(j, i) * pushed[i]).sum()
        };
        let response: Vec<DVec3> = (0..u.len()).map(respond).collect();
        let norm = |forces: &dyn Fn(usize) -> DVec3, moves: &dyn Fn(usize) -> DVec3| -> f64 {
            (0..u.len()).map(|j| forces(j).dot(moves(j))).sum::<f64>().sqrt()
        };
        let imbalance =
            norm(&|j| pushed[j] - held_by[j], &|j| response[j] - u[j]) / norm(&|j| pushed[j], &|j| response[j]);
        assert!(
            (found.residual - imbalance).abs() < 0.01 * imbalance + 1e-10,
            "{} {imbalance} at {q:?}",
            found.residual
        );
        compared += usize::from(found.residual > 1e-9);
    }
    assert!(compared > 2, "{compared}");
}

/// A ball on a mirror plane of the object may balance on a saddle of E, from which it slides off to either side. The
/// result is the minimum of a hair's breadth beside the plane.
#[test]
fn saddles_are_left() {
    let object = bodies::sphere(bodies::PAPER).unwrap();
    let mut left = 0;
    for (radius, stiffness) in [(0.008, 500.0), (0.004, 5000.0)] {
        let chain = bodies::gantry(vec![haptize::scene::ProxyNodeSpec { position: DVec3::ZERO, radius, length: 0.0 }]);
        let model = Model::new(&object, &chain, bodies::contact_of(&chain, stiffness));
        let mut solver = Solver::new(&model);
        for aside in [-0.0047, -0.002, 0.003] {
            for height in [0.03, 0.0315, 0.036, 0.042] {
                let on = solver.solve(&[0.0, aside, height]);
                let beside = solver.solve(&[1e-5, aside, height]);
                assert_eq!((on.status, beside.status), (Status::Contact, Status::Contact));
                assert!(on.energy < 1.001 * beside.energy, "{aside} {height}: {} and {}", on.energy, beside.energy);
                left += usize::from(on.torque[0].abs() > 0.01 * on.torque.norm());
            }
        }
    }
    assert!(left > 5, "a ball that slid off is pushed sideways: {left}");
}

/// Balls about as soft as the object, pressed in by half their radius and more, near edges and vertices of their own
/// dents, where a depth below the nearest facet alone has kinks.
#[test]
fn soft_balls_rest_deep_in_their_dents() {
    let object =
        bodies::sphere(bodies::Ball { rings: 10, springs: SpringKind::Axial, ground: 1e3, patch: false }).unwrap();
    let chain = floating_bar(BALL);
    let model = Model::new(&object, &chain, bodies::contact_of(&chain, 1e3));
    let mut solver = Solver::new(&model);
    let configurations = pressed(&model, 1, 117, 0.2 * RADIUS, 0.5 * RADIUS);
    let (mut sunk, mut derivatives, mut missed) = (0, 0, 0);
    for place in [27, 28, 56, 76, 80, 96, 111, 116] {
        let q = &configurations[place];
        let converged = check_one(&object, &chain, &model, &mut solver, q);
        missed += usize::from(!converged);
        let here = solver.solve(q);
        let force = |i: usize| -> DVec3 {
            here.touches.iter().filter(|touch| touch.proxy_node as usize == i).map(|touch| touch.force).sum()
        };
        sunk += (0..chain.nodes.len()).filter(|&i| force(i).length() > 0.5 * model.kc * BALL).count();
        for joint in 0..q.len() {
            let ends = stencil(&mut solver, q, joint);
            if ends.iter().any(|e| e.status != Status::Contact || facets(e) != facets(&here)) {
                continue;
            }
            derivatives += 1;
            let error = gradient_error(&here, &ends, joint);
            assert!(error < 1e-5, "{error} {:?}", here.torque);
        }
    }
    assert!(missed <= 1, "{missed} of 8 have not converged");
    assert!(sunk >= 20 && derivatives >= 40, "{sunk} {derivatives}");
}

#[test]
fn chains_of_one_and_six_joints_work() {
    let object = sphere(SpringKind::Isotropic);
    let one = Chain::new(&haptize::scene::ProxySpec {
        joints: arm(0.0).joints.split_off(1)[..1].to_vec(),
        ..Default::default()
    });
    let mut sequence = Random::new(5);
    let turns: Vec<Vec<f64>> = (0..40).map(|_| vec![sequence.between(-0.3, 0.4)]).collect();
    let (touching, converged) = check(&object, &one, 500.0, &turns);
    assert!(touching > 5 && converged == touching, "{converged} of {touching}");
    let six = Chain::new(&arm_of_six());
    let turns: Vec<Vec<f64>> = (0..60)
        .map(|_| {
            let mut q = vec![sequence.between(-0.3, 0.3), sequence.between(0.0, 0.4), sequence.between(-0.02, 0.02)];
            q.extend([sequence.between(0.0, 0.6), sequence.between(-1.0, 1.0), sequence.between(-1.0, 1.0)]);
            q
        })
        .collect();
    let (touching, converged) = check(&object, &six, 500.0, &turns);
    assert!(touching > 10 && converged == touching, "{converged} of {touching}");
}

/// Object nodes that carry a touch, ascending: a facet's three, an edge's two or a vertex.
fn touched(touch: &Touch) -> Vec<u32> {
    let carrying = touch.carriers.iter().filter(|(_, weight)| *weight != 0.0);
    let mut nodes: Vec<u32> = carrying.map(|(node, _)| *node).collect();
    nodes.sort_unstable();
    nodes
}

/// What each node touches.
fn facets(equilibrium: &Equilibrium) -> Vec<(u32, Vec<u32>)> {
    equilibrium.touches.iter().map(|touch| (touch.proxy_node, touched(touch))).collect()
}

/// Half the length of a stencil (rad or m).
const STENCIL: f64 = 2e-6;

/// Equilibria at the ends of a stencil about `q` along one joint.
fn stencil(solver: &mut Solver, q: &[f64], joint: usize) -> [Equilibrium; 2] {
    [-STENCIL, STENCIL].map(|step| {
        let mut q = q.to_vec();
        q[joint] += step;
        solver.solve(&q)
    })
}

/// By how much -dU/dq between the ends of a stencil about `here` differs from tau, relative to the whole torque.
fn gradient_error(here: &Equilibrium, [before, after]: &[Equilibrium; 2], joint: usize) -> f64 {
    let slope = (after.energy - before.energy) / (2.0 * STENCIL);
    (slope + here.torque[joint]).abs() / here.torque.norm().max(1e-3)
}

/// The envelope theorem: tau = -dU/dq at a minimum. A stencil of points whose ends touch other facets than its middle
/// crosses a kink of U, where the derivative does not exist. U of balls has none down to half the object's radius,
/// although its slope may change fast. Deeper, as far as its centre, which may be left to any side, an end may be
/// another equilibrium. All that is counted, and must be rare.
#[test]
fn torque_is_minus_the_gradient_of_stored_energy() {
    for (kind, radius) in [(SpringKind::Isotropic, 0.0), (SpringKind::Axial, 0.0), (SpringKind::Isotropic, 0.008)] {
        let chain = Chain::new(&arm(radius));
        let object = sphere(kind);
        let model = Model::new(&object, &chain, bodies::contact_of(&chain, 500.0));
        let mut solver = Solver::new(&model);
        // Down to half the object's radius, and deeper.
        let (mut derivatives, mut kinks) = ([0, 0], [0, 0]);
        for q in random_configurations(6, 200) {
            let here = solver.solve(&q);
            if here.status != Status::Contact {
                continue;
            }
            let deep = usize::from(here.gap < -0.5 * RADIUS);
            for joint in 0..q.len() {
                let ends = stencil(&mut solver, &q, joint);
                derivatives[deep] += 1;
                let error = gradient_error(&here, &ends, joint);
                let across = ends.iter().any(|e| facets(e) != facets(&here));
                assert!(across || error < if radius == 0.0 { 1e-5 } else { 1e-3 }, "{error} {:?}", here.torque);
                kinks[deep] += usize::from(error > 1e-3 || (across && radius == 0.0) || (!across && error > 1e-5));
            }
        }
        assert!(derivatives.iter().all(|&count| count > 80), "{derivatives:?}");
        let rare = if radius == 0.0 { [0.02, 0.02] } else { [0.0, 0.15] };
        let few = (0..2).all(|deep| kinks[deep] as f64 <= rare[deep] * f64::from(derivatives[deep]));
        assert!(few, "{kinks:?} of {derivatives:?} stencils cross a kink");
    }
}

/// A check that cannot fail proves nothing.
#[test]
fn perturbed_results_are_rejected() {
    let object = sphere(SpringKind::Isotropic);
    let chain = Chain::new(&arm(0.0));
    let model = Model::new(&object, &chain, contact(ContactLaw::Following, 500.0));
    let mut solver = Solver::new(&model);
    let (q, right) = random_configurations(1, 120)
        .into_iter()
        .map(|q| (q.clone(), solver.solve(&q)))
        .find(|(_, e)| e.status == Status::Contact && e.touches.len() > 1)
        .unwrap();
    let law = |e: &Equilibrium| check_contact_law(&object, &chain, &q, model.kc, e, 1e-6);
    let account = |e: &Equilibrium| check_account(&object, &chain, &q, e);
    law(&right).unwrap();
    account(&right).unwrap();

    let mut wrong = right.clone();
    wrong.forces[0].force *= 1.0 + 1e-4;
    assert!(law(&wrong).is_err() && account(&wrong).is_err(), "a force on the object");
    let mut wrong = right.clone();
    wrong.touches[0].force *= 1.0 + 1e-4;
    assert!(law(&wrong).is_err() && account(&wrong).is_err(), "a force on the proxy");
    let mut wrong = right.clone();
    wrong.touches.pop();
    assert!(law(&wrong).is_err() && account(&wrong).is_err(), "a lost contact");
    let mut wrong = right.clone();
    wrong.forces.iter_mut().for_each(|force| force.force = -force.force);
    wrong.touches.iter_mut().for_each(|touch| touch.force = -touch.force);
    assert!(law(&wrong).is_err(), "tension");
    let mut wrong = right.clone();
    wrong.torque[1] *= 1.0 + 1e-5;
    assert!(account(&wrong).is_err(), "torque");
    let mut wrong = right;
    wrong.forces.swap(0, 1);
    assert!(account(&wrong).is_err(), "order");
}
