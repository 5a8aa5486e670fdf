//! Observers, controller, guard and bounds.

use super::block::{block, felt, setup};
use haptize::{
    JointVector,
    device::{Device, Motion, SimulatedHand},
    field::TorqueField,
    render::{
        flags::Fault,
        haptic::{GREATEST_GIVEN_ENERGY, Inputs},
        passivity,
        setup::{Setup, labels},
    },
    scene::{HapticsSpec, Interpolation, Waypoint},
};
use std::collections::BTreeMap;

/// What the port has given beyond what it took, at most, in ten seconds in a hand that presses 10 mm deep (J).
fn given_in_a_hand(setup: &Setup) -> f64 {
    let way = [(0.0, -0.005), (0.5, 0.01)].map(|(time, z)| Waypoint { time, q: JointVector::from_slice(&[0.0, z]) });
    let mut hand = SimulatedHand::new(&setup.scene.haptics, Motion::through(&way, 2).unwrap()).unwrap();
    let mut state = setup.haptics.start(&hand.read(0.0).position).unwrap();
    let mut given: f64 = 0.0;
    for _ in 0..10_000 {
        let position = hand.read(1e-3).position;
        let output = setup.haptics.tick(&mut state, &Inputs { position, age: 0.0, elapsed: 1e-3, interval: 1e-3 });
        hand.apply(&output.torque);
        assert_eq!(output.fault, None);
        given = given.max(-output.accounts.device_port().unwrap());
    }
    given
}

/// A coupling five times as stiff as Colgate's bound.
const ACTIVE: &str = "[haptics]
proxy_damping = [2.0, 2.0]
coupling_stiffness = [20000.0, 20000.0]
hand = { stiffness = [500.0, 500.0], damping = [1.0, 1.0] }
";

#[test]
fn a_loop_that_feeds_the_hand_is_let_go_with_the_reason() {
    let setup = setup(&format!("{ACTIVE}torque_rate_limit = [1e6, 1e6]\n")).unwrap();
    assert!(
        setup.exceeded.iter().any(|bound| bound.what.contains("coupling stiffness") && bound.safe.round() == 4000.0)
    );
    // Shaken by 1 mm from tick to tick the device always goes along with the torque that is held: 15 N times 2 mm a
    // tick, of which its own damping takes 12 mJ.
    let shaken = |t: f64| [0.0, if ((1e3 * t).round() as usize).is_multiple_of(2) { -0.011 } else { -0.009 }];
    let mut outputs = Vec::new();
    felt(&setup, 0.1, shaken, |output| outputs.push(*output));
    let last = outputs.last().unwrap();
    assert_eq!((last.fault, last.torque.norm()), (Some(Fault::Energy), 0.0));
    let given = outputs.iter().map(|output| -output.accounts.device_port().unwrap()).fold(0.0, f64::max);
    assert!(given > GREATEST_GIVEN_ENERGY && given < 2.0 * GREATEST_GIVEN_ENERGY, "{given} J");
}

#[test]
fn a_controller_takes_what_the_device_s_port_gives() {
    let (without, with) = (
        given_in_a_hand(&setup(ACTIVE).unwrap()),
        given_in_a_hand(&setup(&format!("{ACTIVE}passivity_control = true\n")).unwrap()),
    );
    assert!(without > 1e-3 && with < 0.5 * without, "{with} J under control, {without} J without");
}

#[test]
fn a_controller_does_nothing_where_the_observers_find_nothing() {
    let motion = |t: f64| [0.02 * (2.0 * t).sin(), 0.004 - 0.008 * (3.0 * t).cos()];
    let run = |spec: &str| {
        let mut outputs = Vec::new();
        felt(&setup(spec).unwrap(), 3.0, motion, |output| outputs.push((output.torque, output.accounts)));
        outputs
    };
    let (plain, controlled) = (run(""), run("[haptics]\npassivity_control = true"));
    assert!(plain.iter().all(|(_, accounts)| accounts.device_port().unwrap() >= 0.0));
    // Until the field has given more than was stored, which linear interpolation does in contact, all is the same.
    let first = plain.iter().position(|(_, accounts)| accounts.created() > 0.0).unwrap_or(plain.len());
    assert!(first > 100);
    assert_eq!(plain[..first], controlled[..first]);
}

