//! Nothing silent, nothing lost: datasets that need nothing but their file, and readers that no file harms.

// Helpers outside test functions may fail the test too.
#![allow(clippy::unwrap_used, clippy::panic)]

mod alone;
mod fuzz;
mod program;
