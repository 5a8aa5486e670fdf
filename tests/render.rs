//! The haptic and the graphics loop, driven from outside: energy accounts, limits, faults, repeatability.

#![allow(clippy::unwrap_used)] // clippy.toml allows it inside #[test] functions only; helpers need it, too.

mod desktop;
mod synthetic;

use desktop::{haptics, proxy};
use glam::DVec3;
use haptize as engine;
use haptize::{
    JointVector,
    contact::{Model, Proximity, Status},
    dataset::{Contacts, Dataset},
    device::{Applied, Device, Motion, Reading, Recorded, SimulatedHand},
    field::{TorqueField, range::HaptizedRange},
    object::Object,
    proxy::Chain,
    render::{
        flags::{Fault, Flags},
        graphics::{ContactForces, Graphics, GraphicsError, ObjectMotion},
        haptic::{Haptics, Inputs, JointsError},
        npmi::Npmi,
        passivity,
        recording::Recording,
        session::{self, Driver, Plan},
        setup::{Setup, SetupError, labels},
        trace::{Frame, Trace},
    },
    scene::{
        GraphicsEffects, GraphicsSpec, GroundNodes, GroundSpec, HapticsSpec, Material, ObjectSpec, Scene, Shape,
        SpringKind, SpringSpec, Waypoint,
    },
    sweep::{BackendChoice, Bake},
};
use std::sync::atomic::AtomicBool;
use synthetic::{grid, half_space};

fn vector(values: &[f64]) -> JointVector {
    JointVector::from_slice(values)
}

fn all(joints: usize, value: f64) -> JointVector {
    vector(&vec![value; joints])
}

/// A half space of 5 N m/rad in `joints` joints, on a grid from -0.6 to 0.6 rad.
fn object(joints: usize) -> Dataset {
    let count = if joints > 3 { 5 } else { 13 };
    half_space(grid(&vec![(-0.6, 1.2 / (count - 1) as f64, count); joints]), 5.0)
}

fn build(data: &Dataset, spec: &HapticsSpec) -> Haptics {
    let field = TorqueField::new(data, spec.threshold, &spec.boundary_slope).unwrap();
    Haptics::new(field, proxy(data.grid.joints()), spec).unwrap()
}

fn plan(data: &Dataset, seconds: f64) -> Plan {
    Plan::new(labels(&data.grid), 1e-3, seconds, 0)
}

/// Into the object, along it, and out again, in two seconds.
fn press(joints: usize) -> Motion {
    let mut along = all(joints, 0.25);
    along[0] = 0.35;
    let way = [(0.0, all(joints, -0.2)), (0.7, all(joints, 0.25)), (1.3, along), (2.0, all(joints, -0.2))];
    Motion::through(&way.map(|(time, q)| Waypoint { time, q }), joints).unwrap()
}

fn pressed(joints: usize, spec: &HapticsSpec) -> Trace {
    let data = object(joints);
    let haptics = build(&data, spec);
    let mut hand = SimulatedHand::new(spec, press(joints)).unwrap();
    session::run(&haptics, &mut hand, None, &plan(&data, 2.0)).unwrap()
}

/// A device that reports what it is told, and keeps the torque that it was given last.
struct Scripted {
    readings: Vec<Reading>,
    next: usize,
    torque: JointVector,
}

impl Scripted {
    fn new(positions: impl IntoIterator<Item = JointVector>) -> Self {
        let reading = |position| Reading { position, age: 0.0, hand: position };
        Self { readings: positions.into_iter().map(reading).collect(), next: 0, torque: vector(&[]) }
    }
}

impl Device for Scripted {
    fn read(&mut self, _: f64) -> Reading {
        let reading = self.readings[self.next.min(self.readings.len() - 1)];
        self.next += 1;
        reading
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        self.torque = *torque;
        Applied::whole(torque)
    }
}

#[test]
fn accounts_close_to_rounding_and_the_proxy_never_gives_more_than_was_put_in() {
    for joints in [1, 2, 3, 6] {
        let trace = pressed(joints, &haptics(joints));
        let summary = trace.summary();
        assert!(summary.contact_share > 0.3, "{summary:?}");
        assert!(summary.max_relative_account_residual < 1e-11, "{summary:?}");
        assert!(summary.min_absorbed > -1e-15, "{summary:?}");
        let last = trace.ticks.last().unwrap().accounts;
        assert!(last.turnover > 1e-3 && last.proxy_dissipation > 0.0 && last.coupling_dissipation > 0.0);
    }
}

#[test]
fn accounts_notice_energy_from_nowhere() {
    let mut accounts = pressed(2, &haptics(2)).ticks.last().unwrap().accounts;
    accounts.field_work += 1e-6;
    assert!(accounts.residual().abs() / accounts.turnover > 1e-8);
}

