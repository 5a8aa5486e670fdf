//! The stages that place the proxy and test it for contact at rest.
//!
//! Gaps to flat triangles in f32 leave few proxy nodes whose gap to the contact surface may be the smallest. That is
//! measured in f64, so that contact or not is what the CPU says; where shaders have no f64 it is known to a band.

use super::{
    buffer::{Staging, StorageBuffer},
    context::Context,
    dispatch::Dispatch,
    error::GpuError,
    kernel::Kernel,
    layout::Parameters,
    model::DeviceModel,
    shaders::{self, Shader},
    stages::{Detected, Trust},
};
use crate::{JointVector, contact, scene::JointKind};

/// Invocations of a workgroup of the stages with one invocation a node or configuration; the shaders' default.
const WORKGROUP: u32 = 64;

/// A kernel and what it is bound to.
struct BoundKernel {
    kernel: Kernel,
    bound: wgpu::BindGroup,
    /// Nodes or configurations that one workgroup takes.
    workgroup: u32,
}

impl BoundKernel {
    fn new(
        context: &Context,
        (shader, workgroup): (&Shader, u32),
        overrides: &[(&str, f64)],
        buffers: &[(&str, &StorageBuffer)],
    ) -> Result<Self, GpuError> {
        let kernel = Kernel::new(context, shader, overrides)?;
        let bound = kernel.bind(context, buffers)?;
        Ok(Self { kernel, bound, workgroup })
    }

    fn dispatch(&self, count: u32, bytes: u64) -> Dispatch<'_> {
        self.kernel.dispatch(&self.bound, count.div_ceil(self.workgroup), bytes)
    }
}

/// Buffers that the stages share.
struct Buffers {
    parameters: StorageBuffer,
    motions: StorageBuffer,
    positions: StorageBuffer,
    placed: StorageBuffer,
    gaps: StorageBuffer,
    list: StorageBuffer,
}

/// All stages, with room for a chunk of configurations.
pub(super) struct Detection {
    parameters: Parameters,
    trust: Trust,
    kinds: Vec<JointKind>,
    buffers: Buffers,
    staging: Staging,
    kinematics: BoundKernel,
    distances: BoundKernel,
    smallest: BoundKernel,
    /// Bytes that `kinematics`, `distances` and `smallest` read of arm and surface (B).
    model_bytes: [u64; 3],
}

impl Detection {
    /// For `chunk` configurations at a time of what `device` has of `model`.
    pub fn new(
        context: &Context,
        model: &contact::Model<'_>,
        device: &DeviceModel,
        chunk: usize,
    ) -> Result<Self, GpuError> {
        let DeviceModel { precision, parameters, chain, rest, mesh, order, surface, .. } = device;
        let (chunk, size) = (chunk as u64, precision.size() as u64);
        let nodes = chunk * u64::from(parameters.proxy_nodes);
        let buffer = |what, bytes| StorageBuffer::new(context, what, bytes);
        let buffers = Buffers {
            parameters: StorageBuffer::uniform(context, "parameters", std::slice::from_ref(parameters))?,
            motions: buffer("joint motions", 2 * size * chunk * u64::from(parameters.joints))?,
            positions: buffer("proxy positions in f32", 16 * nodes)?,
            placed: buffer("proxy positions", 3 * size * nodes)?,
            gaps: buffer("gaps", size * chunk)?,
            list: buffer("list of contacts", 4 * chunk)?,
        };
        let bindings = [
            ("parameters", &buffers.parameters),
            ("chain", chain),
            ("motions", &buffers.motions),
            ("placed", &buffers.placed),
            ("positions", &buffers.positions),
            ("surface", surface),
            ("mesh", mesh),
            ("order", order),
            ("gaps", &buffers.gaps),
            ("list", &buffers.list),
        ];
        let smooth = ("SMOOTH", f64::from(u8::from(device.is_smooth)));
        let kernel = |shader, workgroup, overrides: &[(&str, f64)]| {
            BoundKernel::new(context, (shader, workgroup), overrides, &bindings)
        };
        let flat = bindings.map(|(name, buffer)| (name, if name == "surface" { rest } else { buffer }));
        let lanes = ("WORKGROUP", f64::from(context.adapter().lanes()));
        Ok(Self {
            kinematics: kernel(precision.of(&shaders::KINEMATICS), WORKGROUP, &[])?,
            distances: BoundKernel::new(context, (&shaders::DETECTION, 1), &[], &flat)?,
            smallest: kernel(precision.of(&shaders::GAP), 1, &[lanes, smooth])?,
            parameters: *parameters,
            trust: Trust { band: device.open_band, precision: *precision },
            kinds: model.chain.joints.iter().map(|joint| joint.kind).collect(),
            staging: Staging::new(context, buffers.gaps.size())?,
            buffers,
            model_bytes: [chain.size(), device.surface_bytes()[0], device.surface_bytes()[1]],
        })
    }

