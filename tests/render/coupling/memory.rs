//! Relaxation of the object: closed forms, dissipation whatever the motion, recovery, absence, refusal.

use super::block::{STIFFNESS, block, felt, scene, setup};
use haptize::{
    JointVector,
    fixtures::{
        Random,
        worlds::{BUMP_RADIUS, BUMP_STIFFNESS, bump},
    },
    render::{haptic::Inputs, setup::Setup},
    scene::Rendering,
};

/// The block with `haptics`, and memory of `relaxation`.
fn remembering(haptics: &str, relaxation: &str) -> Setup {
    setup(&format!("[haptics]\ninterpolation = \"potential\"\n{haptics}\n[object.relaxation]\n{relaxation}\n")).unwrap()
}

const TERMS: &str = "terms = [[0.2, 0.05], [0.1, 0.4]]";

/// 1 N/m and 1e6 N/m in series: the proxy goes where the hand goes.
const STIFF: &str =
    "coupling_stiffness = 1e6\ncoupling_damping = 50.0\ndevice_damping = 1e3\nproxy_damping = [2.0, 2.0]";

#[test]
fn a_dent_that_is_held_relaxes_as_the_terms_say() {
    let setup = remembering(STIFF, TERMS);
    let mut outputs = Vec::new();
    // Down at 0.4 m/s in 25 ms, then held.
    felt(&setup, 2.0, |t| [0.0, (0.4 * t).min(0.01)], |output| outputs.push(*output));
    let (ramp, terms) = (0.025, [(0.2, 0.05), (0.1, 0.4)]);
    for (k, output) in outputs.iter().enumerate().skip(40) {
        assert!(output.accounts.residual().abs() <= 1e-12 * output.accounts.exchanged);
        // The ramp's convolution with the relaxation, and the depth that it is at.
        let after = 1e-3 * k as f64 - ramp;
        let faded = |(share, time): &(f64, f64)| {
            share * (1.0 - time / ramp * ((ramp / time).exp() - 1.0) * (-(after + ramp) / time).exp())
        };
        let expected = STIFFNESS * output.proxy[1] * (1.0 - terms.iter().map(faded).sum::<f64>());
        let found = -output.sample.torque[1];
        // z follows w with half a tick of delay.
        assert!((found / expected - 1.0).abs() < 2e-3, "{k} ms: {found} N for {expected}");
    }
    let last = outputs.last().unwrap();
    assert!((-last.sample.torque[1] / (STIFFNESS * last.proxy[1]) - 0.7).abs() < 2e-3);
    // What was pressed in and is not there any more has relaxed.
    let accounts = last.accounts;
    assert!((accounts.stored - 0.5 * 0.7 * STIFFNESS * last.proxy[1].powi(2)).abs() < 1e-3 * accounts.stored);
    assert!(accounts.relaxed > 0.1 * accounts.stored && accounts.leak < accounts.proxy_dissipation, "{accounts:?}");
}

#[test]
fn contact_ends_above_the_surface_of_the_dent_and_that_recovers() {
    let setup = remembering(STIFF, TERMS);
    // Held for two seconds, drawn back in 10 ms to half the depth of the dent, and felt for where it begins again.
    let dent = 0.3 * 0.01;
    let depth = |t: f64| if t < 2.0 { (0.4 * t).min(0.01) } else { (0.01 - 0.85 * (t - 2.0)).max(0.5 * dent) };
    let mut outputs = Vec::new();
    felt(&setup, 12.0, |t| [0.0, depth(t)], |output| outputs.push(*output));
    let ended = &outputs[2015];
    assert!(!ended.sample.contact && ended.sample.torque[1] == 0.0 && ended.sample.index > 0.0, "{ended:?}");
    // The dent has come up to the finger, and pushes it.
    let last = outputs.last().unwrap();
    assert!(last.sample.contact && -last.sample.torque[1] > 0.6 * STIFFNESS * last.proxy[1], "{last:?}");
    assert!(outputs.iter().all(|output| output.sample.torque[1] <= 0.0), "nothing pulls");

    // Left alone for twenty times the longest time it is gone.
    let depth = |t: f64| if t < 1.0 { 0.01 } else { (0.01 - 0.4 * (t - 1.0)).max(-0.01) };
    let mut last = None;
    felt(&setup, 1.05 + 20.0 * 0.4, |t| [0.0, depth(t)], |output| last = Some(*output));
    let left = last.unwrap().accounts.stored / (0.5 * STIFFNESS * 0.01_f64.powi(2));
    assert!(left > 0.0 && left.sqrt() < 1e-6, "{} of the dent is left", left.sqrt());
}

