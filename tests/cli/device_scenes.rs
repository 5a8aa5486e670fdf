//! The scenes of public devices: kinematics against published formulas, and each baked and felt by a simulated device
//! in the loop.

use crate::common::program::{haptize, message};
use glam::DVec3;
use haptize::{
    JointVector,
    contact::{Model, Proximity},
    dataset::Dataset,
    device::{LinearMap, Motion, Recorded},
    proxy::Chain,
    render::{flags::Flags, session, setup::Setup},
    scene::{ContactLaw, Rendering, Scene, Waypoint},
    sweep::{BackendChoice, Bake},
};
use std::{path::Path, sync::atomic::AtomicBool};

fn shipped(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets").join(name)
}

/// Position of the first contact node at `q`, and the torques of `force` on it.
fn tip(name: &str, q: &[f64], force: DVec3) -> (DVec3, JointVector) {
    let chain = Chain::new(&Scene::load(shipped(name)).unwrap().proxy);
    let mut pose = chain.new_pose();
    chain.pose(q, &mut pose);
    let mut torque = JointVector::zeros(q.len());
    chain.add_torque(&pose, 0, force, &mut torque);
    (pose.nodes[0], torque)
}

/// From the device's coordinates to the joints, as the scene's `[device]` has it.
fn map(name: &str) -> LinearMap {
    let text = std::fs::read_to_string(shipped(name)).unwrap();
    let device = Rendering::parse(&text, name).unwrap().device;
    let offset = device.offset.unwrap_or(JointVector::zeros(3));
    LinearMap::new(&device.map.unwrap(), &offset, 3).unwrap()
}

/// Positions and torques that `kinematics.cpp` of the device's own library computes.
#[test]
fn woodenhaptics_moves_as_its_library_says() {
    let map = map("woodenhaptics.toml");
    let theta = JointVector::from_slice(&[0.019_635_0, -0.078_539_8, 1.518_436_4]);
    let (position, torque) = tip("woodenhaptics.toml", &map.position(&theta), DVec3::Z);
    let expected = DVec3::new(0.008_536_06, 0.004_487_87, 0.191_545_74);
    assert!(position.distance(expected) < 1e-7, "{position}");
    for (found, expected) in map.effort(&torque).iter().zip([0.0, 0.016_084_11, 0.244_664_24]) {
        assert!((found - expected).abs() < 1e-7, "{torque:?}");
    }
}

/// The lengths of the robot file: upper arm 0.134 m, lower arm 0.1325 m, shoulder at 0.125 m.
#[test]
fn the_touch_reaches_where_trigonometry_says() {
    let (waist, shoulder, elbow) = (0.3_f64, 0.7_f64, 0.2_f64);
    let (position, _) = tip("touch.toml", &[waist, shoulder, elbow], DVec3::ZERO);
    let reach = 0.134 * shoulder.cos() + 0.1325 * (shoulder + elbow).sin();
    let height = 0.125 + 0.134 * shoulder.sin() - 0.1325 * (shoulder + elbow).cos();
    let expected = DVec3::new(-reach * waist.sin(), reach * waist.cos(), height);
    assert!(position.distance(expected) < 1e-12, "{position}");
    // The library counts the waist to the other side, and the lower arm against the vertical.
    let theta = JointVector::from_slice(&[-waist, shoulder, shoulder + elbow]);
    let (driven, torque) = tip("touch.toml", &map("touch.toml").position(&theta), DVec3::Z);
    assert!(driven.distance(expected) < 1e-12, "{driven}");
    // A force that lifts the tip turns the lower arm by its lever alone, the upper arm by its own.
    let effort = map("touch.toml").effort(&torque);
    let levers = [0.0, 0.134 * shoulder.cos(), 0.1325 * (shoulder + elbow).sin()];
    assert!(effort.iter().zip(levers).all(|(effort, lever)| (effort - lever).abs() < 1e-12), "{effort:?}");
}

