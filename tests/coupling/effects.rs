//! Friction and damping at the contacts: closed forms, dissipation in every tick, absence, refusal.

use super::block::{STIFFNESS, block, felt, setup};
use glam::DVec3;
use haptize::{
    JointVector,
    contact::Model,
    dataset::Dataset,
    object::Object,
    proxy::Chain,
    render::{accounts::Accounts, effects::Contacts, haptic::Inputs, setup::Setup},
    scene::{Rendering, ScanScene, Scene},
    sweep::{BackendChoice, ChosenBackend, Run, Sweep},
};
use std::sync::atomic::AtomicBool;

const FRICTION: &str = "[haptics.friction]\ncoefficient = 0.4\nstiffness = 800.0\ndamping = 2.0";

/// Down in a tenth of a second, then `along(t - 0.5)` from half a second on.
fn pressed(depth: f64, along: impl Fn(f64) -> f64) -> impl Fn(f64) -> [f64; 2] {
    move |t| [along((t - 0.5).max(0.0)), (depth * 10.0 * t).min(depth)]
}

fn balanced(accounts: &Accounts) {
    assert!(accounts.residual().abs() <= 1e-12 * accounts.exchanged, "{accounts:?}");
}

#[test]
fn sliding_feels_the_cone_and_the_proxy_s_own_damping_and_nothing_else() {
    let setup = setup(FRICTION).unwrap();
    let mut last = None;
    felt(&setup, 1.5, pressed(0.012, |t| 0.05 * t), |output| last = Some(*output));
    let last = last.unwrap();
    let normal = -last.sample.torque[1];
    assert!((normal - 2000.0 / (2000.0 + STIFFNESS) * 0.012 * STIFFNESS).abs() < 1e-6, "{normal}");
    // bv = 2 N s/m at 0.05 m/s; and the device's spring begins at x_k, the proxy's pulls at the middle of its step.
    let expected = -(0.4 * normal + 2.0 * 0.05 + 2000.0 * 0.5e-3 * 0.05);
    assert!((last.torque[0] / expected - 1.0).abs() < 1e-6, "{} for {expected}", last.torque[0]);
    let slid = last.accounts.friction_dissipation;
    assert!((slid / (0.4 * normal * 0.05) - 1.0).abs() < 0.1, "{slid} J after a second at 0.05 m/s");
}

#[test]
fn below_the_cone_the_finger_sticks_and_springs_back() {
    let setup = setup(FRICTION).unwrap();
    // 1 mm: 2000 and 800 N/m in series pull by 0.57 N, the cone is 1.9 N.
    let there_and_back =
        |t: f64| if t < 1.0 { 1e-3 * (10.0 * t).min(1.0) } else { 1e-3 * (1.0 - 10.0 * (t - 1.0)).max(0.0) };
    let mut outputs = Vec::new();
    felt(&setup, 3.5, pressed(0.012, there_and_back), |output| outputs.push(*output));
    let held = outputs[1450];
    let expected = 1e-3 * 2000.0 / 2800.0;
    assert!((held.proxy[0] - expected).abs() < 1e-7, "{} for {expected}", held.proxy[0]);
    assert!((held.accounts.bristles - 0.5 * 800.0 * expected * expected).abs() < 1e-9);
    let back = outputs.last().unwrap();
    assert!(back.proxy[0].abs() < 1e-7 && back.accounts.bristles < 1e-12, "{back:?}");
}

#[test]
fn friction_takes_energy_in_every_tick_and_the_accounts_close() {
    for spec in [FRICTION, "[haptics.friction]\ncoefficient = 2.0\nstiffness = 2e5\ndamping = 0.0"] {
        let setup = setup(spec).unwrap();
        let mut state = setup.haptics.start(&JointVector::from_slice(&[0.0, 0.01])).unwrap();
        let (mut before, mut elapsed, mut time): (f64, f64, f64) = (0.0, 1e-3, 0.0);
        for k in 0..20_000_u32 {
            // 0.2 to 20 ms, sliding to and fro, in and out of contact.
            let interval = 2e-3 * 10_f64.powf((f64::from(k) * 1.7).sin());
            let position = JointVector::from_slice(&[0.05 * (3.0 * time).sin(), 0.006 + 0.009 * (7.0 * time).sin()]);
            let output = setup.haptics.tick(&mut state, &Inputs { position, age: 0.0, elapsed, interval });
            balanced(&output.accounts);
            let taken = output.accounts.friction_dissipation;
            assert!(taken >= before - 1e-12 * output.accounts.exchanged, "tick {k}: {taken} J after {before}");
            (before, elapsed, time) = (taken, interval, time + interval);
        }
        assert!(before > 0.1, "{before} J");
    }
}

