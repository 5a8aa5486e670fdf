//! Equilibria of many configurations on the GPU: the backend of a sweep.
//!
//! A chunk of configurations is placed and tested for contact in one submission; the host then knows how many touch,
//! and submits these in batches, one workgroup a configuration. While the device solves one batch, all cores settle the
//! one before in f64. Sizes of chunks and batches follow from measured time: a dispatch should last tens of
//! milliseconds. Results do not depend on them.
//!
//! What f32 or the kernel's room cannot decide is left to the CPU's f64 solver: forces that do not settle, more
//! contacts than the lists hold, and where shaders have no f64 contact within rounding of none. Nothing is cut off.

use super::{
    adapter::AdapterSummary,
    context::{Context, GpuError},
    pipeline::{BatchCapacity, Pipeline},
    unpack::unpack,
};
use crate::{
    JointVector,
    contact::{self, Backend, Equilibrium, Solvers, Status},
    scene::Algorithm,
    tolerances::GPU_RESOLVED_RESIDUAL,
};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};

/// How long a dispatch should last: long enough to keep the device busy, far below the 2 s after which an operating
/// system takes it for hung.
const DISPATCH_TARGET: Duration = Duration::from_millis(50);

/// Solves configurations on the GPU.
pub struct GpuSolver<'a> {
    context: Arc<Context>,
    model: &'a contact::Model<'a>,
    cpu: Solvers<'a>,
    room: BatchCapacity,
    pipeline: Pipeline,
    chunk: AdaptiveSize,
    batch: AdaptiveSize,
    left_to_cpu: usize,
}

/// A number of configurations that follows measured time.
#[derive(Clone, Copy, Debug)]
struct AdaptiveSize {
    now: usize,
    most: usize,
}

impl AdaptiveSize {
    /// Steers towards [`DISPATCH_TARGET`], at most by a factor of two up and four down.
    fn adapt(&mut self, done: usize, time: Duration) {
        // A dispatch that was cut short by the end of the list says nothing about a full one.
        if done < self.now && time < DISPATCH_TARGET {
            return;
        }
        let ratio = (DISPATCH_TARGET.as_secs_f64() / time.as_secs_f64().max(1e-6)).clamp(0.25, 2.0);
        self.now = ((done as f64 * ratio) as usize).clamp(1, self.most);
    }
}

