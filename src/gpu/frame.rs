//! The object's nodes, one passive step a frame (theory: non-iterative passive mechanical integration):
//! `(2M/T + B + (T/2) K) v_hat = (2M/T) v_k - K (n_k - n0) + f`, `n_{k+1} = n_k + T v_hat`, `v_{k+1} = 2 v_hat - v_k`.
//!
//! The state stays on the device, in a buffer that a viewer draws from, and is multiplied by the inverse of the matrix,
//! computed once in f64. Large objects, whose inverse would not fit, those whose surface follows other nodes, and effects
//! are left to the CPU's step (`render/object_motion.rs`, the twin), which takes less than a millisecond for as many
//! nodes as have an inverse here.

use super::{
    buffer::StorageBuffer, context::Context, error::GpuError, kernel::Kernel, layout::FrameParameters, shaders,
};
use crate::object::{Compliance, Factor, Mechanics, Object};
use crate::scene::GraphicsEffects;
use crate::{Error, error, memory};
use glam::DVec3;
use std::sync::Arc;

/// Invocations of a workgroup; the shader's default.
const WORKGROUP: u32 = 64;

/// One dispatch of every frame.
struct FramePass {
    kernel: Kernel,
    bound: wgpu::BindGroup,
    workgroups: u32,
}

/// The nodes' state on the device, and the stages that advance it.
pub struct FrameUpdate {
    context: Arc<Context>,
    nodes: usize,
    forces: StorageBuffer,
    state: StorageBuffer,
    /// Forces as the shader reads them.
    padded: Vec<[f32; 4]>,
    stages: [FramePass; 2],
    bytes: u64,
}

impl FrameUpdate {
    /// Most memory that an inverse is worth, which is read once a frame: that of 3,000 nodes where springs and ground
    /// are isotropic, else of 1,000 (B).
    const MOST_BYTES_INVERTED: usize = 36_000_000;

    /// Whether an object of these `mechanics` is moved here: its surface follows no other nodes, nothing but smoothing
    /// acts on what is drawn, and the inverse is small enough to be read in every frame, 4 N^2 bytes where springs and
    /// ground are isotropic, else 36 N^2.
    #[must_use]
    pub fn suits(mechanics: &Mechanics, effects: &GraphicsEffects) -> bool {
        let Mechanics { stiffness, moved, attachment, .. } = mechanics;
        let order = if stiffness.is_isotropic() { moved.len() } else { 3 * moved.len() };
        let is_plain = GraphicsEffects { smoothing: None, ..*effects } == GraphicsEffects::default();
        attachment.is_identity() && is_plain && order.saturating_pow(2) <= Self::MOST_BYTES_INVERTED / size_of::<f32>()
    }

