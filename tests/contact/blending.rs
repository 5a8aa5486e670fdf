//! Facets that pass into each other: continuous torque, exact depth below a plane, one smooth surface from inside and outside.

use crate::fixture::{Sequence, arm, ball, contact, object, octahedron, probe, random_configurations, sphere};
use glam::DVec3;
use haptize::JointVector;
use haptize::contact::{Model, NodeForce, Solver, Status};
use haptize::haptize::Inspection;
use haptize::object::Object;
use haptize::proxy::Chain;
use haptize::report::stability::contact::world::{self, Ball, RADIUS, floating_bar, joint, pressed};
use haptize::scene::{Algorithm, Blending, ContactSpec, JointKind::Prismatic, ProxyNodeSpec, ProxySpec, SpringKind};
use haptize::tolerances::FACET_ROUNDING;

fn blended(algorithm: Algorithm, stiffness: f64, blending: Blending) -> ContactSpec {
    ContactSpec { blending, ..contact(algorithm, stiffness) }
}

/// Largest change of torque between neighbours of `steps` + 1 configurations on the way from `a` to `b`, over its size.
fn largest_step(solver: &mut Solver, a: &[f64], b: &[f64], steps: u32) -> f64 {
    let (mut largest, mut size) = (0.0f64, 0.0f64);
    let mut before: Option<JointVector> = None;
    for k in 0..=steps {
        let share = f64::from(k) / f64::from(steps);
        let q: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect();
        let now = solver.solve(&q).torque;
        size = size.max(now.norm());
        if let Some(before) = before {
            let change = before.iter().zip(now.iter()).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
            largest = largest.max(change);
        }
        before = Some(now);
    }
    largest / size.max(1e-9)
}

/// Ten times finer steps change torque ten times less, where sharp facets make it jump. The paths are as deep as a tenth of the
/// radius: deeper, this sphere of springs without bending stiffness may buckle from one equilibrium to another, whatever the
/// facets are.
#[test]
fn torque_is_continuous_along_paths() {
    let object = sphere(SpringKind::Isotropic);
    let mut jumps = 0;
    for radius in [0.0, 0.008] {
        let chain = Chain::new(&arm(radius));
        let sharp = Model::new(&object, &chain, contact(Algorithm::Energy, 500.0));
        let smooth = Model::new(&object, &chain, blended(Algorithm::Energy, 500.0, Blending::Mesh));
        assert!(smooth.blending > 0.004 && smooth.blending < 0.02, "{} m", smooth.blending);
        let (mut sharp, mut smooth) = (Solver::new(&sharp), Solver::new(&smooth));
        let mut paths = 0;
        for q in random_configurations(21, 1200) {
            let gap = smooth.gap(&q);
            if !(-0.005..-0.001).contains(&gap) || paths == 10 {
                continue;
            }
            paths += 1;
            let end: Vec<f64> = q.iter().zip([0.05, -0.0025, 0.005]).map(|(q, step)| q + step).collect();
            let (coarse, fine) = (largest_step(&mut smooth, &q, &end, 100), largest_step(&mut smooth, &q, &end, 1000));
            assert!(fine < coarse / 7.0, "{coarse} to {fine} from {q:?}, radius {radius}");
            if radius == 0.0 {
                let (coarse, fine) =
                    (largest_step(&mut sharp, &q, &end, 100), largest_step(&mut sharp, &q, &end, 1000));
                jumps += usize::from(fine > coarse / 2.0);
            }
        }
        assert_eq!(paths, 10);
    }
    assert!(jumps >= 2, "{jumps} of 10 paths jump between sharp facets");
}

/// tau = -dU/dq everywhere, without a kink to leave out, down to a tenth of the radius as above.
#[test]
fn torque_is_minus_the_gradient_of_stored_energy() {
    let h = 2e-6;
    let object = sphere(SpringKind::Isotropic);
    for radius in [0.0, 0.008] {
        let chain = Chain::new(&arm(radius));
        let model = Model::new(&object, &chain, blended(Algorithm::Energy, 500.0, Blending::Mesh));
        let mut solver = Solver::new(&model);
        let mut derivatives = 0;
        for q in random_configurations(6, 400) {
            let here = solver.solve(&q);
            if here.status != Status::Contact || here.gap < -0.005 {
                continue;
            }
            for joint in 0..q.len() {
                let mut at = |step: f64| {
                    let mut q = q.clone();
                    q[joint] += step;
                    solver.solve(&q).energy
                };
                let slope = (at(h) - at(-h)) / (2.0 * h);
                let scale = here.torque.norm().max(1e-3);
                assert!((slope + here.torque[joint]).abs() < 1e-5 * scale, "{slope} against {:?}", here.torque);
                derivatives += 1;
            }
        }
        assert!(derivatives > 40, "{derivatives}");
    }
}

