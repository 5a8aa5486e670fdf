//! One device that solves: its kernel, and two lanes of buffers, so that it has a section of configurations ahead while
//! the host reads the one before.

use super::{
    buffer::{Staging, StorageBuffer},
    context::Context,
    error::GpuError,
    fleet::Device,
    kernel::Kernel,
    layout::Parameters,
    model::RestModel,
    shaders::{self, MOST_CARRIERS},
};
use crate::{
    JointVector, MAX_AXES, contact,
    proxy::{Chain, ChainLink},
    scene::JointKind,
};
use bytemuck::Zeroable;
use std::sync::Arc;

/// Bounds on what a device is given.
#[derive(Clone, Copy, Debug)]
pub struct BatchCapacity {
    /// Most configurations of a dispatch. A GPU that takes 100 us for each is done in a second, before an operating
    /// system takes it for hung; a large one is busy for a millisecond.
    pub section: usize,
    /// Most rows of a configuration: proxy nodes that touch, or have been reached. What has more is solved on the CPU.
    pub rows: usize,
}

impl Default for BatchCapacity {
    fn default() -> Self {
        Self { section: 1 << 13, rows: 64 }
    }
}

/// The same of a software rasteriser, which takes a millisecond for each configuration, and allows 65,535 passes through
/// loops.
const SOFTWARE: BatchCapacity = BatchCapacity { section: 1 << 8, rows: 32 };

/// Most workgroup memory that is asked for (B): more would leave a GPU too few configurations at a time.
pub(super) const MOST_WORKGROUP_MEMORY: u32 = 32 << 10;

/// Workgroup memory of the kernel: for each row, each pair of rows, each row and joint, and besides (B). See
/// `shaders/depth_row.wgsl`, `nonnegative.wgsl` and `rest_tangent.wgsl`.
fn workgroup_memory(rows: u32, carriers: u32, joints: u32) -> u32 {
    const BESIDES: u32 = 1 << 10;
    rows * (16 * row_fours(carriers) + 16 + 5 * 4 + 4 * joints) + 4 * rows * (rows + 1) + BESIDES
}

/// Fours of a row whose facet has `carriers` fours of nodes.
fn row_fours(carriers: u32) -> u32 {
    7 + 3 * carriers
}

/// Touches that one configuration of a section is expected to have at first. What exceeds them costs a copy more.
const FIRST_TOUCHES: usize = 4;

/// Bytes of a touch, and of the number of touches before the first (B).
const TOUCH: u64 = size_of::<[u32; 12]>() as u64;
const COUNT: u64 = 16;

/// What the kernel wrote of a section: see `shaders/rest_types.wgsl`.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    /// As many words for each configuration.
    pub records: Vec<u32>,
    /// Words of each touch.
    pub touches: Vec<[u32; 12]>,
}

/// A device with the model that it solves.
pub(super) struct RestDevice {
    context: Arc<Context>,
    kernel: Kernel,
    parameters: Parameters,
    chain: Chain,
    section: usize,
    record: usize,
    lanes: [Lane; 2],
}

/// Buffers of a section under way.
struct Lane {
    parameters: StorageBuffer,
    motions: StorageBuffer,
    records: StorageBuffer,
    touches: StorageBuffer,
    staging: Staging,
    bound: wgpu::BindGroup,
    /// How many touches come to the host with the records.
    staged: usize,
    ticket: Option<wgpu::SubmissionIndex>,
}

impl RestDevice {
    /// Prepares `model` on the device of `context`, with `capacity` or as much of it as the device has.
    ///
    /// # Errors
    /// When contact is not at rest, the object does not fit the device, or the device refuses.
    pub fn new(context: Arc<Context>, model: &contact::Model<'_>, capacity: BatchCapacity) -> Result<Self, GpuError> {
        let uploaded = RestModel::new(&context, model)?;
        let parameters = uploaded.parameters;
        let is_hardware = context.adapter().hardware;
        let own = if is_hardware { BatchCapacity::default() } else { SOFTWARE };
        // A power of two, so that few kernels are compiled; a software rasteriser, which compiles for longer than it
        // computes, has one size for all scenes.
        let [nodes, carriers, joints] = if is_hardware {
            [model.chain.nodes.len().next_power_of_two() as u32, parameters.carriers, parameters.joints]
        } else {
            [u32::MAX, MOST_CARRIERS / 4, MAX_AXES as u32]
        };
        let joints = if model.with_tangent { joints } else { 0 };
        let memory = context.workgroup_memory();
        let fits = |rows: &u32| workgroup_memory(*rows, carriers, joints) <= memory;
        let most = nodes.min(capacity.rows.min(own.rows) as u32).max(1);
        let rows = (1..=most).rev().find(fits).unwrap_or(1);
        let flag = |is_set: bool| f64::from(u8::from(is_set));
        let overrides = [
            ("ROOM", f64::from(rows)),
            ("ROW_FOURS", f64::from(rows * row_fours(carriers))),
            ("DEEPENINGS", f64::from((rows * joints).max(1))),
            ("SMOOTH", flag(model.surface.smooth.is_some())),
            ("ISOTROPIC", flag(model.compliance.rows_per_node == 1)),
            ("WITH_TANGENT", flag(model.with_tangent)),
            ("WHOLE", flag(model.compliance.is_whole())),
        ];
        let kernel = Kernel::new(&context, &shaders::REST, &overrides)?;
        let record = record_length(model.chain.links.len(), model.with_tangent);
        let section = capacity.section.clamp(1, own.section);
        let room = Room { section, rows: rows as usize, record };
        let lane = |_| Lane::new(&context, &kernel, &uploaded, room);
        let lanes = [lane(0)?, lane(1)?];
        let chain = model.chain.clone();
        Ok(Self { context, kernel, parameters, chain, section, record, lanes })
    }

