//! The safety layer: clamps, ramp, reasons to stop, and that nothing gets past it.

use crate::felt::{PERIOD, accounts_close, all, half_space_loop, pressing, run};
use haptize::{
    JointVector,
    device::{
        Address, Applied, Clamps, Coordinates, Device, Failure, Guard, Halt, JointDevice, Key, LIMIT_SHARE, Limits,
        LinearMap, RAMP_TIME, RISE_TIME, Reading, Script, Simulated, SimulatedHand, WARM_TIME, Watchdog, attach_joints,
        open,
    },
    render::{recording::Recording, trace::Trace},
    scene::DeviceSpec,
};
use std::sync::{
    Arc, Mutex,
    atomic::{AtomicBool, Ordering},
};

/// Maximum torque of the simulated devices (N m).
const MOST: f64 = 1.0;

/// A device that shows what torque is on it, wherever it went.
struct Watched<D> {
    device: D,
    torque: Arc<Mutex<JointVector>>,
}

impl<D: Device> Device for Watched<D> {
    fn read(&mut self, elapsed: f64) -> Reading {
        self.device.read(elapsed)
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        *self.torque.lock().unwrap() = *torque;
        self.device.apply(torque)
    }
}

/// Simulated hardware of `joints` joints that a hand presses into the half space, and the torque on its motors.
fn hardware(joints: usize, scripts: &[Script]) -> (Simulated<Watched<SimulatedHand>>, Arc<Mutex<JointVector>>) {
    let torque = Arc::new(Mutex::new(all(joints, 0.0)));
    let device = Watched { device: pressing(joints, &all(joints, 0.0)), torque: Arc::clone(&torque) };
    let limits = Limits { effort: all(joints, MOST), watchdog: Watchdog::None };
    (Simulated::new(device, Coordinates::Joints(joints), limits, scripts.to_vec()), torque)
}

fn guarded(scripts: &[Script], key: Option<Key>) -> (Guard, Arc<Mutex<JointVector>>) {
    let (hardware, torque) = hardware(2, scripts);
    let mut guard = Guard::new(Box::new(hardware), key).unwrap();
    guard.enable().unwrap();
    (guard, torque)
}

fn script(failure: Failure, from: f64, until: f64) -> Script {
    Script { failure, from, until }
}

#[test]
fn efforts_rise_from_zero_over_half_a_second_and_stay_below_the_device_s_limit_and_rate() {
    let (mut guard, torque) = guarded(&[], None);
    let (mut before, mut greatest) = (0.0, 0.0);
    for tick in 1..=1000 {
        guard.read(PERIOD);
        // Far beyond the limit, its sign changing now and then.
        let wanted = if tick % 200 < 150 { 50.0 } else { -50.0 };
        let held = guard.write(&all(2, wanted));
        let effort = held.effort[0];
        assert_eq!(*torque.lock().unwrap(), held.effort);
        let ramp = (f64::from(tick) * PERIOD / RAMP_TIME).min(1.0);
        assert!(effort.abs() <= LIMIT_SHARE * MOST * ramp + 1e-12, "tick {tick}: {effort}");
        assert!((effort - before).abs() <= LIMIT_SHARE * MOST * PERIOD / RISE_TIME + 1e-12, "tick {tick}");
        assert!(held.clamps.contains(Clamps::SIZE), "tick {tick}");
        assert_eq!(held.clamps.contains(Clamps::RAMP), ramp < 1.0, "tick {tick}");
        before = effort;
        greatest = f64::max(greatest, effort);
    }
    assert_eq!(greatest, LIMIT_SHARE * MOST, "and it is reached");
}

#[test]
fn a_torque_within_all_limits_passes_to_the_last_bit_once_the_ramp_is_over() {
    let (mut guard, _) = guarded(&[], None);
    for tick in 0..1000 {
        guard.read(PERIOD);
        let wanted = all(2, 0.1 + 1e-5 * f64::from(tick));
        let held = guard.write(&wanted);
        if tick > 500 {
            assert_eq!((held.effort, held.clamps, held.halt), (wanted, Clamps::empty(), None));
        }
    }
}

