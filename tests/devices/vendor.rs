//! Devices behind makers' libraries, against stand-ins that are built here: call order, return codes, the stack of
//! errors, and a scheduler that owns the thread.

use crate::{
    common::desktop::haptics,
    felt::{PERIOD, all, half_space_loop},
};
use haptize::{
    JointVector,
    control::{Clock, ControlLoop, Controller, Patience},
    dataset::JointLabel,
    device::{
        Applied, Device, Guard, Halt, Hardware, JointDevice, LONGEST_AGE, LinearMap, RAMP_TIME, Reading, TipDevice,
        WARM_TIME, Watchdog,
        vendor::{ForceDimension, OpenHaptics},
    },
    proxy::Chain,
    render::{
        realtime::{self, Options, RATE},
        session::Plan,
    },
    scene::DeviceSpec,
};
use libloading::Library;
use std::{
    path::PathBuf,
    process::Command,
    sync::OnceLock,
    thread,
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// Builds the stand-in `name` once; each test loads a copy of its own, with a state of its own.
pub fn built(name: &'static str) -> PathBuf {
    static FOLDER: OnceLock<TempDir> = OnceLock::new();
    static DRD: OnceLock<PathBuf> = OnceLock::new();
    static HD: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| tempfile::tempdir().unwrap());
    let library = if name == "drd" { &DRD } else { &HD };
    let build = || {
        let source = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("tests/devices/stand_ins/{name}.rs"));
        let output = folder.path().join(format!("lib{name}.so"));
        let compiler = std::env::var_os("RUSTC").unwrap_or("rustc".into());
        let built = Command::new(compiler)
            .args(["--edition=2024", "--crate-type=cdylib", "-Cpanic=abort", "-o"])
            .arg(&output)
            .arg(source)
            .status()
            .unwrap();
        assert!(built.success());
        output
    };
    library.get_or_init(build).clone()
}

/// A copy of a stand-in, and its levers.
struct StandIn {
    library: Library,
    place: String,
    _folder: TempDir,
}

impl StandIn {
    fn new(name: &'static str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(format!("lib{name}.so"));
        std::fs::copy(built(name), &path).unwrap();
        // SAFETY: the library is ours.
        let library = unsafe { Library::new(&path) }.unwrap();
        Self { library, place: path.to_str().unwrap().to_owned(), _folder: folder }
    }

    fn set(&self, code: i32, error: i32) {
        // SAFETY: the signature is that of the stand-in.
        unsafe { self.library.get::<unsafe extern "C" fn(i32, i32)>(b"stand_in_set\0").unwrap()(code, error) };
    }

    fn effort(&self) -> f64 {
        // SAFETY: the signature is that of the stand-in.
        unsafe { self.library.get::<unsafe extern "C" fn() -> f64>(b"stand_in_effort\0").unwrap()() }
    }

    fn log(&self) -> Vec<String> {
        let mut text = vec![0; 1 << 16];
        // SAFETY: the signature is that of the stand-in, and the room is that of the text.
        let count = unsafe {
            self.library.get::<unsafe extern "C" fn(*mut u8, usize) -> usize>(b"stand_in_log\0").unwrap()(
                text.as_mut_ptr(),
                text.len(),
            )
        };
        text.truncate(count);
        String::from_utf8(text).unwrap().lines().map(str::to_owned).collect()
    }
}

fn enabled(hardware: impl Hardware + 'static) -> Guard {
    let mut guard = Guard::new(Box::new(hardware), None).unwrap();
    guard.enable().unwrap();
    guard
}

/// Pushes with `effort` for `ticks`; the last answer.
fn push(guard: &mut Guard, effort: f64, ticks: usize) -> haptize::device::Held {
    let mut held = None;
    for _ in 0..ticks {
        guard.read(PERIOD);
        held = Some(guard.write(&all(3, effort)));
    }
    held.unwrap()
}

#[test]
fn a_force_dimension_is_opened_watched_driven_and_closed_in_order() {
    let library = StandIn::new("drd");
    let device = ForceDimension::open(Some(&library.place)).unwrap();
    assert!(device.description().contains("stand-in"));
    assert_eq!(device.limits().watchdog, Watchdog::After(0.01));
    let mut guard = enabled(device);
    let held = push(&mut guard, 2.0, 800);
    assert_eq!((held.effort, held.halt), (all(3, 2.0), None));
    assert!((library.effort() - 2.0 * 3.0_f64.sqrt()).abs() < 1e-12);
    drop(guard);
    assert_eq!(library.effort(), 0.0);
    let expected = [
        "dhdOpen",
        "dhdSetWatchdog 80",
        "dhdSetMaxForce 8",
        "dhdEnableForce on",
        "dhdEnableForce off",
        "dhdStop",
        "dhdClose",
    ];
    assert_eq!(library.log(), expected);
}