/// Forces on the object hold the displacement, u = C f: also what stretches triangles, and the proxy does not feel.
#[test]
fn forces_on_the_object_hold_its_displacement() {
    let object = sphere(SpringKind::Isotropic);
    let chain = Chain::new(&arm(0.008));
    let model = Model::new(&object, &chain, blended(Algorithm::Energy, 500.0, Blending::Mesh));
    let mut solver = Solver::new(&model);
    let touching = |q: &Vec<f64>| solver.solve(q).status == Status::Contact;
    let q = random_configurations(6, 60).into_iter().find(touching).unwrap();
    let result = solver.solve(&q);
    let moved_by = |force: &NodeForce, node: usize| model.compliance.block(node, force.node as usize) * force.force;
    let expected = (0..model.rest.len()).flat_map(|node| {
        let moved: DVec3 = result.forces.iter().map(|force| moved_by(force, node)).sum();
        moved.to_array()
    });
    let size = solver.displacement().iter().fold(0.0f64, |size, u| size.max(u.abs()));
    for (found, expected) in solver.displacement().iter().zip(expected) {
        assert!((found - expected).abs() < 1e-6 * size, "{found} {expected}");
    }
}

/// On the middle of a face, farther from its edges than facets blend, nothing changes.
#[test]
fn below_a_plane_nothing_changes() {
    let object = octahedron();
    let outward = DVec3::ONE.normalize();
    let middle = DVec3::splat(0.1 / 2.0f64.sqrt() / 3.0);
    for radius in [0.0, 0.01] {
        let chain = ball(middle + outward * radius, -outward, radius);
        let sharp = Model::new(&object, &chain, contact(Algorithm::Energy, 500.0));
        let smooth = Model::new(&object, &chain, blended(Algorithm::Energy, 500.0, Blending::Width(0.015)));
        let near = Model::new(&object, &chain, blended(Algorithm::Energy, 500.0, Blending::Width(0.05)));
        for depth in [-0.001, 0.001, 0.003] {
            let [sharp, smooth, near] = [&sharp, &smooth, &near].map(|model| Solver::new(model).solve(&[depth]));
            assert_eq!(sharp.status, smooth.status);
            assert!((sharp.gap - smooth.gap).abs() < 1e-15);
            // Sharp facets are rounded for balls, which are smaller by 1/2 k r at most.
            let rounded = if radius > 0.0 { FACET_ROUNDING * radius / depth.abs() } else { 0.0 };
            assert!((sharp.energy - smooth.energy).abs() <= (1e-9 + rounded) * sharp.energy);
            assert!((sharp.torque[0] - smooth.torque[0]).abs() <= (1e-9 + rounded) * sharp.torque[0].abs());
            assert!((sharp.gap - near.gap).abs() > 1e-6, "wide enough to feel the other faces");
        }
    }
}

/// A box with the corner `size` [m].
fn cuboid(size: DVec3) -> Object {
    let corner = |k: u32| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2)) * size;
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    object((0..8).map(corner).collect(), triangles)
}

/// A wedge 0.1 m long, 0.1 m high and 20 mm thick at its base: a blade of eleven degrees.
fn blade() -> Object {
    let nodes = [0.0, 0.1]
        .into_iter()
        .flat_map(|z| [DVec3::new(-0.01, 0.0, z), DVec3::new(0.01, 0.0, z), DVec3::new(0.0, 0.1, z)])
        .collect();
    let triangles = vec![[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]];
    object(nodes, triangles)
}

/// Outside, a ball's gap exceeds the true one by no more than the bulge of edges, a few widths, and the less the farther its
/// centre is away: no edge is felt from afar, however sharp.
#[test]
fn outside_the_gap_tends_to_the_true_distance() {
    let width = 0.004;
    for (object, sharpest) in [(cuboid(DVec3::splat(0.1)), 1.0), (octahedron(), 1.0), (blade(), 2.2)] {
        let radius = 0.2;
        let joints = vec![
            joint(Prismatic, DVec3::ZERO, DVec3::X, vec![]),
            joint(Prismatic, DVec3::ZERO, DVec3::Y, vec![]),
            joint(Prismatic, DVec3::ZERO, DVec3::Z, vec![ProxyNodeSpec { position: DVec3::ZERO, radius }]),
        ];
        let chain = Chain::new(&ProxySpec { joints });
        let sharp = Model::new(&object, &chain, contact(Algorithm::Energy, 500.0));
        let smooth = Model::new(&object, &chain, blended(Algorithm::Energy, 500.0, Blending::Width(width)));
        let (mut sharp, mut smooth) = (Solver::new(&sharp), Solver::new(&smooth));
        let mut sequence = Sequence::new(3);
        let (mut near, mut far, mut count) = (0.0f64, 0.0f64, 0);
        for _ in 0..3000 {
            let q = [0; 3].map(|_| sequence.between(-0.15, 0.25));
            let gap = sharp.gap(&q);
            let distance = gap + radius;
            if distance < 0.0 {
                continue;
            }
            let excess = (gap - smooth.gap(&q)) / width;
            assert!(excess > -1.0, "{excess} at {q:?}");
            near = near.max(excess);
            if distance > 15.0 * width {
                far = far.max(excess.abs());
                count += 1;
            }
        }
        assert!(count > 100 && near <= sharpest && far < 0.3, "{near} and, far away, {far} widths");
    }
}

