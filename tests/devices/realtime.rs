//! The real-time loop: it allocates nothing, and does every tick that it does not report as missed. The device whose
//! hand another thread leads.

use crate::common::{
    desktop::{haptics, proxy},
    program::command,
};
use assert_no_alloc::assert_no_alloc;
use haptize::{
    JointVector, MAX_AXES,
    control::{Clock, LONGEST_ARREARS, Patience},
    dataset::Dataset,
    device::{Applied, Device, Halt, Motion, Pointer, Reading, Scheduler, SimulatedHand},
    field::TorqueField,
    fixtures::grids::{grid, half_space},
    render::{
        flags::Fault,
        graphics::Graphics,
        haptic::{Haptics, Inputs},
        live::LiveScene,
        realtime::{self, Ends, Options, RATE, Recorder},
        recording::Recording,
        session::{Driver, Plan},
        setup::{Setup, labels},
    },
    scene::{
        FourChannelSpec, FrictionSpec, GraphicsEffects, GraphicsSpec, HapticsSpec, Interpolation, ProxyInertia,
        RelaxationSpec, Scene, Waypoint,
    },
    sweep::baked,
};
use std::{
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

fn object(joints: usize) -> Dataset {
    half_space(grid(&vec![(-0.6, 0.3, 5); joints]), 5.0)
}

fn build(data: &Dataset) -> Haptics {
    interpolated(data, Interpolation::Linear)
}

fn interpolated(data: &Dataset, interpolation: Interpolation) -> Haptics {
    let joints = data.grid.joints();
    let spec = haptics(joints);
    let field = TorqueField::interpolated(data, interpolation, spec.threshold, &spec.boundary_slope).unwrap();
    Haptics::new(field, proxy(joints), &spec).unwrap()
}

/// A hand that leads all joints alike through (time, place).
fn along<const N: usize>(joints: usize, places: [(f64, f64); N]) -> SimulatedHand {
    let way = places.map(|(time, x)| Waypoint { time, q: JointVector::from_slice(&vec![x; joints]) });
    SimulatedHand::new(&haptics(joints), Motion::through(&way, joints).unwrap()).unwrap()
}

/// In and out of the object.
fn hand(joints: usize) -> SimulatedHand {
    along(joints, [(0.0, -0.2), (0.1, 0.3), (0.3, -0.2)])
}

#[test]
fn a_tick_allocates_nothing_whatever_it_is_told() {
    let ways = [Interpolation::Linear, Interpolation::Potential];
    for (joints, way) in (1..=MAX_AXES).flat_map(|joints| ways.map(|way| (joints, way))) {
        let haptics = interpolated(&object(joints), way);
        let all = |x: f64| JointVector::from_slice(&vec![x; joints]);
        let mut state = haptics.start(&all(0.0)).unwrap();
        // Free, in contact, outside the grid, at a stop, and what no device should say.
        for x in [0.0, 0.3, 0.7, 50.0, f64::NAN, f64::INFINITY, -0.3] {
            let inputs = Inputs { position: all(x), age: 0.0, elapsed: 1e-3, interval: 1e-3 };
            assert_no_alloc(|| {
                for _ in 0..200 {
                    haptics.tick(&mut state, &inputs);
                }
            });
        }
    }
}

#[test]
fn the_real_time_loop_allocates_nothing() {
    let data = object(3);
    let haptics = build(&data);
    let mut hand = hand(3);
    let goes_on = || Some(Patience::Spins);
    let mut clock = Clock::of(&hand, haptics.period(), RATE, &goes_on).unwrap();
    let mut driver = Driver::new(&haptics, &mut hand).unwrap();
    let (mut recorder, Ends { mut ticks, mut latest }) = Recorder::new(3);
    let (clear, mut count) = (driver.controller.clear(), 0);
    assert_no_alloc(|| {
        driver.pace(&mut clock, &mut |_, record, paced| {
            recorder.take(record, paced);
            count += 1;
            if count == 150 {
                clear.ask();
            }
            count < 300
        })
    });
    assert_eq!(count, 300);
    let mut last = None;
    while let Ok(tick) = ticks.pop() {
        last = Some(tick);
    }
    assert_eq!(latest.read().proxy, last.unwrap().proxy);
}

/// A device whose maker's library calls the loop, at a rate of its own.
struct Called {
    hand: SimulatedHand,
    rate: f64,
    /// Size of the torque that it was given last (N m).
    last: Arc<Mutex<f64>>,
}

impl Device for Called {
    fn read(&mut self, elapsed: f64) -> Reading {
        self.hand.read(elapsed)
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        *self.last.lock().unwrap() = torque.norm();
        self.hand.apply(torque)
    }

    fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
        Some(Arc::new(Rate(self.rate)))
    }
}

