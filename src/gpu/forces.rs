//! The search for forces in f32 on the device, which the host settles in f64: its kernels, its buffers, and the
//! submissions that they make up.

use super::{
    context::{Context, GpuError},
    detection::Detection,
    kernel::{Dispatch, Kernel, Staging, StorageBuffer},
    layout::{Parameters, SolverResult, Touch},
    model::{DeviceModel, LANES},
    pipeline::BatchCapacity,
    shaders,
    stages::{Forces, Found},
};
use crate::{contact, scene::Algorithm};

/// Touches a configuration in contact that are brought to the host with its result at first, and at most. What exceeds
/// them costs a submission more.
const FIRST_TOUCHES: f64 = 4.0;
const STAGED_TOUCHES: usize = 8;

/// What the mean number of touches of one section is raised by to hold those of the next: neighbouring sections differ
/// little.
pub(super) const TOUCHES_MARGIN: f64 = 1.25;

/// The kernels behind detection.
pub(super) struct ForceSearch {
    equilibrium: Kernel,
    count: Kernel,
    gather: Kernel,
    pub compliance: StorageBuffer,
    parameters: Parameters,
    /// Most touches of a configuration.
    contacts: usize,
    /// Bytes that `equilibrium` reads of the object, and reads and writes for one configuration besides its result [B].
    object_bytes: u64,
    own_bytes: u64,
}

/// What one section in flight has of its own.
pub(super) struct ForceLane {
    parameters: StorageBuffer,
    /// Of one batch.
    results: StorageBuffer,
    /// Number of touches of the section so far.
    total: StorageBuffer,
    /// Touches of the section, without gaps.
    touches: StorageBuffer,
    /// Results of the section, the number of its touches, and the first of these.
    staging: Staging,
    /// Touches a configuration in contact that are expected, and how many were brought into `staging`.
    touches_each: f64,
    staged: usize,
    equilibrium: wgpu::BindGroup,
    count: wgpu::BindGroup,
    gather: wgpu::BindGroup,
}

/// Bytes of the number of touches in the staging buffer [B].
const TOTAL_BYTES: u64 = 16;

impl ForceSearch {
    /// Compiles the kernels for `model`, of which `device` has most.
    pub fn new(
        context: &Context,
        model: &contact::Model<'_>,
        device: &DeviceModel,
        room: BatchCapacity,
    ) -> Result<Self, GpuError> {
        let shader = match model.contact.algorithm {
            Algorithm::Paper => &shaders::PAPER,
            Algorithm::Energy | Algorithm::Linearised => &shaders::ENERGY,
        };
        // One invocation keeps one contact.
        let most = room.contacts.min(LANES as usize);
        let contacts = ("CONTACTS", most as f64);
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
        let results = |shader| Kernel::new(context, shader, &[contacts]);
        // Rounded one by one: each keeps 24 bits whatever the condition number of K.
        let entries: Vec<f32> = model.compliance.entries.iter().map(|&entry| entry as f32).collect();
        let compliance = StorageBuffer::from_slice(context, "compliance", &entries)?;
        Ok(Self {
            equilibrium: Kernel::new(context, shader, &overrides)?,
            count: results(&shaders::RESULTS_COUNT)?,
            gather: results(&shaders::RESULTS_GATHER)?,
            object_bytes: device.rest.size() + device.mesh.size() + compliance.size(),
            // Its number and places are read, its workspace is written and read.
            own_bytes: 4 + 16 * u64::from(device.parameters.proxy_nodes) + 2 * 16 * device.workspace(),
            compliance,
            parameters: device.parameters,
            contacts: most,
        })
    }

    /// Bytes of the results of `count` configurations, and of all the touches that they have room for [B].
    fn bytes(&self, count: usize) -> (u64, u64) {
        ((size_of::<SolverResult>() * count) as u64, (size_of::<Touch>() * self.contacts * count) as u64)
    }
}

impl ForceLane {
    /// Room for what `detection` places.
    pub fn new(
        context: &Context,
        search: &ForceSearch,
        device: &DeviceModel,
        room: BatchCapacity,
        detection: &Detection,
    ) -> Result<Self, GpuError> {
        let buffer = |what, bytes: usize| StorageBuffer::new(context, what, bytes as u64);
        let workspace = buffer("workspace", 16 * room.batch * device.workspace() as usize)?;
        let parameters = StorageBuffer::uniform(context, "parameters", &device.parameters)?;
        let results = buffer("results", size_of::<SolverResult>() * room.batch)?;
        let listed = buffer("touches of a batch", size_of::<Touch>() * search.contacts * room.batch)?;
        let starts = buffer("starts of touches", 4 * room.batch)?;
        let total = buffer("number of touches", 4)?;
        let touches = buffer("touches", size_of::<Touch>() * search.contacts * room.chunk)?;
        let staged = size_of::<Touch>() * search.contacts.min(STAGED_TOUCHES) * room.chunk;
        let staging = Staging::new(context, TOTAL_BYTES + (size_of::<SolverResult>() * room.chunk + staged) as u64)?;
        let equilibrium = [
            ("parameters", &parameters),
            ("rest", &device.rest),
            ("mesh", &device.mesh),
            ("compliance", &search.compliance),
            ("positions", detection.positions()),
            ("list", detection.list()),
            ("outcomes", &results),
            ("touches", &listed),
            ("workspace", &workspace),
        ];
        let compacted = [
            ("parameters", &parameters),
            ("results", &results),
            ("listed", &listed),
            ("starts", &starts),
            ("total", &total),
            ("touches", &touches),
        ];
        Ok(Self {
            equilibrium: search.equilibrium.bind(context, &equilibrium)?,
            count: search.count.bind(context, &compacted)?,
            gather: search.gather.bind(context, &compacted)?,
            parameters,
            results,
            total,
            touches,
            staging,
            touches_each: FIRST_TOUCHES,
            staged: 0,
        })
    }

