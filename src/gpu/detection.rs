//! The stages that place the proxy and test it for contact at rest.
//!
//! Where shaders have f64, proxy nodes are placed and the gaps that decide are measured in it, to flat facets or to the
//! smooth surface: contact or not is what the CPU says. Elsewhere gaps are those to flat triangles in f32, and known to
//! a band.

use super::{
    context::{Context, GpuError},
    kernel::{Dispatch, Kernel, Staging, StorageBuffer},
    layout::{DoubleParameters, Parameters},
    model::DeviceModel,
    shaders::{self, CLUSTER, GROUP, Shader},
    stages::Detected,
};
use crate::{
    JointVector,
    contact::{self, geometry::bounding_volumes::CULLING_SLACK},
    scene::{Algorithm, JointKind},
};
use glam::DVec3;

/// Invocations of a workgroup of the stages with one invocation a node or configuration; the shaders' default.
const WORKGROUP: u32 = 64;

/// Most invocations of a workgroup of the gaps in f64: as many as GPUs run in step, since more would only wait for the
/// slowest.
const IN_STEP: u32 = 32;

/// A kernel and what it is bound to.
struct BoundKernel {
    kernel: Kernel,
    bound: wgpu::BindGroup,
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

    fn dispatch(&self, invocations: u32, bytes: u64) -> Dispatch<'_> {
        Dispatch { kernel: &self.kernel, bound: &self.bound, workgroups: invocations.div_ceil(self.workgroup), bytes }
    }
}

/// Buffers that the stages of either precision share.
struct Buffers {
    /// [`Parameters`], and in f64 [`DoubleParameters`].
    parameters: StorageBuffer,
    double_parameters: Option<StorageBuffer>,
    motions: StorageBuffer,
    positions: StorageBuffer,
    /// Three coordinates of each proxy node, in f64.
    placed: Option<StorageBuffer>,
    gaps: StorageBuffer,
    list: StorageBuffer,
}

/// The stages before and behind the distances to the flat triangles in f32, and what they read of arm and surface [B].
struct Ends {
    kinematics: BoundKernel,
    smallest: BoundKernel,
    compaction: BoundKernel,
    arm_bytes: u64,
    surface_bytes: u64,
}

/// All stages, with room for a chunk of configurations.
pub(super) struct Detection {
    single: Parameters,
    /// In f64 its parameters.
    double: Option<DoubleParameters>,
    kinds: Vec<JointKind>,
    buffers: Buffers,
    staging: Staging,
    distances: BoundKernel,
    ends: Ends,
    /// Bytes of the surface that `distances` reads [B].
    surface_bytes: u64,
    gap_band: f64,
}

impl Detection {
    /// For `chunk` configurations at a time of what `device` has of `model`; in f64 where `double` is there.
    pub fn new(
        context: &Context,
        model: &contact::Model<'_>,
        device: &DeviceModel,
        chunk: usize,
        double_model: Option<&DoubleModel>,
    ) -> Result<Self, GpuError> {
        let (chunk, in_double) = (chunk as u64, double_model.is_some());
        let DeviceModel { parameters: single, rest, mesh, clusters, .. } = device;
        let buffer = |what, bytes| StorageBuffer::new(context, what, bytes);
        let size = if in_double { size_of::<f64>() } else { size_of::<f32>() } as u64;
        let double = in_double.then(|| double_parameters(device));
        let uniform = double.map(|double| StorageBuffer::uniform(context, "parameters in f64", &double));
        let buffers = Buffers {
            parameters: StorageBuffer::uniform(context, "parameters", single)?,
            double_parameters: uniform.transpose()?,
            motions: buffer("joint motions", 2 * size * chunk * u64::from(single.joints))?,
            positions: buffer("proxy positions", 16 * chunk * u64::from(single.proxy_nodes))?,
            placed: in_double
                .then(|| buffer("proxy positions in f64", 24 * chunk * u64::from(single.proxy_nodes)))
                .transpose()?,
            gaps: buffer("gaps", size * chunk)?,
            list: buffer("list of contacts", 4 * (chunk + 1))?,
        };
        let Buffers { parameters, positions, .. } = &buffers;
        let bindings = [
            ("parameters", parameters),
            ("rest", rest),
            ("mesh", mesh),
            ("positions", positions),
            ("clusters", clusters),
        ];
        let distances = BoundKernel::new(context, (&shaders::DETECTION, WORKGROUP), &[], &bindings)?;
        let ends = match (&buffers.double_parameters, &buffers.placed, double_model) {
            (Some(uniform), Some(placed), Some(double)) => {
                Ends::double(context, double, device, &buffers, (uniform, placed))?
            }
            _ => Ends::single(context, device, &buffers)?,
        };
        Ok(Self {
            single: *single,
            double,
            kinds: model.chain.joints.iter().map(|joint| joint.kind).collect(),
            staging: Staging::new(context, buffers.gaps.size() + buffers.list.size())?,
            buffers,
            distances,
            ends,
            surface_bytes: device.surface_bytes(),
            // The paper's iteration knows f32 alone: it may start from no contact where there is some.
            gap_band: if in_double && model.contact.algorithm != Algorithm::Paper { 0.0 } else { device.gap_band },
        })
    }

