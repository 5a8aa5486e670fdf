//! The search for equilibria in f64 on the device: its kernels, its buffers, and the rounds that it takes.
//!
//! Each configuration in contact has a workspace. In a round its trial displaces the surface, contacts are found, and
//! the trial is judged and the next one made; what is done leaves the list of the unfinished. A submission makes some
//! rounds; the host asks for more while some are unfinished.

use super::{
    context::{Context, GpuError},
    detection::{Detection, DoubleModel},
    forces::TOUCHES_MARGIN,
    kernel::{Dispatch, Kernel, Staging, StorageBuffer},
    layout::{SearchParameters, SearchTouch},
    search_model::SearchModel,
    shaders::{self, Shader},
    stages::{Found, Solved},
};

/// Invocations of a workgroup that searches: as many as GPUs run in step, and as a software rasteriser does.
const HARDWARE_LANES: u32 = 32;
const SOFTWARE_LANES: u32 = 8;

/// Invocations of a workgroup of the other stages; the shaders' defaults.
const PER_CONFIGURATION: u32 = 64;

/// Rounds of the first submission: the sphere scene takes three steps and the trial at rest. Each submission that
/// follows makes half as many as have been made.
const FIRST_ROUNDS: usize = 4;

/// Words at the beginning of the staging buffer: configurations that are unfinished, and touches.
const HEAD_BYTES: u64 = 16;

/// Touches a configuration that are expected at first, and brought to the host with its record at most. What exceeds
/// them costs a submission more.
const FIRST_TOUCHES: f64 = 8.0;
const STAGED_TOUCHES: usize = 16;

/// The kernels of the search.
pub(super) struct Search {
    pub model: SearchModel,
    arm: Kernel,
    detect: Kernel,
    judge: Kernel,
    step: Kernel,
    unfinished: Kernel,
    count: Kernel,
    gather: Kernel,
}

/// What one section in flight has of its own.
pub(super) struct SearchLane {
    room: usize,
    parameters: StorageBuffer,
    words: StorageBuffer,
    starts: StorageBuffer,
    records: StorageBuffer,
    amounts: StorageBuffer,
    touches: StorageBuffer,
    staging: Staging,
    arm: wgpu::BindGroup,
    detect: wgpu::BindGroup,
    judge: wgpu::BindGroup,
    step: wgpu::BindGroup,
    unfinished: wgpu::BindGroup,
    count: wgpu::BindGroup,
    gather: wgpu::BindGroup,
    /// Touches that one configuration is expected to have.
    touches_each: f64,
    /// How many touches were brought to `staging`.
    staged: usize,
}

impl Search {
    /// Compiles the kernels for `model`.
    pub fn new(context: &Context, model: SearchModel) -> Result<Self, GpuError> {
        let lanes = if context.adapter().hardware { HARDWARE_LANES } else { SOFTWARE_LANES };
        let lanes = ("WORKGROUP", f64::from(lanes));
        let isotropic = ("ISOTROPIC", f64::from(u8::from(model.is_isotropic)));
        let smooth = ("SMOOTH", f64::from(u8::from(model.is_smooth)));
        let kernel = |shader: &Shader, overrides: &[(&str, f64)]| {
            Kernel::new(context, shader, &[&[isotropic], overrides].concat())
        };
        Ok(Self {
            arm: kernel(&shaders::SEARCH_ARM, &[])?,
            detect: kernel(&shaders::SEARCH_DETECT, &[smooth, lanes])?,
            judge: kernel(&shaders::SEARCH_JUDGE, &[lanes])?,
            step: kernel(&shaders::SEARCH_STEP, &[lanes])?,
            unfinished: kernel(&shaders::SEARCH_UNFINISHED, &[])?,
            count: kernel(&shaders::SEARCH_COUNT, &[])?,
            gather: kernel(&shaders::SEARCH_GATHER, &[])?,
            model,
        })
    }

    /// Bytes of what the stages read of the object [B].
    fn object_bytes(&self) -> u64 {
        let SearchModel { surface, mesh, compliance, .. } = &self.model;
        surface.size() + mesh.size() + compliance.size()
    }

    /// Amounts of one record: residual, energy, torque and, where it is wanted, the tangent.
    fn amounts_each(&self) -> usize {
        let SearchParameters { joints, with_tangent, .. } = self.model.parameters;
        (2 + joints + with_tangent * joints * joints) as usize
    }
}