/// Balls as soft as what they press: centres come to lie on sharp edges and vertices of their dents, to which E falls from all
/// sides, and where only a mean of forces balances. Between blended facets there is no such place. The hardest of springs, without
/// stiffness against bending, held at the underside alone and pressed as deep as half the radius, converge either way.
#[test]
fn contact_in_deep_dents_converges() {
    let axial = |ground: f64, patch: bool| Ball { rings: 10, springs: SpringKind::Axial, ground, patch };
    for (ball, stiffness) in [(axial(1e3, false), 1e3), (axial(1e4, true), 1e4)] {
        let object = world::sphere(ball).unwrap();
        let chain = floating_bar(world::BALL);
        let mut model = Model::new(&object, &chain, world::contact(stiffness));
        let configurations = pressed(&model, 1, 30, 0.2 * RADIUS, 0.5 * RADIUS);
        let converged = |model: &Model| {
            let mut solver = Solver::new(model);
            configurations.iter().filter(|q| solver.solve(q).status == Status::Contact).count()
        };
        let sharp = converged(&model);
        assert!(sharp >= 29, "{sharp} of 30 between sharp facets");
        model.set_blending(Blending::Mesh);
        let smooth = converged(&model);
        assert!(smooth >= 29, "{smooth} of 30 between blended ones");
    }
}

/// The gap is one continuous function inside and outside, contact begins where it is zero, and linearised contact tends to the
/// energy form there.
#[test]
fn one_surface_decides_contact_from_inside_and_outside() {
    let object = sphere(SpringKind::Isotropic);
    let chain = probe(crate::fixture::SPHERE_CENTRE + DVec3::new(0.011, 0.007, 0.056), -DVec3::Z);
    let model = Model::new(&object, &chain, blended(Algorithm::Energy, 500.0, Blending::Mesh));
    let frozen = Model::new(&object, &chain, blended(Algorithm::Linearised, 500.0, Blending::Mesh));
    let (mut solver, mut frozen) = (Solver::new(&model), Solver::new(&frozen));
    let (mut before, mut inside, mut outside) = (None::<f64>, 0, 0);
    for k in 0..=400 {
        let result = solver.solve(&[f64::from(k) * 2.5e-5]);
        assert_eq!(result.status == Status::Free, result.gap >= 0.0);
        if let Some(before) = before {
            // No steeper than the node moves, but for the slope of the blend.
            assert!((result.gap - before).abs() < 1.5 * 2.5e-5 && result.gap < before, "{before} to {}", result.gap);
        }
        before = Some(result.gap);
        *(if result.gap < 0.0 { &mut inside } else { &mut outside }) += 1;
        if result.gap < 0.0 && result.gap > -1e-4 {
            let linear = frozen.solve(&[f64::from(k) * 2.5e-5]);
            assert!(
                (linear.torque[0] / result.torque[0] - 1.0).abs() < 0.01,
                "{} {}",
                linear.torque[0],
                result.torque[0]
            );
        }
    }
    assert!(inside > 50 && outside > 50);
}

/// A depth made of many features is told whole: their forces make the torque.
#[test]
fn an_inspection_tells_all_features_of_a_blended_depth() {
    let object = sphere(SpringKind::Isotropic);
    let chain = Chain::new(&arm(0.0));
    let model = Model::new(&object, &chain, blended(Algorithm::Energy, 500.0, Blending::Mesh));
    let mut solver = Solver::new(&model);
    let touching = |q: &Vec<f64>| solver.solve(q).status == Status::Contact;
    let q = random_configurations(6, 60).into_iter().find(touching).unwrap();
    let inspection = Inspection::new(&model, &q);
    assert!(inspection.proxy_nodes.iter().any(|node| node.contacts.len() > 1));
    for (found, expected) in inspection.torque_of_contacts().iter().zip(&inspection.torque) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}

/// Beside a right-angled edge the blended surface stands out by a quarter of the width, and no farther.
#[test]
fn a_right_angled_edge_bulges_by_a_quarter_of_the_width() {
    let cube = cuboid(DVec3::splat(0.1));
    let width = 0.01;
    let mut greatest = 0.0f64;
    for from_edge in 0..=60 {
        // Over the top face, near its edge at x = 0 and far from the others, also that between its two triangles.
        let place = DVec3::new(2e-4 * f64::from(from_edge), 0.05, 0.1);
        let chain = probe(place, DVec3::Z);
        let model = Model::new(&cube, &chain, blended(Algorithm::Energy, 500.0, Blending::Width(width)));
        let mut solver = Solver::new(&model);
        let (mut low, mut high) = (-0.5 * width, width);
        assert!(solver.gap(&[low]) < 0.0 && solver.gap(&[high]) > 0.0);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            *(if solver.gap(&[middle]) < 0.0 { &mut low } else { &mut high }) = middle;
        }
        greatest = greatest.max(low / width);
    }
    assert!((greatest - 0.25).abs() < 0.01, "{greatest} of the width");
}
