//! Hard cases of the haptic tick: time that jitters, devices that lie, gains beyond all bounds, long hours.
//!
//! Each case keeps the same three figures: the torque within its limit, the accounts closed to rounding, and the energy that
//! the device's port gave from nowhere within what the guard allows ([`GREATEST_GIVEN_ENERGY`], and as much again while the
//! torque falls to zero). Cases that must end without torque say so with a fourth.

use super::{
    Bound, Case, Effort, Failure, Outcome, Setting,
    worlds::{block, half_space},
};
use crate::{
    JointVector,
    contact::Status,
    dataset::Dataset,
    device::{Device, Motion, Reading, SimulatedHand},
    render::{
        flags::Fault,
        haptic::{Inputs, Output},
        passivity::{greatest_slope, greatest_stiffness},
        setup::Setup,
    },
    scene::{HapticsSpec, Waypoint},
    tolerances::{ACCOUNT_ROUNDING, GREATEST_GIVEN_ENERGY},
};
use std::collections::VecDeque;

/// The cases of this file.
pub const CASES: [Case; 11] = [
    Case { room: "loop", name: "jittering ticks", run: jitter },
    Case { room: "loop", name: "dropped ticks", run: dropped },
    Case { room: "loop", name: "leaping device", run: leap },
    Case { room: "loop", name: "no numbers from the device", run: not_finite },
    Case { room: "loop", name: "coarse encoders", run: encoders },
    Case { room: "loop", name: "gains about their bound", run: gains },
    Case { room: "loop", name: "delayed positions", run: delay },
    Case { room: "loop", name: "ten minutes at rest", run: rest },
    Case { room: "loop", name: "ten minutes of stick and slip", run: stick_slip },
    Case { room: "loop", name: "bad cells under the proxy", run: bad_cells },
    Case { room: "loop", name: "singular arm", run: singular },
];

/// Gains of a desktop device at their passivity bounds but for a margin, in the hand of somebody.
const DESKTOP: &str = "[haptics]
boundary_slope = 10.0
proxy_damping = 0.02
coupling_stiffness = 15.0
coupling_damping = 0.01
device_damping = 0.02
";

/// What became of all that was tried in a case.
struct Watch {
    limit: JointVector,
    torque: f64,
    /// Worst of all runs, each over its own turnover at its end.
    residual: f64,
    /// Of the present run: greatest residual, and its turnover so far [J].
    run: [f64; 2],
    given: f64,
    finite: bool,
    ended: Option<(Fault, f64)>,
    faults: Vec<Fault>,
    runs: usize,
}

impl Watch {
    fn new(spec: &HapticsSpec) -> Self {
        let (limit, faults) = (spec.torque_limit, Vec::new());
        Self {
            limit,
            torque: 0.0,
            residual: 0.0,
            run: [0.0; 2],
            given: 0.0,
            finite: true,
            ended: None,
            faults,
            runs: 0,
        }
    }

    fn tick(&mut self, output: &Output) {
        let accounts = &output.accounts;
        for (torque, limit) in output.torque.iter().zip(self.limit.iter()) {
            self.torque = self.torque.max(torque.abs() / limit);
        }
        self.run = [self.run[0].max(accounts.residual().abs()), accounts.turnover];
        self.given = self.given.max(-accounts.device_port().unwrap_or(0.0));
        self.finite &= output.torque.is_finite() && output.proxy.is_finite() && accounts.residual().is_finite();
        self.ended = output.fault.map(|fault| (fault, output.torque.norm()));
    }

    /// A variant has come to its end.
    fn end(&mut self) {
        self.runs += 1;
        self.residual = self.residual.max(self.run[0] / self.run[1].max(f64::MIN_POSITIVE));
        self.run = [0.0; 2];
        self.faults.extend(self.ended.map(|(fault, _)| fault));
    }

    fn note(&self) -> String {
        match self.faults.first() {
            None => format!("{} runs, none let go", self.runs),
            Some(first) => format!("{} of {} runs let go: {first}", self.faults.len(), self.runs),
        }
    }

