//! The adapter of Cartesian devices: a spring in space between the tip and a node of an arm.

use crate::{
    common::desktop::haptics,
    felt::{PERIOD, all},
};
use assert_no_alloc::assert_no_alloc;
use glam::{DMat3, DVec3};
use haptize::{
    JointVector,
    device::{
        Applied, Coordinates, Device, Guard, Limits, LinearMap, Motion, Reading, Simulated, SimulatedHand, TipDevice,
        Watchdog,
    },
    proxy::{Chain, Node},
    scene::{DeviceSpec, HandSpec, JointKind, JointSpec, ProxySpec, Waypoint},
};
use std::sync::{Arc, Mutex};

/// An arm of three joints: yaw and two pitches, its tip at (0.3, 0, 0) where all are zero.
pub fn arm() -> Chain {
    let joint = |x: f64, axis: DVec3| JointSpec {
        follows: None,
        name: String::new(),
        kind: JointKind::Revolute,
        origin: DVec3::new(x, 0.0, 0.0),
        axis,
        limits: [-2.0, 2.0],
        mass: 0.1,
        centre_of_mass: DVec3::ZERO,
        inertia: DMat3::ZERO,
        rotor_inertia: 1e-3,
        nodes: Vec::new(),
    };
    let tip = Node { link: 2, position: DVec3::new(0.15, 0.0, 0.0), radius: 0.0, length: 0.0 };
    let joints = vec![joint(0.0, DVec3::Z), joint(0.0, DVec3::Y), joint(0.15, DVec3::Y)];
    Chain { nodes: vec![tip], ..Chain::new(&ProxySpec { joints, ..Default::default() }) }
}

/// A Cartesian device of 100 g in a hand that goes through `way` in space (m).
fn hardware(way: &[(f64, [f64; 3])]) -> Simulated<SimulatedHand> {
    let limits = Limits { effort: all(3, 10.0), watchdog: Watchdog::None };
    Simulated::new(hand(way), Coordinates::Tip, limits, Vec::new())
}

fn hand(way: &[(f64, [f64; 3])]) -> SimulatedHand {
    let way: Vec<Waypoint> =
        way.iter().map(|(time, at)| Waypoint { time: *time, q: JointVector::from_slice(at) }).collect();
    let hand = HandSpec { stiffness: all(3, 300.0), damping: all(3, 5.0), inertia: all(3, 0.05) };
    let motion = Motion::through(&way, 3).unwrap();
    SimulatedHand::holding(&hand, &all(3, 0.1), &all(3, 0.5), motion).unwrap()
}

fn attached(way: &[(f64, [f64; 3])]) -> TipDevice {
    let mut guard = Guard::new(Box::new(hardware(way)), None).unwrap();
    guard.enable().unwrap();
    TipDevice::new(guard, LinearMap::identity(3), arm(), &DeviceSpec::default(), &haptics(3))
}

fn node(q: &JointVector) -> DVec3 {
    let chain = arm();
    let mut pose = chain.new_pose();
    chain.pose(q, &mut pose);
    pose.nodes[0]
}

#[test]
fn the_arm_follows_the_tip_wherever_it_is_led_without_an_allocation() {
    let places = [[0.25, 0.05, -0.05], [0.2, -0.1, 0.08], [0.22, 0.0, 0.0]];
    let way: Vec<(f64, [f64; 3])> = (0..).map(f64::from).zip(places).collect();
    let mut device = attached(&way);
    let (mut reading, free) = (device.read(0.0), all(3, 0.0));
    assert!(node(&reading.position).distance(DVec3::from(places[0])) < 1e-4, "it begins at the tip");
    for _ in 0..4000 {
        reading = assert_no_alloc(|| {
            let reading = device.read(PERIOD);
            device.apply(&free);
            reading
        });
        assert!(reading.position.is_finite());
    }
    assert!(node(&reading.position).distance(DVec3::from(places[2])) < 1e-5, "{:?}", reading.position);
    assert!(device.force().length() < 1e-3);
}