#[test]
fn accounts_close_when_ticks_jitter_from_a_fifth_of_a_millisecond_to_twenty() {
    let (data, spec) = (object(3), haptics(3));
    let haptics = build(&data, &spec);
    let mut state = haptics.start(&all(3, -0.1)).unwrap();
    let (mut time, mut elapsed) = (0.0, 1e-3);
    for k in 0..20_000_u32 {
        let interval = 2e-3 * 10_f64.powf((f64::from(k) * 1.7).sin());
        let position = all(3, 0.1 + 0.25 * (3.0_f64 * time).sin() + 0.001 * (f64::from(k) * 2.9).sin());
        let output = haptics.tick(&mut state, &Inputs { position, age: 0.0, elapsed, interval });
        let accounts = output.accounts;
        assert!(accounts.residual().abs() <= 1e-10 * accounts.turnover, "tick {k}: {accounts:?}");
        assert!(accounts.absorbed() >= -1e-10 * accounts.turnover, "tick {k}: {accounts:?}");
        assert!(output.torque.is_finite() && output.proxy.is_finite());
        time += interval;
        elapsed = interval;
    }
}

#[test]
fn without_input_the_proxy_comes_to_rest_and_the_device_feels_the_contact_torque() {
    // The device held still, inside the object: at rest Kvc (y - x) = -tau(x), and that is what the hand feels.
    let (data, spec) = (object(3), haptics(3));
    let haptics = build(&data, &spec);
    let mut device = Scripted::new([all(3, 0.3)]);
    let trace = session::run(&haptics, &mut device, None, &plan(&data, 3.0)).unwrap();
    assert_eq!(device.torque, all(3, 0.0), "the session leaves the device without torque");
    let last = trace.ticks.last().unwrap();
    assert!(last.accounts.kinetic < 1e-20, "{:?}", last.accounts);
    // Springs in series: 5 of the object along the diagonal, 15 of the coupling.
    for (tau, contact) in last.device_torque.iter().zip(last.contact_torque.iter()) {
        assert!((tau - contact).abs() < 1e-9, "{tau} felt, {contact} rendered");
        assert!((tau + 0.3 * 15.0 * 5.0 / 20.0).abs() < 1e-9, "{tau}");
    }
}

#[test]
fn a_press_is_continuous() {
    let trace = pressed(3, &haptics(3));
    let summary = trace.summary();
    // The torque of the object and its layer changes by no more than 10 N m/rad at the hand's speed of about 2 rad/s.
    assert!(summary.max_contact_torque > 1.0, "{summary:?}");
    assert!(summary.max_contact_torque_step < 0.03, "{summary:?}");
    assert!(summary.max_device_torque_step < 0.06, "{summary:?}");
    assert_eq!((summary.faults, summary.outside, summary.limited), (0, 0, 0));
}

#[test]
fn the_same_session_gives_the_same_numbers_twice() {
    assert_eq!(pressed(3, &haptics(3)), pressed(3, &haptics(3)));
}

#[test]
fn a_device_that_moves_as_recorded_is_given_the_recorded_torques_bit_for_bit() {
    let (data, spec) = (object(2), haptics(2));
    let trace = pressed(2, &spec);
    let mut file = tempfile::NamedTempFile::new().unwrap();
    for tick in &trace.ticks {
        use std::io::Write;
        writeln!(file, "{},{},{}", tick.time, tick.device[0], tick.device[1]).unwrap();
    }
    let mut device = Recorded::new(Motion::from_csv(file.path(), 2).unwrap());
    let haptics = build(&data, &spec);
    let again = session::run(&haptics, &mut device, None, &plan(&data, 2.0)).unwrap();
    assert_eq!(again.ticks.len(), trace.ticks.len());
    for (a, b) in again.ticks.iter().zip(&trace.ticks) {
        assert_eq!((a.device_torque, a.proxy, a.accounts), (b.device_torque, b.proxy, b.accounts), "at {} s", a.time);
    }
}

/// A session as it happens at its worst: ticks that come early and late, a device that fails twice, a fault cleared.
fn eventful(haptics: &Haptics) -> Trace {
    let mut positions: Vec<JointVector> = (0..600).map(|k| all(2, 0.3 * (0.02 * f64::from(k)).sin())).collect();
    positions[300] = vector(&[0.1, f64::NAN]);
    positions[500] = vector(&[]);
    let mut device = Scripted::new(positions);
    let mut driver = Driver::new(haptics, &mut device).unwrap();
    let mut trace = Trace { start: *driver.start(), ..Trace::default() };
    let mut elapsed = 1e-3;
    for k in 0..599 {
        if k == 400 {
            driver.clear_fault();
        }
        let interval = 1e-3 * (1.2 + (1.7 * f64::from(k)).sin());
        trace.ticks.push(driver.tick(elapsed, interval).0);
        elapsed = interval;
    }
    trace
}