    /// The object at rest, to be advanced by `period` (s) a frame. Smoothing is no matter of the device: forces are
    /// filtered before they come here.
    ///
    /// # Errors
    /// When the surface follows other nodes, the matrix is not positive definite (masses, damping or period are not
    /// positive), its inverse would not fit in memory, or the device refuses.
    pub fn new(context: Arc<Context>, object: &Object, period: f64) -> Result<Self, Error> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(error!("the time between frames is {period} s; it must be a positive number"));
        }
        let mechanics = object.mechanics()?;
        let Mechanics { stiffness, mass, damping, attachment, .. } = mechanics;
        if !attachment.is_identity() {
            return Err("the object's surface follows the nodes of its elements: the CPU moves it".into());
        }
        let (nodes, gpu) = (mechanics.moved.len(), context.as_ref());
        let (inverse, is_isotropic) = inverse(mechanics, period)?;
        let structure = stiffness.offsets.iter().map(|&offset| offset as u32).chain(stiffness.columns.iter().copied());
        let blocks = stiffness.blocks.iter().flat_map(|block| block.to_cols_array()).map(|entry| entry as f32);
        let inertia = mass.iter().zip(damping).map(|(&mass, &damping)| [mass as f32, damping as f32]);
        let parameters = FrameParameters { nodes: nodes as u32, period: period as f32 };
        let parameters = StorageBuffer::uniform(gpu, "frame parameters", &[parameters])?;
        let structure = StorageBuffer::from_slice(gpu, "stiffness structure", &structure.collect::<Vec<_>>())?;
        let blocks = StorageBuffer::from_slice(gpu, "stiffness blocks", &blocks.collect::<Vec<_>>())?;
        let inertia = StorageBuffer::from_slice(gpu, "masses and damping", &inertia.collect::<Vec<_>>())?;
        let forces = StorageBuffer::from_slice(gpu, "frame forces", &vec![[0.0f32; 4]; nodes])?;
        let state = StorageBuffer::from_slice(gpu, "frame state", &vec![[0.0f32; 4]; 2 * nodes])?;
        let inverse = StorageBuffer::from_slice(gpu, "inverse", &inverse)?;
        let right = StorageBuffer::new(gpu, "right-hand side", 12 * nodes as u64)?;
        let buffers = [
            ("parameters", &parameters),
            ("structure", &structure),
            ("blocks", &blocks),
            ("inertia", &inertia),
            ("forces", &forces),
            ("state", &state),
            ("right", &right),
            ("inverse", &inverse),
        ];
        let overrides: &[(&str, f64)] = if is_isotropic { &[("ISOTROPIC", 1.0)] } else { &[] };
        let stage = |shader, workgroups| -> Result<FramePass, GpuError> {
            let kernel = Kernel::new(gpu, shader, overrides)?;
            let bound = kernel.bind(gpu, &buffers)?;
            Ok(FramePass { kernel, bound, workgroups })
        };
        let stages = [
            stage(&shaders::FRAME_LOAD, (nodes as u32).div_ceil(WORKGROUP))?,
            stage(&shaders::FRAME_ADVANCE, nodes as u32)?,
        ];
        let bytes = buffers.iter().map(|(_, buffer)| buffer.size()).sum();
        Ok(Self { context, nodes, forces, state, padded: Vec::new(), stages, bytes })
    }

    /// Memory of all its buffers on the device (B).
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Advances by one frame under `forces`, one per node (N); missing ones count as zero. Does not wait for the device.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn step(&mut self, forces: &[DVec3]) -> Result<(), GpuError> {
        self.padded.clear();
        self.padded.extend(forces.iter().map(|force| force.as_vec3().extend(0.0).to_array()));
        self.padded.resize(self.nodes, [0.0; 4]);
        self.forces.write(&self.context, &self.padded);
        let mut encoder = self.context.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        self.stages.iter().for_each(|stage| stage.kernel.record(&mut pass, &stage.bound, stage.workgroups));
        drop(pass);
        self.context.queue.submit([encoder.finish()]);
        self.context.check()
    }

    /// Displacements u = n - n0 (m) and velocities (m/s) of all nodes. Waits for the device.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn read(&self) -> Result<(Vec<DVec3>, Vec<DVec3>), GpuError> {
        let state: Vec<[f32; 4]> = self.state.read(&self.context, 2 * self.nodes)?;
        let mut vectors: Vec<DVec3> =
            state.iter().map(|&[x, y, z, _]| DVec3::new(x.into(), y.into(), z.into())).collect();
        let velocities = vectors.split_off(self.nodes);
        Ok((vectors, velocities))
    }

    /// Displacements of the nodes, then velocities, four numbers a node: what a viewer binds to draw the object.
    #[must_use]
    pub fn state_buffer(&self) -> &wgpu::Buffer {
        &self.state.raw
    }

    /// Contact forces of the last frame, four numbers a node (N).
    #[must_use]
    pub fn force_buffer(&self) -> &wgpu::Buffer {
        &self.forces.raw
    }
}

/// Inverse of 2M/T + B + (T/2) K, row-major. One number for a pair of nodes where the three coordinates are alike, as the
/// flag says, else 3 x 3. An inverse that would not fit in memory is an error before it is begun.
fn inverse(mechanics: &Mechanics, period: f64) -> Result<(Vec<f32>, bool), Error> {
    let Mechanics { stiffness, mass, damping, .. } = mechanics;
    let diagonal: Vec<f64> = mass.iter().zip(damping).map(|(mass, damping)| 2.0 * mass / period + damping).collect();
    check_memory(diagonal.len(), stiffness.is_isotropic())?;
    let inverse = Compliance::inverse(&Factor::of(stiffness, period / 2.0, &diagonal)?, diagonal.len());
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