#[test]
fn energy_created_at_the_object_s_port_is_taken_by_the_controller() {
    // A proxy damped far too little for the object, so that the explicit contact torque creates energy.
    let spec =
        "[haptics]\nproxy_damping = [0.0, 0.0]\ncoupling_damping = [0.0, 0.0]\ncoupling_stiffness = [1.0, 1.0]\n";
    let created = |spec: &str| {
        let mut greatest: f64 = 0.0;
        felt(
            &setup(spec).unwrap(),
            5.0,
            |_| [0.0, 0.01],
            |output| {
                assert!(output.accounts.residual().abs() <= 1e-11 * output.accounts.exchanged);
                greatest = greatest.max(output.accounts.created());
            },
        );
        greatest
    };
    let (without, with) = (created(spec), created(&format!("{spec}passivity_control = true\n")));
    assert!(with < 0.1 * without, "{with} J under control, {without} J without");
}

#[test]
fn an_object_of_unknown_energy_may_give_back_what_it_held_at_the_start() {
    // Without U in the dataset a loop that begins in contact does not know it: 25 mJ come out, and are no creation.
    let mut data = block("");
    data.energy = None;
    let setup = Setup::new(&data).unwrap();
    let mut ports = Vec::new();
    felt(&setup, 1.0, |t| [0.0, 0.01 - 0.02 * t], |output| ports.push(output.accounts.device_port()));
    assert!(ports[0].is_none() && ports.last().unwrap().is_some());
    assert!(ports.iter().flatten().all(|port| *port > -1e-3), "{:?}", ports.last());
}

#[test]
fn bounds_are_reported_with_the_value_that_would_be_safe() {
    let spec = "[haptics]\nproxy_damping = [2.0, 2.0]\nboundary_slope = [1500.0, 3000.0]\n\
     coupling_stiffness = [2000.0, 5000.0]\nencoder_step = [0.0, 1e-4]\n\
     device_friction = [0.0, 0.05]\n";
    let setup = setup(spec).unwrap();
    let found: Vec<(f64, f64)> = setup.exceeded.iter().map(|bound| (bound.value, bound.safe.round())).collect();
    assert_eq!(found, [(3000.0, 2000.0), (5000.0, 4000.0), (5000.0, 1000.0)]);
    assert!(setup.bounds.len() > found.len() && setup.bounds.iter().any(|bound| !bound.is_exceeded()));
    assert!(setup.exceeded[2].to_string().contains("of joint press, against the encoder's step, is 5000.0000"));
    // What is named as safe is safe.
    let mut gains = setup.scene.haptics.clone();
    gains.boundary_slope[1] = 0.999 * 2000.0;
    gains.coupling_stiffness[1] = 0.999 * 1000.0;
    let (_, left) = setup.retuned(&block(spec), &gains).unwrap();
    assert_eq!(left, None);
    assert_eq!(haptize::render::passivity::greatest_stiffness(&gains, 1).round(), 1000.0);
}

#[test]
fn a_layer_and_an_object_that_keep_their_bounds_may_break_the_one_of_both_together() {
    let data = block("");
    let setup = Setup::new(&data).unwrap();
    let mut gains =
        HapticsSpec { interpolation: Interpolation::Linear, passivity_factor: 2.0, ..setup.scene.haptics.clone() };
    let field =
        TorqueField::interpolated(&data, Interpolation::Linear, gains.threshold, &gains.boundary_slope).unwrap();
    let field = field.into();
    let value = |gains: &HapticsSpec, what: &str| {
        let bounds = passivity::bounds(gains, &field, &labels(&data.grid));
        bounds.into_iter().find(|bound| bound.what.contains(what)).unwrap().value
    };
    // Both at 0.95 of what is safe alone.
    let object = value(&gains, "stiffness of the contact torque");
    gains.proxy_damping.iter_mut().for_each(|damping| *damping *= object / 0.95);
    for joint in 0..2 {
        gains.boundary_slope[joint] = 0.95 * passivity::greatest_slope(&gains, joint);
    }
    assert!((value(&gains, "stiffness of the contact torque") - 0.95).abs() < 1e-9);
    let both = value(&gains, "layer and object together");
    assert!((both - 0.95 * 2.0_f64.sqrt()).abs() < 1e-9, "{both}");
    let exceeded = passivity::exceeded(&gains, &field, &labels(&data.grid));
    let of_slopes: Vec<&str> =
        exceeded.iter().map(|bound| bound.what.as_str()).filter(|what| !what.contains("coupling")).collect();
    assert_eq!(of_slopes, ["stiffness of layer and object together over 2 bv / T"]);
}