#[test]
fn every_failure_ends_in_zero_torque_at_once_with_its_reason_and_only_pauses_end_again() {
    let expected = [
        (Failure::Silent, Halt::Stale),
        (Failure::Unplugged, Halt::Unplugged),
        (Failure::Garbage, Halt::Garbage),
        (Failure::Released, Halt::KeyReleased),
        (Failure::Unready, Halt::NotReady),
        (Failure::Error, Halt::DeviceError(1)),
        (Failure::Refused, Halt::DeviceError(2)),
        (Failure::Warm, Halt::Hot),
    ];
    assert_eq!(expected.len(), Failure::NAMED.len());
    for (failure, reason) in expected {
        // Warm motors are scaled down first.
        let until = if failure == Failure::Warm { 1.1 + WARM_TIME } else { 1.1 };
        let (mut guard, torque) = guarded(&[script(failure, 1.0005, until)], None);
        let mut since = None;
        for tick in 1..=4000 {
            guard.read(PERIOD);
            let held = guard.write(&all(2, 0.5));
            let time = f64::from(tick) * PERIOD;
            let on = torque.lock().unwrap()[0];
            if time < 1.0 {
                assert_eq!(held.halt, None, "{failure:?} at {time}");
            }
            if let Some(halt) = held.halt {
                assert_eq!(halt, reason, "{failure:?}");
                assert_eq!(held.effort[0], 0.0, "{failure:?} at {time}");
                since.get_or_insert(time);
                // What cannot be reached any more holds what it held; this is what a device's own watchdog is for.
                if !matches!(failure, Failure::Unplugged | Failure::Refused) {
                    assert_eq!(on, 0.0, "{failure:?} at {time}");
                }
            }
        }
        let since = since.unwrap_or_else(|| panic!("{failure:?} was not found"));
        let expected = match failure {
            Failure::Silent => 1.0 + 6.0 * PERIOD,
            Failure::Warm => 1.0 + WARM_TIME,
            _ => 1.0 + PERIOD,
        };
        assert!(since <= expected + 1.5 * PERIOD, "{failure:?}: found at {since}");
        assert_eq!(guard.stopped().is_some(), reason.is_final(), "{failure:?}");
        let on = torque.lock().unwrap()[0];
        if !reason.is_final() {
            assert_eq!(on, 0.5, "{failure:?}: torque is back");
        }
    }
}

#[test]
fn torque_comes_back_from_zero_after_a_pause() {
    let (mut guard, torque) = guarded(&[script(Failure::Released, 1.0, 1.2)], None);
    for tick in 1..=2000 {
        guard.read(PERIOD);
        guard.write(&all(2, 0.5));
        let time = f64::from(tick) * PERIOD;
        let ramp = ((time - 1.2 + PERIOD) / RAMP_TIME).clamp(0.0, 1.0);
        if time > 1.001 {
            assert!(torque.lock().unwrap()[0] <= 0.5 * ramp + 1e-9, "at {time}");
        }
    }
}

#[test]
fn a_torque_that_is_no_number_stops_the_device_for_good() {
    for wanted in [all(2, f64::NAN), all(2, f64::INFINITY), all(3, 0.1)] {
        let (mut guard, torque) = guarded(&[], None);
        guard.read(PERIOD);
        guard.write(&all(2, 0.1));
        guard.read(PERIOD);
        assert_eq!(guard.write(&wanted).halt, Some(Halt::NotFinite));
        guard.read(PERIOD);
        assert_eq!(guard.write(&all(2, 0.1)).halt, Some(Halt::NotFinite));
        assert_eq!(torque.lock().unwrap()[0], 0.0);
    }
}

#[test]
fn a_raised_flag_ends_torque_at_the_next_tick_and_for_good_whatever_the_loop_does() {
    static OVER: AtomicBool = AtomicBool::new(false);
    let (mut guard, torque) = guarded(&[], None);
    guard.end_with(&OVER);
    let push = |guard: &mut Guard| {
        guard.read(PERIOD);
        guard.write(&all(2, 0.5))
    };
    for _ in 0..800 {
        push(&mut guard);
    }
    assert_eq!(torque.lock().unwrap()[0], 0.5);
    OVER.store(true, Ordering::Relaxed);
    let held = push(&mut guard);
    assert_eq!((held.halt, held.effort, torque.lock().unwrap()[0]), (Some(Halt::Over), all(2, 0.0), 0.0));
    OVER.store(false, Ordering::Relaxed);
    (0..800).for_each(|_| assert_eq!(push(&mut guard).halt, Some(Halt::Over)));
    assert_eq!(torque.lock().unwrap()[0], 0.0);
}

#[test]
fn a_dropped_or_panicking_loop_leaves_no_torque() {
    for panics in [false, true] {
        let (guard, torque) = guarded(&[], None);
        let on = Arc::clone(&torque);
        let body = std::thread::spawn(move || {
            let mut guard = guard;
            for _ in 0..800 {
                guard.read(PERIOD);
                guard.write(&all(2, 0.5));
            }
            assert_eq!(on.lock().unwrap()[0], 0.5);
            if panics {
                std::panic::resume_unwind(Box::new("a panic in the loop"));
            }
        });
        assert_eq!(body.join().is_err(), panics);
        assert_eq!(torque.lock().unwrap()[0], 0.0);
    }
}