#[test]
fn at_rest_the_hand_feels_the_force_that_balances_the_torque() {
    let place = [0.22, 0.03, -0.06];
    let mut device = attached(&[(0.0, place), (1.0, place)]);
    // The torque of a force on the node, as the loop gives it.
    let pushed = DVec3::new(0.4, -0.3, 0.8);
    let chain = arm();
    let mut reading = device.read(0.0);
    let mut held = all(3, 0.0);
    for _ in 0..6000 {
        let mut pose = chain.new_pose();
        chain.pose(&reading.position, &mut pose);
        let mut torque = all(3, 0.0);
        chain.add_torque(&pose, 0, pushed, &mut torque);
        reading = device.read(PERIOD);
        held = device.apply(&torque).torque;
    }
    // The spring's force on the node balances the push: K (p - x) = -pushed, and the hand feels the push.
    assert!(device.force().distance(-pushed) < 1e-3, "{}", device.force());
    assert!(held.norm() > 0.05);
}

/// Positions of a tip and forces on it, tick by tick.
type Log = Arc<Mutex<Vec<(DVec3, DVec3)>>>;

/// A simulated hand that records where it is and what it is under.
struct Recording {
    hand: SimulatedHand,
    log: Log,
}

impl Device for Recording {
    fn read(&mut self, elapsed: f64) -> Reading {
        let reading = self.hand.read(elapsed);
        let [x, y, z, ..] = reading.position.padded();
        self.log.lock().unwrap().push((DVec3::new(x, y, z), DVec3::ZERO));
        reading
    }

    fn apply(&mut self, force: &JointVector) -> Applied {
        let [x, y, z, ..] = force.padded();
        if let Some(last) = self.log.lock().unwrap().last_mut() {
            last.1 = DVec3::new(x, y, z);
        }
        self.hand.apply(force)
    }
}

/// Arm and spring never hold more energy than the hand has put into them, but for what holding a force over a tick
/// gives: `K (dp)^2 / 2` of each.
#[test]
fn the_coupling_is_passive_at_the_tip_s_port() {
    let rest = [0.22, 0.06, 0.0];
    let moved = (0..60).map(|k| {
        let t = 0.1 * f64::from(k);
        (1.0 + t, [0.22 + 0.03 * (7.0 * t).sin(), 0.06 * (9.0 * t).cos(), 0.03 * (11.0 * t).sin()])
    });
    let way: Vec<(f64, [f64; 3])> = std::iter::once((0.0, rest)).chain(moved).collect();
    let log = Log::default();
    let recording = Recording { hand: hand(&way), log: Arc::clone(&log) };
    let limits = Limits { effort: all(3, 1e3), watchdog: Watchdog::None };
    let mut guard =
        Guard::new(Box::new(Simulated::new(recording, Coordinates::Tip, limits, Vec::new())), None).unwrap();
    guard.enable().unwrap();
    let spec = DeviceSpec::default();
    let mut device = TipDevice::new(guard, LinearMap::identity(3), arm(), &spec, &haptics(3));
    let (mut put_in, mut holding, mut start) = (0.0, 0.0, None);
    for tick in 0..6900 {
        device.read(PERIOD);
        let applied = device.apply(&all(3, 0.0));
        // The ramp is over.
        if tick < 900 {
            continue;
        }
        assert!(applied.clamps.is_empty(), "tick {tick}: {:?}", applied.clamps);
        let start = *start.get_or_insert(device.energy());
        let log = log.lock().unwrap();
        if tick > 900 {
            let [(from, force), (to, _)] = [log[log.len() - 2], log[log.len() - 1]];
            put_in -= force.dot(to - from);
            holding += (0.5 * spec.stiffness + spec.damping / PERIOD) * (to - from).length_squared();
        }
        assert!(device.energy() - start <= put_in + holding + 1e-9, "tick {tick}: {} J of {put_in}", device.energy());
    }
    assert!(
        holding < put_in + holding && put_in > 1e-3,
        "the hand worked: {put_in} J, holding gave at most {holding} J"
    );
}
