//! Long hours: ten simulated minutes at rest, and as long dragged along in jerks.

use super::{Bound, CaseResult, DESKTOP, Failure, Setting, Watch, on_time, open, seconds, way};
use haptize::{
    JointVector,
    device::{Device, Motion},
    fixtures::worlds::block,
    render::{accounts::ACCOUNT_ROUNDING, haptic::Inputs, setup::Setup},
    scene::Waypoint,
};

pub(super) fn rest(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 10.0, 600.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    let mut hand = way(&setup, &[(0.0, -0.1), (1.0, 0.3)])?;
    on_time(&setup, &mut hand, seconds, &mut watch)?;
    // What is left of motion when nothing has moved for all that time.
    let before = hand.read(0.0).position;
    let mut drift: f64 = 0.0;
    for _ in 0..100 {
        let after = hand.read(1e-3).position;
        drift = drift.max(after.iter().zip(before.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max));
    }
    let varied = format!("pressed for {seconds} s");
    let mut outcomes = watch.outcomes("ten minutes at rest", &varied);
    outcomes.push(CaseResult {
        measure: "motion at the end within 0.1 s [rad]".into(),
        worst: drift,
        bound: Bound::AtMost(STILL),
        ..outcomes[0].clone()
    });
    Ok(outcomes)
}

/// Motion of a device at rest (rad): a hundredth of the finest encoder's step.
const STILL: f64 = 1e-7;

pub(super) fn stick_slip(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 10.0, 600.0);
    // A hand so soft that it drags the finger along in jerks.
    let haptics = "[haptics]
friction = { coefficient = 0.4, static_coefficient = 0.8, stiffness = 2000.0 }
proxy_damping = [0.2, 2.0]
device_damping = [1.5, 3.0]
hand = { stiffness = [600.0, 400.0], damping = [0.2, 20.0], inertia = [0.1, 0.1] }
";
    let setup = Setup::new(&block(haptics))?;
    let mut points = vec![Waypoint { time: 0.0, q: JointVector::from_slice(&[0.0, 0.0]) }];
    for k in 0..(seconds / 4.0).ceil() as usize {
        // 20 mm/s, to and fro.
        let along = if k % 2 == 0 { 0.08 } else { 0.0 };
        points.push(Waypoint { time: 4.0 * (k + 1) as f64, q: JointVector::from_slice(&[along, 0.02]) });
    }
    let mut hand = setup.hand(Motion::through(&points, 2)?)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    let mut state = setup.haptics.start(&hand.read(0.0).position)?;
    let period = setup.haptics.period();
    let (mut taken, mut least, mut slips, mut stuck) = (0.0, f64::INFINITY, 0_usize, true);
    for _ in 0..(seconds / period) as usize {
        let reading = hand.read(period);
        let inputs = Inputs { position: reading.position, age: reading.age, elapsed: period, interval: period };
        let output = setup.haptics.tick(&mut state, &inputs);
        hand.apply(&output.torque);
        watch.tick(&output);
        let grown = output.accounts.friction_dissipation - taken;
        taken = output.accounts.friction_dissipation;
        least = f64::min(least, grown / output.accounts.exchanged.max(f64::MIN_POSITIVE));
        // Slipping takes power; sticking takes next to none.
        let slips_now = grown > 1e-3 * period;
        slips += usize::from(slips_now && stuck);
        stuck = !slips_now;
    }
    watch.end();
    let mut outcomes =
        watch.outcomes("ten minutes of stick and slip", &format!("dragged for {seconds} s by a soft hand"));
    outcomes.push(CaseResult {
        measure: "energy given by friction in one tick, relative to the energy exchanged [1]".into(),
        worst: -least,
        bound: Bound::AtMost(ACCOUNT_ROUNDING),
        note: format!("{slips} slips, {taken:.3} J taken"),
        ..outcomes[0].clone()
    });
    outcomes.push(CaseResult {
        measure: "slips [1]".into(),
        worst: slips as f64,
        bound: Bound::AtLeast(seconds / 2.0),
        ..outcomes[3].clone()
    });
    Ok(outcomes)
}
