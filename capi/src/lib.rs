//! The C interface of haptize: what `include/haptize.h`, which is made of these sources, declares.
//!
//! Nothing is decided here. Each function checks what it is told, calls the library, and tells the outcome as an
//! [`hz_code`]; a message goes into the caller's buffer. No panic leaves it. Types bear the names that they have in C.

#![allow(non_camel_case_types)]

mod field;
mod haptic_loop;
mod live;
mod outcome;
mod solver;

pub use field::{
    hz_field, hz_field_bounds, hz_field_close, hz_field_joints, hz_field_open, hz_field_sample, hz_field_torque,
    hz_field_torques, hz_sample,
};
pub use haptic_loop::{
    hz_gains, hz_loop, hz_loop_close, hz_loop_fault, hz_loop_joints, hz_loop_open, hz_loop_period, hz_loop_start,
    hz_loop_tick, hz_tick,
};
pub use live::{hz_live, hz_live_close, hz_live_joints, hz_live_open, hz_live_sample};
pub use outcome::hz_code;
pub use solver::{
    hz_equilibrium, hz_force, hz_solver, hz_solver_close, hz_solver_joints, hz_solver_open, hz_solver_solve,
};

use std::ffi::{CStr, c_char};

/// Number of this interface. A program that was compiled with another one must not be run with this library.
pub const HZ_ABI: u32 = 1;

/// Most joints that an arm may have here.
pub const HZ_MAX_JOINTS: usize = 6;

const _: () = assert!(HZ_MAX_JOINTS <= haptize::MAX_JOINTS && HZ_MAX_JOINTS == haptize::MAX_AXES);

/// Checks that an arm has no more joints than the structures hold.
fn check_joints(joints: usize) -> Result<(), outcome::Failure> {
    if joints <= HZ_MAX_JOINTS {
        return Ok(());
    }
    let message = format!("the arm has {joints} joints, and the C interface takes at most {HZ_MAX_JOINTS}");
    Err(outcome::Failure { code: hz_code::HZ_SCENE, message })
}

/// The entries, then zeros.
fn padded(vector: &[f64]) -> [f64; HZ_MAX_JOINTS] {
    std::array::from_fn(|joint| vector.get(joint).copied().unwrap_or_default())
}

const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
    Ok(version) => version,
    Err(_) => c"",
};

/// Returns HZ_ABI of the library, to be compared with that of the header.
#[unsafe(no_mangle)]
pub extern "C" fn hz_abi() -> u32 {
    HZ_ABI
}

/// Returns the library's version, such as "0.1.0". The text is never freed.
#[unsafe(no_mangle)]
pub extern "C" fn hz_version() -> *const c_char {
    VERSION.as_ptr()
}
