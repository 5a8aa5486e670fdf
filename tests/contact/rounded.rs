//! Contact before a rounded surface: exact derivatives, and nothing leaps where the nearest side of a body changes.

use crate::common::cubes::cubes;
use crate::rest::{contact, gradient_error, greatest_step, tangent_error, work_around};
use glam::DVec3;
use haptize::contact::{Model, Solver, Status};
use haptize::fixtures::bodies;
use haptize::object::Object;
use haptize::proxy::Chain;
use haptize::scene::{ContactSpec, ContactSurface, ProxyNodeSpec};

/// Sides of the box (m).
const SIDES: [f64; 3] = [0.1, 0.08, 0.06];

/// Length over which contact is rounded (m).
const LENGTH: f64 = 0.008;

/// A box around the origin.
pub fn cuboid() -> Object {
    let (mut nodes, triangles) = cubes(SIDES.map(|side| (100.0 * side).round() as i32), 0.01, |_| true);
    nodes.iter_mut().for_each(|node| *node -= 0.5 * DVec3::from_array(SIDES));
    bodies::object(nodes, triangles).unwrap()
}

/// Step of central differences (rad or m): depths turn within [`LENGTH`], so that their third derivative leaves some
/// 1e5 times its square.
const STEP: f64 = 2e-7;

pub fn rounded(kc: f64) -> ContactSpec {
    ContactSpec { round: Some(LENGTH), ..contact(kc) }
}

/// A bent bar pressed into the box from all sides, as deep as its middle.
#[test]
fn torque_and_tangent_are_derivatives_at_edges_and_corners() {
    let (object, chain) = (cuboid(), bodies::floating_bar(0.0));
    for kc in [10.0, 1e4, 1e7] {
        let mut model = Model::new(&object, &chain, rounded(kc));
        model.with_tangent = true;
        let mut solver = Solver::new(&model);
        let (mut checked, mut touching, mut worst) = (0, 0, [0.0_f64; 2]);
        for q in bodies::pressed(&model, 31, 24, 0.001, 0.029) {
            let here = solver.solve(&q);
            assert_eq!(here.status, Status::Contact, "{kc} N/m, {q:?}");
            assert!(here.residual < 1e-12, "{kc} N/m: {}", here.residual);
            touching = touching.max(here.touches.len());
            let errors = [gradient_error(&mut solver, &q, &here, STEP), tangent_error(&mut solver, &q, &here, STEP)];
            if let [Some(gradient), Some(tangent)] = errors {
                worst = [worst[0].max(gradient), worst[1].max(tangent)];
                checked += 1;
            }
            for touch in &here.touches {
                let sum: f64 = touch.carriers.iter().map(|(_, share)| share).sum();
                assert!((sum - 1.0).abs() < 1e-12, "{sum}");
            }
        }
        println!("{kc:e} N/m: {checked} checked, up to {touching} contacts, worst {worst:?}");
        assert!(checked > 15 && touching > 6, "{kc} N/m: {checked} {touching}");
        assert!(worst[0] < 1e-7 && worst[1] < 1e-6, "{kc} N/m: {worst:?}");
    }
}

/// A node on three slides.
fn node() -> Chain {
    bodies::gantry(vec![ProxyNodeSpec { position: DVec3::ZERO, radius: 0.0, length: 0.0 }])
}

/// Where the foot goes from one side to another a force with sharp edges leaps: its greatest step does not shrink with
/// the steps. A rounded one has no leap.
#[test]
fn nothing_leaps_where_the_nearest_side_changes() {
    let (object, chain) = (cuboid(), node());
    let [sharp, round] = [contact(1e4), rounded(1e4)].map(|contact| Model::new(&object, &chain, contact));
    let (mut sharp, mut round) = (Solver::new(&sharp), Solver::new(&round));
    // Across the ridges between two sides, and along one that a corner ends.
    for (from, to) in [
        (DVec3::new(0.03, 0.005, 0.024), DVec3::new(0.044, 0.007, 0.004)),
        (DVec3::new(0.045, 0.034, 0.003), DVec3::new(0.032, 0.036, 0.027)),
        (DVec3::new(0.02, 0.02, 0.02), DVec3::new(0.06, 0.05, 0.04)),
    ] {
        let [from, to] = [from, to].map(|place: DVec3| place.to_array());
        let steps =
            |solver: &mut Solver<'_>| [400, 1600].map(|count| greatest_step(solver, [&from, &to], &[1.0; 3], count));
        let (sharp, round) = (steps(&mut sharp), steps(&mut round));
        println!("sharp {sharp:.4?}, round {round:.4?}");
        assert!(round[1] < 0.3 * round[0] && round[1] < 0.02, "{round:?}");
        if to[2] < 0.03 {
            assert!(sharp[1] > 0.9 * sharp[0] && sharp[1] > 0.1, "{sharp:?}");
        }
    }
}