#[test]
fn contact_damping_resists_along_the_normal_only() {
    let (with, without) = (setup("[haptics]\ncontact_damping = 10.0").unwrap(), setup("").unwrap());
    // Deeper at 0.02 m/s while sliding at 0.03. The proxy follows, springs in series, at 0.016 m/s: the damper adds
    // 0.16 N.
    let motion = |t: f64| [0.03 * t, 0.004 + 0.02 * t];
    let ends = [&with, &without].map(|setup| {
        let mut outputs = Vec::new();
        felt(setup, 0.5, motion, |output| outputs.push(*output));
        (outputs[250], outputs[499])
    });
    let [(earlier, damped), (_, free)] = ends;
    balanced(&damped.accounts);
    // The proxy lags by the damper's share, so that spring and damper add up as in the half space of the sum.
    let lag = free.proxy[1] - damped.proxy[1];
    assert!((lag - 0.16 / 2500.0).abs() < 1e-3 * lag, "{lag}");
    assert!((free.torque[1] - damped.torque[1] - 2000.0 * lag).abs() < 1e-6);
    assert!((damped.torque[0] - free.torque[0]).abs() < 1e-12, "tangential");
    let expected = 10.0 * 0.016 * 0.016 * 0.249;
    let taken = damped.accounts.contact_dissipation - earlier.accounts.contact_dissipation;
    assert!((taken / expected - 1.0).abs() < 0.01, "{taken} J for {expected}");
}

#[test]
fn effects_that_are_not_named_do_not_exist() {
    let plain = setup("").unwrap();
    assert!(plain.haptics.effects().is_none());
    let mut accounts = Accounts::default();
    felt(&plain, 0.5, |t| [0.1 * t, 0.01], |output| accounts = output.accounts);
    let booked = [
        accounts.friction_dissipation,
        accounts.bristles,
        accounts.contact_dissipation,
        accounts.channel_work,
        accounts.control_dissipation,
    ];
    assert_eq!(booked, [0.0; 5]);
    // Contact forces are stored for those who need them only.
    let parse = |text: &str| Rendering::parse(text, "scene").unwrap().haptics.at_contacts().is_some();
    assert!(!parse(&super::block::scene("[haptics]\npassivity_control = true\nfour_channel = {}")));
    assert!(parse(&super::block::scene(FRICTION)) && parse(&super::block::scene("[haptics]\ncontact_damping = 1.0")));
}

