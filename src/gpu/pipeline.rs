//! The stages of a batch: their kernels, their buffers, and the submissions they make up.

use super::{
    context::{Context, GpuError},
    kernel::{Access, Dispatch, Kernel, POISON, Staging, StorageBuffer},
    layout::{Outcome, Parameters, Touch},
    model::{DeviceModel, LANES},
    shaders::{self, Shader},
};
use crate::{JointVector, contact, scene::Algorithm};

/// Invocations of a workgroup of the stages with one invocation a node or configuration; the shaders' default.
const WORKGROUP: u32 = 64;

/// Bounds on what one submission holds.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    /// Most configurations placed and tested for contact at a time.
    pub chunk: usize,
    /// Most configurations solved at a time.
    pub batch: usize,
    /// Most proxy nodes in contact in one configuration, at most 32; more are solved on the CPU.
    pub contacts: usize,
}

impl Default for Room {
    /// Enough to keep a large GPU busy; a few tens of megabytes.
    fn default() -> Self {
        Self { chunk: 16_384, batch: 8192, contacts: 32 }
    }
}

/// Most memory that one buffer of a batch takes [B].
const BUFFER_BUDGET: u64 = 64 << 20;

impl Room {
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
            chunk: self.chunk.clamp(1, fit(16 * nodes.max(model.chain.joints.len()))),
            batch: self.batch.clamp(1, fit(workspace.max(size_of::<Touch>() * contacts))),
            contacts,
        }
    }

    /// Half of each, contacts aside.
    pub(super) fn half(self) -> Self {
        Self { chunk: (self.chunk / 2).max(1), batch: (self.batch / 2).max(1), ..self }
    }
}

/// A kernel and what it is bound to.
struct Stage {
    kernel: Kernel,
    bound: wgpu::BindGroup,
}

impl Stage {
    fn new(
        context: &Context,
        shader: &Shader,
        overrides: &[(&str, f64)],
        bindings: &[(Access, &StorageBuffer)],
    ) -> Result<Self, GpuError> {
        let (accesses, buffers): (Vec<_>, Vec<_>) = bindings.iter().copied().unzip();
        let kernel = Kernel::new(context, shader, overrides, &accesses)?;
        let bound = kernel.bind(context, &buffers)?;
        Ok(Self { kernel, bound })
    }

    fn dispatch(&self, workgroups: u32, bytes: u64) -> Dispatch<'_> {
        Dispatch { kernel: &self.kernel, bound: &self.bound, workgroups, bytes }
    }
}

/// What one batch in flight writes. There are two, so that one is read while the other is written.
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
    room: Room,
    parameters: StorageBuffer,
    motions: StorageBuffer,
    gaps: StorageBuffer,
    list: StorageBuffer,
    detected: Staging,
    kinematics: Stage,
    detection: Stage,
    classification: Stage,
    compaction: Stage,
    equilibrium: Kernel,
    /// What `equilibrium` reads and writes for one configuration, besides its result [B].
    own_bytes: u64,
    sets: [ResultSet; 2],
}