    /// Submits the solution of the first `count` configurations in contact of what was detected, `batch` to a dispatch.
    pub fn solve(
        &mut self,
        context: &Context,
        search: &ForceSearch,
        count: usize,
        batch: usize,
    ) -> wgpu::SubmissionIndex {
        let staged = (self.touches_each * TOUCHES_MARGIN * count as f64).ceil() as usize;
        self.staged = staged.min(search.contacts.min(STAGED_TOUCHES) * count);
        let mut first = 0;
        loop {
            let mut encoder = context.device.create_command_encoder(&Default::default());
            if first == 0 {
                self.total.clear(&mut encoder, 4);
            }
            let batch = batch.min(count - first);
            self.record_batch(context, search, &mut encoder, first, batch);
            first += batch;
            if first == count {
                self.staging.copy(&mut encoder, 0, &self.total, 4);
                let behind = TOTAL_BYTES + search.bytes(count).0;
                self.staging.copy(&mut encoder, behind, &self.touches, (size_of::<Touch>() * self.staged) as u64);
                return context.queue.submit([encoder.finish()]);
            }
            // Each batch a submission: no submission lasts longer than one.
            context.queue.submit([encoder.finish()]);
        }
    }

    /// Records the solution of `count` configurations in contact, from number `first` on.
    fn record_batch(
        &self,
        context: &Context,
        search: &ForceSearch,
        encoder: &mut wgpu::CommandEncoder,
        first: usize,
        count: usize,
    ) {
        let configurations = count as u32;
        self.parameters.write(context, &[Parameters { configurations, first: first as u32, ..search.parameters }]);
        let (result_bytes, list_bytes) = search.bytes(count);
        self.results.clear(encoder, result_bytes);
        let each = search.object_bytes + search.own_bytes * count as u64 + result_bytes + list_bytes;
        let starts = 4 * u64::from(configurations);
        let dispatch = |kernel, bound, workgroups, bytes| Dispatch { kernel, bound, workgroups, bytes };
        let groups = (configurations * search.contacts as u32).div_ceil(GATHER_WORKGROUP);
        context.record(
            encoder,
            [
                dispatch(&search.equilibrium, &self.equilibrium, configurations, each),
                dispatch(&search.count, &self.count, 1, result_bytes + starts),
                dispatch(&search.gather, &self.gather, groups, result_bytes + starts + 2 * list_bytes),
            ],
        );
        let place = (size_of::<SolverResult>() * first) as u64;
        self.staging.copy(encoder, TOTAL_BYTES + place, &self.results, result_bytes);
    }

    /// Waits for a submission of [`ForceLane::solve`].
    pub fn found(
        &mut self,
        context: &Context,
        search: &ForceSearch,
        count: usize,
        ticket: &wgpu::SubmissionIndex,
    ) -> Result<Found, GpuError> {
        let results_end = TOTAL_BYTES + search.bytes(count).0;
        let bytes = results_end + (size_of::<Touch>() * self.staged) as u64;
        let (mut found, total) = self.staging.take(context, ticket, bytes, |bytes| {
            let (head, touches) = bytes.split_at(results_end as usize);
            let (total, results) = head.split_at(TOTAL_BYTES as usize);
            let total = bytemuck::pod_read_unaligned::<u32>(&total[..4]) as usize;
            let there = size_of::<Touch>() * total.min(self.staged);
            let touches = bytemuck::pod_collect_to_vec(&touches[..there]);
            (Forces { results: bytemuck::pod_collect_to_vec(results), touches }, total)
        })?;
        let told: usize = found.results.iter().map(|result| result.touches as usize).sum();
        if told != total {
            return Err(GpuError::NeverWritten { count: told.abs_diff(total), total: told });
        }
        if total > self.staged {
            found.touches = self.touches.read(context, total)?;
        }
        self.touches_each = total as f64 / count.max(1) as f64;
        Ok(Found::Forces(found))
    }
}

/// Invocations of a workgroup of `gather`; the shader's default.
const GATHER_WORKGROUP: u32 = 64;