#[test]
fn a_recorded_session_replays_bit_for_bit_with_its_faults() {
    let data = object(2);
    let haptics = build(&data, &haptics(2));
    let mut trace = eventful(&haptics);
    trace.joints = labels(&data.grid);
    let restarts = trace.ticks.iter().filter(|tick| tick.restart).count();
    let reasons: Vec<_> = [0, 299, 398, 400, 499].map(|k| trace.ticks[k].fault).into();
    assert_eq!(restarts, 1);
    assert_eq!(reasons, [None, Some(Fault::NotFinite), Some(Fault::NotFinite), None, Some(Fault::Joints)]);

    let file = tempfile::NamedTempFile::new().unwrap();
    Recording::of(&trace).write(&trace.joints, &mut file.as_file()).unwrap();
    let recording = Recording::read(file.path(), 2).unwrap();
    let again = recording.replay(&haptics, None, labels(&data.grid)).unwrap();
    assert_eq!(recording.first_difference(&again), None);
    for (a, b) in again.ticks.iter().zip(&trace.ticks) {
        assert_eq!((a.time, a.accounts, a.fault, a.restart), (b.time, b.accounts, b.fault, b.restart));
    }
    // The comparison sees the last bit of one torque, another tick, and other gains.
    let mut altered = again.clone();
    altered.ticks[7].device_torque[1] = f64::from_bits(altered.ticks[7].device_torque[1].to_bits() ^ 1);
    assert_eq!(recording.first_difference(&altered), Some(7));
    altered.ticks.truncate(5);
    assert_eq!(recording.first_difference(&altered), Some(5));
    let other = HapticsSpec { coupling_stiffness: all(2, 15.1), ..desktop::haptics(2) };
    let other = recording.replay(&build(&data, &other), None, labels(&data.grid)).unwrap();
    assert!(recording.first_difference(&other).is_some_and(|tick| tick < 5));
}

#[test]
fn files_that_are_no_recording_are_refused_with_their_line() {
    let good = "# start,0,0\nelapsed [s],...\n0.001,0.001,0,0,0,1,1,1,1,1,1,1,1,1,1\n";
    let file = tempfile::NamedTempFile::new().unwrap();
    let read = |text: &str| {
        std::fs::write(file.path(), text).unwrap();
        Recording::read(file.path(), 2).map_err(|error| error.to_string())
    };
    assert_eq!(read(good).unwrap().ticks(), 1);
    for (old, new, expected) in [
        ("0.001,0.001,0,0,0,1", "0.001,0.001,0,0,0,1,1", ":3: 16 fields in the place of 15"),
        ("0.001,0.001,0,0,0,1", "0.001,x,0,0,0,1", ":3: \"x\" is not such a number"),
        ("0.001,0.001,0,0,0,1", "0.001,0.001,0,-1,0,1", ":3: \"-1\" is not such a number"),
        ("0.001,0.001,0,0,0,1", "0.001,0.001,0,0,0,", ":3: \"\" is not such a number"),
        ("# start,0,0\n", "", ":2: 1 ticks and a first position of 0 joints"),
        ("# start,0,0\n", "# start,0\n", ":1: 1 coordinates"),
        ("0.001,0.001,0,0,0,1,1,1,1,1,1,1,1,1,1\n", "", ":2: 0 ticks"),
    ] {
        assert_eq!(good.matches(old).count(), 1);
        let message = read(&good.replace(old, new)).unwrap_err();
        assert!(message.contains(expected) && message.contains("--record"), "{message}");
    }
    assert!(Recording::read(std::path::Path::new("/nowhere.csv"), 2).is_err());
}

#[test]
fn torque_is_limited_in_size_and_rate() {
    let mut spec = haptics(2);
    spec.torque_limit = all(2, 0.4);
    spec.torque_rate_limit = all(2, 20.0);
    // The device is thrown by a radian within 40 ms.
    let positions = (0..400).map(|k| all(2, -0.5 + f64::from(k - 100).clamp(0.0, 40.0) / 40.0));
    let data = object(2);
    let haptics = build(&data, &spec);
    let trace = session::run(&haptics, &mut Scripted::new(positions), None, &plan(&data, 0.4)).unwrap();
    let mut before = all(2, 0.0);
    for tick in &trace.ticks {
        for (tau, before) in tick.device_torque.iter().zip(before.iter()) {
            assert!(tau.abs() <= 0.4 && (tau - before).abs() <= 0.02 + 1e-15, "{tau} after {before}");
        }
        before = tick.device_torque;
    }
    assert!(trace.ticks.iter().any(|tick| tick.flags.contains(Flags::SIZE_LIMITED)));
    assert!(trace.ticks.iter().any(|tick| tick.flags.contains(Flags::RATE_LIMITED)));
    assert!(trace.summary().max_relative_account_residual < 1e-11);
}

