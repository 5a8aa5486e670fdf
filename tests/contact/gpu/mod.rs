//! The GPU against the CPU's f64 code, on whatever adapter there is (software Vulkan counts). None is a failure.

mod adapter;
mod equilibria;
mod fixture;
mod frames;
mod stores;
