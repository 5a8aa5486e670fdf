//! Equilibrium of thousands of configurations at once, and the object's frame update, in WGSL through wgpu.
//!
//! | file | subject |
//! |---|---|
//! | `adapter` | the adapters of this machine, and which is taken |
//! | `context` | the device, and what can go wrong with it |
//! | `layout` | structs shared with WGSL, checked against it |
//! | `shaders` | shaders embedded, assembled from parts, with their override sets |
//! | `model` | object, proxy and contact law as buffers |
//! | `device` | one device that solves: its kernel, its lanes |
//! | `fleet` | sections of configurations, shared by some devices, and back in order |
//! | `unpack` | from what the kernel wrote to equilibria |
//! | `solver` | the backend of a sweep |
//! | `frame` | the object's nodes, one passive step a frame |
//! | `kernel`, `compiled`, `dispatch` | one compute pipeline with its bindings; how its workgroups are counted |
//! | `buffer` | buffers of the device, and how the host reads them |
//!
//! A shader in `shaders/` and its CPU twin share names and order of statements. Kernels compute in f32, with
//! coordinates relative to the object's centre, within WebGPU's default limits. They solve contact with the surface at
//! rest; what they cannot decide the CPU solves.

mod adapter;
mod buffer;
mod compiled;
mod context;
mod device;
mod dispatch;
mod error;
mod fleet;
mod frame;
mod kernel;
pub mod layout;
mod model;
pub mod shaders;
mod solver;
mod unpack;

pub(crate) use adapter::asked_for;
pub use adapter::{ADAPTER_VARIABLE, AdapterChoice, AdapterSummary, adapters, named_adapters};
pub use context::Context;
pub use device::BatchCapacity;
pub use error::GpuError;
pub use frame::FrameUpdate;
pub use shaders::GPU_LEAST_DIVISOR;
pub use solver::GpuSolver;
pub use unpack::GPU_RESIDUAL;