impl SearchLane {
    /// Room for the configurations in contact of what `detection` places, `room` of them.
    pub fn new(
        context: &Context,
        search: &Search,
        double: &DoubleModel,
        detection: &Detection,
        room: usize,
    ) -> Result<Self, GpuError> {
        let parameters = SearchParameters { room: room as u32, ..search.model.parameters };
        let buffer = |what, bytes: usize| StorageBuffer::new(context, what, bytes as u64);
        let uniform = StorageBuffer::uniform(context, "parameters of the search", &parameters)?;
        let words = buffer("words of the search", 4 * (2 * room + 1 + room * parameters.words as usize))?;
        let reals = buffer("reals of the search", room * search.model.workspace())?;
        let starts = buffer("starts of touches", 4 * (room + 1))?;
        let records = buffer("records", size_of::<[u32; 4]>() * room)?;
        let amounts = buffer("amounts", size_of::<f64>() * search.amounts_each() * room)?;
        let touches = buffer("touches", size_of::<SearchTouch>() * parameters.contacts as usize * room)?;
        let staged = size_of::<SearchTouch>() * STAGED_TOUCHES * room;
        let staging = Staging::new(context, HEAD_BYTES + records.size() + amounts.size() + staged as u64)?;
        let placed = detection.placed().ok_or(GpuError::Unsupported("f64"))?;
        let SearchModel { surface, mesh, compliance, .. } = &search.model;
        let buffers = [
            ("parameters", &uniform),
            ("surface", surface),
            ("mesh", mesh),
            ("compliance", compliance),
            ("chain", &double.chain),
            ("motions", detection.motions()),
            ("placed", placed),
            ("positions", detection.positions()),
            ("list", detection.list()),
            ("words", &words),
            ("reals", &reals),
            ("starts", &starts),
            ("records", &records),
            ("amounts", &amounts),
            ("touches", &touches),
        ];
        let bind = |kernel: &Kernel| kernel.bind(context, &buffers);
        Ok(Self {
            room,
            arm: bind(&search.arm)?,
            detect: bind(&search.detect)?,
            judge: bind(&search.judge)?,
            step: bind(&search.step)?,
            unfinished: bind(&search.unfinished)?,
            count: bind(&search.count)?,
            gather: bind(&search.gather)?,
            parameters: uniform,
            words,
            starts,
            records,
            amounts,
            touches,
            staging,
            touches_each: FIRST_TOUCHES,
            staged: 0,
        })
    }

    /// Submits the search for the first `count` configurations in contact of what was detected.
    pub fn solve(&mut self, context: &Context, search: &Search, count: usize) -> wgpu::SubmissionIndex {
        let configurations = count as u32;
        let parameters = SearchParameters { configurations, room: self.room as u32, ..search.model.parameters };
        self.parameters.write(context, &[parameters]);
        self.staged = (self.touches_each * TOUCHES_MARGIN * count as f64).ceil() as usize;
        self.staged = self.staged.min(count * STAGED_TOUCHES.min(parameters.contacts as usize));
        let mut encoder = context.device.create_command_encoder(&Default::default());
        self.words.clear(&mut encoder, 4 * (2 * self.room as u64 + 1 + count as u64 * u64::from(parameters.words)));
        let arm = Dispatch {
            kernel: &search.arm,
            bound: &self.arm,
            workgroups: configurations.div_ceil(PER_CONFIGURATION),
            bytes: 64 * u64::from(configurations * parameters.joints),
        };
        context.record(&mut encoder, [arm]);
        self.record_rounds(context, search, &mut encoder, count, FIRST_ROUNDS);
        self.record_results(context, search, &mut encoder, count);
        context.queue.submit([encoder.finish()])
    }

    /// Records rounds of at most `count` unfinished configurations.
    fn record_rounds(
        &self,
        context: &Context,
        search: &Search,
        encoder: &mut wgpu::CommandEncoder,
        count: usize,
        rounds: usize,
    ) {
        let count = count as u32;
        let bytes = search.object_bytes();
        let dispatch = |kernel, bound| Dispatch { kernel, bound, workgroups: count, bytes };
        let round = [
            dispatch(&search.detect, &self.detect),
            dispatch(&search.judge, &self.judge),
            dispatch(&search.step, &self.step),
            Dispatch {
                kernel: &search.unfinished,
                bound: &self.unfinished,
                workgroups: 1,
                bytes: 16 * u64::from(count),
            },
        ];
        context.record(encoder, std::iter::repeat_n(round, rounds).flatten());
    }

