//! A scene that is solved in every tick: energy, repeatability, and what happens where contact is not solved.

use super::*;
use haptize::{
    render::{live::LiveScene, watchdog::GREATEST_POSITION_AGE},
    report::object::instants,
};
use std::sync::Arc;

/// The shipped scene of this name, or the tests' own arm of twelve joints, after `edit`, ready to be felt.
fn live(name: &str, edit: impl Fn(String) -> String) -> (Dataset, Setup) {
    let folder = if name == "snake" { "tests/scenes" } else { "datasets" };
    let path = format!("{}/{folder}/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = edit(std::fs::read_to_string(&path).unwrap());
    let scene = Arc::new(LiveScene::new(Scene::parse(&text, path).unwrap()).unwrap());
    let dataset = scene.dataset();
    let setup = Setup::live(scene, &dataset).unwrap();
    (dataset, setup)
}

#[test]
fn a_live_session_makes_no_energy_and_is_repeated_and_replayed_to_the_last_bit() {
    let friction = |text| text + "\n[haptics.friction]\ncoefficient = 0.3\n";
    for (name, has_friction) in [("mesh", false), ("touch", false), ("organ", true), ("snake", true)] {
        let (dataset, setup) = live(name, |text| if has_friction { friction(text) } else { text });
        let play = || {
            let way = Motion::through(&setup.scene.motion.press, setup.chain.joints.len()).unwrap();
            let plan = setup.plan(&dataset, way.duration(), 0);
            session::run(&setup.haptics, &mut setup.hand(way).unwrap(), None, &plan).unwrap()
        };
        let trace = play();
        assert_eq!(play(), trace, "{name}");
        let summary = trace.summary();
        assert!(summary.contact_share > 0.2 && summary.unconverged == 0 && summary.faults == 0, "{name}: {summary:?}");
        assert!(summary.max_relative_account_residual < 1e-9, "{name}: {summary:?}");
        // The field's work is what it stored, but for the time step.
        let stored = trace.ticks.iter().map(|tick| tick.sample.energy).fold(0.0, f64::max);
        assert!(summary.leak < 0.02 * stored, "{name}: {} of {stored} J", summary.leak);
        let mut file = tempfile::NamedTempFile::new().unwrap();
        Recording::write(&trace, file.as_file_mut()).unwrap();
        let recording = Recording::read(file.path(), setup.chain.joints.len()).unwrap();
        let again = recording.replay(&setup.haptics, None, labels(&dataset.grid)).unwrap();
        assert_eq!(recording.first_difference(&again), None, "{name}");
    }
}

#[test]
fn contact_that_is_not_solved_is_felt_on_for_as_long_as_a_position_may_be_old() {
    let (_, setup) = live("sphere", |text| text.replace("spacing = 0.0022", "spacing = 0.0001"));
    let haptics = &setup.haptics;
    let press = Motion::through(&setup.scene.motion.press, 3).unwrap();
    let mut state = haptics.start(&press.at(0.0).0).unwrap();
    let mut contact = haptics.source().begin();
    let mut before: Option<Sample> = None;
    let mut held = 0;
    for k in 0..2500 {
        let inputs = Inputs { position: press.at(1e-3 * f64::from(k)).0, age: 0.0, elapsed: 1e-3, interval: 1e-3 };
        let output = haptics.tick_with(&mut state, &inputs, &mut contact);
        if output.sample.flags.contains(Flags::UNCONVERGED) {
            let before = before.unwrap();
            assert!(before.contact && before.torque == output.sample.torque, "{k}");
            held += 1;
        }
        before = Some(output.sample);
        if let Some(fault) = output.fault {
            assert_eq!((fault, held), (Fault::Unsolved, (GREATEST_POSITION_AGE / 1e-3) as u32 + 1));
            // At the greatest rate the torque goes to zero.
            let inputs = Inputs { elapsed: 1e-3, ..inputs };
            let torques = (0..100).map(|_| haptics.tick_with(&mut state, &inputs, &mut contact).torque);
            assert_eq!(torques.last(), Some(JointVector::zeros(3)));
            return;
        }
    }
    panic!("everything was solved, {held} held");
}

#[test]
fn gains_that_a_live_scene_leaves_free_follow_from_its_tangents() {
    let (_, setup) = live("sphere", |text| text);
    let (_, bounded) = live("sphere", |text| text.replace("[haptics]\n", "[haptics]\nproxy_damping = 0.015\n"));
    let damping = |setup: &Setup| setup.scene.haptics.proxy_damping[0];
    assert!(damping(&setup) >= damping(&bounded));
    let stiffness = |setup: &Setup| {
        setup.bounds.iter().find(|bound| bound.what.starts_with("stiffness of the contact torque")).unwrap().value
    };
    assert!(stiffness(&setup) > 0.0 && stiffness(&setup) <= 1.0, "{}", stiffness(&setup));
    assert!(stiffness(&bounded) * 0.015 - stiffness(&setup) * damping(&setup) < 1e-12);
}

/// Nothing is stored of a live scene: the picture of the object shows forces that are solved for it, not zeros.
#[test]
fn the_picture_of_a_live_session_has_the_forces() {
    let (dataset, setup) = live("touch", |text| text);
    let scene = setup.haptics.source().live().unwrap();
    let press = Motion::through(&setup.scene.motion.press, 3).unwrap();
    let mut graphics = setup.graphics(&dataset).unwrap().unwrap();
    let plan = setup.plan(&dataset, press.duration(), 60);
    let mut hand = setup.hand(press).unwrap();
    let trace = session::run(&setup.haptics, &mut hand, Some(&mut graphics), &plan).unwrap();

    let instants = instants(&dataset, &setup.chain, &trace, 6, Some(Arc::clone(scene))).unwrap();
    let touching = instants.iter().filter(|instant| instant.contact_nodes > 0);
    let forces = touching.map(|instant| instant.forces.iter().map(|on| on.force).sum::<DVec3>().length());
    let forces: Vec<f64> = forces.collect();
    assert!(forces.len() > 2 && forces.iter().all(|force| *force > 1e-3), "{forces:?}");
}
