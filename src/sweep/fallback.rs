//! A backend on a device that may fail for good, and the CPU in its place from then on.
//!
//! A GPU is lost by a driver's reset, by sleep, by being pulled out, or by other programs that take its memory. Its
//! solver first tries again with smaller batches, and then goes on with its other devices; what it cannot mend ends
//! here. The batches under way and all that follow are then solved by the CPU, so that a sweep of hours goes on,
//! and [`Backend::notices`] reports it.

use super::{Backend, CpuBackend};
use crate::{
    Error, JointVector,
    contact::{Equilibrium, Model, Work},
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

impl<'a, B: Backend> WithFallback<'a, B> {
    /// Leaves the device, which has failed. What it told on the way is told first.
    fn leave(&mut self, error: &B::Error) {
        self.left_to_cpu = self.left_to_cpu();
        self.notices = self.notices();
        self.device = None;
        self.notices.push(format!("solved by {}, since {} failed: {error}", CpuBackend::adapter(), self.name));
    }

    fn cpu(&mut self) -> Result<&mut CpuBackend<'a>, Error> {
        match &mut self.cpu {
            Some(cpu) => Ok(cpu),
            empty => Ok(empty.insert(CpuBackend::new(self.model, 0)?)),
        }
    }
}

impl<B: Backend> Backend for WithFallback<'_, B> {
    /// When the system gives no threads to the CPU backend.
    type Error = Error;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Self::Error> {
        if let Some(device) = &mut self.device {
            match device.solve(configurations) {
                Ok(equilibria) => return Ok(equilibria),
                Err(error) => self.leave(&error),
            }
        }
        self.cpu()?.solve(configurations).map_err(|never| match never {})
    }

    fn stream(&mut self, work: &mut dyn Work) -> Result<(), Self::Error> {
        if let Some(device) = &mut self.device {
            match device.stream(work) {
                Ok(()) => return Ok(()),
                Err(error) => self.leave(&error),
            }
            work.rewind();
        }
        self.notices().into_iter().for_each(|notice| work.note(notice));
        self.cpu()?.stream(work).map_err(|never| match never {})
    }

    fn notices(&mut self) -> Vec<String> {
        let of_device = self.device.as_mut().map_or_else(Vec::new, Backend::notices);
        [std::mem::take(&mut self.notices), of_device].concat()
    }

    fn left_to_cpu(&self) -> usize {
        self.device.as_ref().map_or(self.left_to_cpu, Backend::left_to_cpu)
    }
}
