//! The proxy's side of the tick: effects at contacts, four channels, passivity control and bounds.

// clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![allow(clippy::unwrap_used, clippy::panic)]

mod block;
mod channels;
mod effects;
mod history;
mod memory;
mod passivity;
#[path = "../../src/random.rs"]
#[allow(dead_code, unreachable_pub)] // The library has more use for it.
mod random;
mod trace;