#[test]
fn no_closed_loop_over_an_edge_makes_work() {
    let (object, chain) = (cuboid(), bodies::floating_bar(0.0));
    let model = Model::new(&object, &chain, rounded(1e4));
    let mut solver = Solver::new(&model);
    let worst = bodies::pressed(&model, 5, 2, 0.004, 0.025).into_iter().map(|q| {
        let (work, greatest, _) = work_around(&mut solver, &q);
        work.abs() / greatest
    });
    let worst = worst.fold(0.0, f64::max);
    assert!(worst > 0.0 && worst < 1e-4, "{worst}");
}

/// Away from edges the rounded surface is the surface: forces on a face agree with those of the sharp one.
#[test]
fn far_from_edges_nothing_is_rounded() {
    let (object, chain) = (cuboid(), node());
    let [sharp, round] = [contact(1e4), rounded(1e4)].map(|contact| Model::new(&object, &chain, contact));
    let (mut sharp, mut round) = (Solver::new(&sharp), Solver::new(&round));
    // The blend reaches 16 mm to all sides, where the top is still the nearest.
    for (x, y, depth) in [(0.003, -0.003, 0.001), (-0.012, 0.001, 0.002), (0.001, 0.002, 0.004)] {
        let q = [x, y, 0.5 * SIDES[2] - depth];
        let (sharp, round) = (sharp.solve(&q), round.solve(&q));
        assert!(
            (round.gap - sharp.gap).abs() < 1e-5 && (round.gap + depth).abs() < 1e-5,
            "{} {}",
            round.gap,
            sharp.gap
        );
        let ratio = round.torque[2] / sharp.torque[2];
        println!("{depth}: {ratio}");
        assert!((ratio - 1.0).abs() < 0.1, "{:?} {:?}", round.torque, sharp.torque);
    }
}

/// A quarter of the thickness, as the next test derives it.
#[test]
fn a_part_too_thin_for_the_length_is_refused_with_the_numbers() {
    let (object, chain) = (cuboid(), node());
    let reach = |length| {
        let contact = ContactSpec { round: Some(length), ..contact(1e4) };
        Model::reaching(&object, &chain, contact, &[]).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(reach(0.0149), Ok(()));
    let error = reach(0.0151).unwrap_err();
    assert!(error.contains("60.0 mm thick") && error.contains("15.1 mm") && error.contains("15.0 mm"), "{error}");
}

/// Depths below a face of the box, 60 mm thick, over the length: down from the surface they are those of the face in a
/// part of four lengths, to a hundredth of one, and not in one of one and a half. The middle keeps half the thickness
/// less about half of the length.
#[test]
fn a_part_of_four_lengths_keeps_the_depth_of_both_faces() {
    let (object, chain) = (cuboid(), node());
    for (lengths, keeps) in [(4.0, true), (1.5, false)] {
        let length = SIDES[2] / lengths;
        let flat = ContactSpec { surface: ContactSurface::Facets, round: Some(length), ..contact(1e4) };
        let model = Model::new(&object, &chain, flat);
        let mut solver = Solver::new(&model);
        let mut depth = |z: f64| -solver.gap(&[0.0, 0.0, z]) / length;
        for side in [-1.0, 1.0] {
            let face = depth(0.5 * side * SIDES[2]);
            assert_eq!(face.abs() < 0.01, keeps, "{lengths} lengths: {face}");
        }
        let middle = depth(0.0) - 0.5 * lengths;
        println!("{lengths} lengths: {middle}");
        assert!((-0.6..-0.2).contains(&middle), "{lengths} lengths: {middle}");
    }
}