/// Hands that shake, intervals, times and shares at their bounds, in and out of contact, with friction and without: the
/// accounts close, what relaxes only ever grows, and nothing is given beyond what the time step makes without memory.
#[test]
fn random_ticks_with_memory_give_nothing() {
    for seed in 0..10 {
        let mut random = Random::new(seed);
        let mut of = |least: f64, greatest: f64| least * (greatest / least).powf(random.between(0.0, 1.0));
        let (first, second) = (of(0.01, 0.5), of(0.01, 0.45));
        let times = [of(2e-3, 10.0), of(2e-3, 10.0)];
        let (mu, dent) = (of(0.05, 2.0), of(1e-3, 0.1));
        let relaxation = format!("terms = [[{first}, {}], [{second}, {}]]", times[0], times[1]);
        let relaxation = if seed % 3 == 0 { relaxation } else { format!("{relaxation}\ndent = {dent}") };
        let friction = if seed % 2 == 0 { String::new() } else { format!("friction = {{ coefficient = {mu} }}") };
        let setup = remembering(&friction, &relaxation);
        let mut state = setup.haptics.start(&JointVector::from_slice(&[0.0, -0.001])).unwrap();
        let (mut before, mut elapsed) = (None::<haptize::render::accounts::Accounts>, 1e-3);
        let mut position = JointVector::from_slice(&[0.0, -0.001]);
        for k in 0..TICKS / 10 {
            // The period, at which the proxy's damping bounds the leak of the time step; sometimes shorter.
            let interval = if k % 7 == 0 { 1e-3 * random.between(0.1, 1.0) } else { 1e-3 };
            let speed = if k % 500 > 400 { 0.0 } else { 1.0 };
            position[0] = (position[0] + speed * elapsed * random.between(-1.0, 1.0)).clamp(-0.1, 0.1);
            position[1] = (position[1] + 0.5 * speed * elapsed * random.between(-1.0, 1.0)).clamp(-0.005, 0.02);
            let output = setup.haptics.tick(&mut state, &Inputs { position, age: 0.0, elapsed, interval });
            let now = output.accounts;
            assert!(now.residual().abs() <= 1e-12 * now.exchanged, "seed {seed}, tick {k}: {now:?}");
            if let Some(before) = before {
                let rounding = 1e-12 * now.exchanged;
                assert!(now.relaxed >= before.relaxed - rounding, "seed {seed}, tick {k}: it gives energy back");
                // The balance of the proxy with what damping takes: passive if the leak is less.
                assert!(now.leak <= now.proxy_dissipation + rounding, "seed {seed}, tick {k}: {now:?}");
            }
            (before, elapsed) = (Some(now), interval);
        }
        let accounts = before.unwrap();
        assert!(accounts.relaxed > 1e-4, "seed {seed}: {} J", accounts.relaxed);
    }
}

/// Random ticks (1): ten times as many were run once.
const TICKS: usize = 100_000;