struct Rate(f64);

impl Scheduler for Rate {
    fn run(&self, tick: &mut (dyn FnMut() -> bool + Send)) -> Result<(), Halt> {
        while tick() {
            std::thread::sleep(Duration::from_secs_f64(1.0 / self.0));
        }
        Ok(())
    }

    fn rate(&self) -> f64 {
        self.0
    }
}

#[test]
fn a_maker_s_library_that_calls_at_another_rate_is_refused_and_the_last_torque_of_a_session_is_zero() {
    let haptics = build(&object(1));
    let rate = 1.0 / haptics.period();
    let called = |rate: f64, last: &Arc<Mutex<f64>>| Called { hand: hand(1), rate, last: Arc::clone(last) };
    let last = Arc::new(Mutex::new(0.0));
    let always = || Some(Patience::Spins);
    for other in [0.5 * rate, 2.0 * rate, 1.001 * rate] {
        let refused = Clock::of(&called(other, &last), haptics.period(), RATE, &always).err().unwrap();
        assert!(refused.to_string().contains(&format!("rate = {other} in [haptics]")), "{refused}");
        let mut device = called(other, &last);
        let plan = Plan::new(Vec::new(), haptics.period(), 0.1, 0);
        assert!(realtime::run(&haptics, &mut device, None, &plan, Options::default()).is_err());
    }
    let mut device = called(rate, &last);
    let clock = Clock::of(&device, haptics.period(), RATE, &always).unwrap();
    let mut driver = Driver::new(&haptics, &mut device).unwrap();
    // Into the object, and no farther.
    let (most, mut pushed) = (Instant::now() + Duration::from_secs(20), false);
    let timing = driver.run(clock, |_, _, _| {
        pushed |= *last.lock().unwrap() > 0.0;
        !pushed && Instant::now() < most
    });
    assert!(timing.refused.is_empty() && pushed, "{timing:?}");
    assert_eq!(*last.lock().unwrap(), 0.0);
}

/// While a simulated hand is still nobody waits for ticks: they are all there afterwards, a period apart.
#[test]
fn no_tick_is_missed_that_is_done_in_arrears() {
    let data = object(3);
    let haptics = build(&data);
    let mut hand = hand(3);
    // The first tick is waited for, and the last one.
    let (done, waited) = (AtomicU64::new(0), AtomicU64::new(0));
    let begin = Instant::now();
    let looked = AtomicU64::new(0);
    let patience = || {
        let now = begin.elapsed().as_nanos() as u64;
        waited.fetch_max(now - looked.swap(now, Ordering::Relaxed), Ordering::Relaxed);
        match done.load(Ordering::Relaxed) {
            0 => Some(Patience::Sleeps),
            1..100 => Some(Patience::Rests),
            _ => Some(Patience::Sleeps),
        }
    };
    let mut clock = Clock::of(&hand, haptics.period(), RATE, &patience).unwrap();
    let mut driver = Driver::new(&haptics, &mut hand).unwrap();
    let (mut recorder, Ends { mut ticks, .. }) = Recorder::new(3);
    assert_no_alloc(|| {
        driver.pace(&mut clock, &mut |_, record, paced| {
            recorder.take(record, paced);
            done.fetch_add(1, Ordering::Relaxed) < 100 || paced.in_arrears
        })
    });
    let waited = Duration::from_nanos(waited.into_inner());
    let (mut elapsed, mut marked) = (Vec::new(), Vec::new());
    while let Ok(tick) = ticks.pop() {
        elapsed.push(tick.inputs.elapsed);
        marked.push(tick.in_arrears);
    }
    let period = haptics.period();
    // The first tick has no other before it; the next, and the one that is waited for, follow those that were late.
    let between = &elapsed[2..elapsed.len() - 1];
    if waited < LONGEST_ARREARS {
        assert!(between.len() >= 95 && between.iter().all(|elapsed| *elapsed == period), "{between:?}");
        // By what was done and not by a clock: an ordinary tick may take a period to the nanosecond, too.
        let waited_for = [0, marked.len() - 1];
        assert!(marked.iter().enumerate().all(|(k, marked)| *marked != waited_for.contains(&k)), "{marked:?}");
    } else {
        // The machine stood still for longer than ticks are done afterwards: no figure of it says anything.
        println!("skipped: {waited:?} for a wait of 25 ms");
    }
}