#[test]
fn a_device_that_fails_is_let_go_smoothly_with_the_reason() {
    let (data, spec) = (object(2), haptics(2));
    let haptics = build(&data, &spec);
    let good = Inputs { position: all(2, 0.3), age: 0.0, elapsed: 1e-3, interval: 1e-3 };
    let failures = [
        (Inputs { position: all(2, f64::NAN), ..good }, Fault::NotFinite),
        (Inputs { position: all(2, f64::INFINITY), ..good }, Fault::NotFinite),
        (Inputs { position: all(2, -1e300), ..good }, Fault::NotFinite),
        (Inputs { position: all(3, 0.3), ..good }, Fault::Joints),
        (Inputs { position: all(0, 0.3), ..good }, Fault::Joints),
        (Inputs { age: 1.0, ..good }, Fault::Stale),
        (Inputs { age: f64::NAN, ..good }, Fault::Stale),
        (Inputs { elapsed: 0.0, ..good }, Fault::Late),
        (Inputs { elapsed: f64::NAN, ..good }, Fault::Late),
        (Inputs { interval: -1e-3, ..good }, Fault::Late),
        (Inputs { interval: f64::INFINITY, ..good }, Fault::Late),
        (Inputs { position: all(2, 1.3), ..good }, Fault::Leap),
    ];
    for (bad, reason) in failures {
        let mut state = haptics.start(&good.position).unwrap();
        for _ in 0..500 {
            assert_eq!(haptics.tick(&mut state, &good).fault, None);
        }
        let mut before = haptics.tick(&mut state, &good).torque;
        assert!(before.norm() > 0.5);
        let mut ticks = 0;
        while before.norm() > 0.0 {
            let output = haptics.tick(&mut state, &bad);
            assert_eq!(output.fault, Some(reason), "{bad:?}");
            // 500 N m/s.
            assert!(output.torque.iter().zip(before.iter()).all(|(tau, b)| (tau - b).abs() <= 0.5 + 1e-12));
            assert!(
                output.torque.norm() < before.norm()
                    && output.proxy.is_finite()
                    && output.accounts.residual().is_finite()
            );
            before = output.torque;
            ticks += 1;
            assert!(ticks < 10);
        }
        // The device comes back: the torque does not, until somebody asks for it, and then without a blow.
        let mut output = haptics.tick(&mut state, &good);
        assert_eq!((output.fault, output.torque.norm()), (Some(reason), 0.0));
        assert!(haptics.restart(&mut state, &all(2, f64::NAN)).is_err());
        assert_eq!(haptics.tick(&mut state, &good).fault, Some(reason));
        haptics.restart(&mut state, &good.position).unwrap();
        for _ in 0..500 {
            let before = output.torque;
            output = haptics.tick(&mut state, &good);
            assert!(
                output.torque.iter().zip(before.iter()).all(|(tau, b)| (tau - b).abs() <= 0.5 + 1e-12),
                "{output:?}"
            );
        }
        assert_eq!(output.fault, None);
        assert!(output.torque.norm() > 0.5 && output.accounts.residual().abs() < 1e-11 * output.accounts.turnover);
    }
    let field = TorqueField::new(&data, 0.5, &spec.boundary_slope).unwrap();
    let differing = JointsError { field: 2, proxy: 3, gains: 2 };
    assert_eq!(Haptics::new(field, proxy(3), &spec).err(), Some(differing));
    assert_eq!(haptics.start(&all(2, f64::NAN)).err(), Some(Fault::NotFinite));
    assert_eq!(haptics.start(&all(1, 0.0)).err(), Some(Fault::Joints));
}

#[test]
fn a_torque_that_is_no_number_never_reaches_the_device() {
    let (data, mut spec) = (object(2), haptics(2));
    (spec.coupling_stiffness, spec.speed_limit) = (all(2, 1e308), all(2, 1e9));
    let haptics = build(&data, &spec);
    let mut state = haptics.start(&all(2, 0.0)).unwrap();
    let mut fault = None;
    for k in 0..40 {
        let position = all(2, 10.0 * f64::from(k));
        let output = haptics.tick(&mut state, &Inputs { position, age: 0.0, elapsed: 1e-3, interval: 1e-3 });
        assert!(output.torque.iter().all(|tau| tau.abs() <= spec.torque_limit[0]));
        fault = output.fault;
    }
    assert_eq!(fault, Some(Fault::Torque));
}

