//! A stand-in for `libHD`: a scheduler with a thread of its own, a stack of errors, frames that are checked, and one
//! device in a simulated hand. Built by the tests as a shared library.

#![allow(non_snake_case, clippy::missing_safety_doc)]

use std::{
    os::raw::{c_char, c_int, c_uint, c_ulong, c_void},
    sync::{
        Mutex, MutexGuard,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

#[repr(C)]
pub struct ErrorInfo {
    code: c_uint,
    internal: c_int,
    device: c_uint,
}

type Callback = unsafe extern "C" fn(*mut c_void) -> c_uint;

#[derive(Clone, Copy)]
struct Job {
    callback: Callback,
    data: usize,
    handle: c_ulong,
}

struct State {
    log: String,
    /// Newest last.
    errors: Vec<c_uint>,
    in_frame: bool,
    angles: [f64; 3],
    velocity: [f64; 3],
    torque: [f64; 3],
    output: bool,
    warm: bool,
    jobs: Vec<Job>,
    handles: c_ulong,
    calibration: c_uint,
    absent: bool,
    frames: u64,
    /// Whether no hand holds it; then its second joint meets a wall.
    free: bool,
}

static STATE: Mutex<State> = Mutex::new(State {
    log: String::new(),
    errors: Vec::new(),
    in_frame: false,
    angles: [0.1, 0.2, 0.3],
    velocity: [0.0; 3],
    torque: [0.0; 3],
    output: false,
    warm: false,
    jobs: Vec::new(),
    handles: 0,
    calibration: 0x5001,
    absent: false,
    frames: 0,
    free: false,
});
static RUNS: AtomicBool = AtomicBool::new(false);
/// Whether the scheduler calls nobody any more.
static HANGS: AtomicBool = AtomicBool::new(false);
static THREAD: Mutex<Option<thread::JoinHandle<()>>> = Mutex::new(None);

fn lock() -> MutexGuard<'static, State> {
    STATE.lock().unwrap()
}

fn state(call: &str) -> MutexGuard<'static, State> {
    let mut state = lock();
    state.log.push_str(call);
    state.log.push('\n');
    state
}

#[unsafe(no_mangle)]
pub extern "C" fn hdInitDevice(_: *const c_char) -> c_uint {
    let mut state = state("hdInitDevice");
    state.free = std::env::var_os("STAND_IN_FREE").is_some();
    if state.absent {
        state.errors.push(0x0302);
        return 0xffff_ffff;
    }
    7
}

#[unsafe(no_mangle)]
pub extern "C" fn hdDisableDevice(device: c_uint) {
    assert_eq!(device, 7);
    drop(state("hdDisableDevice"));
}

#[unsafe(no_mangle)]
pub extern "C" fn hdMakeCurrentDevice(_: c_uint) {}

