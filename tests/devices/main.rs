//! Haptic devices without hardware: the safety layer, the adapters, and every protocol against an emulator of its
//! device.
//!
//! Nothing here was tried on hardware. Time is simulated: a tick is a call, not a millisecond.

// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../desktop/mod.rs"]
mod desktop;
#[cfg(unix)]
mod emulator;
mod felt;
mod guard;
mod inverse3;
#[cfg(target_os = "linux")]
mod jitter;
mod mcap;
mod program;
mod rig;
#[cfg(unix)]
mod serial;
#[path = "../synthetic/mod.rs"]
mod synthetic;
mod tip;
#[cfg(target_os = "linux")]
mod vendor;

use haptize as engine;

// In debug builds the process is aborted when it allocates within `assert_no_alloc`.
#[global_allocator]
static ALLOCATOR: assert_no_alloc::AllocDisabler = assert_no_alloc::AllocDisabler;