#[test]
fn a_session_against_the_clock_does_every_tick_that_it_does_not_report_and_replays_bit_for_bit() {
    let data = object(3);
    let haptics = build(&data);
    let mut hand = hand(3);
    let plan = Plan::new(labels(&data.grid), haptics.period(), 0.4, 0);
    let (trace, timing) = realtime::run(&haptics, &mut hand, None, &plan, Options::default()).unwrap();
    let done = trace.ticks.len() as u64 + timing.unrecorded;
    // The last tick may leave out deadlines beyond the end of the plan.
    assert!(done + timing.missed_deadlines >= 400, "{done} ticks, {timing:?}");
    assert_eq!(timing.lateness.count, done);
    assert_eq!(timing.tick_cost.count, done);
    let summary = trace.summary();
    assert!(summary.contact_share > 0.0 && summary.max_relative_account_residual < 1e-11, "{summary:?}");
    assert!(trace.ticks.windows(2).all(|pair| pair[0].time < pair[1].time));

    // Whatever the clock did: from its file, the session comes again, to the last bit of every account.
    assert_eq!(timing.unrecorded, 0);
    let file = tempfile::NamedTempFile::new().unwrap();
    Recording::write(&trace, &mut file.as_file()).unwrap();
    let recording = Recording::read(file.path(), 3).unwrap();
    let again = recording.replay(&haptics, None, labels(&data.grid)).unwrap();
    assert_eq!(again, trace);
    assert_eq!(recording.first_difference(&again), None);
}

#[test]
fn the_device_goes_where_another_thread_points_and_yields_to_torque() {
    let start = JointVector::from_slice(&[0.1, -0.2]);
    let (mut device, mut pointer) = Pointer::new(&haptics(2), &start).unwrap();
    assert_eq!(device.read(0.0).position, start);
    let goal = JointVector::from_slice(&[0.4, 0.0]);
    std::thread::spawn(move || pointer.move_to(&goal).unwrap()).join().unwrap();
    device.apply(&JointVector::from_slice(&[0.0, -1.0]));
    let mut before = start;
    for _ in 0..2000 {
        let reading = device.read(1e-3);
        // Never faster than sqrt(Kh/m) times the way: no leap, whatever the pointer does.
        assert!((reading.position[0] - before[0]).abs() < 0.3 * (20.0_f64 / 3e-3).sqrt() * 1e-3);
        before = reading.position;
        assert_eq!(reading.hand, goal);
    }
    // At rest where the hand's spring holds the torque: Kh (goal - y) + tau = 0.
    assert!((before[0] - 0.4).abs() < 1e-9 && (before[1] + 1.0 / 20.0).abs() < 1e-9, "{before:?}");
}