#[test]
fn an_effect_that_cannot_act_is_refused_with_its_line() {
    let cases = [
        (FRICTION, "friction", "[haptics.friction]"),
        ("[haptics]\ncontact_damping = 1.0", "contact_damping", "contact_damping"),
    ];
    for (spec, name, place) in cases {
        let mut data = block(spec);
        data.touches = None;
        let line = 1 + data.scene[..data.scene.find(place).unwrap()].matches('\n').count();
        let message = Setup::new(&data).err().unwrap().to_string();
        assert!(message.contains(&format!("{name} needs the contact forces")), "{message}");
        assert!(message.contains(&format!("scene:{line}:")), "{message}");
    }
    // A real object's contacts are not known: a scan with friction in its scene is refused at once.
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sponge.toml");
    let text = std::fs::read_to_string(path).unwrap();
    assert!(ScanScene::parse(&text, path).is_ok());
    let message =
        ScanScene::parse(&format!("{text}\n[haptics.friction]\ncoefficient = 0.3\n"), path).unwrap_err().to_string();
    assert!(message.contains("friction needs the contact forces"), "{message}");
    for (spec, expected) in [
        ("[haptics.friction]\nstiffness = 1.0", "coefficient"),
        ("[haptics.friction]\ncoefficient = -0.1", "coefficient is -0.1: it must be positive"),
        (
            "[haptics]\nfour_channel = { channels = [0.0, 1.0, 1.0, 1.5] }",
            "channels is 1.5: it must be between 0 and 1",
        ),
    ] {
        let message = Rendering::parse(&super::block::scene(spec), "scene").unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

/// Root mean square of the torque that the stored forces miss if they act on the nodes `shift` farther along the proxy,
/// over that of the torque.
fn torque_error(data: &Dataset, chain: &Chain, shift: usize) -> f64 {
    let touches = data.touches.as_ref().unwrap();
    let (mut missed, mut whole) = (0.0, 0.0);
    let mut pose = chain.new_pose();
    for point in 0..data.grid.points() {
        chain.pose(&data.grid.configuration(point), &mut pose);
        let mut torque = JointVector::zeros(data.grid.joints());
        for contact in touches.offsets[point] as usize..touches.offsets[point + 1] as usize {
            let node = (touches.nodes[contact] as usize + shift) % chain.nodes.len();
            let force = DVec3::from_array([0, 1, 2].map(|k| touches.forces[3 * contact + k].into()));
            chain.add_torque(&pose, node, force, &mut torque);
        }
        for (found, stored) in torque.iter().zip(data.torque(point)) {
            missed += (found - stored).powi(2);
            whole += stored * stored;
        }
    }
    (missed / whole).sqrt()
}

/// With points and with balls.
#[test]
fn friction_acts_on_the_nodes_that_the_solver_had_in_contact() {
    // The sphere under the arm of three joints, at every third configuration.
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml");
    let mut text = std::fs::read_to_string(path).unwrap();
    for (fine, coarse) in [
        ("count = 36", "step = 0.157, count = 12"),
        ("count = 16", "step = 0.157, count = 5"),
        ("count = 14", "step = 0.157, count = 5"),
    ] {
        assert!(text.contains(fine));
        let at = text.rfind(fine).unwrap();
        text.replace_range(at..at + fine.len(), coarse);
    }
    let node = "nodes = [{ from = [0.00875, 0.0, 0.0], to = [0.14, 0.0, 0.0], count = 16 }]";
    assert_eq!(text.matches(node).count(), 2);
    let ball = node.replace("count = 16", "count = 16, radius = 0.004");
    text = text.replacen(node, &ball, 1) + "\n[haptics.friction]\ncoefficient = 0.4\n";
    text = text.replace("surface = \"facets\"\n", "");
    let scene = Scene::parse(&text, path).unwrap();
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    let model = Model::new(&object, &chain, scene.contact);
    let mut backend = ChosenBackend::open(BackendChoice::Cpu, &model).unwrap();
    let sweep = Sweep::new(&scene, &object, backend.name(), &backend.adapter(), "2026-01-01T00:00:00Z").unwrap();
    let run = Run { chunk: backend.chunk(), stop: &AtomicBool::new(false), progress: &mut |_| () };
    let (mut data, report) = sweep.run(&mut backend, run).unwrap();
    assert!(report.contact_points > 50, "{report:?}");
    // Forces are stored in f32.
    assert!(torque_error(&data, &chain, 0) < 1e-7, "{}", torque_error(&data, &chain, 0));
    assert!(torque_error(&data, &chain, 1) > 0.01, "the comparison sees the next node");
    // Another proxy is not felt with these contacts.
    assert!(Contacts::new(&data, chain.nodes.len()).is_some());
    assert!(Contacts::new(&data, 20).is_none());
    // Nor are rows that lead beyond the forces, or backwards.
    let whole = data.touches.as_ref().unwrap().offsets.to_vec();
    let (middle, last) = (whole.len() / 2, whole.len() - 1);
    for (place, offset) in [(last, whole[last] + 1), (middle, whole[last] + 1), (0, 1)] {
        let mut offsets = whole.clone();
        offsets[place] = offset;
        data.touches.as_mut().unwrap().offsets = offsets.into();
        assert!(Contacts::new(&data, chain.nodes.len()).is_none(), "{offset} at {place}");
    }
}