    /// Proxy nodes in f32 with their gaps to the flat triangles, configuration by configuration.
    pub fn positions(&self) -> &StorageBuffer {
        &self.buffers.positions
    }

    /// The same in the precision of the stages, three coordinates each, without the gaps.
    pub fn placed(&self) -> &StorageBuffer {
        &self.buffers.placed
    }

    /// Joint motions, configuration by configuration.
    pub fn motions(&self) -> &StorageBuffer {
        &self.buffers.motions
    }

    /// Numbers of the configurations in contact, in the order in which they are solved.
    pub fn list(&self) -> &StorageBuffer {
        &self.buffers.list
    }

    /// Returns how far gaps can be trusted.
    pub fn trust(&self) -> Trust {
        self.trust
    }

    /// Submits where the proxy is at each configuration, and its smallest gap at rest.
    pub fn submit(&self, context: &Context, chunk: &[JointVector]) -> wgpu::SubmissionIndex {
        let buffers = &self.buffers;
        let count = chunk.len() as u32;
        self.write_inputs(context, chunk, count);
        let nodes = count * self.parameters.proxy_nodes;
        let gap_bytes = self.gap_bytes(count);
        let position_bytes = 16 * u64::from(nodes);
        let placed_bytes = (3 * self.trust.precision.size()) as u64 * u64::from(nodes);
        let motion_bytes = 2 * gap_bytes * u64::from(self.parameters.joints);
        let [arm_bytes, flat_bytes, surface_bytes] = self.model_bytes;
        let mut encoder = context.device.create_command_encoder(&Default::default());
        let dispatches = [
            self.kinematics.dispatch(nodes, motion_bytes + arm_bytes + position_bytes + placed_bytes),
            self.distances.dispatch(count, 2 * position_bytes + flat_bytes),
            // Placed nodes are read where they matter.
            self.smallest.dispatch(count, position_bytes + placed_bytes + surface_bytes + gap_bytes),
        ];
        context.record(&mut encoder, dispatches);
        self.staging.copy(&mut encoder, 0, &buffers.gaps, gap_bytes);
        context.queue.submit([encoder.finish()])
    }

    /// Waits for a submission of [`Detection::submit`] of `count` configurations, and tells the device which of them
    /// are in contact: the deepest first. These take longest, so that none of them is left at the end; and those that
    /// are solved together take about as long as each other.
    pub fn collect(
        &self,
        context: &Context,
        count: usize,
        submission: &wgpu::SubmissionIndex,
    ) -> Result<Detected, GpuError> {
        let decode = |bytes: &[u8]| self.trust.precision.decode(bytes);
        let gaps = self.staging.take(context, submission, self.gap_bytes(count as u32), decode)?;
        if count > 0 && gaps.iter().all(|gap| gap.is_nan()) {
            return Err(GpuError::NeverWritten { count, total: count });
        }
        let detected = Detected::deepest_first(gaps);
        self.buffers.list.write(context, &detected.touching);
        Ok(detected)
    }

    /// Bytes of the gaps of `count` configurations (B).
    fn gap_bytes(&self, count: u32) -> u64 {
        self.trust.precision.size() as u64 * u64::from(count)
    }

    /// Tells the device of the `count` configurations of `chunk`.
    fn write_inputs(&self, context: &Context, chunk: &[JointVector], count: u32) {
        let Buffers { parameters, motions, gaps, .. } = &self.buffers;
        parameters.write(context, &[Parameters { configurations: count, ..self.parameters }]);
        // (cos q, sin q) of every joint, or (q, 0) of a prismatic one: all that kinematics needs.
        let motion = |(&kind, &q): (&JointKind, &f64)| match kind {
            JointKind::Revolute => [q.cos(), q.sin()],
            JointKind::Prismatic => [q, 0.0],
        };
        let numbers: Vec<f64> = chunk.iter().flat_map(|q| self.kinds.iter().zip(q.iter()).flat_map(motion)).collect();
        motions.write(context, &self.trust.precision.encode(&numbers));
        // No gap is this where a kernel has written one.
        gaps.write(context, &self.trust.precision.encode(&vec![f64::NAN; chunk.len()]));
    }
}
