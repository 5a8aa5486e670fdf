//! The search for equilibria on the device: its kernels, its buffers, and the rounds that it takes.
//!
//! Each configuration in contact has a workspace. In a round its trial displaces the surface, contacts are found, and
//! the trial is judged and the next one made; what is done leaves the list of the unfinished. A submission makes some rounds; the host asks for more while some are unfinished.

use super::{
    buffer::{Staging, StorageBuffer},
    context::Context,
    detection::Detection,
    error::GpuError,
    kernel::Kernel,
    layout::SearchParameters,
    model::DeviceModel,
    search_model::SearchModel,
    shaders::{self, Shader},
    stages::Found,
};

/// Invocations of a workgroup of the other stages; the shaders' defaults.
const PER_CONFIGURATION: u32 = 64;

/// Passes through loops after which a search goes on in another dispatch: so that one lasts no longer than a tenth of a
/// second on a GPU, of some hundred cycles a pass; and half of what llvmpipe allows, since a phase is not cut.
const HARDWARE_LOOP_BUDGET: u32 = 1 << 20;
const SOFTWARE_LOOP_BUDGET: u32 = 30_000;

/// Rounds of the first submission: the sphere scene takes the trial at rest and four steps at most, and a round of a
/// search that is done costs next to nothing. Each submission that follows makes half as many as have been made.
const FIRST_ROUNDS: usize = 6;

/// Words at the beginning of the staging buffer: configurations that are unfinished, and touches.
const HEAD_BYTES: u64 = 16;

/// Touches a configuration that are expected at first, and brought to the host with its record at most. What exceeds
/// them costs a submission more.
const FIRST_TOUCHES: f64 = 8.0;
const STAGED_TOUCHES: usize = 16;

/// Factor from the mean number of touches of one section to the room for those of the next: neighbouring sections
/// differ little.
const TOUCHES_MARGIN: f64 = 1.25;

/// Numbers of a touch: see `shaders/search_results.wgsl`.
const PRESSES_EACH: usize = 6;

/// Bytes of a record, and of the words of a touch (B).
const WORDS_BYTES: usize = size_of::<[u32; 4]>();

/// The kernels of the search.
pub(super) struct Search {
    pub model: SearchModel,
    arm: Kernel,
    /// The kernels of a round, in order; the last one lists the unfinished.
    round: Vec<Kernel>,
    count: Kernel,
    gather: Kernel,
}

/// Buffers and bindings of one section in flight.
pub(super) struct SearchLane {
    room: usize,
    parameters: StorageBuffer,
    words: StorageBuffer,
    starts: StorageBuffer,
    records: StorageBuffer,
    amounts: StorageBuffer,
    touches: StorageBuffer,
    presses: StorageBuffer,
    staging: Staging,
    arm: wgpu::BindGroup,
    round: Vec<wgpu::BindGroup>,
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
        let lanes = ("WORKGROUP", f64::from(context.adapter().lanes()));
        let budget = if context.adapter().hardware { HARDWARE_LOOP_BUDGET } else { SOFTWARE_LOOP_BUDGET };
        let budget = ("LOOP_BUDGET", f64::from(budget));
        let flag = |name, is_set| (name, f64::from(u8::from(is_set)));
        let smooth = flag("SMOOTH", model.is_smooth);
        let law = [flag("ISOTROPIC", model.is_isotropic), flag("WITH_TANGENT", model.with_tangent)];
        let kernel = |shaders: &[Shader; 2], overrides: &[(&str, f64)]| {
            Kernel::new(context, model.precision.of(shaders), &[&law, overrides].concat())
        };
        let nodes = ("NODE_WORDS", f64::from(model.parameters.covered.div_ceil(u32::BITS)));
        let detect = kernel(&shaders::SEARCH_DETECT, &[smooth, lanes, budget, nodes])?;
        let unfinished = kernel(&shaders::SEARCH_UNFINISHED, &[])?;
        let judge = kernel(&shaders::SEARCH_JUDGE, &[lanes, budget])?;
        let round = vec![detect, judge, kernel(&shaders::SEARCH_STEP, &[lanes, budget])?, unfinished];
        Ok(Self {
            arm: kernel(&shaders::SEARCH_ARM, &[])?,
            round,
            count: kernel(&shaders::SEARCH_COUNT, &[])?,
            gather: kernel(&shaders::SEARCH_GATHER, &[])?,
            model,
        })
    }

    /// Bytes of what the stages read of the object (B).
    fn object_bytes(&self) -> u64 {
        let SearchModel { surface, mesh, compliance, .. } = &self.model;
        surface.size() + mesh.size() + compliance.size()
    }

    /// Amounts of one record: residual, energy, torque and, where it is wanted, the tangent.
    fn amounts_each(&self) -> usize {
        let joints = self.model.parameters.joints as usize;
        2 + joints + if self.model.with_tangent { joints * joints } else { 0 }
    }

    /// Bytes of the records, the amounts, and the words and numbers of `touches` touches, of `count` configurations
    /// (B).
    fn result_bytes(&self, count: usize, touches: usize) -> [u64; 4] {
        let number = self.model.precision.size();
        let amounts = number * self.amounts_each() * count;
        let presses = number * PRESSES_EACH * touches;
        [WORDS_BYTES * count, amounts, WORDS_BYTES * touches, presses].map(|bytes| bytes as u64)
    }
}

