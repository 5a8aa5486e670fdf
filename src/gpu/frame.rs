//! The object's nodes, one passive step a frame (theory: non-iterative passive mechanical integration):
//! `(2M/T + B + (T/2) K) v_hat = (2M/T) v_k - K (n_k - n0) + f`, `n_{k+1} = n_k + T v_hat`, `v_{k+1} = 2 v_hat - v_k`.
//!
//! The state stays on the device, in a buffer that a viewer draws from, and is multiplied by the inverse of the matrix,
//! computed once in f64. Large objects, whose inverse would not fit, are moved by the sparse factor on the CPU.
//!
//! Effects, as in `render/object_motion.rs`, which is the twin: under gravity and with stiffening the nodes' loads are
//! a buffer of their own, forces and weight from the host; stiffening adds its part to it, in a stage of its own, and
//! puts K1 in the place of K; quasi-static graphics is an override constant, without velocities and masses. What the
//! scene does not name is not there.

use super::{
    buffer::StorageBuffer, context::Context, dispatch::Dispatch, error::GpuError, kernel::Kernel,
    layout::FrameParameters, shaders,
};
use crate::object::{Attachment, Compliance, Factor, Mechanics, Object, Stiffening, Stiffness, settled};
use crate::scene::GraphicsEffects;
use crate::{Error, error, memory};
use glam::DVec3;
use std::sync::Arc;

/// Invocations of a workgroup; the shader's default.
const WORKGROUP: u32 = 64;

/// Size of a node's force, displacement or velocity (B).
const VECTOR: u64 = 16;

/// One dispatch of every frame.
struct FramePass {
    kernel: Arc<Kernel>,
    bound: wgpu::BindGroup,
    workgroups: u32,
    /// See [`Dispatch::bytes`].
    bytes: u64,
}

impl FramePass {
    fn dispatch(&self) -> Dispatch<'_> {
        let Self { kernel, bound, workgroups, bytes } = self;
        kernel.dispatch(bound, *workgroups, *bytes)
    }
}

/// The nodes' state on the device, and the stages that advance it.
pub struct FrameUpdate {
    context: Arc<Context>,
    state: StorageBuffer,
    /// N, and displacements of the object's nodes where these are not those of K.
    attachment: Attachment,
    followers: Option<StorageBuffer>,
    forces: StorageBuffer,
    /// Forces on the nodes of K, weight and what stiffening adds; absent where they are `forces`.
    loads: Option<StorageBuffer>,
    /// M g of each node (N); none without gravity.
    weight: Vec<DVec3>,
    /// Forces on the nodes of K (N).
    acting: Vec<DVec3>,
    /// Forces as the shader reads them.
    padded: Vec<[f32; 4]>,
    stages: Vec<FramePass>,
    takes: FrameCost,
}

/// Resources of a frame update on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct FrameCost {
    /// Memory of all its buffers (B).
    pub bytes: u64,
    /// Number of its buffers.
    pub buffers: usize,
    /// Dispatches a frame.
    pub dispatches: usize,
    /// Compiled pipelines.
    pub pipelines: usize,
}

impl FrameCost {
    /// That of buffers of these sizes (B), and of stages.
    fn of(buffers: &[u64], stages: &[FramePass]) -> Self {
        let mut pipelines: Vec<_> = stages.iter().map(|stage| Arc::as_ptr(&stage.kernel)).collect();
        pipelines.sort_unstable();
        pipelines.dedup();
        Self {
            bytes: buffers.iter().sum(),
            buffers: buffers.len(),
            dispatches: stages.len(),
            pipelines: pipelines.len(),
        }
    }
}

impl FrameUpdate {
    /// Most memory that an inverse is worth, which is read once a frame: that of 3,000 nodes where springs and ground
    /// are isotropic, else of 1,000 (B).
    const MOST_BYTES_INVERTED: usize = 36_000_000;

    /// Whether the inverse of an object's matrix is small enough to be multiplied by in every frame: 4 N^2 bytes where
    /// springs and ground are isotropic, else 36 N^2.
    #[must_use]
    pub fn suits(mechanics: &Mechanics) -> bool {
        let Mechanics { stiffness, moved, .. } = mechanics;
        let order = if stiffness.is_isotropic() { moved.len() } else { 3 * moved.len() };
        order.saturating_pow(2) <= Self::MOST_BYTES_INVERTED / size_of::<f32>()
    }

