//! A stand-in for `libdrd`: one delta device in a simulated hand, its call order recorded. Built by the tests as a
//! shared library.

#![allow(non_snake_case, clippy::missing_safety_doc)]

use std::{
    os::raw::{c_char, c_int, c_uchar},
    sync::{Mutex, MutexGuard},
};

struct State {
    log: String,
    force: [f64; 3],
    position: [f64; 3],
    velocity: [f64; 3],
    forces_on: bool,
    /// What the next calls answer: 0 as usual, 1 the time guard, 2 saturation, -1 with `error`.
    code: c_int,
    error: c_int,
    absent: bool,
}

static STATE: Mutex<State> = Mutex::new(State {
    log: String::new(),
    force: [0.0; 3],
    position: [0.0; 3],
    velocity: [0.0; 3],
    forces_on: false,
    code: 0,
    error: 0,
    absent: false,
});

fn state(call: &str) -> MutexGuard<'static, State> {
    let mut state = STATE.lock().unwrap();
    state.log.push_str(call);
    state.log.push('\n');
    state
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdOpen() -> c_int {
    if state("dhdOpen").absent { -1 } else { 3 }
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdClose(id: c_char) -> c_int {
    assert_eq!(id, 3);
    drop(state("dhdClose"));
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdGetSystemName(_: c_char) -> *const c_char {
    c"stand-in".as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdErrorGetLast() -> c_int {
    STATE.lock().unwrap().error
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdErrorGetLastStr() -> *const c_char {
    c"no device found".as_ptr()
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn dhdGetPosition(x: *mut f64, y: *mut f64, z: *mut f64, id: c_char) -> c_int {
    assert_eq!(id, 3);
    let mut state = STATE.lock().unwrap();
    if state.code != 0 && state.code != 2 {
        return state.code;
    }
    // A hand of 0.2 kg that is held by 400 N/m and 8 N s/m about the origin, for a millisecond.
    for a in 0..3 {
        let push = state.force[a] - 400.0 * state.position[a] - 8.0 * state.velocity[a];
        state.velocity[a] += 1e-3 * push / 0.2;
        state.position[a] += 1e-3 * state.velocity[a];
    }
    unsafe {
        (*x, *y, *z) = (state.position[0], state.position[1], state.position[2]);
    }
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdEnableForce(on: c_uchar, _: c_char) -> c_int {
    let mut state = state(if on != 0 { "dhdEnableForce on" } else { "dhdEnableForce off" });
    state.forces_on = on != 0;
    if on == 0 {
        state.force = [0.0; 3];
    }
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdSetForceAndTorqueAndGripperForce(
    x: f64,
    y: f64,
    z: f64,
    tx: f64,
    ty: f64,
    tz: f64,
    gripper: f64,
    _: c_char,
) -> c_int {
    assert_eq!([tx, ty, tz, gripper], [0.0; 4]);
    let mut state = STATE.lock().unwrap();
    if state.code < 0 {
        return state.code;
    }
    state.force = if state.forces_on { [x, y, z] } else { [0.0; 3] };
    if state.code == 2 { 2 } else { 0 }
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdSetMaxForce(newton: f64, _: c_char) -> c_int {
    drop(state(&format!("dhdSetMaxForce {newton}")));
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdSetWatchdog(count: c_uchar, _: c_char) -> c_int {
    drop(state(&format!("dhdSetWatchdog {count}")));
    0
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn dhdGetStatus(status: *mut c_int, _: c_char) -> c_int {
    let state = STATE.lock().unwrap();
    // Seventeen numbers, as the SDK has them.
    let status = unsafe { std::slice::from_raw_parts_mut(status, 17) };
    status.fill(1);
    status[5] = c_int::from(state.forces_on);
    0
}

#[unsafe(no_mangle)]
pub extern "C" fn dhdStop(_: c_char) -> c_int {
    drop(state("dhdStop"));
    0
}

/// Lets the next calls answer `code`, with `error`; 100 and 101: no device, forces off.
#[unsafe(no_mangle)]
pub extern "C" fn stand_in_set(code: c_int, error: c_int) {
    let mut state = STATE.lock().unwrap();
    match code {
        100 => state.absent = true,
        101 => state.forces_on = false,
        _ => (state.code, state.error) = (code, error),
    }
}

/// Copies the calls so far into `text`, of `room` bytes; returns their length.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn stand_in_log(text: *mut u8, room: usize) -> usize {
    let state = STATE.lock().unwrap();
    let count = state.log.len().min(room);
    unsafe { std::ptr::copy_nonoverlapping(state.log.as_ptr(), text, count) };
    count
}

/// Size of the force on the device (N).
#[unsafe(no_mangle)]
pub extern "C" fn stand_in_effort() -> f64 {
    STATE.lock().unwrap().force.iter().map(|f| f * f).sum::<f64>().sqrt()
}