#[test]
fn the_library_s_return_codes_mean_what_the_sdk_says() {
    // Old readings: the age grows until torque ends, and torque comes back with new ones.
    let library = StandIn::new("drd");
    let mut guard = enabled(ForceDimension::open(Some(&library.place)).unwrap());
    push(&mut guard, 1.0, 800);
    library.set(1, 0);
    let halts: Vec<_> = (0..8).map(|_| push(&mut guard, 1.0, 1).halt).collect();
    assert_eq!(halts.iter().position(Option::is_some), Some(5), "{halts:?}");
    assert_eq!(halts.last(), Some(&Some(Halt::Stale)));
    library.set(0, 0);
    assert_eq!(push(&mut guard, 1.0, 800).halt, None);
    // Saturation is counted, and no more.
    library.set(2, 0);
    let held = push(&mut guard, 1.0, 1);
    assert!(held.halt.is_none() && held.clamps.contains(haptize::device::Clamps::DEVICE));
    // A connection that is gone, an error of another kind, and forces that the device has switched off.
    for (code, error, reason) in [(-1, 2, Halt::Unplugged), (-1, 11, Halt::DeviceError(11)), (101, 0, Halt::ForcesOff)]
    {
        let library = StandIn::new("drd");
        let mut guard = enabled(ForceDimension::open(Some(&library.place)).unwrap());
        push(&mut guard, 1.0, 800);
        library.set(code, error);
        let held = push(&mut guard, 1.0, if reason == Halt::ForcesOff { 10 } else { 1 });
        assert_eq!((held.halt, held.effort), (Some(reason), all(3, 0.0)));
    }
}

#[test]
fn a_library_that_is_missing_or_has_no_device_is_refused_with_the_remedy() {
    let error = ForceDimension::open(Some("/nowhere/libdrd.so")).err().unwrap();
    assert!(error.contains("FDSDK"), "{error}");
    let error = OpenHaptics::open(Some("/nowhere/libHD.so")).err().unwrap();
    assert!(error.contains("OpenHaptics"), "{error}");
    // A library with other functions.
    let other = StandIn::new("hd");
    let error = ForceDimension::open(Some(&other.place)).err().unwrap();
    assert!(error.contains("dhdOpen"), "{error}");

    let library = StandIn::new("drd");
    library.set(100, 0);
    let error = ForceDimension::open(Some(&library.place)).err().unwrap();
    assert!(error.contains("no device found") && error.contains("udev"), "{error}");
    let library = StandIn::new("hd");
    library.set(4, 0);
    let error = OpenHaptics::open(Some(&library.place)).err().unwrap();
    assert!(error.contains("0x0302"), "{error}");
    let library = StandIn::new("hd");
    library.set(5, 0);
    let error = OpenHaptics::open(Some(&library.place)).err().unwrap();
    assert!(error.contains("calibrat"), "{error}");
}

#[test]
fn a_3d_systems_device_is_opened_calibrated_driven_and_closed_in_order() {
    let library = StandIn::new("hd");
    let device = OpenHaptics::open(Some(&library.place)).unwrap();
    let mut guard = enabled(device);
    // Outside of a session, each reading and command is a frame of its own.
    let held = push(&mut guard, 0.1, 800);
    assert_eq!((held.effort, held.halt), (all(3, 0.1), None));
    assert!((library.effort() - 0.1 * 3.0_f64.sqrt()).abs() < 1e-12, "newton metres are sent as thousandths");
    drop(guard);
    let expected = [
        "hdInitDevice",
        "hdSetSchedulerRate 1000",
        "hdStartScheduler",
        "hdUpdateCalibration",
        "hdEnable",
        "hdDisable",
        "hdStopScheduler",
        "hdDisableDevice",
    ];
    assert_eq!(library.log(), expected);
    assert_eq!(library.effort(), 0.0);
}

#[test]
fn errors_of_the_stack_end_torque_by_the_newest_and_warm_motors_scale_it_down_first() {
    let library = StandIn::new("hd");
    let mut guard = enabled(OpenHaptics::open(Some(&library.place)).unwrap());
    push(&mut guard, 0.1, 800);
    library.set(3, 0);
    let held = push(&mut guard, 0.1, 1);
    assert_eq!((held.halt, held.effort), (Some(Halt::Unplugged), all(3, 0.0)));
    assert_eq!(library.effort(), 0.0);

    let library = StandIn::new("hd");
    let mut guard = enabled(OpenHaptics::open(Some(&library.place)).unwrap());
    push(&mut guard, 0.1, 800);
    library.set(1, 0);
    let half = push(&mut guard, 0.1, (500.0 * WARM_TIME) as usize);
    assert!(half.halt.is_none() && (half.effort[0] - 0.05).abs() < 1e-3, "{half:?}");
    let held = push(&mut guard, 0.1, (520.0 * WARM_TIME) as usize);
    assert_eq!((held.halt, library.effort()), (Some(Halt::Hot), 0.0));
}

fn plan(seconds: f64) -> Plan {
    let joints = (0..3).map(|k| JointLabel { name: format!("joint {k}"), unit: "rad".into() }).collect();
    Plan::new(joints, PERIOD, seconds, 0)
}

fn session(library: &StandIn) -> JointDevice {
    let guard = enabled(OpenHaptics::open(Some(&library.place)).unwrap());
    // The hand rests inside of the half space.
    JointDevice::new(guard, LinearMap::identity(3))
}

