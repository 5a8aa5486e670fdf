//! Equilibrium of thousands of configurations at once, and the object's frame update, in WGSL through wgpu.
//!
//! | file | subject |
//! |---|---|
//! | `context` | adapter, device, what can go wrong with them |
//! | `layout` | structs shared with WGSL, checked against it |
//! | `shaders` | shaders embedded, assembled from parts, with their override sets |
//! | `kernel` | one compute pipeline with its bindings; buffers, poison, read-back |
//!
//! A shader in `shaders/` and its CPU twin share names and order of statements. The GPU computes in f32 with
//! coordinates relative to the object's centroid; what is summed over few terms (torque, forces of a node) is summed on
//! the host in f64.

mod context;
mod kernel;
pub mod layout;
pub mod shaders;

pub use context::{AdapterChoice, AdapterSummary, Context, GpuError, adapters};
pub use kernel::{Access, Kernel, POISON, StorageBuffer};
