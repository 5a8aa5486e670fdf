//! Nothing silent, nothing lost: datasets that need nothing but their file.

// Helpers outside test functions may fail the test too.
#![allow(clippy::unwrap_used)]

mod alone;
mod program;
