//! The paper's press on the baked sphere.

use super::*;

/// The paper's sphere scene, baked.
fn baked_sphere() -> Dataset {
    let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml")).unwrap();
    baked(&scene).unwrap().0
}

#[test]
fn the_papers_press_is_smooth_multi_point_passive_and_repeatable() {
    let data = baked_sphere();
    let setup = Setup::new(&data).unwrap();
    // The scene's gains keep to their bounds.
    assert_eq!(setup.exceeded, []);
    let run = || {
        let motion = Motion::through(&setup.scene.motion.press, 3).unwrap();
        let seconds = motion.duration();
        let mut hand = setup.hand(motion).unwrap();
        let mut graphics = setup.graphics(&data).unwrap();
        session::run(&setup.haptics, &mut hand, graphics.as_mut(), &setup.plan(&data, seconds, 8)).unwrap()
    };
    let trace = run();
    assert_eq!(trace, run());
    let summary = trace.summary();
    assert!(summary.max_contact_nodes >= 6, "{summary:?}");
    // Ks = 15 N m/rad bounds the rise at contact; the hand moves at less than a radian a second.
    assert!(summary.max_contact_torque > 0.2 && summary.max_contact_torque_step < 0.015, "{summary:?}");
    assert!(summary.max_relative_account_residual < 1e-11 && summary.min_absorbed > -1e-15, "{summary:?}");
    assert!(summary.leak.abs() < 0.05 * trace.ticks.iter().map(|tick| tick.accounts.stored).fold(0.0, f64::max));
    assert_eq!((summary.faults, summary.absent, summary.unconverged), (0, 0, 0));
    // The layer acts where contact begins and ends, not on the object.
    let held = trace.ticks.iter().filter(|tick| tick.sample.contact && tick.flags.contains(Flags::LAYER)).count();
    assert!(held > 0 && held < 100, "{held} ticks");
    // The object is seen to be dented, and to be round again.
    let moved = |frame: &Frame| {
        let rest = &setup.object.as_ref().unwrap().rest;
        frame.nodes.iter().zip(rest).map(|(n, rest)| n.distance(*rest)).fold(0.0, f64::max)
    };
    assert!(trace.frames.iter().map(moved).fold(0.0, f64::max) > 2e-3);
    assert!(moved(&trace.frames[0]) < 1e-6);
}
