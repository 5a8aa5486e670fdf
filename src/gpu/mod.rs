//! Equilibrium of thousands of configurations at once, and the object's frame update, in WGSL through wgpu.
//!
//! | file | subject |
//! |---|---|
//! | `adapter` | the adapters of this machine, and which is taken |
//! | `context` | the device, and what can go wrong with it |
//! | `layout` | structs shared with WGSL, checked against it |
//! | `shaders` | shaders embedded, assembled from parts, with their override sets |
//! | `model` | object, proxy and contact law as buffers |
//! | `detection` | the stages that place the proxy and test it for contact at rest |
//! | `precision` | f64, or f32 where a device has no f64 |
//! | `search` | the search for equilibria: kernels, buffers, rounds |
//! | `search_model` | object, proxy and contact law for the search |
//! | `pipeline` | the stages of a batch and their buffers |
//! | `stages` | what a batch goes through, whoever does it; a device that returns stored results |
//! | `flights` | sections of configurations in flight on some devices, and back in order |
//! | `solver` | the backend of a sweep: what is made of results, retries |
//! | `unpack` | from what the kernels wrote to equilibria, settled in f64 by the CPU's search |
//! | `frame` | the object's nodes, one passive step a frame |
//! | `kernel`, `compiled`, `dispatch` | one compute pipeline with its bindings; its dispatches |
//! | `buffer` | buffers of the device, and how the host reads them |
//! | `timing` | how long each kernel takes, where that is asked for |
//!
//! A shader in `shaders/` and its CPU twin share names and order of statements. Where the device has f64, contact or
//! not is decided in it, and equilibria are found in it from the rest state to the result, in the steps of the CPU.
//! Elsewhere the same shaders compute in f32, with coordinates relative to the object's centre, and the host settles
//! what they find in f64.

mod adapter;
mod buffer;
mod compiled;
mod context;
mod detection;
mod dispatch;
mod error;
#[cfg(test)]
mod facet_tests;
mod flights;
mod frame;
mod kernel;
pub mod layout;
#[cfg(test)]
mod leaf_tests;
mod model;
mod pipeline;
pub mod precision;
mod search;
mod search_model;
pub mod shaders;
mod solver;
pub mod stages;
mod timing;
mod unpack;

pub(crate) use adapter::asked_for;
pub use adapter::{ADAPTER_VARIABLE, AdapterChoice, AdapterSummary, adapters, named_adapters};
pub use context::Context;
pub use error::GpuError;
pub use flights::HostTime;
pub use frame::{FrameCost, FrameError, FrameMethod, FrameUpdate};
pub use pipeline::BatchCapacity;
pub use shaders::GPU_LEAST_DIVISOR;
pub use solver::GpuSolver;
pub use timing::{KernelTime, SearchCounts};
pub use unpack::GPU_SETTLED_RESIDUAL;
