//! Nothing silent, nothing lost: datasets that need nothing but their file, readers that no file harms, and bakes that
//! survive what stops them.

// Helpers outside test functions may fail the test too.
#![allow(clippy::unwrap_used, clippy::panic)]

mod alone;
mod crash;
mod fuzz;
mod inputs;
mod outputs;
mod program;
mod signals;
mod telling;