    fn outcomes(&self, case: &str, varied: &str) -> Vec<Outcome> {
        let judged = |measure: &str, worst: f64, bound: f64| Outcome {
            case: case.into(),
            varied: varied.into(),
            measure: measure.into(),
            worst: if self.finite { worst } else { f64::NAN },
            bound: Bound::AtMost(bound),
            note: self.note(),
        };
        vec![
            judged("torque over its limit [1]", self.torque, 1.0),
            judged("residual of the accounts over their turnover [1]", self.residual, ACCOUNT_ROUNDING),
            judged("energy given from nowhere [J]", self.given, 2.0 * GREATEST_GIVEN_ENERGY),
        ]
    }

    /// The same, and that each run ended without torque by a fault.
    fn must_let_go(&self, case: &str, varied: &str) -> Vec<Outcome> {
        let mut outcomes = self.outcomes(case, varied);
        outcomes.push(Outcome {
            measure: "runs that did not end without torque and with the reason [1]".into(),
            worst: (self.runs - self.faults.len()) as f64 + self.ended.map_or(1.0, |(_, torque)| torque),
            bound: Bound::AtMost(0.0),
            ..outcomes[0].clone()
        });
        outcomes
    }
}

/// A way of the hand: all joints alike through (time, place).
fn way(setup: &Setup, places: &[(f64, f64)]) -> Result<SimulatedHand, Failure> {
    let joints = setup.chain.joints.len();
    let point = |&(time, place): &(f64, f64)| {
        let mut q = JointVector::zeros(joints);
        q.fill(place);
        Waypoint { time, q }
    };
    let points: Vec<Waypoint> = places.iter().map(point).collect();
    Ok(setup.hand(Motion::through(&points, joints)?)?)
}

/// In and out of the half space, again and again for `seconds`.
fn presses(setup: &Setup, seconds: f64) -> Result<SimulatedHand, Failure> {
    let places: Vec<(f64, f64)> =
        (0..=(2.0 * seconds) as usize).map(|k| (0.5 * k as f64, if k % 2 == 0 { -0.15 } else { 0.3 })).collect();
    way(setup, &places)
}

/// `count` ticks of `setup` with `device`; `time(k)` is T_k [s].
fn drive(
    setup: &Setup,
    device: &mut dyn Device,
    count: usize,
    time: impl Fn(usize) -> f64,
    watch: &mut Watch,
) -> Result<(), Failure> {
    let mut state = setup.haptics.start(&device.read(0.0).position)?;
    let mut elapsed = setup.haptics.period();
    for k in 0..count {
        let reading = device.read(elapsed);
        let interval = time(k);
        let inputs = Inputs { position: reading.position, age: reading.age, elapsed, interval };
        let output = setup.haptics.tick(&mut state, &inputs);
        device.apply(&output.torque);
        watch.tick(&output);
        elapsed = interval;
    }
    watch.end();
    Ok(())
}

/// The same on time.
fn on_time(setup: &Setup, device: &mut dyn Device, seconds: f64, watch: &mut Watch) -> Result<(), Failure> {
    let period = setup.haptics.period();
    drive(setup, device, (seconds / period).round() as usize, |_| period, watch)
}