/// On a circle in a round bump the torque turns, and the energy stays: nothing is given. Torques that relax joint by joint
/// are ahead of the finger, `h' + h / theta = g dtau/dt`, and push it along.
#[test]
fn a_circle_around_a_bump_gives_nothing() {
    const RADIUS: f64 = 0.02;
    const RATE: f64 = std::f64::consts::TAU * 2.0;
    let terms = [[0.2, 0.05], [0.1, 0.4]];
    let data = bump(&format!("[haptics]\ninterpolation = \"potential\"\n{STIFF}\n[object.relaxation]\n{TERMS}\n"));
    let setup = Setup::new(&data).unwrap();
    let field = setup.haptics.source().field().unwrap();
    let mut outputs = Vec::new();
    felt(&setup, 6.0, |t| [RADIUS * (RATE * t).cos(), RADIUS * (RATE * t).sin()], |output| outputs.push(*output));
    let (mut relaxing, mut given) = ([[0.0; 2]; 2], vec![0.0]);
    let mut relaxed = field.sample(&outputs[0].proxy).torque;
    for pair in outputs.windows(2) {
        let [before, here] = [0, 1].map(|k| (pair[k].proxy, field.sample(&pair[k].proxy).torque));
        let mut work = 0.0;
        for joint in 0..2 {
            let mut torque = 0.7 * here.1[joint];
            for (h, [share, time]) in relaxing.iter_mut().zip(terms) {
                h[joint] = (-1e-3_f64 / time).exp() * h[joint] + share * (here.1[joint] - before.1[joint]);
                torque += h[joint];
            }
            work += 0.5 * (relaxed[joint] + torque) * (here.0[joint] - before.0[joint]);
            relaxed[joint] = torque;
        }
        given.push(given[given.len() - 1] + work);
    }
    let (last, a_loop) = (outputs.len() - 1, 500);
    let ahead = terms.iter().map(|[share, time]| share * RATE * time / (1.0 + (RATE * time).powi(2))).sum::<f64>();
    let force = BUMP_STIFFNESS * (BUMP_RADIUS - RADIUS);
    let expected = std::f64::consts::TAU * RADIUS * force * ahead;
    let found = given[last] - given[last - a_loop];
    assert!((found / expected - 1.0).abs() < 0.03, "{found} J a loop for {expected} J");
    let own = outputs[last].accounts.field_work - outputs[last - a_loop].accounts.field_work;
    println!("{own:.1e} J a loop, where torques that relax give {found:.3} J");
    // The torque of a tick is that at its beginning, half the angle of a tick behind: that takes energy.
    let behind = -std::f64::consts::TAU * RADIUS * force * 0.7 * 0.5e-3 * RATE;
    assert!((own / behind - 1.0).abs() < 0.02, "{own} J for {behind} J");
}

#[test]
fn relaxation_that_cannot_act_is_refused_with_its_line() {
    let text = |relaxation: &str| scene(&format!("[haptics]\ninterpolation = \"potential\"\n{relaxation}"));
    for (relaxation, expected) in [
        ("[object.relaxation]\nterms = []", "terms lists 0 terms: it must list 1 to 4"),
        ("[object.relaxation]\nterms = [[0.5, 0.0]]", "a share between 0 and 1 and a positive time"),
        ("[object.relaxation]\nterms = [[0.5, 0.1], [0.5, 1.0]]", "the shares of terms sum to 1"),
        ("[object.relaxation]\nterms = [[0.5, 0.1]]\ndent = 0.0", "dent is 0: it must be positive"),
        ("[object.relaxation]\ndent = 0.01", "terms"),
    ] {
        let message = Rendering::parse(&text(relaxation), "scene").unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    let relaxation = "[object.relaxation]\nterms = [[0.5, 0.1]]\n";
    let linear = Rendering::parse(&scene(relaxation), "scene").unwrap_err().to_string();
    assert!(linear.contains("would give energy from nowhere") && linear.contains("scene:"), "{linear}");
    // Where it is to forget it needs the slip.
    let mut data = block(&format!("[haptics]\ninterpolation = \"potential\"\n{relaxation}dent = 0.01\n"));
    data.slip = None;
    let message = Setup::new(&data).err().unwrap().to_string();
    assert!(message.contains("dent needs to know how contacts slip"), "{message}");
}