    /// The device.
    pub fn context(&self) -> &Context {
        &self.context
    }
}

/// Words of the record of a configuration.
pub(super) fn record_length(joints: usize, with_tangent: bool) -> usize {
    7 + joints + if with_tangent { joints * (joints + 1) / 2 } else { 0 }
}

/// Sizes of a lane.
#[derive(Clone, Copy)]
struct Room {
    section: usize,
    rows: usize,
    record: usize,
}

impl Lane {
    fn new(context: &Context, kernel: &Kernel, model: &RestModel, room: Room) -> Result<Self, GpuError> {
        let Room { section, rows, record } = room;
        let joints = model.parameters.joints as usize;
        let buffer = |what, bytes: usize| StorageBuffer::new(context, what, bytes as u64);
        let parameters = StorageBuffer::uniform(context, "parameters", &[Parameters::zeroed()])?;
        let motions = buffer("joint motions", size_of::<[f32; 2]>() * joints * section)?;
        let records = buffer("records", size_of::<u32>() * record * section)?;
        let touches = StorageBuffer::new(context, "touches", COUNT + TOUCH * (rows * section) as u64)?;
        let staging = Staging::new(context, records.size() + touches.size())?;
        let bound = kernel.bind(
            context,
            &[
                ("parameters", &parameters),
                ("chain", &model.chain),
                ("motions", &motions),
                ("surface", &model.surface),
                ("mesh", &model.mesh),
                ("compliance", &model.compliance),
                ("records", &records),
                ("touches", &touches),
            ],
        )?;
        let staged = FIRST_TOUCHES.min(rows) * section;
        Ok(Self { parameters, motions, records, touches, staging, bound, staged, ticket: None })
    }

    /// Most touches of a section.
    fn room(&self) -> usize {
        ((self.touches.size() - COUNT) / TOUCH) as usize
    }
}

impl Device for RestDevice {
    type Found = Found;

    fn section(&self) -> usize {
        self.section
    }

    fn submit(&mut self, lane: usize, section: &[JointVector]) {
        let lane = &mut self.lanes[lane];
        let count = section.len();
        // (cos q, sin q) of every link, or (q, 0) of a prismatic one: all that kinematics needs.
        let motion = |link: &ChainLink, q: f64| match link.spec.kind {
            JointKind::Revolute => [q.cos() as f32, q.sin() as f32],
            JointKind::Prismatic => [q as f32, 0.0],
        };
        let links = &self.chain.links;
        let motions: Vec<[f32; 2]> =
            section.iter().flat_map(|q| links.iter().map(|link| motion(link, link.coordinate(q)))).collect();
        lane.motions.write(&self.context, &motions);
        lane.parameters.write(&self.context, &[Parameters { configurations: count as u32, ..self.parameters }]);
        let records = (4 * self.record * count) as u64;
        let mut encoder = self.context.device.create_command_encoder(&Default::default());
        // No record is zero where the kernel has written one.
        lane.records.clear(&mut encoder, records);
        lane.touches.clear(&mut encoder, COUNT);
        self.kernel.record(&mut encoder.begin_compute_pass(&Default::default()), &lane.bound, count as u32);
        lane.staging.copy(&mut encoder, 0, &lane.records, records);
        lane.staging.copy(&mut encoder, records, &lane.touches, COUNT + TOUCH * lane.staged as u64);
        lane.ticket = Some(self.context.queue.submit([encoder.finish()]));
    }

    fn collect(&mut self, lane: usize, count: usize) -> Result<Found, GpuError> {
        let lane = &mut self.lanes[lane];
        let Some(ticket) = lane.ticket.take() else { return Ok(Found::default()) };
        let records = 4 * self.record * count;
        let bytes = records as u64 + COUNT + TOUCH * lane.staged as u64;
        let (total, mut found) = lane.staging.take(&self.context, &ticket, bytes, |bytes| {
            let (records, touches) = bytes.split_at(records);
            let (head, touches) = touches.split_at(COUNT as usize);
            let total = bytemuck::pod_read_unaligned::<u32>(&head[..4]) as usize;
            let touches = &touches[..TOUCH as usize * total.min(lane.staged)];
            let found = Found {
                records: bytemuck::pod_collect_to_vec(records),
                touches: bytemuck::pod_collect_to_vec(touches),
            };
            (total, found)
        })?;
        if found.records.iter().all(|word| *word == 0) {
            return Err(GpuError::NeverWritten { count, total: count });
        }
        if total > lane.staged {
            let bytes = COUNT as usize + TOUCH as usize * total.min(lane.room());
            let all: Vec<u8> = lane.touches.read(&self.context, bytes)?;
            found.touches = bytemuck::pod_collect_to_vec(&all[COUNT as usize..]);
        }
        // Neighbouring sections differ little.
        lane.staged = (total + total / 4).clamp(lane.staged.min(count), lane.room());
        Ok(found)
    }
}
