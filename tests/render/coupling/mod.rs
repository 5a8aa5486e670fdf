//! The proxy's side of the tick: effects at contacts, four channels, passivity control and bounds.

mod block;
mod channels;
mod effects;
mod history;
mod memory;
mod passivity;
mod trace;