    /// Proxy nodes in f32 with their gaps to the flat triangles, configuration by configuration.
    pub fn positions(&self) -> &StorageBuffer {
        &self.buffers.positions
    }

    /// The same in f64, three coordinates each, where the device has it.
    pub fn placed(&self) -> Option<&StorageBuffer> {
        self.buffers.placed.as_ref()
    }

    /// Joint motions, configuration by configuration.
    pub fn motions(&self) -> &StorageBuffer {
        &self.buffers.motions
    }

    /// One more than there are configurations in contact, then their numbers.
    pub fn list(&self) -> &StorageBuffer {
        &self.buffers.list
    }

    /// Gaps no farther than this from zero are left open [m].
    pub fn gap_band(&self) -> f64 {
        self.gap_band
    }

    /// Whether gaps are those of the contact surface in f64.
    pub fn is_exact(&self) -> bool {
        self.double.is_some()
    }

    /// Submits where the proxy is at each configuration, its smallest gap at rest, and the list of those in contact.
    pub fn submit(&self, context: &Context, chunk: &[JointVector]) -> wgpu::SubmissionIndex {
        let Self { buffers, ends, .. } = self;
        let count = chunk.len() as u32;
        self.write_inputs(context, chunk, count);
        let placed = count * self.single.proxy_nodes;
        let (gap_bytes, list_bytes) = self.read_bytes(count);
        let place_bytes = 16 * u64::from(placed);
        // In f64 three coordinates more of each node are written, and read where they matter.
        let double_bytes = if self.is_exact() { 24 * u64::from(placed) } else { 0 };
        let motion_bytes = 2 * gap_bytes * u64::from(self.single.joints);
        let mut encoder = context.device.create_command_encoder(&Default::default());
        buffers.gaps.clear(&mut encoder, gap_bytes);
        buffers.list.clear(&mut encoder, list_bytes);
        let dispatches = [
            ends.kinematics.dispatch(placed, motion_bytes + ends.arm_bytes + place_bytes + double_bytes),
            self.distances.dispatch(placed, 2 * place_bytes + self.surface_bytes),
            ends.smallest.dispatch(count, place_bytes + double_bytes + ends.surface_bytes + gap_bytes),
            ends.compaction.dispatch(1, gap_bytes + list_bytes),
        ];
        context.record(&mut encoder, dispatches);
        self.staging.record(&mut encoder, &[(&buffers.gaps, gap_bytes), (&buffers.list, list_bytes)]);
        context.queue.submit([encoder.finish()])
    }

