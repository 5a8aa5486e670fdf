//! Hard cases of the haptic tick: time that jitters, devices that lie, gains beyond all bounds, long hours.
//!
//! Each case keeps the same three figures: the torque within its limit, the accounts closed to rounding, and the energy
//! that the device's port gave from nowhere within what the guard allows ([`GREATEST_GIVEN_ENERGY`], and as much again
//! while the torque falls to zero). Cases that must end without torque say so with a fourth. One file a kind of
//! hardship.

mod devices;
mod endurance;
mod gains;
mod places;
mod time;

use crate::hard_cases::{Bound, Case, CaseResult, Effort, Failure, Setting};
use haptize::fixtures::worlds::half_space;
use haptize::{
    JointVector,
    device::{Applied, Device, Motion, Reading, SimulatedHand},
    render::{
        accounts::ACCOUNT_ROUNDING,
        flags::Fault,
        haptic::{GREATEST_GIVEN_ENERGY, Inputs, Output},
        setup::Setup,
    },
    scene::{HapticsSpec, Waypoint},
};

/// The cases of these files.
pub const CASES: [Case; 13] = [
    Case { room: "loop", name: "jittering ticks", run: time::jitter },
    Case { room: "loop", name: "dropped ticks", run: time::dropped },
    Case { room: "loop", name: "persistent overruns", run: time::overruns },
    Case { room: "loop", name: "delayed positions", run: time::delay },
    Case { room: "loop", name: "leaping device", run: devices::leap },
    Case { room: "loop", name: "no numbers from the device", run: devices::not_finite },
    Case { room: "loop", name: "coarse encoders", run: devices::encoders },
    Case { room: "loop", name: "gains about their bound", run: gains::about_their_bound },
    Case { room: "loop", name: "control over a potential", run: gains::control_over_a_potential },
    Case { room: "loop", name: "bad cells under the proxy", run: places::bad_cells },
    Case { room: "loop", name: "singular arm", run: places::singular },
    Case { room: "loop", name: "ten minutes at rest", run: endurance::rest },
    Case { room: "loop", name: "ten minutes of stick and slip", run: endurance::stick_slip },
];

/// Gains of a desktop device at their passivity bounds but for a margin, in the hand of somebody.
const DESKTOP: &str = "[haptics]
boundary_slope = 10.0
proxy_damping = 0.02
coupling_stiffness = 15.0
coupling_damping = 0.01
device_damping = 0.02
";

/// The outcome of all that was tried in a case.
struct Watch {
    limit: JointVector,
    torque: f64,
    /// Worst of all runs, each over the energy that it exchanged.
    residual: f64,
    /// Greatest residual of the present run, and the energy that it has exchanged so far (J).
    run: [f64; 2],
    given: f64,
    /// At the object's port, beyond what the controller took there (J).
    created: f64,
    /// Most that the torque held over one tick could have given: the greatest torque along the way of the device (J).
    hold: f64,
    device: Option<JointVector>,
    finite: bool,
    ended: Option<(Fault, f64)>,
    /// Torques after faults, at the ends of runs (N m).
    left: f64,
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
            created: 0.0,
            hold: 0.0,
            device: None,
            finite: true,
            ended: None,
            left: 0.0,
            faults,
            runs: 0,
        }
    }

    fn tick(&mut self, output: &Output) {
        let accounts = &output.accounts;
        for (torque, limit) in output.torque.iter().zip(self.limit.iter()) {
            self.torque = self.torque.max(torque.abs() / limit);
        }
        self.run = [self.run[0].max(accounts.residual().abs()), accounts.exchanged];
        self.given = self.given.max(-accounts.device_port().unwrap_or(0.0));
        self.created = self.created.max(accounts.created() - accounts.control_dissipation);
        if let Some(before) = self.device.replace(output.device) {
            let way = output.device.iter().zip(before.iter()).map(|(to, from)| (to - from).abs());
            self.hold = self.hold.max(way.zip(self.limit.iter()).map(|(way, limit)| way * limit).sum());
        }
        self.finite &= output.torque.is_finite() && output.proxy.is_finite() && accounts.residual().is_finite();
        self.ended = output.fault.map(|fault| (fault, output.torque.norm()));
    }

    /// A variant has come to its end.
    fn end(&mut self) {
        self.runs += 1;
        self.residual = self.residual.max(self.run[0] / self.run[1].max(f64::MIN_POSITIVE));
        self.run = [0.0; 2];
        self.device = None;
        if let Some((fault, torque)) = self.ended.take() {
            self.faults.push(fault);
            self.left += torque;
        }
    }

    fn note(&self) -> String {
        match self.faults.first() {
            None if self.runs == 1 => "1 run, not let go".into(),
            None => format!("{} runs, none let go", self.runs),
            Some(first) => format!("{} of {} runs let go: {first}", self.faults.len(), self.runs),
        }
    }

    fn outcomes(&self, case: &str, varied: &str) -> Vec<CaseResult> {
        let judged = |measure: &str, worst: f64, bound: f64| CaseResult {
            case: case.into(),
            varied: varied.into(),
            measure: measure.into(),
            worst: if self.finite { worst } else { f64::NAN },
            bound: Bound::AtMost(bound),
            note: self.note(),
        };
        vec![
            judged("torque over its limit [1]", self.torque, 1.0),
            judged("energy balance error, relative to the energy exchanged [1]", self.residual, ACCOUNT_ROUNDING),
            judged("energy given from nowhere [J]", self.given, 2.0 * GREATEST_GIVEN_ENERGY),
        ]
    }

    /// The same, and that each run ended without torque for one of the `reasons`.
    fn must_let_go(&self, case: &str, varied: &str, reasons: &[Fault]) -> Vec<CaseResult> {
        let mut outcomes = self.outcomes(case, varied);
        outcomes.push(CaseResult {
            measure: "runs that did not end without torque and with the reason [1]".into(),
            worst: (self.runs - self.faults.iter().filter(|fault| reasons.contains(fault)).count()) as f64 + self.left,
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

/// `count` ticks of `setup` with `device`; `time(k)` is T_k (s).
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

    fn apply(&mut self, torque: &JointVector) -> Applied {
        self.device.apply(torque)
    }
}
