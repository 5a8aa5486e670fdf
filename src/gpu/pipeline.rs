//! The stages on a device: their kernels, their buffers, and the submissions they make up.

use super::{
    context::{Context, GpuError},
    detection::{Detection, DoubleModel},
    kernel::{Access, Dispatch, Kernel, Staging, StorageBuffer},
    layout::{Parameters, SolverResult, Touch},
    model::{DeviceModel, LANES},
    shaders,
    stages::{Detected, Found, GapPrecision, StageRoom, Stages},
};
use crate::{JointVector, contact, scene::Algorithm};
use std::sync::Arc;

/// Bounds on what a device is given.
#[derive(Clone, Copy, Debug)]
pub struct BatchCapacity {
    /// Most configurations placed and tested for contact at a time.
    pub chunk: usize,
    /// Most configurations solved by one dispatch.
    pub batch: usize,
    /// Most proxy nodes in contact in one configuration, at most 32; more are solved on the CPU.
    pub contacts: usize,
    /// Whether the proxy is placed and tested for contact in f64 where the device has it.
    pub double: bool,
    /// How many sections of configurations are under way at a time, each with buffers of its own.
    pub in_flight: usize,
}

impl Default for BatchCapacity {
    /// Enough to keep a large GPU busy while the host turns to what it has found.
    fn default() -> Self {
        Self { chunk: 1 << 16, batch: 1 << 15, contacts: 32, double: true, in_flight: 3 }
    }
}

/// Most memory that one buffer takes, on a GPU and on a software rasteriser, whose memory is the host's [B]. There are
/// [`BUFFERS`] of such a size a section in flight. No adapter tells how much memory it has: where it runs out, there is
/// another try with half the room.
const HARDWARE_BUDGET: u64 = 128 << 20;
const SOFTWARE_BUDGET: u64 = 16 << 20;

/// Touches a configuration in contact that are brought to the host with its result at first, and at most. What exceeds
/// them costs a submission more.
const FIRST_TOUCHES: f64 = 4.0;
const STAGED_TOUCHES: usize = 8;

/// What the mean number of touches of one section is raised by to hold those of the next: neighbouring sections differ
/// little.
const TOUCHES_MARGIN: f64 = 1.25;

impl BatchCapacity {
    /// Cut to what buffers may take.
    fn within(self, context: &Context, model: &contact::Model<'_>) -> Self {
        let budget = if context.adapter().hardware { HARDWARE_BUDGET } else { SOFTWARE_BUDGET };
        let budget = budget.min(context.binding_limit());
        let fit = |bytes: usize| (budget as usize / bytes.max(1)).max(1);
        let nodes = model.chain.nodes.len();
        // A proxy node has one contact.
        let contacts = self.contacts.clamp(1, 32).min(nodes);
        let clusters = model.object.triangles.len().div_ceil(shaders::CLUSTER);
        let workspace = 16 * (model.compliance.nodes.len() + 2 * clusters);
        let touches = size_of::<Touch>() * contacts;
        let placed = 24 * nodes.max(model.chain.joints.len());
        let chunk = self.chunk.clamp(1, fit(placed.max(touches)));
        Self { chunk, batch: self.batch.clamp(1, fit(workspace.max(touches)).min(chunk)), contacts, ..self }
    }

    /// Half of each, contacts aside.
    fn half(self) -> Self {
        Self { chunk: (self.chunk / 2).max(1), batch: (self.batch / 2).max(1), ..self }
    }
}

/// What one section in flight has of its own.
struct Lane {
    detection: Detection,
    parameters: StorageBuffer,
    /// Of one batch.
    results: StorageBuffer,
    /// Number of touches of the section so far.
    total: StorageBuffer,
    /// Touches of the section, without gaps.
    touches: StorageBuffer,
    /// Results of the section, the number of its touches, and the first of these.
    staging: Staging,
    /// How many touches were brought into `staging`.
    staged: usize,
    equilibrium: wgpu::BindGroup,
    count: wgpu::BindGroup,
    gather: wgpu::BindGroup,
}

/// Bytes of the number of touches in the staging buffer [B].
const TOTAL_BYTES: u64 = 16;

/// The kernels behind detection.
struct Kernels {
    equilibrium: Kernel,
    count: Kernel,
    gather: Kernel,
}

/// All stages of a model on a device.
pub struct Pipeline<'a> {
    context: Arc<Context>,
    model: &'a contact::Model<'a>,
    device: DeviceModel,
    room: BatchCapacity,
    kernels: Kernels,
    /// Bytes that `equilibrium` reads and writes for one configuration, besides its result [B].
    own_bytes: u64,
    lanes: Vec<Lane>,
    /// Touches a configuration in contact that are expected.
    touches_each: f64,
}

