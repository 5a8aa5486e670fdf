//! Equilibria of many configurations on GPUs: the backend of a sweep.
//!
//! Configurations are cut into sections (`flights`), which are placed and tested for contact; the host then knows how
//! many touch, and submits these, one workgroup a configuration. While the devices solve sections, all cores make
//! equilibria of the ones before, which in f32 are settled in f64. Sizes of sections follow from measured time: a
//! dispatch should last tens of milliseconds. Results depend neither on them nor on how many devices there are.
//!
//! What f32 or the kernel's room cannot decide is left to the CPU's solver: forces that do not settle, more contacts
//! than the lists hold, and where shaders have no f64 contact within rounding of none. Nothing is cut off.

use super::{
    adapter::AdapterSummary,
    context::Context,
    error::GpuError,
    flights::{HostTime, Landed, PacedDevice, Queue, fly},
    pipeline::{BatchCapacity, Pipeline},
    precision::Precision,
    stages::{Detected, Found, Recorded, Stages, Trust},
    unpack::{GPU_RESOLVED_RESIDUAL, unpack},
};
use crate::{
    JointVector,
    contact::{self, Backend, Equilibrium, Solvers, Status, Work},
};
use std::{sync::Arc, time::Instant};

/// Configurations of a call on a software rasteriser, which takes a second for some hundred of them.
const SOFTWARE_CHUNK: usize = 1024;

/// Solves configurations on GPUs, or on what stands for them.
pub struct GpuSolver<'a, S: Stages = Pipeline<'a>> {
    devices: Vec<PacedDevice<S>>,
    host: HostPart<'a>,
    time: HostTime,
    notices: Vec<String>,
}

/// The host's part: equilibria of what the devices found.
struct HostPart<'a> {
    model: &'a contact::Model<'a>,
    cpu: Solvers<'a>,
    left_to_cpu: usize,
}

impl<'a> GpuSolver<'a> {
    /// A solver of `model` on `context`.
    ///
    /// # Errors
    /// When the object does not fit the device, or the device refuses.
    pub fn new(context: Arc<Context>, model: &'a contact::Model<'a>) -> Result<Self, GpuError> {
        Self::with_room(context, model, BatchCapacity::default())
    }

    /// The same with other bounds on what one submission holds.
    ///
    /// # Errors
    /// As [`GpuSolver::new`].
    pub fn with_room(
        context: Arc<Context>,
        model: &'a contact::Model<'a>,
        room: BatchCapacity,
    ) -> Result<Self, GpuError> {
        Self::on(vec![context], model, room)
    }

    /// The same on several devices, which share the configurations. None of them is no error, and solves nothing.
    ///
    /// # Errors
    /// As [`GpuSolver::new`].
    pub fn on(
        contexts: Vec<Arc<Context>>,
        model: &'a contact::Model<'a>,
        room: BatchCapacity,
    ) -> Result<Self, GpuError> {
        let pipelines = contexts.into_iter().map(|context| Pipeline::new(context, model, room));
        Ok(Self::of(pipelines.collect::<Result<_, _>>()?, model))
    }

    /// The adapters in use.
    pub fn adapters(&self) -> impl Iterator<Item = &AdapterSummary> {
        self.devices.iter().map(|device| device.stages.context().adapter())
    }

    /// Records what its first device finds of `configurations`, to be replayed.
    ///
    /// # Errors
    /// When the device fails.
    pub fn record(&mut self, configurations: &[JointVector]) -> Result<Recorded, GpuError> {
        Recorded::of(&mut self.devices[0].stages, configurations)
    }

    /// A good number of configurations for one call: progress is reported between calls.
    #[must_use]
    pub fn chunk(&self) -> usize {
        let of = |device: &PacedDevice<Pipeline<'_>>| {
            let section = device.stages.room().section;
            if device.stages.context().adapter().hardware { section } else { section.min(SOFTWARE_CHUNK) }
        };
        self.devices.iter().map(of).sum()
    }
}

impl<'a, S: Stages> GpuSolver<'a, S> {
    /// A solver of `model` on `devices`, which were made for it.
    pub fn of(devices: Vec<S>, model: &'a contact::Model<'a>) -> Self {
        let cpu = Solvers::new(model, rayon::current_num_threads());
        Self {
            devices: devices.into_iter().map(PacedDevice::new).collect(),
            host: HostPart { model, cpu, left_to_cpu: 0 },
            time: HostTime::default(),
            notices: Vec::new(),
        }
    }

    /// Whether contact or not is decided on the devices, in f64.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.devices.iter().all(|device| device.stages.trust().precision == Precision::Double)
    }

    /// Returns where the time of the host went since the solver was made.
    #[must_use]
    pub fn host_time(&self) -> HostTime {
        self.time
    }
}

