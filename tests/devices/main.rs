//! What lives by the clock: the real-time loop; and haptic devices without hardware: the safety layer, the adapters, and
//! every protocol against an emulator of its device.
//!
//! Nothing here was tried on hardware. Time is simulated: a tick is a call, not a millisecond.

// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;
#[cfg(unix)]
mod emulator;
mod felt;
mod guard;
mod inverse3;
#[cfg(target_os = "linux")]
mod jitter;
mod mcap;
mod program;
mod realtime;
mod rig;
#[cfg(unix)]
mod serial;
mod tip;
#[cfg(target_os = "linux")]
mod vendor;

// In debug builds the process is aborted when it allocates within `assert_no_alloc`.
#[global_allocator]
static ALLOCATOR: assert_no_alloc::AllocDisabler = assert_no_alloc::AllocDisabler;