impl SearchLane {
    /// Buffers and bindings for what `detection` finds in contact, `room` configurations at a time.
    pub fn new(
        context: &Context,
        search: &Search,
        device: &DeviceModel,
        detection: &Detection,
        room: usize,
    ) -> Result<Self, GpuError> {
        let SearchModel { surface, mesh, compliance, precision, .. } = &search.model;
        let parameters = SearchParameters { room: room as u32, ..search.model.parameters };
        let buffer = |what, bytes: u64| StorageBuffer::new(context, what, bytes);
        let uniform = StorageBuffer::uniform(context, "parameters of the search", &parameters.encode(*precision))?;
        // The number of the unfinished stands beside their lists.
        let [word_bytes, real_bytes, vector_bytes] = search.model.workspace().map(|bytes| room as u64 * bytes);
        let words = buffer("words of the search", 4 + word_bytes)?;
        let reals = buffer("reals of the search", real_bytes)?;
        let vectors = buffer("vectors of the search", vector_bytes)?;
        let starts = buffer("starts of touches", 4 * (room as u64 + 1))?;
        let [record_bytes, amount_bytes, touch_bytes, press_bytes] =
            search.result_bytes(room, parameters.contacts as usize * room);
        let records = buffer("records", record_bytes)?;
        let amounts = buffer("amounts", amount_bytes)?;
        let touches = buffer("touches", touch_bytes)?;
        let presses = buffer("presses", press_bytes)?;
        let staged: u64 = search.result_bytes(room, STAGED_TOUCHES * room).iter().sum();
        let staging = Staging::new(context, HEAD_BYTES + staged)?;
        let buffers = [
            ("parameters", &uniform),
            ("surface", surface),
            ("mesh", mesh),
            ("compliance", compliance),
            ("chain", &device.chain),
            ("motions", detection.motions()),
            ("placed", detection.placed()),
            ("positions", detection.positions()),
            ("list", detection.list()),
            ("words", &words),
            ("reals", &reals),
            ("vectors", &vectors),
            ("starts", &starts),
            ("records", &records),
            ("amounts", &amounts),
            ("touches", &touches),
            ("presses", &presses),
        ];
        let bind = |kernel: &Kernel| kernel.bind(context, &buffers);
        Ok(Self {
            room,
            arm: bind(&search.arm)?,
            round: search.round.iter().map(bind).collect::<Result<_, _>>()?,
            count: bind(&search.count)?,
            gather: bind(&search.gather)?,
            parameters: uniform,
            words,
            starts,
            records,
            amounts,
            touches,
            presses,
            staging,
            touches_each: FIRST_TOUCHES,
            staged: 0,
        })
    }

    /// Submits the search for the first `count` configurations in contact of what was detected, or for as many of them
    /// as there is room for.
    pub fn solve(&mut self, context: &Context, search: &Search, count: usize) -> wgpu::SubmissionIndex {
        self.solve_from(context, search, 0, count)
    }

    /// The same for those behind the `first` ones, which are solved already.
    fn solve_from(&mut self, context: &Context, search: &Search, first: usize, count: usize) -> wgpu::SubmissionIndex {
        let batch = self.batch(first, count);
        let configurations = batch as u32;
        let (room, first) = (self.room as u32, first as u32);
        let parameters = SearchParameters { configurations, first, room, ..search.model.parameters };
        self.parameters.write(context, &parameters.encode(search.model.precision));
        self.staged = (self.touches_each * TOUCHES_MARGIN * batch as f64).ceil() as usize;
        self.staged = self.staged.min(batch * STAGED_TOUCHES.min(parameters.contacts as usize));
        let mut encoder = context.device.create_command_encoder(&Default::default());
        self.words.clear(&mut encoder, 4 * (2 * self.room as u64 + 1 + batch as u64 * u64::from(parameters.words)));
        let bytes = 64 * u64::from(configurations * parameters.joints);
        let arm = search.arm.dispatch(&self.arm, configurations.div_ceil(PER_CONFIGURATION), bytes);
        context.record(&mut encoder, [arm]);
        self.record_rounds(context, search, &mut encoder, batch, FIRST_ROUNDS);
        self.record_results(context, search, &mut encoder, batch);
        context.queue.submit([encoder.finish()])
    }

