//! Friction at the contacts: closed forms, dissipation in every tick, absence, refusal.

use super::block::{STIFFNESS, block, felt, setup};
use haptize::{
    JointVector,
    contact::{Model, Slip, Solver, Status, exact_dissipation},
    fixtures::Random,
    object::Object,
    proxy::Chain,
    render::{
        accounts::Accounts,
        haptic::Inputs,
        setup::{self, Setup},
    },
    scene::{Rendering, ScanScene, Scene},
    sweep::baked,
};

const FRICTION: &str = "[haptics.friction]\ncoefficient = 0.4\nstiffness = 800.0";

/// Random ticks (1): ten times as many were run once.
const TICKS: usize = 100_000;

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
    assert!((held.accounts.presliding - 0.5 * 800.0 * expected * expected).abs() < 1e-9);
    let back = outputs.last().unwrap();
    assert!(back.proxy[0].abs() < 1e-7 && back.accounts.presliding < 1e-12, "{back:?}");
}

#[test]
fn friction_takes_energy_in_every_tick_and_the_accounts_close() {
    for spec in [FRICTION, "[haptics.friction]\ncoefficient = 2.0\nstiffness = 2e5"] {
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
fn effects_that_are_not_named_do_not_exist() {
    let plain = setup("").unwrap();
    let mut accounts = Accounts::default();
    felt(&plain, 0.5, |t| [0.1 * t, 0.01], |output| accounts = output.accounts);
    let booked =
        [accounts.friction_dissipation, accounts.presliding, accounts.channel_work, accounts.control_dissipation];
    assert_eq!(booked, [0.0; 4]);
}

#[test]
fn an_effect_that_cannot_act_is_refused_with_its_line() {
    let mut data = block(FRICTION);
    data.slip = None;
    let line = 1 + data.scene[..data.scene.find("[haptics.friction]").unwrap()].matches('\n').count();
    let message = Setup::new(&data).err().unwrap().to_string();
    assert!(message.contains("friction needs to know how contacts slip"), "{message}");
    assert!(message.contains(&format!("scene:{line}:")), "{message}");
    // A real object's friction is measured: a scan with friction in its scene is refused at once.
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sponge.toml");
    let text = std::fs::read_to_string(path).unwrap();
    assert!(ScanScene::parse(&text, path).is_ok());
    let message =
        ScanScene::parse(&format!("{text}\n[haptics.friction]\ncoefficient = 0.3\n"), path).unwrap_err().to_string();
    assert!(message.contains("is identified from [scan.history], not named"), "{message}");
    for (spec, expected) in [
        ("[haptics.friction]\nstiffness = 1.0", "coefficient"),
        ("[haptics.friction]\ncoefficient = -0.1", "coefficient is -0.1: it must be positive"),
        ("[haptics.friction]\ncoefficient = 0.1\ndamping = 1.0", "friction has no damping of its own any more"),
        ("[haptics]\ncontact_damping = 1.0", "contact_damping was removed: leave it out"),
        (
            "[haptics]\nfour_channel = { channels = [0.0, 1.0, 1.0, 1.5] }",
            "channels is 1.5: it must be between 0 and 1",
        ),
    ] {
        let message = Rendering::parse(&super::block::scene(spec), "scene").unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
}

/// Joint rates in any direction.
fn rates(random: &mut Random) -> JointVector {
    JointVector::from_slice(&[(); 3].map(|()| random.between(-1.0, 1.0)))
}

/// What a dataset's slips say of friction at its grid points is what the contacts themselves say, with points and with
/// balls: exactly for one contact, at least that for several; and the field interpolates between them.
#[test]
fn friction_takes_what_the_contacts_take_and_between_grid_points_nearly_so() {
    // The sphere under the arm of three joints, at every third configuration.
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml");
    let mut text = std::fs::read_to_string(path).unwrap();
    for (fine, coarse) in [
        ("count = 36", "step = 0.157, count = 12"),
        ("count = 16", "step = 0.157, count = 5"),
        ("count = 14", "step = 0.157, count = 5"),
    ] {
        let at = text.rfind(fine).unwrap();
        text.replace_range(at..at + fine.len(), coarse);
    }
    let node = "nodes = [{ from = [0.00875, 0.0, 0.0], to = [0.14, 0.0, 0.0], count = 16 }]";
    assert_eq!(text.matches(node).count(), 2);
    let ball = node.replace("count = 16", "count = 16, radius = 0.004");
    text = text.replacen(node, &ball, 1) + "\n[haptics.friction]\ncoefficient = 0.4\n";
    text = text.replace("surface = \"facets\"\n", "");
    let scene = Scene::parse(&text, path).unwrap();
    let (data, report) = baked(&scene).unwrap();
    assert!(report.contact_points > 50, "{report:?}");
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let mut solver = Solver::new(&model);
    let mut random = Random::new(7);
    let field = setup::field(&data, None).unwrap();
    let slips = data.slip.as_ref().unwrap();
    let (mut several, mut most) = (0, 1.0_f64);
    // Of friction, and of the torque.
    let mut errors = [[0.0; 2]; 2];
    for point in (0..data.grid.points()).filter(|&point| data.status(point) == Status::Contact) {
        let q = data.grid.configuration(point);
        let here = solver.solve(&q);
        let Slip { normal_force, .. } = Slip::of(&chain, &q, here.on_proxy());
        assert!((f64::from(slips.normal_force[point]) - normal_force).abs() <= 1e-6 * normal_force);
        let felt = field.slip(&q, &field.sample(&q));
        let rates = rates(&mut random);
        let exact = exact_dissipation(&chain, &q, here.on_proxy(), &rates);
        let ratio = felt.dissipation(&rates) / exact;
        // What is stored is f32.
        assert!(ratio > 1.0 - 1e-5, "{ratio} at {q:?}");
        if here.touches.len() == 1 {
            assert!(ratio < 1.0 + 1e-5, "{ratio} at {q:?}");
        } else {
            several += 1;
            most = most.max(ratio);
        }
        // Half a cell on.
        let mut between = q;
        between.iter_mut().zip(&data.grid.axes).for_each(|(q, axis)| *q += 0.5 * axis.step);
        let there = solver.solve(&between);
        let sample = field.sample(&between);
        let exact = Slip::of(&chain, &between, there.on_proxy()).dissipation(&rates);
        let torque = there.torque.iter().zip(sample.torque.iter()).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let missed = [(field.slip(&between, &sample).dissipation(&rates) - exact).powi(2), torque];
        let whole = [exact.powi(2), there.torque.norm().powi(2)];
        for (error, parts) in errors.iter_mut().zip(missed.into_iter().zip(whole)) {
            *error = [error[0] + parts.0, error[1] + parts.1];
        }
    }
    println!("{several} points with several contacts, where friction is up to {most:.3} times the contacts'");
    assert!(several > 20 && most > 1.001, "{several}, {most}");
    let [friction, torque] = errors.map(|[missed, whole]| (missed / whole).sqrt());
    println!(
        "in the middles of cells of 9 degrees friction errs by {friction:.3} of its rms, the torque by {torque:.3}"
    );
    assert!(friction < torque, "{friction}, {torque}");
}

/// Hands that shake, gains and intervals at their bounds: friction gives nothing in any tick, and nothing is given in
/// all beyond what the accounts say.
#[test]
fn random_ticks_with_friction_give_nothing() {
    for seed in 0..10 {
        let mut random = Random::new(seed);
        let mut of = |least: f64, greatest: f64| least * (greatest / least).powf(random.between(0.0, 1.0));
        let (mu, stiction, stiffness) = (of(0.05, 3.0), of(1.0, 3.0), of(50.0, 1e5));
        let setup = setup(&format!(
            "[haptics.friction]\ncoefficient = {mu}\nstatic_coefficient = {}\nstiffness = {stiffness}",
            mu * stiction
        ))
        .unwrap();
        let mut state = setup.haptics.start(&JointVector::from_slice(&[0.0, 0.01])).unwrap();
        let (mut taken, mut elapsed) = (0.0, 1e-3);
        let mut position = JointVector::from_slice(&[0.0, 0.01]);
        for k in 0..TICKS / 10 {
            let interval = 2e-4 * 100_f64.powf(random.between(0.0, 1.0));
            let speed = if k % 500 > 400 { 0.0 } else { 0.4 };
            position[0] = (position[0] + speed * elapsed * random.between(-1.0, 1.0)).clamp(-0.1, 0.1);
            position[1] = (position[1] + 0.5 * speed * elapsed * random.between(-1.0, 1.0)).clamp(-0.005, 0.02);
            let output = setup.haptics.tick(&mut state, &Inputs { position, age: 0.0, elapsed, interval });
            balanced(&output.accounts);
            let now = output.accounts.friction_dissipation;
            assert!(now >= taken - 1e-12 * output.accounts.exchanged, "seed {seed}, tick {k}: {now} after {taken}");
            (taken, elapsed) = (now, interval);
        }
        assert!(taken > 1e-3, "seed {seed}: {taken} J");
    }
}