    /// Waits for a submission of [`Detection::submit`] of `count` configurations.
    pub fn collect(
        &self,
        context: &Context,
        count: usize,
        submission: &wgpu::SubmissionIndex,
    ) -> Result<Detected, GpuError> {
        let (gap_bytes, list_bytes) = self.read_bytes(count as u32);
        self.staging.take(context, submission, gap_bytes + list_bytes, |bytes| {
            let (gaps, list) = bytes.split_at(gap_bytes as usize);
            let gaps: Vec<f64> = if self.is_exact() {
                bytemuck::pod_collect_to_vec(gaps)
            } else {
                bytemuck::pod_collect_to_vec::<u8, f32>(gaps).into_iter().map(f64::from).collect()
            };
            let list: Vec<u32> = bytemuck::pod_collect_to_vec(list);
            let touching = gaps.iter().filter(|gap| **gap < 0.0).count();
            if list[0] as usize != touching + 1 {
                return Err(GpuError::NeverWritten { count: gaps.len() - touching, total: gaps.len() });
            }
            Ok(Detected { touching: list[1..=touching].to_vec(), gaps })
        })?
    }

    /// Bytes of the gaps of `count` configurations, and of the list of those in contact [B].
    fn read_bytes(&self, count: u32) -> (u64, u64) {
        let gap_size = if self.is_exact() { size_of::<f64>() } else { size_of::<f32>() };
        (gap_size as u64 * u64::from(count), 4 * u64::from(count + 1))
    }

    /// Tells the device of the `count` configurations of `chunk`.
    fn write_inputs(&self, context: &Context, chunk: &[JointVector], count: u32) {
        let Buffers { parameters, double_parameters, motions, .. } = &self.buffers;
        parameters.write(context, &[Parameters { configurations: count, ..self.single }]);
        // (cos q, sin q) of every joint, or (q, 0) of a prismatic one: all that kinematics needs.
        let motion = |(&kind, &q): (&JointKind, &f64)| match kind {
            JointKind::Revolute => [q.cos(), q.sin()],
            JointKind::Prismatic => [q, 0.0],
        };
        let pairs = chunk.iter().flat_map(|q| self.kinds.iter().zip(q.iter()).map(motion));
        match (double_parameters, self.double) {
            (Some(uniform), Some(double)) => {
                uniform.write(context, &[DoubleParameters { configurations: count, ..double }]);
                motions.write(context, &pairs.collect::<Vec<_>>());
            }
            _ => motions.write(context, &pairs.map(|pair| pair.map(|part| part as f32)).collect::<Vec<_>>()),
        }
    }
}

impl Ends {
    fn single(context: &Context, device: &DeviceModel, buffers: &Buffers) -> Result<Self, GpuError> {
        let Buffers { parameters, motions, positions, gaps, list, .. } = buffers;
        let DeviceModel { joints, proxy_nodes, .. } = device;
        let buffers = [
            ("parameters", parameters),
            ("joints", joints),
            ("proxy_nodes", proxy_nodes),
            ("motions", motions),
            ("positions", positions),
            ("gaps", gaps),
            ("list", list),
        ];
        Ok(Self {
            kinematics: BoundKernel::new(context, (&shaders::KINEMATICS, WORKGROUP), &[], &buffers)?,
            smallest: BoundKernel::new(context, (&shaders::CLASSIFICATION, WORKGROUP), &[], &buffers)?,
            compaction: BoundKernel::new(context, (&shaders::COMPACTION, WORKGROUP), &[], &buffers)?,
            arm_bytes: device.arm_bytes(),
            surface_bytes: 0,
        })
    }

    fn double(
        context: &Context,
        DoubleModel { chain, surface, smooth }: &DoubleModel,
        device: &DeviceModel,
        buffers: &Buffers,
        (uniform, placed): (&StorageBuffer, &StorageBuffer),
    ) -> Result<Self, GpuError> {
        let Buffers { motions, positions, gaps, list, .. } = buffers;
        let DeviceModel { mesh, clusters, .. } = device;
        let buffers = [
            ("parameters", uniform),
            ("chain", chain),
            ("motions", motions),
            ("placed", placed),
            ("positions", positions),
            ("surface", surface),
            ("mesh", mesh),
            ("order", clusters),
            ("gaps", gaps),
            ("list", list),
        ];
        let overrides = [("WORKGROUP", f64::from(IN_STEP)), ("SMOOTH", f64::from(u8::from(*smooth)))];
        Ok(Self {
            kinematics: BoundKernel::new(context, (&shaders::DOUBLE_KINEMATICS, WORKGROUP), &[], &buffers)?,
            smallest: BoundKernel::new(context, (&shaders::DOUBLE_GAP, IN_STEP), &overrides, &buffers)?,
            compaction: BoundKernel::new(context, (&shaders::DOUBLE_COMPACTION, WORKGROUP), &[], &buffers)?,
            arm_bytes: chain.size(),
            surface_bytes: surface.size(),
        })
    }
}