#[test]
fn a_device_that_allows_no_spring_is_said_with_what_it_lacks_and_where() {
    let spec = "[haptics]\nencoder_step = [0.0, 1e-4]\ndevice_friction = [0.1, 0.05]\n";
    let setup = setup(spec).unwrap();
    let mut gains = setup.scene.haptics.clone();
    for (damping, friction, expected) in [
        ([0.0, 1.0], [0.1, 0.05], "a device_damping of joint 1 above 0: with less, no coupling_stiffness is passive"),
        ([1.0, 1.0], [0.0, 0.0], "a device_friction of joint 2 above 0: with less"),
        ([1.0, 0.0], [0.0, 0.0], "a device_damping of joint 2 above 0 and a device_friction of joint 2 above 0"),
    ] {
        gains.device_damping.copy_from_slice(&damping);
        gains.device_friction.copy_from_slice(&friction);
        let (_, advice) = setup.retuned(&block(spec), &gains).unwrap();
        let advice = advice.unwrap();
        assert!(advice.passive.is_none() && advice.text.contains(expected), "{}", advice.text);
    }
}

/// The gains that `advice` asks for, by their keys: with `choice`, the second of two alternatives.
fn advised(advice: &str, choice: bool) -> BTreeMap<String, String> {
    let remedies = advice.split("Set in [haptics]: ").nth(1).unwrap();
    let mut gains = BTreeMap::new();
    for remedy in remedies.split("; ") {
        let alternative = remedy.strip_prefix("or else ");
        if choice && alternative.is_some() {
            gains.remove("device_damping");
        }
        if alternative.is_none() || choice {
            for gain in alternative.unwrap_or(remedy).split(" and ") {
                let (key, value) = gain.split_once(" = ").unwrap();
                gains.insert(key.to_owned(), value.split(" if ").next().unwrap().to_owned());
            }
        }
    }
    gains
}

#[test]
fn gains_that_are_advised_are_passive() {
    let (mut state, mut refused) = (7_u64, 0);
    for scene in 0..60 {
        let mut list = |low: f64, high: f64| {
            let mut value = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                low * (high / low).powf((state >> 11) as f64 / (1_u64 << 53) as f64)
            };
            format!("[{}, {}]", value(), value())
        };
        let mut gains: BTreeMap<String, String> = [
            ("boundary_slope", 100.0, 1e5),
            ("proxy_damping", 0.1, 100.0),
            ("coupling_stiffness", 100.0, 1e5),
            ("coupling_damping", 1e-3, 4.0),
            ("device_damping", 1.5, 10.0),
        ]
        .map(|(key, low, high)| (key.to_owned(), list(low, high)))
        .into();
        gains.insert("interpolation".into(), ["\"linear\"", "\"potential\""][scene % 2].into());
        gains.insert("passivity_factor".into(), ["1.0", "1.9"][scene / 2 % 2].into());
        if scene % 3 == 0 {
            gains.insert("encoder_step".into(), "[0.0, 1e-4]".into());
            gains.insert("device_friction".into(), "[0.0, 0.05]".into());
        }
        let advice = |gains: &BTreeMap<String, String>| {
            let lines: String = gains.iter().map(|(key, value)| format!("{key} = {value}\n")).collect();
            setup(&format!("[haptics]\n{lines}")).unwrap().advice.map(|advice| advice.text)
        };
        let Some(first) = advice(&gains) else { continue };
        refused += 1;
        let lines: String = gains.iter().map(|(key, value)| format!("{key} = {value}\n")).collect();
        let spec = format!("[haptics]\n{lines}");
        let mut made = setup(&spec).unwrap();
        let changes = made.make_passive(&block(&spec)).unwrap();
        assert!(made.exceeded.is_empty() && made.advice.is_none(), "{spec}: {changes:?}");
        let own = setup(&spec).unwrap().scene.haptics;
        for (made, own) in [
            (&made.scene.haptics.coupling_stiffness, &own.coupling_stiffness),
            (&made.scene.haptics.coupling_damping, &own.coupling_damping),
            (&own.proxy_damping, &made.scene.haptics.proxy_damping),
        ] {
            assert!(made.iter().zip(own.iter()).all(|(made, own)| made <= own), "{spec}: {changes:?}");
        }
        // What the scene would have: the same gains, and nothing that was passive is changed.
        let mut written = gains.clone();
        written.extend(
            changes.iter().map(|gain| gain.split_once(" = ").unwrap()).map(|(key, value)| (key.into(), value.into())),
        );
        assert_eq!(advice(&written), None, "{changes:?}");
        assert_eq!(made.make_passive(&block(&spec)).unwrap(), [""; 0]);
        for choice in [false, true] {
            let mut followed = gains.clone();
            followed.extend(advised(&first, choice));
            assert_eq!(advice(&followed), None, "{first}");
        }
    }
    assert!(refused > 40, "{refused} of the scenes needed advice");
}