    /// The object in equilibrium under no forces but its weight, where there is one, to be advanced by `period` (s) a
    /// frame. Smoothing is no matter of the device: forces are filtered before they come here.
    ///
    /// # Errors
    /// When the matrix is not positive definite (masses, damping or period are not positive), its inverse would not fit
    /// in memory, or the device refuses.
    pub fn new(context: Arc<Context>, object: &Object, period: f64, effects: &GraphicsEffects) -> Result<Self, Error> {
        Self::remembering(context, object, period, effects, false)
    }

    /// As [`FrameUpdate::new`]; `remembers`: a body force of the object's past acts beside the contact forces.
    ///
    /// # Errors
    /// As there.
    pub fn remembering(
        context: Arc<Context>,
        object: &Object,
        period: f64,
        effects: &GraphicsEffects,
        remembers: bool,
    ) -> Result<Self, Error> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(error!("the time between frames is {period} s; it must be a positive number"));
        }
        let mechanics = object.mechanics()?;
        let stiffening = effects.stiffening.map(|spec| Stiffening::new(mechanics, spec.factor, spec.strain));
        let weight: Vec<DVec3> =
            effects.gravity.map_or_else(Vec::new, |g| mechanics.mass.iter().map(|m| *m * g).collect());
        let start = start(mechanics, &weight, stiffening.as_ref(), effects)?;
        let stiffness = stiffening.as_ref().map_or(&mechanics.stiffness, Stiffening::bound);
        let gpu = context.as_ref();
        let common =
            Common::new(gpu, mechanics, stiffness, (period, effects), &start, !weight.is_empty() || remembers)?;
        let mut stages = Vec::new();
        let mut buffers = common.sizes();
        if let (Some(stiffening), Some(loads), Some(spec)) = (&stiffening, &common.loads, effects.stiffening) {
            let reach: Vec<f32> = stiffening.unit_strain_force().iter().map(|&force| force as f32).collect();
            let reach = StorageBuffer::from_slice(gpu, "reach of the springs", &reach)?;
            buffers.push(reach.size());
            stages.push(common.stiffening_stage(gpu, &reach, loads, [spec.factor, spec.strain])?);
        }
        let mut overrides = if effects.quasi_static { vec![("QUASI_STATIC", 1.0)] } else { Vec::new() };
        let (inverse, is_isotropic) = inverse(mechanics, stiffness, period, effects)?;
        if is_isotropic {
            overrides.push(("ISOTROPIC", 1.0));
        }
        let inverse = StorageBuffer::from_slice(gpu, "inverse", &inverse)?;
        let right = StorageBuffer::new(gpu, "right-hand side", 12 * u64::from(common.nodes))?;
        buffers.extend([inverse.size(), right.size()]);
        stages.extend(common.stages(gpu, [&inverse, &right], &overrides)?);
        let attachment = mechanics.attachment.clone();
        let followers = if attachment.is_identity() {
            None
        } else {
            let (stage, followers) = following_stage(gpu, &attachment, &common.state, &mut buffers)?;
            stages.push(stage);
            Some(followers)
        };
        let takes = FrameCost::of(&buffers, &stages);
        let (acting, padded) = (vec![DVec3::ZERO; mechanics.moved.len()], Vec::new());
        let Common { state, forces, loads, .. } = common;
        Ok(Self { state, attachment, followers, forces, loads, weight, acting, padded, stages, takes, context })
    }

    /// Returns the resources of the update on the device.
    #[must_use]
    pub fn takes(&self) -> FrameCost {
        self.takes
    }

    /// Advances by one frame under `forces`, one per node of the object (N); missing ones count as zero. Does not wait
    /// for the device.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn step(&mut self, forces: &[DVec3]) -> Result<(), GpuError> {
        self.step_remembering(forces, &[])
    }

    /// As [`FrameUpdate::step`], with the body force `past` beside the forces of `contact`.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn step_remembering(&mut self, contact: &[DVec3], past: &[DVec3]) -> Result<(), GpuError> {
        let padded = |force: DVec3| force.as_vec3().extend(0.0).to_array();
        self.padded.clear();
        self.padded.extend(contact.iter().map(|force| padded(*force)));
        self.padded.resize(self.attachment.rows(), [0.0; 4]);
        self.forces.write(&self.context, &self.padded);
        if let Some(loads) = &self.loads {
            self.attachment.spread(contact, &mut self.acting);
            self.attachment.add(past, &mut self.acting);
            self.acting.iter_mut().zip(&self.weight).for_each(|(force, weight)| *force += *weight);
            self.padded.clear();
            self.padded.extend(self.acting.iter().map(|force| padded(*force)));
            loads.write(&self.context, &self.padded);
        }
        let mut encoder = self.context.device.create_command_encoder(&Default::default());
        self.context.record(&mut encoder, self.stages.iter().map(FramePass::dispatch));
        self.context.queue.submit([encoder.finish()]);
        self.context.check()
    }

    /// Displacements u = n - n0 (m) and velocities (m/s) of all nodes of K; of quasi-static graphics no velocities.
    /// Waits for the device.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn read(&self) -> Result<(Vec<DVec3>, Vec<DVec3>), GpuError> {
        let state: Vec<[f32; 4]> = self.state.read(&self.context, self.state.size() as usize / 16)?;
        let mut vectors: Vec<DVec3> =
            state.iter().map(|&[x, y, z, _]| DVec3::new(x.into(), y.into(), z.into())).collect();
        let velocities = vectors.split_off(self.attachment.columns());
        Ok((vectors, velocities))
    }

    /// Displacements of the object's own nodes (m), as they are drawn. Waits for the device.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn drawn(&self) -> Result<Vec<DVec3>, GpuError> {
        let drawn = self.followers.as_ref().unwrap_or(&self.state);
        let drawn: Vec<[f32; 4]> = drawn.read(&self.context, self.attachment.rows())?;
        Ok(drawn.iter().map(|&[x, y, z, _]| DVec3::new(x.into(), y.into(), z.into())).collect())
    }

    /// Displacements of the object's nodes, maybe velocities after them, four numbers a node: what a viewer binds to draw
    /// the object.
    #[must_use]
    pub fn state_buffer(&self) -> &wgpu::Buffer {
        &self.followers.as_ref().unwrap_or(&self.state).raw
    }

    /// Contact forces of the last frame, four numbers a node (N).
    #[must_use]
    pub fn force_buffer(&self) -> &wgpu::Buffer {
        &self.forces.raw
    }
}