#[test]
fn gains_beyond_their_bound_are_named_with_the_safe_value() {
    let (data, mut spec) = (object(2), haptics(2));
    let field = |spec: &HapticsSpec| TorqueField::new(&data, 0.5, &spec.boundary_slope).unwrap();
    assert_eq!(passivity::exceeded(&spec, &field(&spec), &labels(&data.grid)), []);
    spec.boundary_slope[1] = 50.0;
    spec.coupling_stiffness[0] = 30.0;
    let found = passivity::exceeded(&spec, &field(&spec), &labels(&data.grid));
    let safe: Vec<(f64, f64)> = found.iter().map(|bound| (bound.value, bound.safe)).collect();
    assert_eq!(safe[..2], [(30.0, 20.0), (50.0, 40.0)]);
    // Layer and object together: sqrt((Ks / safe)^2 + L^2) with the object's own relative stiffness L, which is less than one.
    let &[_, _, (together, 1.0)] = &safe[..] else { panic!("{safe:?}") };
    assert!(together > 50.0 / 40.0 && together < (1.0 + (50.0_f64 / 40.0).powi(2)).sqrt(), "{together}");
    assert!(found[1].to_string().contains("boundary slope Ks of joint joint 1 is 50.0000, beyond the passive 40.0000"));
    // The values that it names are safe; beside the object's own stiffness, which takes a hundredth of it, a slope a little less.
    spec.boundary_slope[1] = 0.98 * safe[1].1;
    spec.coupling_stiffness[0] = safe[0].1;
    assert_eq!(passivity::exceeded(&spec, &field(&spec), &labels(&data.grid)), []);
    spec.proxy_damping = all(2, 1e-3);
    assert!(
        passivity::exceeded(&spec, &field(&spec), &labels(&data.grid)).iter().any(|b| b.what.starts_with("stiffness"))
    );
}

/// The paper's sphere: 102 nodes.
fn sphere(stiffness: f64, damping: f64) -> Object {
    Object::build(&ObjectSpec {
        shape: Shape::Sphere { centre: DVec3::ZERO, radius: 0.05, rings: 10, segments: 10 },
        material: Material::Springs(SpringSpec { kind: SpringKind::Isotropic, stiffness }),
        skin: None,
        ground: Some(GroundSpec { stiffness: 0.3 * stiffness, nodes: GroundNodes::All }),
        node_mass: 1e-3,
        node_damping: damping,
    })
    .unwrap()
}

/// The paper's graphics loop.
fn graphics_60() -> GraphicsSpec {
    GraphicsSpec { rate: 60.0, effects: GraphicsEffects::default() }
}

/// Kinetic and elastic energy of the object [J].
fn energy(object: &Object, motion: &ObjectMotion<'_>) -> f64 {
    let mut force = vec![DVec3::ZERO; object.rest.len()];
    object.stiffness.apply(motion.displacement(), &mut force);
    let elastic: f64 = force.iter().zip(motion.displacement()).map(|(f, u)| f.dot(*u)).sum();
    let kinetic: f64 = object.mass.iter().zip(motion.velocity()).map(|(m, v)| m * v.length_squared()).sum();
    0.5 * (elastic + kinetic)
}

#[test]
fn the_object_never_gains_energy_without_input_and_balances_with_it() {
    for stiffness in [300.0, 3e7] {
        let object = sphere(stiffness, 0.05);
        for period in [1e-3, 1.0 / 60.0, 1.0] {
            let mut motion = ObjectMotion::new(&object, period, &GraphicsEffects::default()).unwrap();
            let mut before = 0.0;
            for frame in 0..200 {
                let pushed = frame < 20;
                let force =
                    |k: usize| if pushed { DVec3::new(0.0, 0.1, -(((k + frame) % 7) as f64)) } else { DVec3::ZERO };
                let forces: Vec<DVec3> = (0..object.rest.len()).map(force).collect();
                let v_hat = motion.step(&forces);
                let work: f64 = period * v_hat.iter().zip(&forces).map(|(v, f)| v.dot(*f)).sum::<f64>();
                let loss: f64 =
                    period * v_hat.iter().zip(&object.damping).map(|(v, b)| b * v.length_squared()).sum::<f64>();
                let after = energy(&object, &motion);
                let scale = before + after + work.abs() + loss;
                assert!(
                    (after - before - work + loss).abs() < 1e-11 * scale,
                    "{stiffness} N/m, {period} s, frame {frame}"
                );
                assert!(pushed || after <= before * (1.0 + 1e-12), "{stiffness} N/m, {period} s, frame {frame}");
                before = after;
            }
            assert!(before > 0.0);
        }
    }
}