#[test]
fn torque_needs_the_dead_man_key() {
    let (key, input) = Key::new();
    let (mut guard, torque) = guarded(&[], Some(key));
    let mut tick = |press: bool| {
        if press {
            input.press();
        }
        guard.read(PERIOD);
        guard.write(&all(2, 0.5)).halt
    };
    assert_eq!(tick(false), Some(Halt::KeyReleased));
    // Down, and repeated by the keyboard after half a second, 30 times a second.
    for k in 0..2000 {
        assert_eq!(tick(k == 0 || k > 500 && k % 33 == 0), None, "tick {k}");
    }
    assert_eq!(torque.lock().unwrap()[0], 0.5);
    // Released: the keyboard stops, and torque ends within a fifth of a second.
    let ticks = (0..400).position(|_| tick(false).is_some()).unwrap();
    assert!(ticks <= 200, "{ticks} ticks");
    assert_eq!(torque.lock().unwrap()[0], 0.0);
    // A short tap counts no longer than a keyboard's delay.
    tick(true);
    let ticks = (0..1000).position(|_| tick(false).is_some()).unwrap();
    assert!((740..=760).contains(&ticks), "{ticks} ticks");
}

#[test]
fn accounts_close_and_sessions_replay_when_the_device_holds_less_than_was_asked_for() {
    let haptics = half_space_loop(2);
    let (mut guard, _) = guarded(&[], None);
    guard.limit_to(0.3);
    let mut device = JointDevice::new(guard, LinearMap::identity(2));
    let ticks = run(&haptics, &mut device, 1500, |_| ());
    assert!(ticks.iter().any(|tick| tick.applied.clamps.contains(Clamps::SIZE)));
    assert!(ticks.iter().any(|tick| tick.sample.contact && tick.applied.torque[0].abs() > 0.2));
    assert!(ticks.iter().all(|tick| tick.fault.is_none()), "{:?}", ticks.last());
    assert!(accounts_close(&ticks));
    // The port's work is that of what the device held.
    let mut work = 0.0;
    for pair in ticks.windows(2) {
        work -= (0..2).map(|a| pair[0].applied.torque[a] * (pair[1].device[a] - pair[0].device[a])).sum::<f64>();
    }
    let booked = ticks.last().unwrap().accounts.port_work - ticks[0].accounts.port_work;
    assert!((work - booked).abs() < 1e-12, "{work} {booked}");

    let joints = ["a", "b"].map(|name| haptize::dataset::JointLabel { name: name.into(), unit: "rad".into() });
    let trace = Trace { joints: joints.to_vec(), start: all(2, -0.2), ticks, ..Trace::default() };
    let file = tempfile::NamedTempFile::new().unwrap();
    Recording::write(&trace, &mut file.as_file()).unwrap();
    let recording = Recording::read(file.path(), 2).unwrap();
    let again = recording.replay(&haptics, None, joints.to_vec()).unwrap();
    assert_eq!(recording.first_difference(&again), None);
    assert_eq!(again.ticks.last().unwrap().accounts, trace.ticks.last().unwrap().accounts);
}

#[test]
fn every_failure_in_a_session_leaves_no_torque_within_two_ticks() {
    for (failure, name) in Failure::NAMED.into_iter().filter(|(failure, _)| *failure != Failure::Warm) {
        let haptics = half_space_loop(3);
        let (hardware, torque) = hardware(3, &[script(failure, 0.8, f64::INFINITY)]);
        let mut guard = Guard::new(Box::new(hardware), None).unwrap();
        guard.enable().unwrap();
        let mut device = JointDevice::new(guard, LinearMap::identity(3));
        let mut seen = Vec::new();
        let ticks = run(&haptics, &mut device, 1000, |_| seen.push(torque.lock().unwrap().norm()));
        let first = ticks.iter().position(|tick| tick.applied.halt.is_some()).unwrap_or_else(|| panic!("{name}"));
        assert!(seen[first - 1] > 0.1, "{name}: there was a torque to lose");
        if !matches!(failure, Failure::Unplugged | Failure::Refused) {
            assert!(seen[first + 1..].iter().all(|torque| *torque == 0.0), "{name}");
        }
        assert!(ticks[first..].iter().all(|tick| tick.applied.torque.norm() == 0.0), "{name}");
        drop(device);
        assert_eq!(torque.lock().unwrap().norm(), 0.0, "{name}");
    }
}