/// The stage by which the object's nodes follow `state`, and their displacements; `buffers` takes the sizes of all that
/// it needs (B).
fn following_stage(
    gpu: &Context,
    attachment: &Attachment,
    state: &StorageBuffer,
    buffers: &mut Vec<u64>,
) -> Result<(FramePass, StorageBuffer), GpuError> {
    let nodes = attachment.rows();
    let entries = (0..nodes).flat_map(|node| attachment.row(node));
    let (columns, weights): (Vec<u32>, Vec<f32>) = entries.map(|&(column, weight)| (column, weight as f32)).unzip();
    let ends = (0..nodes).scan(0, |end, node| {
        *end += attachment.row(node).len() as u32;
        Some(*end)
    });
    let rows: Vec<u32> = std::iter::once(0).chain(ends).chain(columns).collect();
    let rows = StorageBuffer::from_slice(gpu, "rows of the attachment", &rows)?;
    let weights = StorageBuffer::from_slice(gpu, "weights of the attachment", &weights)?;
    let followers = StorageBuffer::from_slice(gpu, "followers", &vec![[0.0f32; 4]; nodes])?;
    let kernel = Arc::new(Kernel::new(gpu, &shaders::FRAME_SURFACE, &[])?);
    let named = [("rows", &rows), ("weights", &weights), ("state", state), ("followers", &followers)];
    let bound = kernel.bind(gpu, &named)?;
    let sizes = [rows.size(), weights.size(), followers.size()];
    buffers.extend(sizes);
    let pass = FramePass {
        kernel,
        bound,
        workgroups: (nodes as u32).div_ceil(WORKGROUP),
        bytes: sizes.iter().sum::<u64>() + state.size(),
    };
    Ok((pass, followers))
}