#[test]
fn under_constant_forces_the_object_settles_where_its_springs_balance_them() {
    let object = sphere(300.0, 2.0);
    let mut motion = ObjectMotion::new(&object, 1.0 / 60.0, &GraphicsEffects::default()).unwrap();
    let mut forces = vec![DVec3::ZERO; object.rest.len()];
    forces[0] = DVec3::new(0.1, 0.0, -0.8);
    for _ in 0..4000 {
        motion.step(&forces);
    }
    let mut spring = vec![DVec3::ZERO; object.rest.len()];
    object.stiffness.apply(motion.displacement(), &mut spring);
    let error = spring.iter().zip(&forces).map(|(k, f)| (*k - *f).length()).fold(0.0, f64::max);
    assert!(error < 1e-6, "{error}");
    assert_eq!(motion.nodes().len(), 102);
}

/// A dataset in one joint over a sphere: node 3 is pushed from 0.2 rad on, node 7 with it from 0.4 rad on.
fn pushed() -> Dataset {
    let mut data = Dataset::of_field(grid(&[(0.0, 0.2, 4)]), |q| {
        (vector(&[-q[0]]), 0.0, if q[0] > 0.1 { Status::Contact } else { Status::Free })
    });
    let forces: Vec<f32> = vec![0.0, 0.0, -1.0, 0.0, 0.0, -2.0, 1.0, 0.0, 0.0, 0.0, 0.0, -3.0, 2.0, 0.0, 0.0];
    let contacts = Contacts {
        offsets: vec![0_u64, 0, 1, 3, 5].into(),
        nodes: vec![3_u32, 3, 7, 3, 7].into(),
        forces: forces.into(),
    };
    data.contacts = Some(contacts);
    data
}

#[test]
fn contact_forces_are_interpolated_over_the_nodes_of_all_corners() {
    let contact = ContactForces::new(&pushed(), 102).unwrap();
    let mut forces = vec![DVec3::ONE; 102];
    contact.interpolate(&[0.25], 0.5, &mut forces);
    // Three quarters of the point at 0.2 rad and a quarter of that at 0.4 rad, times the share.
    assert!((forces[3] - DVec3::new(0.0, 0.0, -0.625)).length() < 1e-12, "{}", forces[3]);
    assert!((forces[7] - DVec3::new(0.125, 0.0, 0.0)).length() < 1e-12, "{}", forces[7]);
    assert_eq!(forces.iter().filter(|f| **f != DVec3::ZERO).count(), 2);
    contact.interpolate(&[0.25], 0.0, &mut forces);
    assert!(forces.iter().all(|f| *f == DVec3::ZERO));
}

#[test]
fn contact_forces_that_do_not_fit_are_refused() {
    assert_eq!(ContactForces::new(&object(1), 102).err(), Some(GraphicsError::NoForces));
    assert_eq!(ContactForces::new(&pushed(), 7).err(), Some(GraphicsError::Rows { nodes: 7 }));
    for offsets in [[0, 0, 1, 3, 6], [0, 3, 1, 3, 5], [0, 0, 1, 3, u64::MAX]] {
        let mut data = pushed();
        data.contacts.as_mut().unwrap().offsets = offsets.to_vec().into();
        assert_eq!(ContactForces::new(&data, 102).err(), Some(GraphicsError::Rows { nodes: 102 }), "{offsets:?}");
    }
    assert_eq!(
        ObjectMotion::new(&sphere(300.0, 0.05), f64::NAN, &GraphicsEffects::default())
            .err()
            .map(|e| e.to_string().contains("NaN")),
        Some(true)
    );
}

