//! Nothing silent, nothing lost: datasets that need nothing but their file, readers that no file harms, and bakes that
//! survive what stops them.

mod alone;
mod crash;
mod fuzz;
mod inputs;
mod objects;
mod outputs;
mod signals;
mod telling;
