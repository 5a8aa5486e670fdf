//! Four-channel coupling beside spring and damper: what the hand feels, at rest and on the way.

use super::block::{STIFFNESS, block, felt, setup};
use haptize::{
    JointVector,
    device::{Motion, SimulatedHand},
    render::{session, setup::Setup},
    scene::Waypoint,
};

const IDEAL: &str = "[haptics.four_channel]\n";

#[test]
fn at_rest_the_hand_feels_the_object_and_not_the_coupling_in_series() {
    let press = |_| [0.0, 0.005];
    let ends = ["", IDEAL].map(|spec| {
        let mut last = None;
        felt(&setup(spec).unwrap(), 2.0, press, |output| last = Some(*output));
        last.unwrap()
    });
    let series = 2000.0 * STIFFNESS / (2000.0 + STIFFNESS);
    assert!((ends[0].torque[1] + series * 0.005).abs() < 1e-6, "{:?}", ends[0].torque);
    assert!((ends[1].torque[1] + STIFFNESS * 0.005).abs() < 1e-4, "{:?}", ends[1].torque);
    assert!((ends[1].proxy[1] - 0.005).abs() < 1e-7 && ends[0].proxy[1] < 0.0041, "{:?}", ends[1].proxy);
}

#[test]
fn a_press_and_scrape_in_a_simulated_hand_is_calm_balanced_and_ends() {
    for spec in ["", IDEAL] {
        let data = block(&format!("[haptics]\ndevice_damping = 4.0\n{spec}"));
        let setup = Setup::new(&data).unwrap();
        let way = [(0.0, [0.0, -0.005]), (0.5, [0.0, 0.01]), (1.0, [0.05, 0.01]), (1.5, [0.05, -0.005])];
        let way = way.map(|(time, q)| Waypoint { time, q: JointVector::from_slice(&q) });
        let mut hand = SimulatedHand::new(&setup.scene.haptics, Motion::through(&way, 2).unwrap()).unwrap();
        let trace = session::run(&setup.haptics, &mut hand, None, &setup.plan(&data, 2.5, 0)).unwrap();
        let summary = trace.summary();
        assert_eq!(summary.faults, 0, "{spec}: {:?}", trace.ticks.last());
        assert!(summary.max_relative_account_residual < 1e-11, "{spec}: {summary:?}");
        assert!(summary.max_contact_force > 2.0, "{spec}: {summary:?}");
        let last = trace.ticks.last().unwrap();
        assert!(last.device_torque.norm() < 1e-3 && last.accounts.kinetic < 1e-9, "{spec}: {last:?}");
    }
}

#[test]
fn the_bound_on_the_device_counts_what_the_channels_hand_to_it() {
    let plain = setup("").unwrap();
    let handed = setup(IDEAL).unwrap();
    assert!(plain.exceeded.is_empty(), "{:?}", plain.exceeded);
    // Kvc + c2 Ks of 2000 + 1500 N/m; bd - Bvc of 2 N s/m are safe for 4000.
    let bound = handed.bounds.iter().find(|bound| bound.what.contains("Kvc + c2 Ks")).unwrap();
    assert_eq!((bound.value.round(), bound.safe.round()), (3500.0, 4000.0));
}