#[test]
fn a_place_that_is_none_is_refused_and_the_hand_keeps_its_goal() {
    let start = JointVector::zeros(2);
    let (mut device, mut pointer) = Pointer::new(&haptics(2), &start).unwrap();
    for place in [&[f64::NAN, 0.0][..], &[0.0, f64::INFINITY], &[0.0, -1e300]] {
        let place = JointVector::from_slice(place);
        assert!(pointer.move_to(&place).unwrap_err().to_string().contains("no place for a hand"));
        assert!(Pointer::new(&haptics(2), &place).is_err());
    }
    let other = JointVector::zeros(3);
    assert!(pointer.move_to(&other).unwrap_err().to_string().contains("told 3 joints and the haptic device has 2"));
    assert!(Pointer::new(&haptics(2), &other).is_err());
    assert_eq!(device.read(1e-3).hand, start);
}

#[test]
fn a_loop_that_keeps_missing_its_deadlines_lets_go_without_a_jump_and_says_why() {
    let data = object(3);
    let haptics = build(&data);
    // Time is told, not waited for: pressed for a second on time, then as the machine allows.
    let run = |late: f64| {
        let mut hand = along(3, [(0.0, -0.2), (0.5, 0.3)]);
        let mut driver = Driver::new(&haptics, &mut hand).unwrap();
        let (mut before, mut greatest) = (JointVector::zeros(3), 0.0);
        for k in 0..2000 {
            let interval = if k < 1000 { 1e-3 } else { late };
            let (tick, _) = driver.tick(interval, interval);
            let change = |a: usize| (tick.device_torque[a] - before[a]).abs() / (1e-3_f64).max(interval);
            greatest = (0..3).map(change).fold(greatest, f64::max);
            if k == 999 {
                assert!(tick.fault.is_none() && tick.device_torque.norm() > 0.1, "{tick:?}");
            }
            if tick.fault.is_some() && tick.device_torque.norm() == 0.0 {
                return (tick.fault, tick.time, greatest);
            }
            before = tick.device_torque;
        }
        (None, f64::INFINITY, greatest)
    };
    for late in [0.012, 0.05, 0.1] {
        let (fault, when, greatest) = run(late);
        assert_eq!(fault, Some(Fault::Overrun), "{late} s");
        assert!(when < 2.0, "{late} s: without torque only after {when} s");
        // No faster than the device's greatest rate, 500 N m/s.
        assert!(greatest <= 500.0 * (1.0 + 1e-12), "{late} s: {greatest} N m/s");
    }
    assert_eq!(run(0.008).0, None);
}

#[test]
fn the_first_deadline_comes_after_the_system_has_granted_what_it_grants() {
    let data = object(3);
    let haptics = build(&data);
    let mut hand = hand(3);
    let goes_on = || Some(Patience::Spins);
    let mut clock = Clock::of(&hand, haptics.period(), RATE, &goes_on).unwrap();
    let mut driver = Driver::new(&haptics, &mut hand).unwrap();
    // As long as memory may take to be locked.
    std::thread::sleep(Duration::from_millis(200));
    clock.begin();
    driver.pace(&mut clock, &mut |_, _, _| false);
    let lateness = clock.timing(Vec::new()).lateness;
    // A busy machine makes the tick late, too, by far less.
    assert!(lateness.count == 1 && lateness.max < 150e3, "{lateness:?}");
}

/// Friction as the tests feel it.
fn rubbing(gains: &mut HapticsSpec) {
    gains.friction = Some(FrictionSpec { coefficient: 0.3, static_coefficient: Some(0.4), stiffness: 500.0 });
}

/// Memory as the tests feel it, forgetting as the arm slides.
fn relaxing() -> Option<RelaxationSpec> {
    Some(RelaxationSpec { terms: vec![[0.5, 0.05], [0.2, 0.5]], dent: Some(0.01) })
}

/// The sphere over every third line of its grid, a little less than the joints can reach, with what friction
/// needs.
fn sphere() -> Dataset {
    let mut scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sphere.toml")).unwrap();
    rubbing(&mut scene.haptics);
    for axis in &mut scene.grid.axes {
        (axis.step, axis.count) = (3.0 * axis.step, axis.count.div_ceil(3));
    }
    baked(&scene).unwrap().0
}

