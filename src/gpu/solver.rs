//! Equilibria of many configurations on GPUs: the backend of a sweep.
//!
//! Configurations are cut into sections, which the devices share (`fleet`), one dispatch each. Results depend neither
//! on the sections nor on how many devices there are.
//!
//! What f32 or the kernel's room cannot decide is left to the CPU's solver ([`unpack`]). Nothing is cut off.

use super::{
    adapter::AdapterSummary,
    context::Context,
    device::{BatchCapacity, Found, RestDevice, record_length},
    error::GpuError,
    fleet::{Device, solve_together},
    unpack::unpack,
};
use crate::{
    JointVector,
    contact::{self, Backend, Equilibrium, Solvers, Work},
};
use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

/// Sections of a device that one call should have: two are under way.
const SECTIONS: usize = 2;

/// Solves configurations on GPUs.
pub struct GpuSolver<'a> {
    devices: Vec<RestDevice>,
    model: &'a contact::Model<'a>,
    cpu: Solvers<'a>,
    left_to_cpu: AtomicUsize,
    notices: Vec<String>,
}

impl<'a> GpuSolver<'a> {
    /// A solver of `model` on `context`.
    ///
    /// # Errors
    /// When contact is not at rest, the object does not fit the device, or the device refuses.
    pub fn new(context: Arc<Context>, model: &'a contact::Model<'a>) -> Result<Self, GpuError> {
        Self::on(vec![context], model, BatchCapacity::default())
    }

    /// The same on several devices, which share the configurations, with these bounds. One that cannot take the model
    /// is as one that is not there.
    ///
    /// # Errors
    /// As [`GpuSolver::new`], where no device takes it.
    pub fn on(
        contexts: Vec<Arc<Context>>,
        model: &'a contact::Model<'a>,
        capacity: BatchCapacity,
    ) -> Result<Self, GpuError> {
        let (mut devices, mut notices, mut refusal) = (Vec::new(), Vec::new(), None);
        for context in contexts {
            let name = context.adapter().to_string();
            match RestDevice::new(context, model, capacity) {
                Ok(device) => devices.push(device),
                Err(error) => {
                    notices.push(format!("solved without {name}, which failed: {error}"));
                    refusal = refusal.or(Some(error));
                }
            }
        }
        if let (true, Some(error)) = (devices.is_empty(), refusal) {
            return Err(error);
        }
        let cpu = Solvers::new(model, rayon::current_num_threads());
        Ok(Self { devices, model, cpu, left_to_cpu: AtomicUsize::new(0), notices })
    }

    /// The adapters in use.
    pub fn adapters(&self) -> impl Iterator<Item = &AdapterSummary> {
        self.devices.iter().map(|device| device.context().adapter())
    }

    /// A good number of configurations for one call: progress is reported between calls.
    #[must_use]
    pub fn chunk(&self) -> usize {
        self.devices.iter().map(|device| SECTIONS * device.section()).sum()
    }
}

/// One chunk.
struct OneChunk {
    configurations: Option<Vec<JointVector>>,
    equilibria: Vec<Equilibrium>,
    notices: Vec<String>,
}

impl Work for OneChunk {
    fn next(&mut self) -> Option<Vec<JointVector>> {
        self.configurations.take()
    }

    /// There is no other backend for it.
    fn rewind(&mut self) {}

    fn take(&mut self, equilibria: Vec<Equilibrium>) {
        self.equilibria = equilibria;
    }

    fn note(&mut self, notice: String) {
        self.notices.push(notice);
    }
}

impl Backend for GpuSolver<'_> {
    type Error = GpuError;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, GpuError> {
        let configurations = Some(configurations.to_vec());
        let mut work = OneChunk { configurations, equilibria: Vec::new(), notices: Vec::new() };
        let solved = self.stream(&mut work);
        self.notices.append(&mut work.notices);
        solved.map(|()| work.equilibria)
    }

    fn stream(&mut self, work: &mut dyn Work) -> Result<(), GpuError> {
        let Self { devices, model, cpu, left_to_cpu, .. } = self;
        solve_together(devices, work, |section, Found { records, touches }| {
            let each = record_length(model.chain.links.len(), model.with_tangent);
            let results: Vec<_> = section.iter().zip(records.chunks_exact(each)).collect();
            cpu.map(&results, |solver, (q, record)| {
                unpack(model, q, record, &touches).unwrap_or_else(|| {
                    left_to_cpu.fetch_add(1, Ordering::Relaxed);
                    solver.solve(q)
                })
            })
        })
    }

    fn notices(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notices)
    }

    fn left_to_cpu(&self) -> usize {
        self.left_to_cpu.load(Ordering::Relaxed)
    }
}