/// The pantograph of the vendor's package at the joint angles 168.25 and 12.5 degrees, bases 0.038 m apart: its end
/// effector is where the two distal bars meet.
#[test]
fn the_pantographs_end_effector_is_on_its_first_pair_of_bars() {
    let end = DVec3::new(0.018_794_5, 0.036_023_4, 0.0);
    let shoulder = 168.25_f64.to_radians();
    let joint = 0.07 * DVec3::new(shoulder.cos(), shoulder.sin(), 0.0);
    let bar = end - joint;
    assert!((bar.length() - 0.09).abs() < 1e-6, "the distal bar is {} m long", bar.length());
    let (position, _) = tip("two_diy.toml", &[shoulder, bar.y.atan2(bar.x) - shoulder], DVec3::ZERO);
    assert!(position.distance(end) < 1e-6, "{position}");
}

#[test]
fn the_woodenhaptics_feels_its_scene() {
    feels("woodenhaptics.toml", 1.2);
}

#[test]
fn the_touch_feels_its_scene() {
    feels("touch.toml", 0.35);
}

#[test]
fn the_pantograph_feels_its_scene() {
    feels("two_diy.toml", 0.123);
}

/// The dataset of `scene`, converged everywhere.
fn baked(scene: &Scene) -> Dataset {
    let stop = AtomicBool::new(false);
    let progress = &mut |_| ();
    let bake =
        Bake { scene, backend: BackendChoice::Cpu, measured: Some(0), aim: None, date: "", stop: &stop, progress };
    let (dataset, report) = bake.in_memory().unwrap();
    assert_eq!((report.unconverged, report.overflowed), (0, 0), "{}: {report:?}", scene.name);
    dataset
}

/// The other scenes that ship are held to it where they are felt.
#[test]
fn a_mesh_and_a_nodule_are_passive_as_they_ship() {
    for name in ["mesh.toml", "nodule.toml"] {
        let setup = Setup::new(&baked(&Scene::load(shipped(name)).unwrap())).unwrap();
        assert!(setup.exceeded.is_empty(), "{name}: {:?}", setup.exceeded);
    }
}

/// The scene is baked, and pressed and scraped by a device of at most `most` (N m).
fn feels(name: &str, most: f64) {
    let scene = Scene::load(shipped(name)).unwrap();
    let dataset = baked(&scene);
    let setup = Setup::new(&dataset).unwrap();
    assert!(setup.exceeded.is_empty(), "{name}: {:?}", setup.exceeded);
    for motion in [&setup.scene.motion.press, &setup.scene.motion.scrape] {
        let motion = Motion::through(motion, setup.chain.joints.len()).unwrap();
        // Without frames of the object, which the torque does not depend on.
        let plan = setup.plan(&dataset, motion.duration(), 0);
        let mut hand = setup.hand(motion).unwrap();
        let felt = session::run(&setup.haptics, &mut hand, None, &plan).unwrap().summary();
        assert_eq!((felt.faults, felt.outside), (0, 0), "{name}: {felt:?}");
        assert!(felt.contact_share > 0.2 && felt.contact_share < 0.95, "{name}: {felt:?}");
        assert!(felt.max_device_torque > 0.05 * most && felt.max_device_torque <= most, "{name}: {felt:?}");
        assert!(felt.max_relative_account_residual < 1e-10, "{name}: {felt:?}");
    }
}

#[test]
fn a_woodenhaptics_beyond_a_smaller_grid_is_free_or_held() {
    beyond_a_grid(
        "woodenhaptics.toml",
        &["-0.04, stop = 0.14, count = 10", "0.2, stop = 0.42, count = 13", "0.93, stop = 1.13, count = 11"],
    );
}

#[test]
fn a_touch_beyond_a_smaller_grid_is_free_or_held() {
    beyond_a_grid(
        "touch.toml",
        &["-0.052, stop = 0.182, count = 10", "0.0, stop = 0.3, count = 13", "-0.23, stop = 0.25, count = 13"],
    );
}

#[test]
fn a_pantograph_beyond_a_smaller_grid_is_free_or_held() {
    beyond_a_grid("two_diy.toml", &["2.16, stop = 2.72, count = 29", "-1.94, stop = -1.52, count = 22"]);
}

