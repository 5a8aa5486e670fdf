//! The haptic and the graphics loop, and what scenes name beside contact.

// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod absence;
#[path = "../common/mod.rs"]
mod common;
mod coupling;
mod graphics;
mod session;