/// One batch under way.
struct PendingBatch {
    first: usize,
    count: usize,
    set: usize,
    submission: wgpu::SubmissionIndex,
    since: Instant,
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
        let room = room.within(context.binding_limit(), model);
        let pipeline = Pipeline::new(&context, model, room)?;
        Ok(Self {
            context,
            model,
            cpu: Solvers::new(model, rayon::current_num_threads()),
            room,
            pipeline,
            // First dispatches are small: nothing is known of the device yet.
            chunk: AdaptiveSize { now: room.chunk.min(1024), most: room.chunk },
            batch: AdaptiveSize { now: room.batch.min(64), most: room.batch },
            left_to_cpu: 0,
        })
    }

    /// The adapter in use.
    #[must_use]
    pub fn adapter(&self) -> &AdapterSummary {
        self.context.adapter()
    }

    /// Whether contact or not is decided on the device, in f64.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.pipeline.detection().is_exact()
    }

    /// A good number of configurations for one call: progress is reported between calls.
    #[must_use]
    pub fn chunk(&self) -> usize {
        if self.adapter().hardware { self.room.chunk } else { self.room.chunk.min(1024) }
    }

    /// Equilibria of one chunk.
    fn solve_chunk(&mut self, chunk: &[JointVector]) -> Result<Vec<Equilibrium>, GpuError> {
        let since = Instant::now();
        let (gaps, touching) = self.pipeline.detection().detect(&self.context, chunk)?;
        self.chunk.adapt(chunk.len(), since.elapsed());
        let mut results: Vec<Equilibrium> = gaps.iter().zip(chunk).map(|(&gap, q)| free(gap, q.len())).collect();
        self.decide_free(chunk, &touching, &mut results);
        let mut flight: Option<PendingBatch> = None;
        let mut first = 0;
        while first < touching.len() || flight.is_some() {
            let previous = flight.take();
            if first < touching.len() {
                let count = self.batch.now.min(touching.len() - first);
                let set = previous.as_ref().map_or(0, |flight: &PendingBatch| 1 - flight.set);
                let submission = self.pipeline.solve(&self.context, first, count, set);
                flight = Some(PendingBatch { first, count, set, submission, since: Instant::now() });
                first += count;
            }
            if let Some(done) = previous {
                let members = &touching[done.first..done.first + done.count];
                let landed = self.land(chunk, members, &done, &mut results)?;
                // The next one began when this one ended.
                if let Some(next) = &mut flight {
                    next.since = landed;
                }
            }
        }
        Ok(results)
    }

    /// Solves on the CPU what touches nothing but lies within what its gap is known to of contact, and where gaps are
    /// those to flat triangles measures those to a smooth surface.
    fn decide_free(&mut self, chunk: &[JointVector], touching: &[u32], results: &mut [Equilibrium]) {
        let mut free = vec![true; chunk.len()];
        touching.iter().for_each(|&member| free[member as usize] = false);
        let measured = self.pipeline.detection().is_exact() || self.model.surface.smooth.is_none();
        let (undecided, others): (Vec<usize>, Vec<usize>) =
            (0..chunk.len()).filter(|&k| free[k]).partition(|&k| self.is_undecided(&results[k]));
        self.left_to_cpu += undecided.len();
        let open = if measured { undecided } else { [undecided, others].concat() };
        let decided = self.cpu.map(&open, |solver, &k| solver.solve(&chunk[k]));
        for (k, result) in open.into_iter().zip(decided) {
            results[k] = result;
        }
    }

    /// Waits for a batch and stores its results; when the device had done with it.
    fn land(
        &mut self,
        chunk: &[JointVector],
        members: &[u32],
        flight: &PendingBatch,
        results: &mut [Equilibrium],
    ) -> Result<Instant, GpuError> {
        let (outcomes, touches) = self.pipeline.collect(&self.context, flight.set, flight.count, &flight.submission)?;
        let landed = Instant::now();
        self.batch.adapt(flight.count, landed - flight.since);
        let places: Vec<usize> = (0..members.len()).collect();
        let solved = self.cpu.map(&places, |solver, &place| {
            let member = members[place] as usize;
            let list = &touches[place * self.room.contacts..][..self.room.contacts];
            let mut result = unpack(self.model, solver, &chunk[member], &outcomes[place], list)?;
            if self.model.contact.algorithm == Algorithm::Paper {
                result.gap = results[member].gap;
            }
            Some(if self.is_undecided(&result) { (solver.solve(&chunk[member]), 1) } else { (result, 0) })
        });
        let unwritten = solved.iter().filter(|result| result.is_none()).count();
        if unwritten > 0 {
            return Err(GpuError::NeverWritten { count: unwritten, total: members.len() });
        }
        for (&member, (result, left)) in members.iter().zip(solved.into_iter().flatten()) {
            results[member as usize] = result;
            self.left_to_cpu += left;
        }
        Ok(landed)
    }

    /// Whether f32 or the kernel's room left open what the equilibrium is. The paper's iteration often does not
    /// converge in any precision, and is then left at that.
    fn is_undecided(&self, result: &Equilibrium) -> bool {
        result.gap.is_nan()
            || result.gap.abs() <= self.pipeline.detection().gap_band()
            || match result.status {
                Status::Contact => result.residual.is_nan() || result.residual > GPU_RESOLVED_RESIDUAL,
                Status::Unconverged => self.model.contact.algorithm != Algorithm::Paper,
                Status::Overflow => true,
                Status::Free | Status::Outside => false,
            }
    }

    /// Opens the device again, with half the room.
    fn reopen(&mut self) -> Result<(), GpuError> {
        let context = Arc::new(self.context.reopen()?);
        let room = self.room.half();
        self.pipeline = Pipeline::new(&context, self.model, room)?;
        self.context = context;
        self.room = room;
        for (pace, most) in [(&mut self.chunk, room.chunk), (&mut self.batch, room.batch)] {
            *pace = AdaptiveSize { now: (pace.now / 2).clamp(1, most), most };
        }
        Ok(())
    }
}

/// No contact.
pub(super) fn free(gap: f64, joints: usize) -> Equilibrium {
    Equilibrium {
        status: Status::Free,
        iterations: 0,
        residual: 0.0,
        energy: 0.0,
        gap,
        torque: JointVector::zeros(joints),
        forces: Vec::new(),
        tangent: None,
        touches: Vec::new(),
    }
}

impl Backend for GpuSolver<'_> {
    type Error = GpuError;

    /// Equilibria of `configurations`, in the same order. A device that is lost, hangs or runs out of memory is opened
    /// again, once a chunk, with half the room.
    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, GpuError> {
        let mut results = Vec::with_capacity(configurations.len());
        while results.len() < configurations.len() {
            let rest = &configurations[results.len()..];
            let solved = match self.solve_chunk(&rest[..rest.len().min(self.chunk.now)]) {
                Err(GpuError::Lost(_) | GpuError::TimedOut(_) | GpuError::OutOfMemory(_)) => {
                    self.reopen()?;
                    self.solve_chunk(&rest[..rest.len().min(self.chunk.now)])?
                }
                outcome => outcome?,
            };
            results.extend(solved);
        }
        Ok(results)
    }

    fn left_to_cpu(&self) -> usize {
        self.left_to_cpu
    }
}