impl HostPart<'_> {
    /// Adds the equilibria of a section that a device has solved.
    fn conclude(
        &mut self,
        trust: Trust,
        landed: Landed<'_>,
        time: &mut HostTime,
        equilibria: &mut Vec<Equilibrium>,
    ) -> Result<(), GpuError> {
        let Landed { configurations, detected: Detected { gaps, touching }, found } = landed;
        let begin = Instant::now();
        let mut results: Vec<Equilibrium> =
            gaps.iter().zip(configurations).map(|(&gap, q)| Equilibrium::free(gap, q.len())).collect();
        let assembled = Instant::now();
        self.decide_free(trust, configurations, &touching, &mut results);
        let settled = self.settle(trust, configurations, &touching, &found, &results)?;
        let done = Instant::now();
        for (&member, result) in touching.iter().zip(settled) {
            results[member as usize] = result;
        }
        // All of a section or, where it fails, nothing: what has no equilibrium departs again.
        equilibria.append(&mut results);
        time.settling += done - assembled;
        time.assembling += (assembled - begin) + done.elapsed();
        Ok(())
    }

    /// Solves on the CPU what touches nothing but lies within what its gap is known to of contact.
    fn decide_free(&mut self, trust: Trust, section: &[JointVector], touching: &[u32], results: &mut [Equilibrium]) {
        if results.iter().all(|result| result.gap.abs() > trust.band) {
            return;
        }
        let mut free = vec![true; section.len()];
        touching.iter().for_each(|&member| free[member as usize] = false);
        let open: Vec<usize> =
            (0..section.len()).filter(|&k| free[k] && self.is_undecided(trust, &results[k])).collect();
        self.left_to_cpu += open.len();
        let decided = self.cpu.map(&open, |solver, &k| solver.solve(&section[k]));
        for (k, result) in open.into_iter().zip(decided) {
            results[k] = result;
        }
    }

    /// The equilibria of those in contact, from what the kernels `found`.
    fn settle(
        &mut self,
        trust: Trust,
        section: &[JointVector],
        touching: &[u32],
        found: &Found,
        at_rest: &[Equilibrium],
    ) -> Result<Vec<Equilibrium>, GpuError> {
        let starts: Vec<usize> = found
            .counts()
            .iter()
            .scan(0_usize, |end, &count| {
                let start = *end;
                *end = end.saturating_add(count);
                Some(start)
            })
            .collect();
        let places: Vec<usize> = (0..touching.len()).collect();
        let model = self.model;
        let settled = self.cpu.map(&places, |solver, &place| {
            let member = touching[place] as usize;
            let (q, start) = (&section[member], *starts.get(place)?);
            let result = unpack(model, solver, (q, at_rest[member].gap), found, (place, start), trust.precision)?;
            let is_undecided = self.is_undecided(trust, &result);
            Some(if is_undecided { (solver.solve(q), 1) } else { (result, 0) })
        });
        let unwritten = settled.iter().filter(|result| result.is_none()).count();
        if unwritten > 0 {
            return Err(GpuError::NeverWritten { count: unwritten, total: touching.len() });
        }
        let (results, left): (Vec<_>, Vec<usize>) = settled.into_iter().flatten().unzip();
        self.left_to_cpu += left.into_iter().sum::<usize>();
        Ok(results)
    }

    /// Whether f32 or the kernel's room left open what the equilibrium is.
    fn is_undecided(&self, trust: Trust, result: &Equilibrium) -> bool {
        let is_settled = trust.precision == Precision::Double;
        result.gap.is_nan()
            || result.gap.abs() <= trust.band && trust.precision == Precision::Single
            || match result.status {
                Status::Contact => !is_settled && (result.residual.is_nan() || result.residual > GPU_RESOLVED_RESIDUAL),
                Status::Unconverged => !is_settled,
                Status::Overflow => true,
                Status::Free | Status::Outside => false,
            }
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

impl<S: Stages> Backend for GpuSolver<'_, S> {
    type Error = GpuError;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, GpuError> {
        let configurations = Some(configurations.to_vec());
        let mut work = OneChunk { configurations, equilibria: Vec::new(), notices: Vec::new() };
        let solved = self.stream(&mut work);
        self.notices.append(&mut work.notices);
        solved.map(|()| work.equilibria)
    }

    fn stream(&mut self, work: &mut dyn Work) -> Result<(), GpuError> {
        let Self { devices, host, time, .. } = self;
        let conclude = |stages: &S, landed: Landed<'_>, time: &mut HostTime, equilibria: &mut Vec<Equilibrium>| {
            host.conclude(stages.trust(), landed, time, equilibria)
        };
        fly(devices, &mut Queue::new(work), time, conclude)
    }

    fn notices(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notices)
    }

    fn left_to_cpu(&self) -> usize {
        self.host.left_to_cpu
    }
}