#[test]
fn hardware_without_a_position_or_with_limits_that_are_none_is_refused() {
    let limits = |effort: JointVector| Limits { effort, watchdog: Watchdog::None };
    let open = |effort: JointVector, scripts: &[Script]| {
        let device = pressing(2, &all(2, 0.0));
        Guard::new(Box::new(Simulated::new(device, Coordinates::Joints(2), limits(effort), scripts.to_vec())), None)
            .err()
    };
    assert_eq!(open(all(2, 1.0), &[]), None);
    for effort in [all(3, 1.0), all(2, f64::NAN), all(2, f64::INFINITY), all(2, -1.0)] {
        assert_eq!(open(effort, &[]), Some(Halt::Garbage), "{effort:?}");
    }
    assert_eq!(open(all(2, 1.0), &[script(Failure::Garbage, 0.0, 1.0)]), Some(Halt::Garbage));
    assert_eq!(open(all(2, 1.0), &[script(Failure::Unplugged, 0.0, 1.0)]), Some(Halt::Unplugged));
}

#[test]
fn scripts_of_failures_are_read_as_they_are_written_and_nonsense_is_refused() {
    assert_eq!("unplugged@1.5".parse(), Ok(script(Failure::Unplugged, 1.5, f64::INFINITY)));
    assert_eq!("silent@0.5-0.6".parse(), Ok(script(Failure::Silent, 0.5, 0.6)));
    for wrong in ["", "silent", "asleep@1", "silent@", "silent@2-1", "silent@-1", "silent@nan", "silent@1-nan"] {
        assert!(wrong.parse::<Script>().unwrap_err().contains("unplugged@1.5"), "{wrong}");
    }
}

#[test]
fn hardware_is_released_once_and_nothing_is_driven_before_it_is_enabled() {
    let (hardware, torque) = hardware(2, &[]);
    let mut guard = Guard::new(Box::new(hardware), None).unwrap();
    *torque.lock().unwrap() = all(2, 7.0);
    for _ in 0..600 {
        guard.read(PERIOD);
        assert_eq!(guard.write(&all(2, 0.5)).effort, all(2, 0.0));
    }
    assert_eq!(torque.lock().unwrap()[0], 7.0, "no command has reached it");
    drop(guard);
    assert_eq!(torque.lock().unwrap()[0], 0.0);
}

/// A five-bar under a serial arm: whose joint is whose, no program can know.
#[test]
fn a_joint_true_device_leads_no_arm_whose_map_the_scene_does_not_give() {
    let simulated: Address = "simulated".parse().unwrap();
    let guard = || Guard::new(open(&simulated, None).unwrap(), None).unwrap();
    let real: Address = "2diy:/dev/null".parse().unwrap();
    let refused = attach_joints(guard(), &real, 3, &DeviceSpec::default()).err().unwrap();
    assert!(refused.to_string().contains("give [device] a map"), "{refused}");
    let rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0]].map(|row| JointVector::from_slice(&row));
    let spec = DeviceSpec { map: Some(rows.into()), ..DeviceSpec::default() };
    assert!(attach_joints(guard(), &real, 3, &spec).is_ok());
    assert!(attach_joints(guard(), &simulated, 3, &DeviceSpec::default()).is_ok());
}

/// What it rehearses for a device with coordinates of its own is the scene's motion, and the torque is the scene's.
#[test]
fn the_simulated_device_is_the_scene_s_arm_behind_the_scene_s_map() {
    let rows = vec![JointVector::from_slice(&[-1.0, 0.0]), JointVector::from_slice(&[0.5, 2.0])];
    let offset = JointVector::from_slice(&[0.3, -0.2]);
    let map = LinearMap::new(&rows, &offset, 2).unwrap();
    let spec = DeviceSpec { map: Some(rows), offset: Some(offset), ..DeviceSpec::default() };
    let arm = || pressing(2, &all(2, 0.1));
    let address: Address = "simulated".parse().unwrap();
    let (mut device, mut alone) = (open(&address, Some((arm(), &spec))).unwrap(), arm());
    // Of order one, in some hundred steps that each round.
    let rounding = 1000.0 * f64::EPSILON;
    for tick in 0..500 {
        let seen = map.position(&device.read(PERIOD).unwrap().position);
        let there = alone.read(PERIOD).position;
        assert!(seen.iter().zip(there.iter()).all(|(a, b)| (a - b).abs() < rounding), "{tick}: {seen:?} {there:?}");
        let torque = JointVector::from_slice(&[0.2, -0.1]);
        device.write(&map.effort(&torque)).unwrap();
        alone.apply(&torque);
    }
}
