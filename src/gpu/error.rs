//! Why the GPU could not do it.

use crate::{Error, MAX_AXES, memory};
use std::time::Duration;

/// Why the GPU could not do it.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// No adapter of the kind asked for.
    #[error(
        "no {wanted} Vulkan, Metal or DX12 adapter; found: {found}. Install your GPU's Vulkan driver (or Mesa's \
         software Vulkan, package mesa-vulkan-drivers, for --backend gpu without a GPU), or use --backend cpu"
    )]
    NoAdapter {
        /// `hardware` or `usable`.
        wanted: &'static str,
        /// Adapters that were there, or `none`.
        found: String,
    },
    /// The one adapter that was asked for is not among those of this machine.
    #[error("the adapter {wanted} does not answer; found: {found}. Choose one of these, or the CPU")]
    NotThere {
        /// The adapter that was asked for.
        wanted: String,
        /// Adapters that were there, or `none`.
        found: String,
    },
    /// The adapter refuses a device with WebGPU's default limits.
    #[error("adapter {adapter} gives no device: {reason}. Update its driver, or use --backend cpu")]
    NoDevice {
        /// The adapter's name.
        adapter: String,
        /// wgpu's reason.
        reason: String,
    },
    /// The device was lost: driver reset, removal, or a dispatch that ran too long.
    #[error("the GPU was lost: {0}. Use --backend cpu, or update the driver")]
    Lost(String),
    /// The system gives no thread that drives the device.
    #[error(transparent)]
    NoThread(Error),
    /// Device memory is exhausted.
    #[error("the GPU is out of memory: {0}. Use a smaller object, close other programs, or use --backend cpu")]
    OutOfMemory(String),
    /// wgpu or naga refuses a shader, pipeline or command: a defect of this crate or of the driver.
    #[error("the GPU refused a command: {0}. Please report this with the output of `haptize doctor`")]
    Refused(String),
    /// A submission did not end in time.
    #[error("the GPU did not answer within {0:?}. Use --backend cpu, or update the driver")]
    TimedOut(Duration),
    /// The object does not fit the device's limits.
    #[error("{what} needs {needed} bytes, the GPU binds at most {limit}. Use --backend cpu for this scene")]
    TooLarge {
        /// Which buffer.
        what: &'static str,
        /// Its size (B).
        needed: u64,
        /// The limit (B).
        limit: u64,
    },
    /// The kernel takes arms of as many joints as a grid has axes.
    #[error("the GPU solves for arms of at most {MAX_AXES} joints, not {0}. Use --backend cpu")]
    Joints(usize),
    /// The kernel takes the surface at rest as it is.
    #[error("the GPU solves contact with a surface that is not rounded. Use --backend cpu, or leave `round` out")]
    Rounded,
    /// The kernel takes contact with the surface at rest alone.
    #[error(
        "the GPU solves contact with the surface at rest, not by the law `{0}`. Name `law = \"rest\"` in the \
         scene's [contact], or use --backend cpu"
    )]
    Law(&'static str),
    /// Outputs that no invocation wrote: a dispatch was cut short.
    #[error(
        "the GPU left {count} of {total} results unwritten. Use --backend cpu, and report this with `haptize doctor`"
    )]
    NeverWritten {
        /// Results whose records are still zero.
        count: usize,
        /// Results asked for.
        total: usize,
    },
}

impl From<wgpu::Error> for GpuError {
    fn from(error: wgpu::Error) -> Self {
        match error {
            wgpu::Error::OutOfMemory { source } => Self::OutOfMemory(source.to_string()),
            wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
                Self::Refused(description)
            }
        }
    }
}

impl From<GpuError> for Error {
    fn from(error: GpuError) -> Self {
        Self::new(format!("{error}{}", memory::scarcity()))
    }
}