/// Arm and surface in f64 on the device.
pub(super) struct DoubleModel {
    pub chain: StorageBuffer,
    surface: StorageBuffer,
    /// Whether the surface is smooth.
    smooth: bool,
}

impl DoubleModel {
    pub fn new(context: &Context, model: &contact::Model<'_>) -> Result<Self, GpuError> {
        Ok(Self {
            chain: StorageBuffer::from_slice(context, "chain", &chain(model))?,
            surface: StorageBuffer::from_slice(context, "surface in f64", &surface(model))?,
            smooth: model.surface.smooth.is_some(),
        })
    }
}

fn double_parameters(device: &DeviceModel) -> DoubleParameters {
    let single = &device.parameters;
    DoubleParameters {
        configurations: 0,
        joints: single.joints,
        proxy_nodes: single.proxy_nodes,
        surface_nodes: single.surface_nodes,
        triangles: single.triangles,
        clusters: single.clusters,
        groups: single.clusters.div_ceil(GROUP as u32),
        padding: 0,
        gap_band: device.gap_band,
    }
}

/// Origin, axis and kind of each joint, the first origin relative to the object's centre; position and link of each
/// proxy node.
fn chain(model: &contact::Model<'_>) -> Vec<f64> {
    let mut numbers = Vec::new();
    for (k, joint) in model.chain.joints.iter().enumerate() {
        let origin = if k == 0 { joint.origin - model.surface.centre } else { joint.origin };
        numbers.extend(origin.to_array());
        numbers.extend(joint.axis.to_array());
        numbers.push(f64::from(u8::from(joint.kind == JointKind::Prismatic)));
    }
    for node in &model.chain.nodes {
        numbers.extend(node.position.to_array());
        numbers.push(node.link as f64);
    }
    numbers
}

/// The control points of facet `t` at rest, of a flat one its corners [m].
pub(super) fn controls(model: &contact::Model<'_>, t: u32) -> Vec<DVec3> {
    let facet = model.surface.facet_at_rest(t);
    facet.net.map_or_else(|| facet.corners.to_vec(), |net| net.to_vec())
}

/// Spheres around the facets, `together` of them in their order: centre and radius.
fn spheres(model: &contact::Model<'_>, together: usize) -> Vec<[f64; 4]> {
    let slack = CULLING_SLACK * model.surface.extent;
    let sphere = |facets: &[u32]| {
        // No point of a facet lies outside its control points.
        let points: Vec<DVec3> = facets.iter().flat_map(|&t| controls(model, t)).collect();
        let centre = points.iter().sum::<DVec3>() / points.len() as f64;
        let radius = points.iter().map(|point| point.distance(centre)).fold(0.0, f64::max);
        [centre.x, centre.y, centre.z, radius + slack]
    };
    let order: Vec<u32> = model.surface.bounds.order().collect();
    order.chunks(together).map(sphere).collect()
}

/// The spheres of the clusters of facets, of the groups of clusters, and of the facets in the order of the clusters:
/// see `shaders/bounding_spheres.wgsl`.
pub(super) fn bounding_spheres(model: &contact::Model<'_>) -> Vec<f64> {
    [CLUSTER, GROUP * CLUSTER, 1].into_iter().flat_map(|together| spheres(model, together)).flatten().collect()
}

/// Bounding spheres, radii of proxy nodes and control points: see `shaders/double_gap.wgsl`.
fn surface(model: &contact::Model<'_>) -> Vec<f64> {
    let mut numbers = bounding_spheres(model);
    numbers.extend(model.chain.nodes.iter().map(|node| node.radius));
    let facets = 0..model.object.triangles.len() as u32;
    numbers.extend(facets.flat_map(|t| controls(model, t)).flat_map(|point| point.to_array()));
    numbers
}