#[unsafe(no_mangle)]
pub extern "C" fn hdBeginFrame(_: c_uint) {
    let mut state = lock();
    if std::mem::replace(&mut state.in_frame, true) {
        state.errors.push(0x0400);
    }
    if state.warm {
        state.errors.push(0x0200);
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdEndFrame(_: c_uint) {
    let mut state = lock();
    state.frames += 1;
    if !std::mem::replace(&mut state.in_frame, false) {
        state.errors.push(0x0401);
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdGetError() -> ErrorInfo {
    let code = lock().errors.pop().unwrap_or(0);
    ErrorInfo { code, internal: -1, device: 7 }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdEnable(what: c_uint) {
    assert_eq!(what, 0x4000);
    state("hdEnable").output = true;
}

#[unsafe(no_mangle)]
pub extern "C" fn hdDisable(what: c_uint) {
    assert_eq!(what, 0x4000);
    let mut state = state("hdDisable");
    (state.output, state.torque) = (false, [0.0; 3]);
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetDoublev(what: c_uint, values: *mut f64) {
    let mut state = lock();
    if what != 0x2100 {
        state.errors.push(0x0100);
        return;
    }
    if !state.in_frame {
        state.errors.push(0x0402);
    }
    // A millisecond of a hand of 3e-3 kg m^2 that holds the joints by 20 N m/rad; or of as heavy an arm before a wall
    // of 1 N m/rad at 0.3 rad.
    for a in 0..3 {
        let rest = [0.1, 0.2, 0.3][a];
        let wall = if a == 1 { (state.angles[a] - 0.3).max(0.0) } else { 0.0 };
        let held = if state.free {
            wall + 0.02 * state.velocity[a]
        } else {
            20.0 * (state.angles[a] - rest) + 0.3 * state.velocity[a]
        };
        let push = state.torque[a] - held;
        state.velocity[a] += 1e-3 * push / 3e-3;
        state.angles[a] += 1e-3 * state.velocity[a];
    }
    unsafe { std::ptr::copy_nonoverlapping(state.angles.as_ptr(), values, 3) };
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdSetDoublev(what: c_uint, values: *const f64) {
    let mut state = lock();
    if what != 0x2703 {
        state.errors.push(0x0100);
        return;
    }
    if !state.in_frame {
        state.errors.push(0x0402);
    }
    let millis = unsafe { std::slice::from_raw_parts(values, 3) };
    if state.output {
        state.torque = [1e-3 * millis[0], 1e-3 * millis[1], 1e-3 * millis[2]];
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdGetIntegerv(_: c_uint, value: *mut c_int) {
    unsafe { *value = 4 };
}

#[unsafe(no_mangle)]
pub extern "C" fn hdCheckCalibration() -> c_uint {
    lock().calibration
}

#[unsafe(no_mangle)]
pub extern "C" fn hdUpdateCalibration(style: c_uint) {
    assert_eq!(style, 4);
    let mut state = state("hdUpdateCalibration");
    if state.calibration == 0x5001 {
        state.calibration = 0x5000;
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdSetSchedulerRate(rate: c_ulong) {
    drop(state(&format!("hdSetSchedulerRate {rate}")));
}

#[unsafe(no_mangle)]
pub extern "C" fn hdStartScheduler() {
    drop(state("hdStartScheduler"));
    RUNS.store(true, Ordering::SeqCst);
    *THREAD.lock().unwrap() = Some(thread::spawn(|| {
        while RUNS.load(Ordering::SeqCst) {
            thread::sleep(Duration::from_millis(1));
            if HANGS.load(Ordering::SeqCst) {
                continue;
            }
            let jobs = std::mem::take(&mut lock().jobs);
            for job in jobs {
                // Callbacks call back: nothing is locked.
                if unsafe { (job.callback)(job.data as *mut c_void) } == 1 {
                    lock().jobs.push(job);
                }
            }
        }
    }));
}

#[unsafe(no_mangle)]
pub extern "C" fn hdStopScheduler() {
    drop(state("hdStopScheduler"));
    RUNS.store(false, Ordering::SeqCst);
    if let Some(thread) = THREAD.lock().unwrap().take() {
        thread.join().unwrap();
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn hdScheduleAsynchronous(callback: Callback, data: *mut c_void, priority: u16) -> c_ulong {
    assert_eq!(priority, 65_535);
    let mut state = state("hdScheduleAsynchronous");
    state.handles += 1;
    let handle = state.handles;
    state.jobs.push(Job { callback, data: data as usize, handle });
    handle
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn hdScheduleSynchronous(callback: Callback, data: *mut c_void, _: u16) {
    // The caller waits: its thread is as good as the scheduler's.
    while unsafe { callback(data) } == 1 {}
}

#[unsafe(no_mangle)]
pub extern "C" fn hdUnschedule(handle: c_ulong) {
    state("hdUnschedule").jobs.retain(|job| job.handle != handle);
}

/// 1: motors are warm; 2: the scheduler hangs; 3: a communication error; 4: no device; 5: calibration needs a person.
#[unsafe(no_mangle)]
pub extern "C" fn stand_in_set(code: c_int, _: c_int) {
    match code {
        1 => lock().warm = true,
        2 => HANGS.store(true, Ordering::SeqCst),
        // An older error lies below.
        3 => lock().errors.extend([0x0402, 0x0302]),
        4 => lock().absent = true,
        _ => lock().calibration = 0x5002,
    }
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn stand_in_log(text: *mut u8, room: usize) -> usize {
    let state = lock();
    let count = state.log.len().min(room);
    unsafe { std::ptr::copy_nonoverlapping(state.log.as_ptr(), text, count) };
    count
}

/// Size of the torque on the device (N m).
#[unsafe(no_mangle)]
pub extern "C" fn stand_in_effort() -> f64 {
    lock().torque.iter().map(|f| f * f).sum::<f64>().sqrt()
}