    /// How many of `count` configurations are solved together behind the `first` ones: those that are left are divided
    /// evenly.
    fn batch(&self, first: usize, count: usize) -> usize {
        let left = count - first;
        left.div_ceil(left.div_ceil(self.room).max(1))
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
        let last = search.round.len() - 1;
        let round = search.round.iter().zip(&self.round).enumerate().map(|(k, (kernel, bound))| {
            let (workgroups, bytes) =
                if k < last { (count, search.object_bytes()) } else { (1, 16 * u64::from(count)) };
            kernel.dispatch(bound, workgroups, bytes)
        });
        context.record(encoder, std::iter::repeat_n(round, rounds).flatten());
    }

    /// Records that what was found of `count` configurations comes to the host.
    fn record_results(&self, context: &Context, search: &Search, encoder: &mut wgpu::CommandEncoder, count: usize) {
        let rows = count as u32 * search.model.parameters.contacts;
        let each = search.result_bytes(count, self.staged);
        let bytes = each.iter().sum();
        let count_up = search.count.dispatch(&self.count, 1, bytes);
        let gather = search.gather.dispatch(&self.gather, rows.div_ceil(PER_CONFIGURATION), bytes);
        context.record(encoder, [count_up, gather]);
        self.staging.copy_from(encoder, 0, (&self.words, 8 * self.room as u64), 4);
        self.staging.copy_from(encoder, 4, (&self.starts, 4 * count as u64), 4);
        let mut place = HEAD_BYTES;
        for (buffer, bytes) in [&self.records, &self.amounts, &self.touches, &self.presses].into_iter().zip(each) {
            self.staging.copy(encoder, place, buffer, bytes);
            place += bytes;
        }
    }

    /// Waits for a submission of [`SearchLane::solve`], and solves what there was no room for, until all `count` are
    /// done.
    pub fn found(
        &mut self,
        context: &Context,
        search: &Search,
        count: usize,
        ticket: &wgpu::SubmissionIndex,
    ) -> Result<Found, GpuError> {
        let mut batch = self.batch(0, count);
        let mut found = self.finished(context, search, batch, ticket)?;
        let mut first = batch;
        while first < count {
            let ticket = self.solve_from(context, search, first, count);
            batch = self.batch(first, count);
            found.extend(self.finished(context, search, batch, &ticket)?);
            first += batch;
        }
        Ok(found)
    }

    /// Waits for one batch, and makes more rounds until all `count` of it are done.
    fn finished(
        &mut self,
        context: &Context,
        search: &Search,
        count: usize,
        ticket: &wgpu::SubmissionIndex,
    ) -> Result<Found, GpuError> {
        let mut again = None;
        let mut made = FIRST_ROUNDS;
        loop {
            let (unfinished, total, mut found) = self.read(context, search, count, again.as_ref().unwrap_or(ticket))?;
            if unfinished > 0 {
                let mut encoder = context.device.create_command_encoder(&Default::default());
                self.record_rounds(context, search, &mut encoder, unfinished, made / 2);
                self.record_results(context, search, &mut encoder, count);
                again = Some(context.queue.submit([encoder.finish()]));
                made += made / 2;
                continue;
            }
            if total > self.staged {
                let precision = search.model.precision;
                found.touches = self.touches.read(context, total)?;
                let bytes = self.presses.read(context, precision.size() * PRESSES_EACH * total)?;
                found.presses = precision.decode(&bytes);
            }
            self.touches_each = total as f64 / count.max(1) as f64;
            if let Some(stopwatch) = &context.stopwatch {
                let (before, each) = (2 * self.room + 1, search.model.parameters.words as usize);
                let words = self.words.read(context, before + count * each)?;
                stopwatch.count(&words[before..], each);
            }
            return Ok(found);
        }
    }

    /// Returns how many configurations are unfinished, the number of all touches, and what was staged.
    fn read(
        &self,
        context: &Context,
        search: &Search,
        count: usize,
        ticket: &wgpu::SubmissionIndex,
    ) -> Result<(usize, usize, Found), GpuError> {
        let each = search.result_bytes(count, self.staged).map(|bytes| bytes as usize);
        let bytes = HEAD_BYTES + each.iter().sum::<usize>() as u64;
        self.staging.take(context, ticket, bytes, |bytes| {
            let (head, mut rest) = bytes.split_at(HEAD_BYTES as usize);
            let head: Vec<u32> = bytemuck::pod_collect_to_vec(head);
            let (unfinished, total) = (head[0] as usize, head[1] as usize);
            let [records, amounts, touches, presses] = each.map(|bytes| {
                let (own, behind) = rest.split_at(bytes);
                rest = behind;
                own
            });
            let [.., touch_bytes, press_bytes] = search.result_bytes(count, total.min(self.staged));
            let found = Found {
                records: bytemuck::pod_collect_to_vec(records),
                amounts: search.model.precision.decode(amounts),
                touches: bytemuck::pod_collect_to_vec(&touches[..touch_bytes as usize]),
                presses: search.model.precision.decode(&presses[..press_bytes as usize]),
            };
            (unfinished, total, found)
        })
    }
}
