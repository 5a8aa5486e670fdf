//! A backend on a device that may fail for good, and the CPU in its place from then on.
//!
//! A GPU is lost by a driver's reset, by sleep, by being pulled out, or by other programs that take its memory. Its
//! solver first tries again by itself with smaller batches; what it cannot mend ends here. The current batch and all
//! that follow are then solved by the CPU, so that a sweep of hours goes on, and [`Backend::notices`] reports it.

use super::{Backend, CpuBackend};
use crate::{
    JointVector,
    contact::{Equilibrium, Model},
};
use std::fmt::Display;

/// A backend with the CPU behind it.
pub struct WithFallback<'a, B> {
    model: &'a Model<'a>,
    /// `None` once it has failed.
    device: Option<B>,
    cpu: Option<CpuBackend<'a>>,
    /// Name of the device.
    name: String,
    notices: Vec<String>,
    /// By the device, before it failed.
    left_to_cpu: usize,
}

impl<'a, B: Backend> WithFallback<'a, B> {
    /// `device`, called `name`, which solves `model`.
    pub fn new(device: B, name: impl Display, model: &'a Model<'a>) -> Self {
        Self { model, device: Some(device), cpu: None, name: name.to_string(), notices: Vec::new(), left_to_cpu: 0 }
    }

    /// Name of the device.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }
}

impl<B: Backend> Backend for WithFallback<'_, B> {
    /// When the system gives no threads to the CPU backend.
    type Error = rayon::ThreadPoolBuildError;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Self::Error> {
        if let Some(device) = &mut self.device {
            match device.solve(configurations) {
                Ok(equilibria) => return Ok(equilibria),
                Err(error) => {
                    self.left_to_cpu = device.left_to_cpu();
                    self.device = None;
                    self.notices.push(format!(
                        "solved by {}, since {} failed: {error}",
                        CpuBackend::adapter(),
                        self.name
                    ));
                }
            }
        }
        let cpu = match &mut self.cpu {
            Some(cpu) => cpu,
            empty => empty.insert(CpuBackend::new(self.model, 0)?),
        };
        cpu.solve(configurations).map_err(|never| match never {})
    }

    fn notices(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notices)
    }

    fn left_to_cpu(&self) -> usize {
        self.device.as_ref().map_or(self.left_to_cpu, Backend::left_to_cpu)
    }
}