#[test]
fn no_interpolation_and_no_effect_allocates_in_a_tick() {
    let data = sphere();
    let setup = Setup::new(&data).unwrap();
    let press = setup.scene.motion.press[2].q;
    let mut all = setup.scene.haptics.clone();
    rubbing(&mut all);
    all.four_channel = Some(FourChannelSpec { channels: [0.5, 1.0, 1.0, 0.5], filter: 0.005 });
    all.passivity_control = true;
    let HapticsSpec { friction, four_channel, .. } = all;
    let none = HapticsSpec { friction: None, four_channel: None, passivity_control: false, ..all.clone() };
    let effects = [
        none.clone(),
        HapticsSpec { friction, ..none.clone() },
        HapticsSpec { relaxation: relaxing(), ..none.clone() },
        HapticsSpec { friction, relaxation: relaxing(), ..none.clone() },
        HapticsSpec { four_channel, ..none.clone() },
        HapticsSpec { passivity_control: true, ..none },
        all,
    ];
    let mut touched = 0;
    for interpolation in Interpolation::ALL {
        for inertia in [ProxyInertia::Constant, ProxyInertia::Configuration] {
            for effects in &effects {
                let relaxation = effects.relaxation.clone().filter(|_| interpolation.is_potential());
                let gains = HapticsSpec { interpolation, proxy_inertia: inertia, relaxation, ..effects.clone() };
                let (haptics, _) = setup.retuned(&data, &gains).unwrap();
                let mut state = haptics.start(&setup.scene.motion.press[0].q).unwrap();
                let mut before = setup.scene.motion.press[0].q;
                assert_no_alloc(|| {
                    // Into the object, along it, beyond the grid, and what no device should say.
                    for k in 0..400 {
                        let mut position = before;
                        for (a, (x, to)) in position.iter_mut().zip(press.iter()).enumerate() {
                            *x += 0.01 * (to - *x) + if k > 200 && a == 0 { 5e-3 } else { 0.0 };
                        }
                        before = position;
                        if k == 398 {
                            position[0] = f64::NAN;
                        }
                        let inputs = Inputs { position, age: 0.0, elapsed: 1e-3, interval: 1e-3 };
                        touched += usize::from(haptics.tick(&mut state, &inputs).sample.contact);
                    }
                });
            }
        }
    }
    assert!(touched > 36 * 20, "{touched}");
}

