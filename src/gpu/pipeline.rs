//! The stages of a batch: their kernels, their buffers, and the submissions they make up.

use super::{
    context::{Context, GpuError},
    detection::Detection,
    kernel::{Access, Dispatch, Kernel, Staging, StorageBuffer},
    layout::{Parameters, SolverResult, Touch},
    model::{DeviceModel, LANES},
    shaders,
};
use crate::{contact, scene::Algorithm};

/// Bounds on what one submission holds.
#[derive(Clone, Copy, Debug)]
pub struct BatchCapacity {
    /// Most configurations placed and tested for contact at a time.
    pub chunk: usize,
    /// Most configurations solved at a time.
    pub batch: usize,
    /// Most proxy nodes in contact in one configuration, at most 32; more are solved on the CPU.
    pub contacts: usize,
    /// Whether the proxy is placed and tested for contact in f64 where the device has it.
    pub double: bool,
}

impl Default for BatchCapacity {
    /// Enough to keep a large GPU busy; a few tens of megabytes.
    fn default() -> Self {
        Self { chunk: 16_384, batch: 8192, contacts: 32, double: true }
    }
}

/// Most memory that one buffer of a batch takes [B].
const BUFFER_BUDGET: u64 = 64 << 20;

impl BatchCapacity {
    /// Cut to what a binding reaches.
    pub(super) fn within(self, binding_limit: u64, model: &contact::Model<'_>) -> Self {
        let budget = binding_limit.min(BUFFER_BUDGET);
        let fit = |bytes: usize| (budget as usize / bytes.max(1)).max(1);
        let nodes = model.chain.nodes.len();
        // A proxy node has one contact.
        let contacts = self.contacts.clamp(1, 32).min(nodes);
        let clusters = model.object.triangles.len().div_ceil(shaders::CLUSTER);
        let workspace = 16 * (model.compliance.nodes.len() + 2 * clusters);
        Self {
            chunk: self.chunk.clamp(1, fit(24 * nodes.max(model.chain.joints.len()))),
            batch: self.batch.clamp(1, fit(workspace.max(size_of::<Touch>() * contacts))),
            contacts,
            double: self.double,
        }
    }

    /// Half of each, contacts aside.
    pub(super) fn half(self) -> Self {
        Self { chunk: (self.chunk / 2).max(1), batch: (self.batch / 2).max(1), ..self }
    }
}

/// Buffers that one pending batch writes. There are two, so that one is read while the other is written.
struct ResultSet {
    parameters: StorageBuffer,
    outcomes: StorageBuffer,
    touches: StorageBuffer,
    staging: Staging,
    bound: wgpu::BindGroup,
}

/// All stages of a batch.
pub(super) struct Pipeline {
    model: DeviceModel,
    room: BatchCapacity,
    detection: Detection,
    equilibrium: Kernel,
    /// Bytes that `equilibrium` reads and writes for one configuration, besides its result [B].
    own_bytes: u64,
    sets: [ResultSet; 2],
}

impl Pipeline {
    pub fn new(context: &Context, model: &contact::Model<'_>, room: BatchCapacity) -> Result<Self, GpuError> {
        use Access::{Read, Uniform, Write};
        let device = DeviceModel::new(context, model)?;
        let detection = Detection::new(context, model, &device, room.chunk, room.double && context.adapter().double)?;
        let nodes = u64::from(device.parameters.proxy_nodes);
        let buffer = |what, bytes| StorageBuffer::new(context, what, bytes);
        let workspace = buffer("workspace", 16 * room.batch as u64 * device.workspace())?;
        let shader = match model.contact.algorithm {
            Algorithm::Paper => &shaders::PAPER,
            Algorithm::Energy | Algorithm::Linearised => &shaders::ENERGY,
        };
        let mut overrides = vec![("WORKGROUP", f64::from(LANES)), ("CONTACTS", room.contacts as f64)];
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
        let equilibrium = Kernel::new(context, shader, &overrides, &accesses)?;
        // Its number and places are read, its workspace is written and read.
        let own_bytes = 4 + 16 * nodes + 2 * 16 * device.workspace();
        let result_set = || -> Result<ResultSet, GpuError> {
            let parameters = StorageBuffer::uniform(context, "parameters", &device.parameters)?;
            let outcomes = buffer("outcomes", (size_of::<SolverResult>() * room.batch) as u64)?;
            let touches = buffer("touches", (size_of::<Touch>() * room.contacts * room.batch) as u64)?;
            let staging = Staging::new(context, outcomes.size() + touches.size())?;
            let buffers = [
                &parameters,
                &device.rest,
                &device.mesh,
                &device.compliance,
                detection.positions(),
                detection.list(),
                &outcomes,
                &touches,
                &workspace,
            ];
            let bound = equilibrium.bind(context, &buffers)?;
            Ok(ResultSet { parameters, outcomes, touches, staging, bound })
        };
        let sets = [result_set()?, result_set()?];
        Ok(Self { model: device, room, detection, equilibrium, own_bytes, sets })
    }

    /// The stages that place the proxy and test it for contact.
    pub fn detection(&self) -> &Detection {
        &self.detection
    }

    /// Submits the solution of `count` configurations in contact, from number `first` of the list on.
    pub fn solve(&self, context: &Context, first: usize, count: usize, set: usize) -> wgpu::SubmissionIndex {
        let results = &self.sets[set];
        let (outcome_bytes, touch_bytes) = self.result_bytes(count);
        let parameters = Parameters { configurations: count as u32, first: first as u32, ..self.model.parameters };
        results.parameters.write(context, &[parameters]);
        let mut encoder = context.device.create_command_encoder(&Default::default());
        results.outcomes.clear(&mut encoder, outcome_bytes);
        let bytes = self.model.object_bytes() + self.own_bytes * count as u64 + outcome_bytes + touch_bytes;
        let workgroups = count as u32;
        let dispatch = Dispatch { kernel: &self.equilibrium, bound: &results.bound, workgroups, bytes };
        context.record(&mut encoder, [dispatch]);
        results.staging.record(&mut encoder, &[(&results.outcomes, outcome_bytes), (&results.touches, touch_bytes)]);
        context.queue.submit([encoder.finish()])
    }

    /// Waits for a submission of [`Pipeline::solve`] and reads its results.
    pub fn collect(
        &self,
        context: &Context,
        set: usize,
        count: usize,
        submission: &wgpu::SubmissionIndex,
    ) -> Result<(Vec<SolverResult>, Vec<Touch>), GpuError> {
        let (outcome_bytes, touch_bytes) = self.result_bytes(count);
        self.sets[set].staging.take(context, submission, outcome_bytes + touch_bytes, |bytes| {
            let (outcomes, touches) = bytes.split_at(outcome_bytes as usize);
            (bytemuck::pod_collect_to_vec(outcomes), bytemuck::pod_collect_to_vec(touches))
        })
    }

    fn result_bytes(&self, count: usize) -> (u64, u64) {
        ((size_of::<SolverResult>() * count) as u64, (size_of::<Touch>() * self.room.contacts * count) as u64)
    }
}