/// Numbers from 0 to 1 that look random, the same every time.
fn noise(k: usize) -> f64 {
    let mixed = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    ((mixed ^ (mixed >> 32)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Seconds of a run: `sample` in tests.
fn seconds(setting: &Setting, sample: f64, full: f64) -> f64 {
    if setting.effort == Effort::Sample { sample } else { full }
}

fn open(joints: usize, haptics: &str) -> Result<Setup, Failure> {
    Ok(Setup::new(&half_space(joints, haptics))?)
}

fn jitter(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let seconds = seconds(setting, 5.0, 120.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for haptics in [DESKTOP.to_owned(), format!("{DESKTOP}passivity_control = true\n")] {
        let setup = open(3, &haptics)?;
        // The mean of a number that is uniform in its logarithm from 0.2 to 20 is 4.3.
        let time = |k: usize| 0.2e-3 * 100_f64.powf(noise(k));
        drive(&setup, &mut presses(&setup, seconds)?, (seconds / 4.3e-3) as usize, time, &mut watch)?;
    }
    Ok(watch.outcomes("jittering ticks", "T from 0.2 to 20 ms, with and without passivity control"))
}

fn dropped(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for share in [0.1, 0.5, 0.9] {
        // Every tick that is not dropped comes after as many as were.
        let time = |k: usize| 1e-3 * (1.0 + (noise(k).ln() / f64::ln(share)).floor()).min(50.0);
        let count = (seconds * (1.0 - share) * 1e3) as usize;
        drive(&setup, &mut presses(&setup, seconds)?, count, time, &mut watch)?;
    }
    Ok(watch.outcomes("dropped ticks", "10, 50 and 90 % dropped"))
}

/// A device that reports what `altered` makes of tick and reading of the one in the hand.
struct Altered<F> {
    device: SimulatedHand,
    tick: usize,
    altered: F,
}

impl<F: FnMut(usize, Reading) -> Reading + Send> Device for Altered<F> {
    fn read(&mut self, elapsed: f64) -> Reading {
        self.tick += 1;
        (self.altered)(self.tick, self.device.read(elapsed))
    }

    fn apply(&mut self, torque: &JointVector) {
        self.device.apply(torque);
    }
}

/// `reading` with each joint's position changed.
fn moved(reading: Reading, change: impl Fn(f64) -> f64) -> Reading {
    let mut position = reading.position;
    position.iter_mut().for_each(|x| *x = change(*x));
    Reading { position, ..reading }
}

fn leap(_: &Setting) -> Result<Vec<Outcome>, Failure> {
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for by in [1.0, -1.0, 0.1] {
        let device = presses(&setup, 1.0)?;
        let altered = |tick, reading| moved(reading, |x| if tick > 500 { x + by } else { x });
        on_time(&setup, &mut Altered { device, tick: 0, altered }, 1.0, &mut watch)?;
    }
    Ok(watch.must_let_go("leaping device", "by 1, -1 and 0.1 rad within a tick, in contact"))
}

fn not_finite(_: &Setting) -> Result<Vec<Outcome>, Failure> {
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        let device = presses(&setup, 1.0)?;
        // For one tick only: what comes after is not trusted either.
        let altered = |tick, reading| moved(reading, |x| if tick == 500 { value } else { x });
        on_time(&setup, &mut Altered { device, tick: 0, altered }, 1.0, &mut watch)?;
    }
    Ok(watch.must_let_go("no numbers from the device", "NaN, infinities and 1e300 for one tick, in contact"))
}

fn encoders(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let seconds = seconds(setting, 1.0, 60.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for step in [1e-5, 1e-4, 1e-3, 1e-2] {
        let device = presses(&setup, seconds)?;
        let altered = |_, reading| moved(reading, |x| step * (x / step).round());
        on_time(&setup, &mut Altered { device, tick: 0, altered }, seconds, &mut watch)?;
    }
    Ok(watch.outcomes("coarse encoders", "steps of 1e-5 to 1e-2 rad"))
}

fn gains(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let bound = open(3, DESKTOP)?.scene.haptics;
    let (slope, stiffness) = (greatest_slope(&bound, 0), greatest_stiffness(&bound, 0));
    let mut outcomes = Vec::new();
    for (factor, varied) in [(0.1, "a tenth of Ks and Kvc"), (1.0, "Ks and Kvc at the bound"), (10.0, "ten times")] {
        let mut watch = Watch::new(&bound);
        for control in [false, true] {
            let haptics = format!(
                "[haptics]
boundary_slope = {}
proxy_damping = 0.02
coupling_stiffness = {}
coupling_damping = 0.01
device_damping = 0.02
passivity_control = {control}
",
                factor * slope,
                factor * stiffness
            );
            let setup = open(3, &haptics)?;
            on_time(&setup, &mut presses(&setup, seconds)?, seconds, &mut watch)?;
        }
        outcomes.extend(watch.outcomes("gains about their bound", &format!("{varied}, with and without control")));
    }
    Ok(outcomes)
}

fn delay(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for ticks in [1_u8, 2, 5, 10, 20] {
        for control in ["", "passivity_control = true\n"] {
            let setup = open(3, &format!("{DESKTOP}{control}"))?;
            let device = presses(&setup, seconds)?;
            let mut past: VecDeque<Reading> = VecDeque::new();
            // The device says how old its positions are, as it must.
            let altered = |_, reading: Reading| {
                past.push_back(reading);
                let old = if past.len() > usize::from(ticks) { past.pop_front() } else { past.front().copied() };
                Reading { age: 1e-3 * f64::from(ticks), ..old.unwrap_or(reading) }
            };
            on_time(&setup, &mut Altered { device, tick: 0, altered }, seconds, &mut watch)?;
        }
    }
    Ok(watch.outcomes("delayed positions", "1, 2, 5, 10 and 20 ms one way, with and without passivity control"))
}

fn rest(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
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
    outcomes.push(Outcome {
        measure: "motion at the end within 0.1 s [rad]".into(),
        worst: drift,
        bound: Bound::AtMost(STILL),
        ..outcomes[0].clone()
    });
    Ok(outcomes)
}

/// Motion of a device at rest [rad]: a hundredth of the finest encoder's step.
const STILL: f64 = 1e-7;

fn stick_slip(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let seconds = seconds(setting, 10.0, 600.0);
    // A hand so soft that it drags the finger along in jerks.
    let haptics = "[haptics]
friction = { coefficient = 0.4, static_coefficient = 0.8, stiffness = 2000.0, damping = 0.5 }
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
        least = f64::min(least, grown / output.accounts.turnover.max(f64::MIN_POSITIVE));
        // Slipping takes power; a bristle that holds takes next to none.
        let slips_now = grown > 1e-3 * period;
        slips += usize::from(slips_now && stuck);
        stuck = !slips_now;
    }
    watch.end();
    let mut outcomes =
        watch.outcomes("ten minutes of stick and slip", &format!("dragged for {seconds} s by a soft hand"));
    outcomes.push(Outcome {
        measure: "energy given by friction in one tick, over the turnover [1]".into(),
        worst: -least,
        bound: Bound::AtMost(ACCOUNT_ROUNDING),
        note: format!("{slips} slips, {taken:.3} J taken"),
        ..outcomes[0].clone()
    });
    outcomes.push(Outcome {
        measure: "slips [1]".into(),
        worst: slips as f64,
        bound: Bound::AtLeast(seconds / 2.0),
        ..outcomes[3].clone()
    });
    Ok(outcomes)
}

fn bad_cells(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for share in [0.1, 0.5] {
        let setup = Setup::new(&spoilt(half_space(3, DESKTOP), share))?;
        on_time(&setup, &mut presses(&setup, seconds)?, seconds, &mut watch)?;
    }
    Ok(watch.outcomes(
        "bad cells under the proxy",
        "10 and 50 % of the points absent, as many unconverged and wrong by half",
    ))
}

/// `data` with `share` of its points in contact absent, and as many unconverged.
fn spoilt(data: Dataset, share: f64) -> Dataset {
    let joints = data.grid.joints();
    let (mut status, mut torque) = (data.status.to_vec(), data.torque.to_vec());
    for point in 0..data.grid.points() {
        if data.status(point) == Status::Contact && noise(point) < share {
            status[point] = Status::Outside as u8;
        } else if data.status(point) == Status::Contact && noise(3 * point) < share {
            status[point] = Status::Unconverged as u8;
            for (joint, tau) in torque[point * joints..(point + 1) * joints].iter_mut().enumerate() {
                *tau *= 0.5 + noise(7 * point + joint);
            }
        }
    }
    Dataset { status: status.into(), torque: torque.into(), ..data }
}

fn singular(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let mut outcomes = Vec::new();
    for joints in [3, 6] {
        // Stretched out at q = 0, where all links are in line, and through it at several rad/s.
        let setup = open(joints, &format!("{DESKTOP}proxy_inertia = \"configuration\"\n"))?;
        let mut watch = Watch::new(&setup.scene.haptics);
        let places: Vec<(f64, f64)> =
            (0..=(4.0 * seconds) as usize).map(|k| (0.25 * k as f64, if k % 2 == 0 { -0.4 } else { 0.2 })).collect();
        on_time(&setup, &mut way(&setup, &places)?, seconds, &mut watch)?;
        let varied = format!("{joints} joints through the stretched arm, inertia of each configuration");
        outcomes.extend(watch.outcomes("singular arm", &varied));
    }
    Ok(outcomes)
}