/// State at the start: displacements under the nodes' `weight` (m), then velocities where there are any; four numbers a
/// node.
fn start(
    mechanics: &Mechanics,
    weight: &[DVec3],
    stiffening: Option<&Stiffening>,
    effects: &GraphicsEffects,
) -> Result<Vec<[f32; 4]>, Error> {
    let nodes = mechanics.moved.len();
    let mut start = vec![[0.0; 4]; if effects.quasi_static { nodes } else { 2 * nodes }];
    if !weight.is_empty() {
        for (start, u) in start.iter_mut().zip(settled(mechanics, weight, stiffening)?) {
            *start = u.as_vec3().extend(0.0).to_array();
        }
    }
    Ok(start)
}

/// Inverse of 2M/T + B + (T/2) K, row-major; of (T/2) K in quasi-static graphics. One number for a pair of nodes where
/// the three coordinates are alike, as the flag says, else 3 x 3. An inverse that would not fit in memory is an
/// error before it is begun.
fn inverse(
    mechanics: &Mechanics,
    stiffness: &Stiffness,
    period: f64,
    effects: &GraphicsEffects,
) -> Result<(Vec<f32>, bool), Error> {
    let nodes = mechanics.moved.len();
    let inertia = mechanics.mass.iter().zip(&mechanics.damping);
    let mut diagonal: Vec<f64> = inertia.map(|(mass, damping)| 2.0 * mass / period + damping).collect();
    if effects.quasi_static {
        diagonal.fill(0.0);
    }
    check_memory(nodes, stiffness.is_isotropic())?;
    let inverse = Compliance::inverse(&Factor::of(stiffness, period / 2.0, &diagonal)?, nodes);
    let entries = inverse.entries.iter().map(|&entry| entry as f32).collect();
    Ok((entries, inverse.rows_per_node == 1))
}

/// Refuses an inverse over `nodes` nodes that would not fit in the host's memory, before anything is allocated: f64 as
/// it is solved, f32 as the device takes it, and once more on its way there.
fn check_memory(nodes: usize, is_isotropic: bool) -> Result<(), Error> {
    let order = nodes.saturating_mul(if is_isotropic { 1 } else { 3 });
    let bytes = order.saturating_pow(2).saturating_mul(size_of::<f64>() + 2 * size_of::<f32>());
    let enough = if bytes > memory::SMALL { memory::check(bytes) } else { Ok(()) };
    enough.map_err(|shortage| error!("the motion of an object of {nodes} nodes: {shortage}, or use a coarser surface"))
}

/// Buffers that all stages bind.
struct Common {
    nodes: u32,
    parameters: StorageBuffer,
    structure: StorageBuffer,
    blocks: StorageBuffer,
    /// Masses and damping; none in quasi-static graphics.
    inertia: Option<StorageBuffer>,
    forces: StorageBuffer,
    /// See [`FrameUpdate::loads`].
    loads: Option<StorageBuffer>,
    state: StorageBuffer,
}

impl Common {
    /// The update of an object of matrix `stiffness`, from the state `start`; `is_heavy` where nodes have a weight.
    fn new(
        gpu: &Context,
        mechanics: &Mechanics,
        stiffness: &Stiffness,
        (period, effects): (f64, &GraphicsEffects),
        start: &[[f32; 4]],
        is_heavy: bool,
    ) -> Result<Self, GpuError> {
        let nodes = mechanics.moved.len();
        let zero = vec![[0.0f32; 4]; nodes.max(mechanics.attachment.rows())];
        let has_loads = is_heavy || effects.stiffening.is_some() || !mechanics.attachment.is_identity();
        let mut structure: Vec<u32> = stiffness.offsets.iter().map(|&offset| offset as u32).collect();
        structure.extend(&stiffness.columns);
        let blocks: Vec<f32> =
            stiffness.blocks.iter().flat_map(|block| block.to_cols_array()).map(|entry| entry as f32).collect();
        let inertia: Vec<[f32; 2]> = mechanics
            .mass
            .iter()
            .zip(&mechanics.damping)
            .map(|(&mass, &damping)| [mass as f32, damping as f32])
            .collect();
        let parameters = FrameParameters { nodes: nodes as u32, period: period as f32 };
        Ok(Self {
            nodes: parameters.nodes,
            parameters: StorageBuffer::uniform(gpu, "frame parameters", &[parameters])?,
            structure: StorageBuffer::from_slice(gpu, "stiffness structure", &structure)?,
            blocks: StorageBuffer::from_slice(gpu, "stiffness blocks", &blocks)?,
            inertia: (!effects.quasi_static)
                .then(|| StorageBuffer::from_slice(gpu, "masses and damping", &inertia))
                .transpose()?,
            forces: StorageBuffer::from_slice(gpu, "frame forces", &zero[..mechanics.attachment.rows()])?,
            loads: has_loads.then(|| StorageBuffer::from_slice(gpu, "frame loads", &zero[..nodes])).transpose()?,
            state: StorageBuffer::from_slice(gpu, "frame state", start)?,
        })
    }