#[test]
fn two_loops_run_at_two_rates_and_repeat_bit_for_bit() {
    let (data, spec, object) = (pushed(), haptics(1), sphere(300.0, 0.05));
    let haptics = build(&data, &spec);
    let way = [(0.0, 0.0), (0.5, 0.5), (1.0, 0.5), (1.5, 0.0)];
    let run = || {
        let motion = Motion::through(&way.map(|(time, q)| Waypoint { time, q: vector(&[q]) }), 1).unwrap();
        let mut hand = SimulatedHand::new(&spec, motion).unwrap();
        let mut graphics = Graphics::new(&data, &object, &graphics_60()).unwrap();
        let plan = Plan { snapshots: vec![0.0, 0.8, 0.8001, 1.45], ..plan(&data, 1.5) };
        session::run(&haptics, &mut hand, Some(&mut graphics), &plan).unwrap()
    };
    let trace = run();
    assert_eq!(trace, run());
    assert_eq!(trace.ticks.len(), 1500);
    // Graphics comes again from a recording, too.
    let mut graphics = Graphics::new(&data, &object, &graphics_60()).unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    Recording::of(&trace).write(&trace.joints, &mut file.as_file()).unwrap();
    let recording = Recording::read(file.path(), 1).unwrap();
    assert_eq!(recording.replay(&haptics, Some(&mut graphics), labels(&data.grid)).unwrap(), trace);
    // The first frame at or after each instant, each once.
    let times: Vec<f64> = trace.frames.iter().map(|frame| frame.time).collect();
    let expected = [0.0, 48.0 / 60.0, 49.0 / 60.0, 87.0 / 60.0];
    assert!(times.len() == 4 && times.iter().zip(expected).all(|(t, e)| (t - e).abs() < 1e-12), "{times:?}");
    assert_eq!(trace.summary().max_contact_nodes, 2);
    let moved = |frame: usize| trace.frames[frame].nodes[3] - object.rest[3];
    assert_eq!(moved(0), DVec3::ZERO);
    assert!(moved(1).z < -1e-4, "{}", moved(1));
}

/// The paper's sphere scene, baked.
fn baked_sphere() -> Dataset {
    let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml")).unwrap();
    let bake = Bake {
        scene: &scene,
        backend: BackendChoice::Cpu,
        measured: Some(0),
        aim: None,
        date: "2000-01-01T00:00:00Z",
        stop: &AtomicBool::new(false),
        progress: &mut |_| {},
    };
    bake.in_memory().unwrap().0
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
    let held = trace.ticks.iter().filter(|tick| tick.contact && tick.flags.contains(Flags::LAYER)).count();
    assert!(held > 0 && held < 100, "{held} ticks");
    // The object is seen to be dented, and to be round again.
    let moved = |frame: &Frame| {
        let rest = &setup.object.as_ref().unwrap().rest;
        frame.nodes.iter().zip(rest).map(|(n, rest)| n.distance(*rest)).fold(0.0, f64::max)
    };
    assert!(trace.frames.iter().map(moved).fold(0.0, f64::max) > 2e-3);
    assert!(moved(&trace.frames[0]) < 1e-6);
}

#[test]
fn datasets_that_cannot_be_rendered_say_why() {
    let mut data = object(2);
    assert!(matches!(Setup::new(&data).err(), Some(SetupError::NoScene)));
    data.scene = "name = 3".into();
    assert!(matches!(Setup::new(&data).err(), Some(SetupError::Scene(_))));
    data.scene = include_str!("scenes/sphere.toml").into();
    assert!(matches!(Setup::new(&data).err(), Some(SetupError::Joints { grid: 2, chain: 3 })));
}

#[test]
fn at_the_end_of_the_grid_the_device_is_held_by_the_coupling() {
    // Pressed into the half space and on beyond the grid, which ends at 0.6 rad; held there, and let out again.
    for joints in 1..=3 {
        let (data, mut spec) = (object(joints), haptics(joints));
        spec.torque_limit = all(joints, 10.0);
        let haptics = build(&data, &spec);
        let mut script: Vec<JointVector> = (0..1200).map(|k| all(joints, -0.2 + 1e-3 * f64::from(k))).collect();
        script.extend(vec![all(joints, 1.0); 2000]);
        script.extend((0..1200).map(|k| all(joints, 1.0 - 1e-3 * f64::from(k))));
        let count = script.len();
        let trace =
            session::run(&haptics, &mut Scripted::new(script), None, &plan(&data, 1e-3 * count as f64)).unwrap();
        let summary = trace.summary();
        assert!(summary.max_relative_account_residual < 1e-11 && summary.min_absorbed > -1e-12, "{summary:?}");
        assert_eq!((summary.outside, summary.faults), (0, 0));
        let last = trace.ticks.last().unwrap();
        assert!(!last.contact && last.accounts.stop_work < 0.0, "{last:?}");
        let (mut deepest, mut torque) = (0.0_f64, 0.0_f64);
        for tick in &trace.ticks[..3200] {
            // The deeper the device is, the more it is pushed back: nowhere beyond the border does that end.
            let pushed = -tick.device_torque[0];
            if tick.device[0] > 0.3 && tick.device[0] > deepest {
                assert!(pushed > torque - 1e-3, "{pushed} after {torque}");
                (deepest, torque) = (tick.device[0], pushed);
            }
        }
        let held = &trace.ticks[3190];
        assert!(held.contact && held.flags.contains(Flags::HELD) && !held.flags.contains(Flags::STOPPED));
        for a in 0..joints {
            assert!((held.proxy[a] - 0.6).abs() < 1e-12, "{held:?}");
            assert!((held.device_torque[a] + 15.0 * 0.4).abs() < 1e-9, "{held:?}");
        }
    }
}