/// The scene with the axes `grid`, which leave out much of what the joints' limits allow. The hand goes anywhere within
/// the limits: the proxy enters the object nowhere that was not solved, and a hand in the object is pushed back
/// wherever it is.
fn beyond_a_grid(name: &str, grid: &[&str]) {
    /// Depth from which a hand must feel something (m): well beyond a cell's error of where contact begins.
    const DEEP: f64 = 0.004;
    let text = std::fs::read_to_string(shipped(name)).unwrap();
    let (before, after) = text.split_once("axes = [\n").unwrap();
    let axes: String = grid.iter().map(|axis| format!("{{ start = {axis} }}, ")).collect();
    let text = format!("{before}axes = [{axes}]\n{}", after.split_once("\n]\n").unwrap().1);
    let scene = &Scene::parse(&text, name).unwrap();
    let dataset = &baked(scene);
    let setup = &Setup::new(dataset).unwrap();
    let object = setup.object.as_ref().unwrap();
    let model = Model::new(object, &setup.chain, scene.contact);
    let mut proximity = Proximity::new(&model);
    let mut gap = |q: &JointVector| {
        proximity.place(q);
        proximity.gap(q)
    };
    let mut seed = 22_u64;
    let mut between = |[low, high]: [f64; 2]| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut free, mut held) = (0, 0);
    for _ in 0..12 {
        let at: Vec<Waypoint> = (0..5)
            .map(|k| {
                let anywhere = setup.chain.joints.iter().map(|joint| joint.limits);
                // Every other waypoint is in the grid or beside it, where the object is.
                let near = scene.grid.axes.iter().zip(anywhere.clone()).map(|(axis, [low, high])| {
                    let width = (axis.count - 1) as f64 * axis.step;
                    [low.max(axis.start - 0.5 * width), high.min(axis.start + 1.5 * width)]
                });
                let ranges: Vec<_> = if k % 2 == 0 { anywhere.collect() } else { near.collect() };
                let q: Vec<f64> = ranges.into_iter().map(&mut between).collect();
                Waypoint { time: 0.8 * f64::from(k), q: JointVector::from_slice(&q) }
            })
            .collect();
        let motion = Motion::through(&at, setup.chain.joints.len()).unwrap();
        let plan = setup.plan(dataset, 3.2, 0);
        let trace = session::run(&setup.haptics, &mut Recorded::new(motion), None, &plan).unwrap();
        for tick in trace.ticks.iter().step_by(5) {
            let outside = tick.flags.contains(Flags::OUTSIDE);
            free += usize::from(outside);
            held += usize::from(tick.flags.contains(Flags::HELD));
            if outside {
                let gap = gap(&tick.proxy);
                assert!(gap >= 0.0, "{name}: the proxy is {gap} m in the object beyond the grid at {:?}", tick.proxy);
            }
            // The torque rises from zero at the start.
            if tick.time > 0.01 && tick.fault.is_none() && gap(&tick.device) < -DEEP {
                let torque = tick.device_torque.iter().map(|torque| torque.abs()).fold(0.0, f64::max);
                assert!(torque > 0.0, "{name}: nothing is felt at {:?}", tick.device);
            }
        }
    }
    assert!(free > 500 && held > 50, "{name}: {free} ticks free beyond the grid, {held} held at its border");
}

/// Nothing was baked: contact is solved in every tick, the same each time, recorded and replayed to the last bit.
#[test]
fn scenes_are_felt_at_once_and_replayed_as_they_were_felt() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let output = haptize(folder.path(), arguments);
        (
            output.status.success(),
            message(&output),
            serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap(),
        )
    };
    for name in ["organ.toml", "sphere.toml"] {
        let scene = shipped(name).display().to_string();
        let felt = ["play", &scene, "--seconds", "2.2", "--json", "--record", "session.csv"];
        let (whole, told, felt) = run(&felt);
        assert!(whole && felt["contact_share"].as_f64().unwrap() > 0.05, "{told} {felt:#}");
        assert!(felt["max_relative_account_residual"].as_f64().unwrap() < 1e-9, "{felt:#}");
        assert_eq!(felt["unconverged"], 0, "{felt:#}");
        assert!(!told.contains("not passive"), "{told}");
        let follows = Scene::load(&scene).unwrap().contact.law != ContactLaw::Rest;
        assert_eq!(told.contains("law that follows the deformation"), follows, "{told}");
        let (whole, told, again) = run(&["play", &scene, "--replay", "session.csv", "--json"]);
        assert!(whole && again["replayed"] == true, "{told} {again:#}");
        std::fs::remove_file(folder.path().join("session.csv")).unwrap();
    }
}