/// Contact solved in every tick, with friction at its contacts: from the first touch on, along the surface, out of the
/// region, and where a device says what none should.
#[test]
fn contact_that_is_solved_live_allocates_nothing_in_a_tick() {
    let friction = "\n[haptics.friction]\ncoefficient = 0.3\nstiffness = 1000.0\n";
    let round = "[contact]\nround = 0.005";
    for (name, contact, effects) in [
        ("organ", "[contact]", ""),
        ("organ", "[contact]", friction),
        ("sphere", "[contact]", ""),
        ("mesh", "[contact]", ""),
        ("mesh", round, ""),
    ] {
        let file = format!("{}/datasets/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(&file).unwrap().replace("[contact]", contact) + effects;
        let live = Arc::new(LiveScene::new(Scene::parse(&text, &file).unwrap()).unwrap());
        let setup = Setup::live(Arc::clone(&live), &live.dataset()).unwrap();
        let joints = setup.chain.joints.len();
        for way in [&setup.scene.motion.press, &setup.scene.motion.scrape] {
            let motion = Motion::through(way, joints).unwrap();
            let mut state = setup.haptics.start(&motion.at(0.0).0).unwrap();
            let mut contact = setup.haptics.source().begin();
            let mut touched = 0;
            assert_no_alloc(|| {
                for k in 0..(1e3 * motion.duration()) as usize {
                    let mut position = motion.at(1e-3 * k as f64).0;
                    position[0] += if k % 1000 > 990 { 10.0 } else { 0.0 };
                    position[0] = if k % 1000 == 995 { f64::NAN } else { position[0] };
                    let inputs = Inputs { position, age: 0.0, elapsed: 1e-3, interval: 1e-3 };
                    let output = setup.haptics.tick_with(&mut state, &inputs, &mut contact);
                    touched += usize::from(output.sample.contact);
                    if output.fault.is_some() {
                        let _ = setup.haptics.restart(&mut state, &inputs.position);
                    }
                }
            });
            assert!(touched > 100, "{name}: {touched} ticks in contact");
        }
    }
}

/// The dataset of a real object with its twin: measured, passing over, and the twin alone.
#[test]
fn a_dataset_with_its_twin_allocates_nothing_in_a_tick() {
    let file = format!("{}/tests/scenes/small.toml", env!("CARGO_MANIFEST_DIR"));
    let scene = Scene::load(&file).unwrap();
    let twin = Arc::new(LiveScene::new(scene.clone()).unwrap());
    let dataset = twin.beside(baked(&scene).unwrap().0);
    let setup = Setup::twinned(twin, &dataset).unwrap();
    let mut state = setup.haptics.start(&JointVector::from_slice(&[0.0, 0.02])).unwrap();
    let mut contact = setup.haptics.source().begin();
    let mut touched = [0; 2];
    assert_no_alloc(|| {
        for k in 0..8000 {
            // Into contact and beyond the grid, to and fro.
            let phase = 1e-3 * f64::from(k);
            let position = JointVector::from_slice(&[0.4 * phase.sin(), 0.034 - 0.014 * (3.0 * phase).cos()]);
            let inputs = Inputs { position, age: 0.0, elapsed: 1e-3, interval: 1e-3 };
            let sample = setup.haptics.tick_with(&mut state, &inputs, &mut contact).sample;
            touched[usize::from(sample.twin > 0.0)] += usize::from(sample.contact);
        }
    });
    assert!(touched.iter().all(|ticks| *ticks > 20), "{touched:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_that_another_program_cuts_short_does_not_stop_a_running_loop() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sphere.haptize");
    sphere().save(&file).unwrap();
    let arguments = ["play", "--realtime", "--seconds", "1.5", "-o", "out", "sphere.haptize"];
    let mut played = command(folder.path(), &arguments).spawn().unwrap();
    // The loop runs once there is a thread for it.
    let is_running = || {
        let Ok(tasks) = std::fs::read_dir(format!("/proc/{}/task", played.id())) else { return false };
        tasks
            .flatten()
            .any(|task| std::fs::read_to_string(task.path().join("comm")).is_ok_and(|name| name.trim() == "haptic"))
    };
    let deadline = Instant::now() + Duration::from_secs(60);
    while !is_running() {
        assert!(Instant::now() < deadline, "the loop never began");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::fs::OpenOptions::new().write(true).open(&file).unwrap().set_len(64).unwrap();
    // Late ticks of a busy machine may end it with a fault, a cut file by no signal.
    assert!(played.wait().unwrap().code().is_some());
    assert!(folder.path().join("out/trace.csv").exists());
}

#[test]
fn a_slow_frame_rate_does_not_hold_up_the_end_of_a_session() {
    // Frames every twenty seconds, a session of a tenth of one.
    let data = sphere();
    let setup = Setup::new(&data).unwrap();
    let slow = GraphicsSpec { rate: 0.05, effects: GraphicsEffects::default() };
    let forces = setup.contact_forces(&data).unwrap().unwrap();
    let mut graphics = Graphics::new(forces, setup.object.as_ref().unwrap(), &slow, None).unwrap();
    let mut hand = setup.hand(Motion::through(&setup.scene.motion.press, 3).unwrap()).unwrap();
    let plan = setup.plan(&data, 0.1, 0);
    let began = Instant::now();
    realtime::run(&setup.haptics, &mut hand, Some(&mut graphics), &plan, Options::default()).unwrap();
    assert!(began.elapsed().as_secs() < 10, "{:?}", began.elapsed());
}