    /// Records that what was found of `count` configurations comes to the host.
    fn record_results(&self, context: &Context, search: &Search, encoder: &mut wgpu::CommandEncoder, count: usize) {
        let rows = count as u32 * search.model.parameters.contacts;
        let bytes = self.result_bytes(search, count) + (size_of::<SearchTouch>() * self.staged) as u64;
        let dispatch = |kernel, bound, workgroups| Dispatch { kernel, bound, workgroups, bytes };
        let gather = dispatch(&search.gather, &self.gather, rows.div_ceil(PER_CONFIGURATION));
        context.record(encoder, [dispatch(&search.count, &self.count, 1), gather]);
        let (records, amounts) = self.split_bytes(search, count);
        self.staging.copy_from(encoder, 0, (&self.words, 8 * self.room as u64), 4);
        self.staging.copy_from(encoder, 4, (&self.starts, 4 * count as u64), 4);
        self.staging.copy(encoder, HEAD_BYTES, &self.records, records);
        self.staging.copy(encoder, HEAD_BYTES + records, &self.amounts, amounts);
        let touches = (size_of::<SearchTouch>() * self.staged) as u64;
        self.staging.copy(encoder, HEAD_BYTES + records + amounts, &self.touches, touches);
    }

    /// Bytes of the records and of the amounts of `count` configurations [B].
    fn split_bytes(&self, search: &Search, count: usize) -> (u64, u64) {
        let amounts = size_of::<f64>() * search.amounts_each() * count;
        ((size_of::<[u32; 4]>() * count) as u64, amounts as u64)
    }

    fn result_bytes(&self, search: &Search, count: usize) -> u64 {
        let (records, amounts) = self.split_bytes(search, count);
        HEAD_BYTES + records + amounts
    }

    /// Waits for a submission of [`SearchLane::solve`], and makes more rounds until all `count` are done.
    pub fn found(
        &mut self,
        context: &Context,
        search: &Search,
        count: usize,
        ticket: &wgpu::SubmissionIndex,
    ) -> Result<Found, GpuError> {
        let mut again = None;
        let mut made = FIRST_ROUNDS;
        loop {
            let (unfinished, total, mut solved) =
                self.read(context, search, count, again.as_ref().unwrap_or(ticket))?;
            if unfinished > 0 {
                let mut encoder = context.device.create_command_encoder(&Default::default());
                self.record_rounds(context, search, &mut encoder, unfinished, made / 2);
                self.record_results(context, search, &mut encoder, count);
                again = Some(context.queue.submit([encoder.finish()]));
                made += made / 2;
                continue;
            }
            if total > self.staged {
                solved.touches = self.touches.read(context, total)?;
            }
            self.touches_each = total as f64 / count.max(1) as f64;
            return Ok(Found::Solved(solved));
        }
    }

    /// How many configurations are unfinished, the number of all touches, and what was staged.
    fn read(
        &self,
        context: &Context,
        search: &Search,
        count: usize,
        ticket: &wgpu::SubmissionIndex,
    ) -> Result<(usize, usize, Solved), GpuError> {
        let (records, amounts) = self.split_bytes(search, count);
        let bytes = self.result_bytes(search, count) + (size_of::<SearchTouch>() * self.staged) as u64;
        self.staging.take(context, ticket, bytes, |bytes| {
            let (head, bytes) = bytes.split_at(HEAD_BYTES as usize);
            let (records, bytes) = bytes.split_at(records as usize);
            let (amounts, touches) = bytes.split_at(amounts as usize);
            let head: Vec<u32> = bytemuck::pod_collect_to_vec(head);
            let (unfinished, total) = (head[0] as usize, head[1] as usize);
            let there = size_of::<SearchTouch>() * total.min(self.staged);
            let solved = Solved {
                records: bytemuck::pod_collect_to_vec(records),
                amounts: bytemuck::pod_collect_to_vec(amounts),
                touches: bytemuck::pod_collect_to_vec(&touches[..there]),
            };
            (unfinished, total, solved)
        })
    }
}
