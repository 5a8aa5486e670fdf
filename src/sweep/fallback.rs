//! A backend on a device that may fail for good, and the CPU in its place from then on; or the CPU alone.
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
    /// Name of the device; empty where there never was one.
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

    /// The CPU alone, to solve `model`.
    ///
    /// # Errors
    /// When the system gives no threads.
    pub fn cpu_alone(model: &'a Model<'a>) -> Result<Self, Error> {
        let cpu = Some(CpuBackend::new(model, 0)?);
        Ok(Self { model, device: None, cpu, name: String::new(), notices: Vec::new(), left_to_cpu: 0 })
    }

    /// Whether there never was a device.
    #[must_use]
    pub fn is_cpu_alone(&self) -> bool {
        self.name.is_empty()
    }

    /// `cpu` or `gpu`, as a dataset's provenance says it.
    #[must_use]
    pub fn name(&self) -> &'static str {
        if self.is_cpu_alone() { "cpu" } else { "gpu" }
    }

    /// Returns the backend's name as a dataset's provenance states it: that of the device, or of the CPU.
    #[must_use]
    pub fn adapter(&self) -> String {
        if self.is_cpu_alone() { CpuBackend::adapter() } else { self.name.clone() }
    }

    /// A good [`super::Run::chunk`] for this backend, where its device has one of `chunk`.
    pub(super) fn chunk_of(&self, chunk: impl FnOnce(&B) -> usize) -> usize {
        self.device.as_ref().map_or_else(|| self.cpu.as_ref().map_or(1, CpuBackend::chunk), chunk)
    }

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

    fn threads(&self) -> usize {
        let of_cpu = || self.cpu.as_ref().map_or_else(rayon::current_num_threads, Backend::threads);
        self.device.as_ref().map_or_else(of_cpu, Backend::threads)
    }

    fn notices(&mut self) -> Vec<String> {
        let of_device = self.device.as_mut().map_or_else(Vec::new, Backend::notices);
        [std::mem::take(&mut self.notices), of_device].concat()
    }

    fn left_to_cpu(&self) -> usize {
        self.device.as_ref().map_or(self.left_to_cpu, Backend::left_to_cpu)
    }
}