#[test]
fn the_proxy_leaves_the_grid_where_space_is_free_and_nowhere_else() {
    let mut scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sphere.toml")).unwrap();
    // A narrow grid over the middle of the sphere, touched at some of its borders; the joints reach farther.
    for (axis, (start, step, count)) in scene.grid.axes.iter_mut().zip([(-0.3, 0.1, 7), (1.0, 0.1, 6), (-2.25, 0.1, 5)])
    {
        (axis.start, axis.step, axis.count) = (start, step, count);
    }
    let bake = Bake {
        scene: &scene,
        backend: BackendChoice::Cpu,
        measured: Some(0),
        aim: None,
        date: "2000-01-01T00:00:00Z",
        stop: &AtomicBool::new(false),
        progress: &mut |_| {},
    };
    let data = bake.in_memory().unwrap().0;
    let mut chain = Chain::new(&scene.proxy);
    for (joint, limits) in chain.joints.iter_mut().zip([[-1.5, 1.5], [0.4, 2.2], [-2.8, -1.2]]) {
        joint.limits = limits;
    }
    let spec = &scene.haptics;
    let field = TorqueField::interpolated(&data, spec.interpolation, spec.threshold, &spec.boundary_slope).unwrap();
    let haptics = Haptics::new(field, Npmi::of_chain(&chain).unwrap(), spec)
        .unwrap()
        .with_range(HaptizedRange::new(&data, &chain).unwrap());
    let object = Object::build(&scene.object).unwrap();
    let model = Model::new(&object, &chain, scene.contact);
    let mut proximity = Proximity::new(&model);
    let mut seed = 7_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut held, mut outside, mut far, mut least) = (0, 0, 0.0_f64, f64::INFINITY);
    for _ in 0..40 {
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * random();
        let at: Vec<_> = (0..4).map(|_| [[-1.4, 1.4], [0.5, 2.1], [-2.7, -1.3]].map(&mut between)).collect();
        let way = at.iter().enumerate().map(|(k, q)| Waypoint { time: 0.7 * k as f64, q: vector(q) });
        let motion = Motion::through(&way.collect::<Vec<_>>(), 3).unwrap();
        let trace = session::run(&haptics, &mut Recorded::new(motion), None, &plan(&data, 2.1)).unwrap();
        let summary = trace.summary();
        assert!(summary.max_relative_account_residual < 1e-11, "{summary:?}");
        held += summary.held;
        for tick in trace.ticks.iter().filter(|tick| tick.flags.contains(Flags::OUTSIDE)) {
            outside += 1;
            let inside = data.grid.clamp(&tick.proxy);
            far = inside.iter().zip(tick.proxy.iter()).map(|(a, b)| (a - b).abs()).fold(far, f64::max);
            proximity.place(&tick.proxy);
            least = least.min(proximity.gap(&tick.proxy));
        }
    }
    assert!(least >= 0.0, "{least} m");
    assert!(held > 500 && outside > 500 && far > 0.2, "held {held}, outside {outside}, as far as {far} rad");
}

#[test]
fn beyond_a_measured_range_a_free_border_is_free_and_one_in_contact_holds() {
    // No gaps: steps from contact count. The half space fills the upper half of the grid.
    let data = object(2);
    let mut chain = Chain { joints: Vec::new(), nodes: Vec::new() };
    let setup = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sphere.toml")).unwrap();
    chain.joints = Chain::new(&setup.proxy).joints[..2].to_vec();
    chain.joints.iter_mut().for_each(|joint| joint.limits = [-3.0, 3.0]);
    let range = HaptizedRange::new(&data, &chain).unwrap();
    let haptics = build(&data, &haptics(2)).with_range(range);
    let mut script: Vec<JointVector> = (0..1000).map(|k| all(2, -0.2 - 1e-3 * f64::from(k))).collect();
    script.extend((0..2200).map(|k| all(2, -1.2 + 1e-3 * f64::from(k))));
    let trace = session::run(&haptics, &mut Scripted::new(script), None, &plan(&data, 3.2)).unwrap();
    let away = &trace.ticks[990];
    assert!(away.proxy[0] < -1.1 && away.flags.contains(Flags::OUTSIDE) && !away.flags.contains(Flags::HELD));
    let last = trace.ticks.last().unwrap();
    assert!(last.contact && last.flags.contains(Flags::HELD) && last.proxy[0] <= 0.6, "{last:?}");
}