/// Calls `session` with a device of the stand-in for `libdrd` whose tip leads `chain`.
pub fn with_force_dimension(chain: Chain, session: impl FnOnce(&mut dyn Device)) {
    let library = StandIn::new("drd");
    let guard = enabled(ForceDimension::open(Some(&library.place)).unwrap());
    session(&mut TipDevice::new(guard, LinearMap::identity(3), chain, &DeviceSpec::default(), &haptics(3)));
}

/// Calls `session` with a device of the stand-in for `libHD`.
pub fn with_touch(run: impl FnOnce(&mut dyn Device)) {
    let library = StandIn::new("hd");
    run(&mut session(&library));
}

#[test]
fn the_scheduler_s_thread_runs_the_loop() {
    let library = StandIn::new("hd");
    let haptics = half_space_loop(3);
    let mut device = session(&library);
    assert!(device.scheduler().is_some());
    let (trace, _) = realtime::run(&haptics, &mut device, None, &plan(1.0), Options::default()).unwrap();
    assert!(trace.ticks.len() > 100, "{} ticks", trace.ticks.len());
    let halts: Vec<_> = trace.ticks.iter().filter_map(|tick| tick.applied.halt).collect();
    assert!(halts.is_empty(), "no illegal frame, no error: {halts:?}");
    let last = trace.ticks.last().unwrap();
    assert!(last.sample.contact, "{last:?}");
    // Torque begins at zero, and again after each pause of a busy machine that makes a sample too old.
    let pauses = trace.ticks.windows(2).filter(|pair| pair[1].time - pair[0].time > LONGEST_AGE).count();
    let idle = trace.ticks.iter().filter(|tick| tick.sample.contact && tick.applied.torque[0] >= 0.0).count();
    assert!(idle <= 1 + pauses, "{idle} ticks in contact without torque, {pauses} pauses");
    assert_eq!(library.effort(), 0.0, "the loop leaves no torque");
    drop(device);
    assert_eq!(library.log().last().unwrap(), "hdDisableDevice");
}

#[test]
fn a_scheduler_that_hangs_or_fails_ends_the_session() {
    for (code, within) in [(2, 2.0), (3, 2.0)] {
        let library = StandIn::new("hd");
        let haptics = half_space_loop(3);
        let mut device = session(&library);
        let (trace, timing) = thread::scope(|scope| {
            scope.spawn(|| {
                thread::sleep(Duration::from_millis(300));
                library.set(code, 0);
            });
            realtime::run(&haptics, &mut device, None, &plan(30.0), Options::default()).unwrap()
        });
        assert!(trace.ticks.last().unwrap().time < within);
        if code == 2 {
            assert!(timing.refused[0].contains("own thread"), "{:?}", timing.refused);
        } else {
            assert_eq!(trace.ticks.last().unwrap().applied.halt, Some(Halt::Unplugged));
        }
        assert_eq!(library.effort(), 0.0);
    }
}

/// A controller that pushes always alike.
struct Push;

impl Controller for Push {
    type Record = Applied;

    fn joints(&self) -> usize {
        3
    }

    fn answer(&mut self, _: &Reading, _: f64, _: f64) -> JointVector {
        all(3, 0.05)
    }

    fn held(&mut self, applied: &Applied) -> Applied {
        *applied
    }
}

#[test]
fn any_controller_follows_the_scheduler_s_thread_and_leaves_no_torque() {
    let library = StandIn::new("hd");
    let mut device = session(&library);
    assert_eq!(device.scheduler().unwrap().rate(), 1000.0);
    let goes_on = || Some(Patience::Spins);
    let clock = Clock::of(&device, PERIOD, RATE, &goes_on).unwrap();
    let mut held = 0;
    // A busy machine may bring it back to zero; it rises again then.
    let begin = Instant::now();
    let timing = ControlLoop::of(Push, &mut device).run(clock, |_, applied, _| {
        held += usize::from(applied.torque == all(3, 0.05));
        held == 0
    });
    assert!(timing.refused.is_empty() && held == 1, "{timing:?}");
    assert!(begin.elapsed().as_secs_f64() >= RAMP_TIME, "it rises from zero");
    assert_eq!(library.effort(), 0.0);
    drop(device);
    let log = library.log();
    let at = |call: &str| log.iter().position(|line| line == call).unwrap_or_else(|| panic!("{call}: {log:?}"));
    assert!(at("hdEnable") < at("hdScheduleAsynchronous") && at("hdScheduleAsynchronous") < at("hdDisable"));
    assert_eq!(log.last().unwrap(), "hdDisableDevice");
}

#[test]
fn any_controller_learns_that_the_scheduler_hangs() {
    let library = StandIn::new("hd");
    let mut device = session(&library);
    let goes_on = || Some(Patience::Spins);
    let clock = Clock::of(&device, PERIOD, RATE, &goes_on).unwrap();
    library.set(2, 0);
    let timing = ControlLoop::of(Push, &mut device).run(clock, |_, _, _| true);
    assert!(timing.refused[0].contains("own thread stopped"), "{timing:?}");
    assert_eq!(library.effort(), 0.0);
}