impl Pipeline {
    pub fn new(context: &Context, model: &contact::Model<'_>, room: Room) -> Result<Self, GpuError> {
        use Access::{Read, Uniform, Write};
        let device = DeviceModel::new(context, model)?;
        let chunk = room.chunk as u64;
        let nodes = u64::from(device.parameters.proxy_nodes);
        let buffer = |what, bytes| StorageBuffer::new(context, what, bytes);
        let parameters = StorageBuffer::uniform(context, "parameters", &device.parameters)?;
        let motions = buffer("joint motions", 8 * chunk * u64::from(device.parameters.joints))?;
        let positions = buffer("proxy positions", 16 * chunk * nodes)?;
        let gaps = buffer("gaps", 4 * chunk)?;
        let list = buffer("list of contacts", 4 * (chunk + 1))?;
        let workspace = buffer("workspace", 16 * room.batch as u64 * device.workspace())?;
        let stage = |shader, bindings: &[(Access, &StorageBuffer)]| Stage::new(context, shader, &[], bindings);
        let kinematics = stage(
            &shaders::KINEMATICS,
            &[
                (Uniform, &parameters),
                (Read, &device.joints),
                (Read, &device.proxy_nodes),
                (Read, &motions),
                (Write, &positions),
            ],
        )?;
        let detection = stage(
            &shaders::DETECTION,
            &[
                (Uniform, &parameters),
                (Read, &device.rest),
                (Read, &device.mesh),
                (Write, &positions),
                (Read, &device.clusters),
            ],
        )?;
        let classification =
            stage(&shaders::CLASSIFICATION, &[(Uniform, &parameters), (Read, &positions), (Write, &gaps)])?;
        let compaction = stage(&shaders::COMPACTION, &[(Uniform, &parameters), (Read, &gaps), (Write, &list)])?;
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
            let outcomes = buffer("outcomes", (size_of::<Outcome>() * room.batch) as u64)?;
            let touches = buffer("touches", (size_of::<Touch>() * room.contacts * room.batch) as u64)?;
            let staging = Staging::new(context, outcomes.size() + touches.size())?;
            let buffers = [
                &parameters,
                &device.rest,
                &device.mesh,
                &device.compliance,
                &positions,
                &list,
                &outcomes,
                &touches,
                &workspace,
            ];
            let bound = equilibrium.bind(context, &buffers)?;
            Ok(ResultSet { parameters, outcomes, touches, staging, bound })
        };
        let sets = [result_set()?, result_set()?];
        let detected = Staging::new(context, gaps.size() + list.size())?;
        Ok(Self {
            model: device,
            room,
            parameters,
            motions,
            gaps,
            list,
            detected,
            kinematics,
            detection,
            classification,
            compaction,
            equilibrium,
            own_bytes,
            sets,
        })
    }

    /// Gaps within this of zero are decided in f64 [m].
    pub fn gap_band(&self) -> f64 {
        self.model.gap_band
    }

    /// Places the proxy at each configuration; smallest gap of each at rest [m], and the numbers of those
    /// in contact.
    pub fn detect(&self, context: &Context, chunk: &[JointVector]) -> Result<(Vec<f32>, Vec<u32>), GpuError> {
        let count = chunk.len() as u32;
        let parameters = Parameters { configurations: count, ..self.model.parameters };
        self.parameters.write(context, &[parameters]);
        self.motions.write(context, &self.model.motions(chunk));
        let (gap_bytes, list_bytes) = (4 * u64::from(count), 4 * u64::from(count + 1));
        self.gaps.poison(context, gap_bytes);
        self.list.poison(context, list_bytes);
        let placed = count * parameters.proxy_nodes;
        let (motion_bytes, place_bytes) = (8 * u64::from(count * parameters.joints), 16 * u64::from(placed));
        let (nodes, configurations) = (placed.div_ceil(WORKGROUP), count.div_ceil(WORKGROUP));
        let mut encoder = context.device.create_command_encoder(&Default::default());
        let dispatches = [
            self.kinematics.dispatch(nodes, motion_bytes + self.model.arm_bytes() + place_bytes),
            self.detection.dispatch(nodes, place_bytes + self.model.surface_bytes() + place_bytes),
            self.classification.dispatch(configurations, place_bytes + gap_bytes),
            self.compaction.dispatch(1, gap_bytes + list_bytes),
        ];
        context.record(&mut encoder, dispatches);
        self.detected.record(&mut encoder, &[(&self.gaps, gap_bytes), (&self.list, list_bytes)]);
        let submission = context.queue.submit([encoder.finish()]);
        self.detected.take(context, &submission, gap_bytes + list_bytes, |bytes| {
            let (gaps, list) = bytes.split_at(gap_bytes as usize);
            let gaps: Vec<f32> = bytemuck::pod_collect_to_vec(gaps);
            let list: Vec<u32> = bytemuck::pod_collect_to_vec(list);
            let unwritten = gaps.iter().filter(|gap| gap.to_ne_bytes() == [POISON; 4]).count();
            let touching = list[0] as usize;
            if unwritten > 0 || touching != gaps.iter().filter(|gap| **gap < 0.0).count() {
                return Err(GpuError::NeverWritten { count: unwritten.max(1), total: gaps.len() });
            }
            Ok((gaps, list[1..=touching].to_vec()))
        })?
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
    ) -> Result<(Vec<Outcome>, Vec<Touch>), GpuError> {
        let (outcome_bytes, touch_bytes) = self.result_bytes(count);
        self.sets[set].staging.take(context, submission, outcome_bytes + touch_bytes, |bytes| {
            let (outcomes, touches) = bytes.split_at(outcome_bytes as usize);
            (bytemuck::pod_collect_to_vec(outcomes), bytemuck::pod_collect_to_vec(touches))
        })
    }

    fn result_bytes(&self, count: usize) -> (u64, u64) {
        ((size_of::<Outcome>() * count) as u64, (size_of::<Touch>() * self.room.contacts * count) as u64)
    }
}