impl<'a> Pipeline<'a> {
    /// The stages of `model` on the device of `context`, with `room` or as much of it as the device has.
    pub(super) fn new(
        context: Arc<Context>,
        model: &'a contact::Model<'a>,
        room: BatchCapacity,
    ) -> Result<Self, GpuError> {
        let mut room = room.within(&context, model);
        loop {
            match Self::with_room(Arc::clone(&context), model, room) {
                Err(GpuError::OutOfMemory(_)) if room.chunk > 1 => room = room.half(),
                made => return made,
            }
        }
    }

    fn with_room(context: Arc<Context>, model: &'a contact::Model<'a>, room: BatchCapacity) -> Result<Self, GpuError> {
        let device = DeviceModel::new(&context, model)?;
        let kernels = Kernels::new(&context, model, room)?;
        let in_double = room.double && context.adapter().double;
        let double = in_double.then(|| DoubleModel::new(&context, model)).transpose()?;
        let lanes = (0..room.in_flight.max(1)).map(|_| {
            let detection = Detection::new(&context, model, &device, room.chunk, double.as_ref())?;
            Lane::new(&context, &device, &kernels, room, detection)
        });
        let lanes = lanes.collect::<Result<_, GpuError>>()?;
        // Its number and places are read, its workspace is written and read.
        let own_bytes = 4 + 16 * u64::from(device.parameters.proxy_nodes) + 2 * 16 * device.workspace();
        Ok(Self { context, model, device, room, kernels, own_bytes, lanes, touches_each: FIRST_TOUCHES })
    }

    /// The device.
    pub(super) fn context(&self) -> &Context {
        &self.context
    }
}

impl Kernels {
    fn new(context: &Context, model: &contact::Model<'_>, room: BatchCapacity) -> Result<Self, GpuError> {
        use Access::{Read, Uniform, Write};
        let shader = match model.contact.algorithm {
            Algorithm::Paper => &shaders::PAPER,
            Algorithm::Energy | Algorithm::Linearised => &shaders::ENERGY,
        };
        let contacts = ("CONTACTS", room.contacts as f64);
        let mut overrides = vec![("WORKGROUP", f64::from(LANES)), contacts];
        if model.contact.algorithm == Algorithm::Linearised {
            overrides.push(("FROZEN", 1.0));
        }
        if !model.compliance.is_whole() {
            overrides.push(("PARTIAL", 1.0));
        }
        if model.compliance.rows_per_node == 1 {
            overrides.push(("ISOTROPIC", 1.0));
        }
        let accesses = [Uniform, Read, Read, Read, Read, Read, Write, Write, Write];
        let results = |shader| Kernel::new(context, shader, &[contacts], &[Uniform, Read, Read, Write, Write, Write]);
        Ok(Self {
            equilibrium: Kernel::new(context, shader, &overrides, &accesses)?,
            count: results(&shaders::RESULTS_COUNT)?,
            gather: results(&shaders::RESULTS_GATHER)?,
        })
    }
}

impl Lane {
    fn new(
        context: &Context,
        device: &DeviceModel,
        kernels: &Kernels,
        room: BatchCapacity,
        detection: Detection,
    ) -> Result<Self, GpuError> {
        let buffer = |what, bytes: usize| StorageBuffer::new(context, what, bytes as u64);
        let workspace = buffer("workspace", 16 * room.batch * device.workspace() as usize)?;
        let parameters = StorageBuffer::uniform(context, "parameters", &device.parameters)?;
        let results = buffer("results", size_of::<SolverResult>() * room.batch)?;
        let listed = buffer("touches of a batch", size_of::<Touch>() * room.contacts * room.batch)?;
        let starts = buffer("starts of touches", 4 * room.batch)?;
        let total = buffer("number of touches", 4)?;
        let touches = buffer("touches", size_of::<Touch>() * room.contacts * room.chunk)?;
        let staged = size_of::<Touch>() * room.contacts.min(STAGED_TOUCHES) * room.chunk;
        let staging = Staging::new(context, TOTAL_BYTES + (size_of::<SolverResult>() * room.chunk + staged) as u64)?;
        let equilibrium = [
            &parameters,
            &device.rest,
            &device.mesh,
            &device.compliance,
            detection.positions(),
            detection.list(),
            &results,
            &listed,
            &workspace,
        ];
        let compacted = [&parameters, &results, &listed, &starts, &total, &touches];
        Ok(Self {
            equilibrium: kernels.equilibrium.bind(context, &equilibrium)?,
            count: kernels.count.bind(context, &compacted)?,
            gather: kernels.gather.bind(context, &compacted)?,
            detection,
            parameters,
            results,
            total,
            touches,
            staging,
            staged: 0,
        })
    }
}

/// Invocations of a workgroup of `gather`; the shader's default.
const GATHER_WORKGROUP: u32 = 64;

