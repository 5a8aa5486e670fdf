//! Contact solved along a way: the same as that of the solver, bounded, and unmoved by what no arm does.

use haptize::JointVector;
use haptize::contact::{LiveSolver, Model, Solver, Status};
use haptize::device::Motion;
use haptize::fixtures::Random;
use haptize::object::Object;
use haptize::proxy::Chain;
use haptize::scene::{ContactLaw, Scene};

/// Rounding of a torque, over the largest entry, and of an energy, over itself (1): the sets of rows are the same, and
/// their order is not; in stiff contact rows are good to 1e-16 kc times the object's compliance, 1e-10.
const ROUNDING: f64 = 1e-9;

/// Rounding of a distance between two points of coordinates below a metre (m).
const LENGTH_ROUNDING: f64 = 1e-15;

/// The shipped scene of this name with the law at rest, after `edit`.
fn scene(name: &str, edit: impl Fn(String) -> String) -> Scene {
    let path = format!("{}/datasets/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = edit(std::fs::read_to_string(&path).unwrap());
    let mut scene = Scene::parse(&text, path).unwrap();
    scene.contact.law = ContactLaw::Rest;
    scene
}

/// Runs `check` with the model of `scene`.
fn with_model(scene: &Scene, check: impl FnOnce(&Model<'_>)) {
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    check(&Model::new(&object, &chain, scene.contact));
}

/// A random configuration of the grid of `scene`.
fn place(scene: &Scene, random: &mut Random) -> JointVector {
    let axes = scene.grid.axes.iter();
    let place = axes.map(|axis| random.between(axis.start, axis.start + axis.step * (axis.count - 1) as f64));
    JointVector::from_slice(&place.collect::<Vec<_>>())
}

/// Along the scenes' own motions, a millisecond a step, and after leaps from one random configuration to another.
#[test]
fn live_contact_is_that_of_the_solver_wherever_it_comes_from() {
    for (name, round) in [("sphere", ""), ("mesh", ""), ("organ", ""), ("touch", ""), ("mesh", "\nround = 0.005")] {
        let scene = scene(name, |text| text.replace("[contact]", &format!("[contact]{round}")));
        with_model(&scene, |model| {
            let (mut live, mut solver) = (LiveSolver::new(model), Solver::new(model));
            let mut random = Random::new(31);
            let motions = [&scene.motion.press, &scene.motion.scrape].map(|way| Motion::through(way, way[0].q.len()));
            let mut places: Vec<JointVector> = Vec::new();
            for motion in motions.map(Result::unwrap) {
                places.extend((0..(500.0 * motion.duration()) as usize).map(|k| motion.at(2e-3 * k as f64).0));
            }
            places.extend((0..400).map(|_| place(&scene, &mut random)));
            let (mut touched, mut worst) = (0, 0.0_f64);
            for q in &places {
                let (found, expected) = (live.solve(q), solver.solve(q));
                assert_eq!(found.status, expected.status, "{name} {:?}", &q[..]);
                assert!((found.gap - expected.gap).abs() <= LENGTH_ROUNDING, "{name} {:?}", &q[..]);
                let size = expected.torque.iter().fold(0.0_f64, |most, tau| most.max(tau.abs()));
                let pairs = found.torque.iter().zip(expected.torque.iter());
                let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off <= ROUNDING * size, "{name} {:?}: {off} of {size}", &q[..]);
                assert!((found.energy - expected.energy).abs() <= ROUNDING * expected.energy, "{name}");
                assert_eq!(found.contact_nodes as usize, expected.forces.len(), "{name}");
                let nodes: Vec<u32> = expected.touches.iter().map(|touch| touch.proxy_node).collect();
                let mut own: Vec<u32> = live.on_proxy().iter().map(|force| force.node).collect();
                own.sort_unstable();
                assert_eq!(own, nodes, "{name}");
                touched += usize::from(found.status == Status::Contact);
                worst = worst.max(if size > 0.0 { off / size } else { 0.0 });
            }
            println!("{name}: {touched} of {} in contact, {worst:.1e} off", places.len());
            assert!(touched > 200, "{name}: {touched}");
        });
    }
}

/// Steps of central differences (rad).
const STEP: f64 = 1e-6;

/// With twelve joints, too many for a grid: the torque is minus the gradient of the energy, the tangent that of the
/// torque.
#[test]
fn an_arm_of_twelve_joints_is_pushed_down_the_gradient_of_the_energy() {
    let scene = Scene::parse(include_str!("../scenes/snake.toml"), "snake.toml").unwrap();
    assert_eq!(scene.proxy.joints.len(), haptize::MAX_JOINTS);
    with_model(&scene, |model| {
        let mut model = model.clone();
        model.with_tangent = true;
        let (mut live, mut solver) = (LiveSolver::new(&model), Solver::new(&model));
        let mut random = Random::new(5);
        let (mut touched, mut worst, mut worst_tangent) = (0, 0.0_f64, 0.0_f64);
        for _ in 0..200 {
            let mut q = scene.motion.press[1].q;
            q.iter_mut().for_each(|q| *q += random.between(-0.02, 0.02));
            let (here, expected) = (live.solve(&q), solver.solve(&q));
            assert_eq!(here.status, expected.status);
            if here.status == Status::Free {
                continue;
            }
            let size = expected.torque.iter().fold(0.0_f64, |most, tau| most.max(tau.abs()));
            let steep = expected.tangent.unwrap();
            let stiffest = steep.as_flattened().iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
            for joint in 0..q.len() {
                let [before, after] = [-STEP, STEP].map(|step| {
                    let mut moved = q;
                    moved[joint] += step;
                    solver.solve(&moved)
                });
                if [&before, &after].iter().any(|there| there.touches.len() != expected.touches.len()) {
                    continue;
                }
                let slope = (before.energy - after.energy) / (2.0 * STEP);
                worst = worst.max((slope - here.torque[joint]).abs() / size);
                let differences = after.torque.iter().zip(before.torque.iter()).map(|(a, b)| (a - b) / (2.0 * STEP));
                let off = differences.zip(steep[joint]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                worst_tangent = worst_tangent.max(off / stiffest);
            }
            touched += 1;
        }
        println!("{touched} touch, torque {worst:.1e} off, tangent {worst_tangent:.1e}");
        assert!(touched > 100 && worst < 1e-6 && worst_tangent < 1e-3, "{touched} {worst} {worst_tangent}");
    });
}

/// What is no configuration has no torque, and leaves the next one as it is.
#[test]
fn what_is_no_configuration_is_not_solved() {
    let scene = scene("touch", |text| text);
    with_model(&scene, |model| {
        let mut live = LiveSolver::new(model);
        let pressed = scene.motion.press[2].q;
        let expected = live.solve(&pressed);
        assert_eq!(expected.status, Status::Contact);
        let nothing = [&[f64::NAN, 0.0, 0.0][..], &[0.0, f64::INFINITY, 0.0], &[0.0; 2], &[0.0; 4], &[]];
        for q in nothing {
            let found = live.solve(q);
            assert_eq!((found.status, found.torque), (Status::Unconverged, JointVector::zeros(3)), "{q:?}");
            assert!(live.on_proxy().is_empty());
            assert_eq!(live.solve(&pressed), expected, "{q:?}");
        }
        // Turned round and round, the arm is where it was.
        assert!(!live.solve(&[1e12, 0.0, 0.0]).status.is_failed());
    });
}

/// Ten times as many nodes on the arm touch with more than a tick has time for.
#[test]
fn contact_of_too_many_nodes_is_not_solved() {
    let dense = |text: String| text.replace("spacing = 0.0022", "spacing = 0.00011");
    let scene = scene("sphere", dense);
    with_model(&scene, |model| {
        let mut live = LiveSolver::new(model);
        let pressed = scene.motion.press[2].q;
        let found = live.solve(&pressed);
        assert_eq!((found.status, found.torque), (Status::Overflow, JointVector::zeros(3)), "{found:?}");
        assert_eq!(live.solve(&scene.motion.press[0].q).status, Status::Free);
    });
}
