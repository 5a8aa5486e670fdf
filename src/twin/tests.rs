//! Bodies of the scene's own kinds, scanned by a rig that is computed configuration by configuration: encoder steps,
//! actuator noise, dry friction of the joints, friction on the surface. The truth has a mesh of its own.

use super::{Approaches, Given, KnownRange, Modulus, ScannedShape, Watched, twin_scene};
use crate::{
    JointVector,
    contact::{Model, Solver, geometry::RestSurface},
    object::Object,
    proxy::{Chain, inverse_kinematics::reach},
    random::Random,
    scan::{LogHeader, Plan, RowStatus, ScanLog, ScanRow, labels},
    scene::{ContactSurface, ScanScene, Scene},
};
use glam::DVec3;
use std::sync::atomic::AtomicBool;

/// Encoder step (rad), actuator noise of an average of 100 ticks, and dry friction of each joint (N m), as of the rig
/// of the sponge; friction on the surface (1).
const ENCODER: f64 = std::f64::consts::TAU / 40_000.0;
const NOISE: f64 = 2e-4;
const JOINT_FRICTION: f64 = 2e-3;
const FRICTION: f64 = 0.3;

/// The arm of the sponge's scene; `nodes` of its forearm.
fn arm(nodes: &str) -> String {
    format!(
        "[[proxy.joint]]
kind = \"revolute\"
origin = [0.0, 0.0, 0.12]
axis = [0.0, 0.0, 1.0]
limits = [-1.2, 1.2]
[[proxy.joint]]
kind = \"revolute\"
axis = [0.0, 1.0, 0.0]
limits = [-0.9, 0.9]
[[proxy.joint]]
kind = \"revolute\"
origin = [0.155, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
limits = [0.5, 2.6]
nodes = [{nodes}]
"
    )
}

const TIP: &str = "{ at = [0.155, 0.0, 0.0], radius = 0.006 }";

/// A tip with four balls around it, 6 mm higher: they touch when the tip is 6 mm deep.
const PAD: &str = "{ at = [0.155, 0.0, 0.0], radius = 0.006 }, { at = [0.149, 0.009, 0.0], radius = 0.006 }, { at = [0.149, \
                   -0.009, 0.0], radius = 0.006 }, { at = [0.149, 0.0, 0.009], radius = 0.006 }, { at = [0.149, 0.0, -0.009], \
                   radius = 0.006 }";

/// A body that is scanned, and how.
struct Specimen {
    /// `[object]` and what belongs to it.
    object: &'static str,
    /// Nodes of the forearm.
    nodes: &'static str,
    /// `[scan.workspace]`.
    plan: &'static str,
}

struct Scanned {
    log: ScanLog,
    scene: ScanScene,
    chain: Chain,
    truth: Object,
    presses: Vec<Press>,
}

/// A press that the scan knows nothing of.
struct Press {
    /// At 0.8 of its depth, at its depth, at twice its depth.
    q: [JointVector; 3],
    torque: [JointVector; 3],
    /// Of the truth's surface at its depth (m).
    displacement: Vec<DVec3>,
}

impl Specimen {
    fn scene(&self) -> String {
        format!("{}\n{}", self.object, arm(self.nodes))
            + "[contact]\nsurface = \"smooth\"\nstiffness = \"rigid\"\n[grid]\naxes = [{ start = 0.0, stop = 0.1, count = 2 }, \
               { start = 0.0, stop = 0.1, count = 2 }, { start = 1.0, stop = 1.1, count = 2 }]\n"
    }

    /// The log of the whole plan, and presses at places across (m), so `deep` (m).
    fn scan(&self, seed: u64, (places, deep): (&[[f64; 2]], f64)) -> Scanned {
        let truth = Scene::parse(&self.scene(), "datasets/truth.toml").unwrap();
        let scan = "[scan.limits]\nworkspace = [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]\n[scan.simulated]\ncorner = [0.0, 0.0, \
                    0.0]\nsize = [0.1, 0.1, 0.1]\n";
        let text = format!("{}[scan.workspace]\n{}\n{scan}", arm(self.nodes), self.plan);
        let scene = ScanScene::parse(&text, "scan.toml").unwrap();
        let chain = Chain::new(&scene.proxy);
        let plan = Plan::new(&scene.scan, &chain).unwrap();
        let object = Object::build(&truth.object).unwrap();
        let model = Model::new(&object, &chain, truth.contact);
        let mut solver = Solver::new(&model);
        let (mut random, mut rows, mut before) = (Random::new(seed), Vec::new(), plan.stops[0].q);
        let mut rubbing = JointVector::zeros(3);
        for stop in &plan.stops {
            let equilibrium = solver.solve(&stop.q);
            let mut torque = equilibrium.torque;
            let moved: Vec<f64> = stop.q.iter().zip(before.iter()).map(|(a, b)| a - b).collect();
            for touch in &equilibrium.touches {
                // Against the part of the node's way that is along the surface.
                let way: DVec3 =
                    (0..3).map(|k| moved[k] * chain.jacobian_column(solver.pose(), touch.proxy_node as usize, k)).sum();
                let along = way - way.project_onto(touch.force.normalize_or(DVec3::Z));
                let sliding = (along.length() / way.length().max(1e-12)).min(0.2) / 0.2;
                let force = -FRICTION * sliding * touch.force.length() * along.normalize_or_zero();
                chain.add_torque(solver.pose(), touch.proxy_node as usize, force, &mut torque);
            }
            for k in 0..3 {
                if moved[k] != 0.0 {
                    rubbing[k] = -moved[k].signum() * JOINT_FRICTION * random.between(0.7, 1.0);
                }
                torque[k] += rubbing[k] + NOISE * random.normal();
            }
            before = stop.q;
            let Some(point) = stop.point else { continue };
            let mut q = stop.q;
            q.iter_mut().for_each(|x| *x = (*x / ENCODER).round() * ENCODER);
            let mut deviation = JointVector::zeros(3);
            deviation.fill(10.0 * NOISE);
            let time = rows.len() as f64;
            rows.push(ScanRow { point, time, q, torque, deviation, ticks: 100, status: RowStatus::Steady });
        }
        let mut near = plan.stops[0].q;
        let mut press = |[x, y]: &[f64; 2]| {
            let mut at = |z: f64| {
                near = reach(&chain, 0, DVec3::new(*x, *y, z), &near).unwrap();
                near
            };
            // Down by what is missing: the gap grows no faster than the way.
            let mut top = 0.03;
            for _ in 0..30 {
                top -= solver.gap(&at(top));
            }
            let q = [0.8, 1.0, 2.0].map(|share| at(top - share * deep));
            let torque = q.map(|q| solver.solve(&q).torque);
            assert!(solver.solve(&q[1]).gap < 0.0);
            Press { q, torque, displacement: solver.displacement().chunks_exact(3).map(DVec3::from_slice).collect() }
        };
        let presses = places.iter().map(&mut press).collect();
        drop(solver);
        drop(model);
        let header = LogHeader { joints: labels(&chain), simulated: true, scene: text, ..LogHeader::default() };
        Scanned { log: ScanLog { header, rows }, scene, chain, truth: object, presses }
    }
}

/// A ball of 40 mm radius on a small foot, its top at z = 0, scanned from above.
const SPHERE: Specimen = Specimen {
    object: "[object.sphere]
centre = [0.16, 0.0, -0.04]
radius = 0.04
edge = 0.007
[object.elasticity]
young = 1e4
poisson = 0.45
cell = 0.008
[object.skin]
width = 0.02
[object.ground]
clamp = true
below = -0.07",
    nodes: TIP,
    plan: "start = [0.124, -0.036, 0.009]
across = [
    { direction = [0.0, 1.0, 0.0], spacing = 0.006, count = 13 },
    { direction = [1.0, 0.0, 0.0], spacing = 0.006, count = 13 },
]
depth = { direction = [0.0, 0.0, -1.0], spacing = 0.003, count = 13 }
clearance = 0.004",
};

/// A slab of 80 x 60 x 30 mm, its top at z = 0, scanned 6 mm deep by a fingertip whose sides touch beyond.
const SLAB: Specimen = Specimen {
    object: "[object.mesh]
file = \"slab.obj\"
scale = 0.001
centre = [0.16, 0.0, 0.0]
refine = 0.007
[object.elasticity]
young = 8e3
poisson = 0.45
cell = 0.007
[object.skin]
width = 0.02
[object.ground]
clamp = true
below = -0.0299",
    nodes: PAD,
    plan: "node = 0
start = [0.124, -0.027, 0.008]
across = [
    { direction = [0.0, 1.0, 0.0], spacing = 0.006, count = 10 },
    { direction = [1.0, 0.0, 0.0], spacing = 0.006, count = 13 },
]
depth = { direction = [0.0, 0.0, -1.0], spacing = 0.002, count = 5 }
clearance = 0.004",
};

/// The bean of the scene that ships in its bed, scanned from above.
const BEAN: Specimen = Specimen {
    object: "[object.mesh]
file = \"bean.obj\"
scale = 0.0008
centre = [0.165, 0.0, -0.03]
refine = 0.007
[object.elasticity]
young = 1.5e4
poisson = 0.45
cell = 0.008
[object.skin]
width = 0.02
[object.ground]
clamp = true
below = -0.035",
    nodes: TIP,
    plan: "start = [0.124, -0.039, 0.007]
across = [
    { direction = [0.0, 1.0, 0.0], spacing = 0.006, count = 14 },
    { direction = [1.0, 0.0, 0.0], spacing = 0.006, count = 14 },
]
depth = { direction = [0.0, 0.0, -1.0], spacing = 0.003, count = 12 }
clearance = 0.004",
};

/// How a twin is to what it was scanned of.
#[derive(Debug)]
struct Likeness {
    /// Estimated over true modulus (1).
    modulus: f64,
    /// Difference of displacement under presses held out, rms over the nodes that were touched, over the largest (1).
    displacement: f64,
    /// Error of the torque of such presses, at their depth and at twice it, over that torque; and that of a line through
    /// the last two levels.
    torque: [f64; 3],
    misfit: f64,
    /// Distance of the surface that was touched to that of the truth, rms, over the spacing (1).
    surface: f64,
    /// Coefficient of friction (1), whose truth is [`FRICTION`].
    friction: f64,
}

/// Modulus from which the search begins (Pa).
const START: f64 = 5e3;

/// What `then` makes of the twin of what was scanned, on a ground at `ground` under a skin of `width` (m): of its shape, its
/// modulus, and contact with it at [`START`].
fn with_twin<T>(
    scanned: &Scanned,
    [ground, width]: [f64; 2],
    then: impl FnOnce(&ScannedShape, &Modulus, &mut Solver<'_>) -> T,
) -> T {
    let Scanned { log, scene, chain, .. } = scanned;
    let approaches = Approaches::new(log, scene, chain).unwrap();
    let shape = ScannedShape::new(&approaches, chain, Some(ground)).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let [file, path] = ["twin.obj", "twin.toml"].map(|name| folder.path().join(name));
    std::fs::write(&file, shape.obj()).unwrap();
    let mesh = (file.as_path(), "twin.obj");
    let (range, given) = (KnownRange::around(&approaches), Given { width: Some(width), cell: None });
    let twin = twin_scene((&scene.text, &path), mesh, (&shape, &range), START, given).unwrap();
    let object = Object::build(&twin.object).unwrap();
    // What is known of a node of the shape is known of the twin's of the same number. A scene has places to 1e-6 m.
    assert!(shape.nodes.iter().zip(&object.rest).all(|(own, read)| own.distance(*read) < 2e-6));
    let mut model = Model::new(&object, chain, twin.contact);
    let watched = &mut Watched { stop: &AtomicBool::new(false), progress: &mut |_, _| () };
    let modulus = Modulus::fit(&mut model, START, (&approaches, &shape), watched).unwrap();
    then(&shape, &modulus, &mut Solver::new(&model))
}

/// The twin of `specimen` on a ground at `ground`, of true modulus `young` and skin `width`; presses at three `places`,
/// so `deep` (m).
fn likeness(specimen: &Specimen, [ground, young, width]: [f64; 3], places: [[f64; 2]; 3], deep: f64) -> Likeness {
    let scanned = specimen.scan(2, (&places, deep));
    with_twin(&scanned, [ground, width], |shape, modulus, solver| compare(&scanned, young, shape, modulus, solver))
}

/// How the twin answers the presses of `scanned`, whose true modulus is `young` (Pa).
fn compare(
    Scanned { truth, presses, .. }: &Scanned,
    young: f64,
    shape: &ScannedShape,
    modulus: &Modulus,
    solver: &mut Solver<'_>,
) -> Likeness {
    // In rigid contact torque is in proportion to the modulus, and displacement does not depend on it.
    let ratio = modulus.young / START;
    let (mut squares, mut count, mut largest, mut worst) = (0.0, 0.0, 0.0_f64, [0.0_f64; 3]);
    for Press { q, torque, displacement } in presses {
        let own = q.map(|q| solver.solve(&q).torque.iter().map(|tau| ratio * tau).collect::<Vec<f64>>());
        let line: Vec<f64> =
            torque[1].iter().zip(torque[0].iter()).map(|(end, before)| end + 5.0 * (end - before)).collect();
        for (worst, (truth, said)) in
            worst.iter_mut().zip([(&torque[1], &own[1][..]), (&torque[2], &own[2][..]), (&torque[2], &line[..])])
        {
            let off: f64 = truth.iter().zip(said).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            *worst = worst.max(off / truth.norm());
        }
        assert!(solver.solve(&q[1]).gap < 0.0);
        let touched = shape.deviations.iter().map(Option::is_some);
        let moved = solver.displacement().chunks_exact(3).map(DVec3::from_slice);
        for (x, own) in shape.nodes.iter().zip(moved).zip(touched).filter(|(_, touched)| *touched).map(|(pair, _)| pair)
        {
            // Between the three nearest nodes of the truth, by their distances.
            let mut nearest: Vec<(f64, usize)> =
                (0..truth.surface_nodes).map(|n| (truth.rest[n].distance_squared(*x), n)).collect();
            nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
            let weight = |square: f64| 1.0 / (square + 1e-12);
            let sum: f64 = nearest[..3].iter().map(|(square, _)| weight(*square)).sum();
            let there = nearest[..3].iter().map(|(square, n)| weight(*square) / sum * displacement[*n]).sum::<DVec3>();
            squares += there.distance_squared(own);
            count += 1.0;
        }
        largest = displacement.iter().map(|u| u.length()).fold(largest, f64::max);
    }
    let surface = RestSurface::new(truth, ContactSurface::Smooth);
    let offs = shape.nodes.iter().zip(&shape.deviations).filter(|(_, known)| known.is_some());
    let offs: Vec<f64> = offs.map(|(x, _)| surface.signed_distance(*x - surface.centre, u32::MAX)).collect();
    Likeness {
        surface: f64::sqrt(offs.iter().map(|off| off * off).sum::<f64>() / offs.len() as f64) / shape.spacing,
        modulus: modulus.young / young,
        displacement: f64::sqrt(squares / count) / largest,
        torque: worst,
        misfit: modulus.misfit / modulus.torque,
        friction: modulus.friction,
    }
}

#[test]
fn the_twin_of_a_slab_is_as_stiff_moves_alike_and_answers_deeper_than_was_scanned() {
    let places = [[0.151, 0.004], [0.163, -0.011], [0.179, 0.008]];
    let found = likeness(&SLAB, [-0.03, 8e3, 0.02], places, 0.006);
    println!("slab: {found:?}");
    assert!(found.misfit < 0.05);
    assert!((found.modulus - 1.0).abs() < 0.1 && found.displacement < 0.1 && found.torque[1] < 0.15);
    assert!(found.surface < 0.1);
}

#[test]
fn the_twin_of_a_ball_is_as_stiff_and_answers_deeper_than_a_line() {
    let found = likeness(&SPHERE, [-0.07, 1e4, 0.02], [[0.157, 0.004], [0.163, -0.008], [0.172, 0.007]], 0.01);
    println!("ball: {found:?}");
    assert!((found.friction - FRICTION).abs() < 0.1);
    assert!((found.modulus - 1.0).abs() < 0.1 && found.displacement < 0.1);
    assert!(found.torque[1] < 0.15 && found.torque[1] < found.torque[2]);
}

#[test]
fn the_twin_of_a_bean_is_as_stiff_and_moves_alike() {
    let found = likeness(&BEAN, [-0.04, 1.5e4, 0.02], [[0.165, 0.002], [0.157, -0.006], [0.173, 0.006]], 0.008);
    println!("bean: {found:?}");
    assert!((found.modulus - 1.0).abs() < 0.1 && found.displacement < 0.1 && found.torque[0] < 0.1);
    assert!(found.surface < 0.1);
    // It lies in a bed that holds its sides, which no flat ground does: twice as deep, a line errs less.
    assert!(found.torque[1] < 0.25);
}

/// A ball of ten times the slab's stiffness, 3 mm below its top, is seen from outside.
#[test]
fn a_nodule_is_seen_in_the_map_of_moduli() {
    let nodule = Specimen {
        object: "[object.mesh]
file = \"slab.obj\"
scale = 0.001
centre = [0.16, 0.0, 0.0]
refine = 0.007
[object.elasticity]
young = 8e3
poisson = 0.45
cell = 0.01
inclusion = [{ sphere = { centre = [0.171, 0.002, -0.010], radius = 0.007 }, young = 8e4 }]
[object.skin]
width = 0.02
[object.ground]
clamp = true
below = -0.0299",
        nodes: TIP,
        ..SLAB
    };
    let scanned = nodule.scan(4, (&[], 0.0));
    with_twin(&scanned, [-0.03, 0.02], |shape, modulus, _| {
        let apparent = |touched: &super::Touched| modulus.apparent.get(&touched.line).copied();
        let known = shape.touched.iter().filter_map(|touched| Some((touched.place, apparent(touched)?)));
        let stiffest = known.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        let (off, contrast) =
            ((stiffest.0 - DVec3::new(0.171, 0.002, stiffest.0.z)).length(), stiffest.1 / modulus.young);
        println!("nodule: {:.1} mm off, contrast {contrast:.2}, spacing {:.1} mm", 1e3 * off, 1e3 * shape.spacing);
        assert!(off < shape.spacing && contrast > 1.03, "{off} {contrast}");
    });
}

/// The ground clamps the underside of a twin, to which contact goes past the middle.
#[test]
fn the_grid_of_a_twin_is_no_deeper_than_the_rows_that_count_and_its_torque_as_bounded() {
    let scanned = Specimen { nodes: TIP, plan: DEEP, ..SLAB }.scan(5, (&[], 0.0));
    let Scanned { log, scene, chain, .. } = &scanned;
    let approaches = Approaches::new(log, scene, chain).unwrap();
    let around = KnownRange::around(&approaches);
    with_twin(&scanned, [-0.03, 0.02], |shape, modulus, solver| {
        let range = around.no_deeper(modulus.deepest, shape, chain);
        assert!(modulus.counted < modulus.rows && modulus.deepest < 0.03, "{modulus:?}");
        let held = |range: &KnownRange, solver: &mut Solver<'_>| {
            let forces: Vec<f64> = range.grid().iter().map(|q| solver.solve(q).torque.norm()).collect();
            forces.into_iter().fold(0.0, f64::max) * modulus.young / START
        };
        let [whole, within] = [&around, &range].map(|range| held(range, solver));
        println!("torque over the whole box {whole:.3}, within {within:.3} N m; {range:?}");
        assert!(within > 0.0 && whole > 1e3 * within);
    });
}

/// Through the slab, almost.
const DEEP: &str = "node = 0
start = [0.124, -0.027, 0.012]
across = [
    { direction = [0.0, 1.0, 0.0], spacing = 0.006, count = 10 },
    { direction = [1.0, 0.0, 0.0], spacing = 0.006, count = 13 },
]
depth = { direction = [0.0, 0.0, -1.0], spacing = 0.004, count = 9 }
clearance = 0.004";

#[test]
fn a_ball_is_found_to_a_tenth_of_the_spacing() {
    let scanned = SPHERE.scan(1, (&[], 0.0));
    let approaches = Approaches::new(&scanned.log, &scanned.scene, &scanned.chain).unwrap();
    let shape = ScannedShape::new(&approaches, &scanned.chain, Some(-0.08)).unwrap();
    let centre = DVec3::new(0.16, 0.0, -0.04);
    let rms = |errors: &[f64]| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let places: Vec<f64> = shape.touched.iter().map(|t| t.place.distance(centre) - 0.04).collect();
    let measured = shape.nodes.iter().zip(&shape.deviations).filter(|(_, deviation)| deviation.is_some());
    let errors: Vec<f64> = measured.map(|(x, _)| x.distance(centre) - 0.04).collect();
    // A surface that is one spacing off is not found.
    assert!(rms(&places) < 0.1 * shape.spacing, "{}", rms(&places));
    println!(
        "surface {:.3} mm rms, told {:.3} mm, held out {:.3} mm; {:?}, {} nodes, exponent {}",
        1e3 * rms(&errors),
        1e3 * shape.deviation(),
        1e3 * shape.held_out,
        shape.carving,
        shape.nodes.len(),
        approaches.exponent
    );
    assert!(rms(&errors) < 0.1 * shape.spacing);
}