impl Pipeline<'_> {
    /// Records the solution of `count` configurations in contact, from number `first` of the lane's list on.
    fn record_batch(&self, encoder: &mut wgpu::CommandEncoder, lane: &Lane, first: usize, count: usize) {
        let Self { context, device, kernels, .. } = self;
        let configurations = count as u32;
        lane.parameters.write(context, &[Parameters { configurations, first: first as u32, ..device.parameters }]);
        let (result_bytes, list_bytes) = self.bytes(count);
        lane.results.clear(encoder, result_bytes);
        let each = device.object_bytes() + self.own_bytes * count as u64 + result_bytes + list_bytes;
        let starts = 4 * u64::from(configurations);
        let dispatch = |kernel, bound, workgroups, bytes| Dispatch { kernel, bound, workgroups, bytes };
        let slots = configurations * self.room.contacts as u32;
        context.record(
            encoder,
            [
                dispatch(&kernels.equilibrium, &lane.equilibrium, configurations, each),
                dispatch(&kernels.count, &lane.count, 1, result_bytes + starts),
                dispatch(
                    &kernels.gather,
                    &lane.gather,
                    slots.div_ceil(GATHER_WORKGROUP),
                    result_bytes + starts + 2 * list_bytes,
                ),
            ],
        );
        let place = (size_of::<SolverResult>() * first) as u64;
        lane.staging.copy(encoder, TOTAL_BYTES + place, &lane.results, result_bytes);
    }

    /// Bytes of the results of `count` configurations, and of all the touches that they have room for [B].
    fn bytes(&self, count: usize) -> (u64, u64) {
        ((size_of::<SolverResult>() * count) as u64, (size_of::<Touch>() * self.room.contacts * count) as u64)
    }
}

impl Stages for Pipeline<'_> {
    type Ticket = wgpu::SubmissionIndex;

    fn room(&self) -> StageRoom {
        StageRoom { lanes: self.lanes.len(), section: self.room.chunk, batch: self.room.batch }
    }

    fn precision(&self) -> GapPrecision {
        let detection = &self.lanes[0].detection;
        GapPrecision { band: detection.gap_band(), exact: detection.is_exact() }
    }

    fn detect(&mut self, lane: usize, section: &[JointVector]) -> Self::Ticket {
        self.lanes[lane].detection.submit(&self.context, section)
    }

    fn detected(&mut self, lane: usize, count: usize, ticket: &Self::Ticket) -> Result<Detected, GpuError> {
        self.lanes[lane].detection.collect(&self.context, count, ticket)
    }

    fn solve(&mut self, lane: usize, count: usize, batch: usize) -> Self::Ticket {
        let staged = (self.touches_each * TOUCHES_MARGIN * count as f64).ceil() as usize;
        let staged = staged.min(self.room.contacts.min(STAGED_TOUCHES) * count);
        self.lanes[lane].staged = staged;
        let lane = &self.lanes[lane];
        let mut first = 0;
        loop {
            let mut encoder = self.context.device.create_command_encoder(&Default::default());
            if first == 0 {
                lane.total.clear(&mut encoder, 4);
            }
            let batch = batch.min(count - first);
            self.record_batch(&mut encoder, lane, first, batch);
            first += batch;
            if first == count {
                lane.staging.copy(&mut encoder, 0, &lane.total, 4);
                let behind = TOTAL_BYTES + self.bytes(count).0;
                lane.staging.copy(&mut encoder, behind, &lane.touches, (size_of::<Touch>() * staged) as u64);
                return self.context.queue.submit([encoder.finish()]);
            }
            // Each batch a submission: no submission lasts longer than one.
            self.context.queue.submit([encoder.finish()]);
        }
    }

    fn found(&mut self, lane: usize, count: usize, ticket: &Self::Ticket) -> Result<Found, GpuError> {
        let lane = &self.lanes[lane];
        let results_end = TOTAL_BYTES + self.bytes(count).0;
        let bytes = results_end + (size_of::<Touch>() * lane.staged) as u64;
        let (mut found, total) = lane.staging.take(&self.context, ticket, bytes, |bytes| {
            let (head, touches) = bytes.split_at(results_end as usize);
            let (total, results) = head.split_at(TOTAL_BYTES as usize);
            let total = bytemuck::pod_read_unaligned::<u32>(&total[..4]) as usize;
            let there = size_of::<Touch>() * total.min(lane.staged);
            let touches = bytemuck::pod_collect_to_vec(&touches[..there]);
            (Found { results: bytemuck::pod_collect_to_vec(results), touches }, total)
        })?;
        let told: usize = found.results.iter().map(|result| result.touches as usize).sum();
        if told != total {
            return Err(GpuError::NeverWritten { count: told.abs_diff(total), total: told });
        }
        if total > lane.staged {
            found.touches = lane.touches.read(&self.context, total)?;
        }
        self.touches_each = total as f64 / count.max(1) as f64;
        Ok(found)
    }

    fn reopen(&mut self) -> Result<(), GpuError> {
        let context = Arc::new(self.context.reopen()?);
        *self = Self::new(context, self.model, self.room.half())?;
        Ok(())
    }
}