    /// Sizes of the buffers (B).
    fn sizes(&self) -> Vec<u64> {
        let Self { nodes: _, parameters, structure, blocks, inertia, forces, loads, state } = self;
        let always = [state, forces, structure, blocks, parameters];
        always.into_iter().chain(inertia).chain(loads).map(StorageBuffer::size).collect()
    }

    /// Nothing reads masses where there are none: the binding takes any buffer.
    fn masses(&self) -> &StorageBuffer {
        self.inertia.as_ref().unwrap_or(&self.forces)
    }

    /// The forces that act on the nodes.
    fn acting(&self) -> &StorageBuffer {
        self.loads.as_ref().unwrap_or(&self.forces)
    }

    /// Bindings of a stage on which `forces` act and that has two buffers of its own.
    fn bindings<'a>(
        &'a self,
        forces: &'a StorageBuffer,
        own: [(&'a str, &'a StorageBuffer); 2],
    ) -> [(&'a str, &'a StorageBuffer); 8] {
        [
            ("parameters", &self.parameters),
            ("structure", &self.structure),
            ("blocks", &self.blocks),
            ("inertia", self.masses()),
            ("forces", forces),
            ("state", &self.state),
            own[0],
            own[1],
        ]
    }

    /// Adds what stiffening by `factor` from the strain `strain` on adds to the `loads`.
    fn stiffening_stage(
        &self,
        gpu: &Context,
        reach: &StorageBuffer,
        loads: &StorageBuffer,
        [factor, strain]: [f64; 2],
    ) -> Result<FramePass, GpuError> {
        let Self { nodes, structure, blocks, forces, .. } = self;
        let constants = [("FACTOR", factor), ("STRAIN", strain)];
        let kernel = Arc::new(Kernel::new(gpu, &shaders::FRAME_STIFFENING, &constants)?);
        let bound = kernel.bind(gpu, &self.bindings(forces, [("reach", reach), ("loads", loads)]))?;
        // Forces and what is added to them are read and written, displacements read.
        let vectors = 3 * VECTOR * u64::from(*nodes);
        let bytes = structure.size() + blocks.size() + reach.size() + vectors;
        Ok(FramePass { kernel, bound, workgroups: nodes.div_ceil(WORKGROUP), bytes })
    }

    fn stages(
        &self,
        gpu: &Context,
        [inverse, right]: [&StorageBuffer; 2],
        overrides: &[(&str, f64)],
    ) -> Result<[FramePass; 2], GpuError> {
        let buffers = self.bindings(self.acting(), [("inverse", inverse), ("right", right)]);
        let stage = |shader, workgroups, bytes| -> Result<FramePass, GpuError> {
            let kernel = Arc::new(Kernel::new(gpu, shader, overrides)?);
            let bound = kernel.bind(gpu, &buffers)?;
            Ok(FramePass { kernel, bound, workgroups, bytes })
        };
        let load = buffers[1..6].iter().map(|(_, buffer)| buffer.size()).sum::<u64>() + right.size();
        let advance = inverse.size() + right.size() + 2 * self.state.size();
        let groups = self.nodes.div_ceil(WORKGROUP);
        Ok([stage(&shaders::FRAME_LOAD, groups, load)?, stage(&shaders::FRAME_ADVANCE, self.nodes, advance)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn an_inverse_that_no_memory_holds_is_refused_with_bytes_and_remedy() {
        assert!(check_memory(100, true).is_ok() && check_memory(100, false).is_ok());
        // 2^24 nodes need 2^52 bytes, or nine times as many.
        for (is_isotropic, megabytes) in [(true, "4503599628 MB"), (false, "40532396647 MB")] {
            let said = check_memory(1 << 24, is_isotropic).unwrap_err().to_string();
            assert!(said.contains("of 16777216 nodes"), "{said}");
            assert!(said.contains(megabytes) && said.contains("ulimit -v") && said.contains("coarser"), "{said}");
        }
    }
}
