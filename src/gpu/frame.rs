//! The object's nodes, one passive step a frame (theory: non-iterative passive mechanical integration):
//! `(2M/T + B + (T/2) K) v_hat = (2M/T) v_k - K (n_k - n0) + f`, `n_{k+1} = n_k + T v_hat`, `v_{k+1} = 2 v_hat - v_k`.
//!
//! The state stays on the device, in a buffer that a viewer draws from. Small objects multiply by the inverse of the
//! matrix, computed once in f64; large ones, whose inverse would not fit, take a fixed number of conjugate-gradient
//! iterations, which keeps the step passive however few they are (see `shaders/frame_iterative.wgsl`).

use super::{
    context::{Context, GpuError},
    kernel::{Access, Kernel, StorageBuffer},
    layout::FrameParameters,
    shaders,
};
use crate::object::{Factor, FactorError, Object};
use glam::DVec3;
use std::sync::Arc;

/// Invocations of a workgroup; the shader's default.
const WORKGROUP: u32 = 64;

/// Which solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameMethod {
    /// Inverse computed beforehand: 36 N^2 bytes, two dispatches a frame.
    Inverse,
    /// This many iterations of conjugate gradients a frame, at least one.
    Iterations(u32),
}

impl FrameMethod {
    /// Most nodes whose inverse is worth its memory: 36 MB, read once a frame.
    pub const MOST_NODES_INVERTED: usize = 1000;

    /// Enough iterations for objects whose springs reach a few dozen edges in one period.
    pub const USUAL_ITERATIONS: u32 = 32;

    /// What suits an object of `nodes` nodes.
    #[must_use]
    pub fn suitable(nodes: usize) -> Self {
        if nodes <= Self::MOST_NODES_INVERTED { Self::Inverse } else { Self::Iterations(Self::USUAL_ITERATIONS) }
    }
}

/// Why the frame update cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// The device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The matrix.
    #[error(transparent)]
    Matrix(#[from] FactorError),
    /// The time between frames is not a positive number.
    #[error("the time between frames is {0} s; it must be a positive number")]
    Period(f64),
}

/// One recorded dispatch: kernel, bindings, workgroups.
type Stage = (Arc<Kernel>, wgpu::BindGroup, u32);

/// The nodes' state on the device, and the stages that advance it.
pub struct FrameUpdate {
    context: Arc<Context>,
    nodes: usize,
    state: StorageBuffer,
    forces: StorageBuffer,
    /// The forces as the shader reads them.
    padded_forces: Vec<[f32; 4]>,
    stages: Vec<Stage>,
}

impl FrameUpdate {
    /// The object at rest, to be advanced by `period` [s] a frame.
    ///
    /// # Errors
    /// When the matrix is not positive definite (masses, damping or period are not positive) or the device refuses.
    pub fn new(context: Arc<Context>, object: &Object, period: f64, method: FrameMethod) -> Result<Self, FrameError> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(FrameError::Period(period));
        }
        let nodes = object.rest.len();
        let gpu = context.as_ref();
        let state = StorageBuffer::from_slice(gpu, "frame state", &vec![[0.0f32; 4]; 2 * nodes])?;
        let forces = StorageBuffer::from_slice(gpu, "frame forces", &vec![[0.0f32; 4]; nodes])?;
        let stiffness = &object.stiffness;
        let mut structure: Vec<u32> = stiffness.offsets.iter().map(|&offset| offset as u32).collect();
        structure.extend(&stiffness.columns);
        let blocks: Vec<f32> =
            stiffness.blocks.iter().flat_map(|block| block.to_cols_array()).map(|entry| entry as f32).collect();
        let inertia: Vec<[f32; 2]> =
            object.mass.iter().zip(&object.damping).map(|(&mass, &damping)| [mass as f32, damping as f32]).collect();
        let structure = StorageBuffer::from_slice(gpu, "stiffness structure", &structure)?;
        let blocks = StorageBuffer::from_slice(gpu, "stiffness blocks", &blocks)?;
        let inertia = StorageBuffer::from_slice(gpu, "masses and damping", &inertia)?;
        let groups = (nodes as u32).div_ceil(WORKGROUP);
        let parameters = |odd: u32| FrameParameters { nodes: nodes as u32, period: period as f32, odd, groups };
        let even = StorageBuffer::uniform(gpu, "frame parameters", &parameters(0))?;
        let common = [&structure, &blocks, &inertia, &forces, &state];
        let stages = match method {
            FrameMethod::Inverse => {
                let inverse = StorageBuffer::from_slice(gpu, "inverse", &inverse(object, period)?)?;
                let right = StorageBuffer::new(gpu, "right-hand side", 12 * nodes as u64)?;
                dense_stages(gpu, &even, common, [&inverse, &right], groups, nodes as u32)?
            }
            FrameMethod::Iterations(iterations) => {
                let odd = StorageBuffer::uniform(gpu, "frame parameters", &parameters(1))?;
                let work = StorageBuffer::new(gpu, "conjugate gradients", 5 * 16 * nodes as u64)?;
                let sums = StorageBuffer::new(gpu, "sums", 3 * 4 * u64::from(groups))?;
                iterative_stages(gpu, [&even, &odd], common, [&work, &sums], groups, iterations)?
            }
        };
        Ok(Self { nodes, state, forces, padded_forces: vec![[0.0; 4]; nodes], stages, context })
    }

    /// Advances by one frame under `forces`, one per node [N]; missing ones count as zero. Does not wait for the device.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn step(&mut self, forces: &[DVec3]) -> Result<(), GpuError> {
        self.padded_forces.fill([0.0; 4]);
        for (padded, force) in self.padded_forces.iter_mut().zip(forces) {
            *padded = force.as_vec3().extend(0.0).to_array();
        }
        self.forces.write(&self.context, &self.padded_forces);
        let mut encoder = self.context.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            for (kernel, bound, workgroups) in &self.stages {
                kernel.record(&mut pass, bound, *workgroups);
            }
        }
        self.context.queue.submit([encoder.finish()]);
        self.context.check()
    }

    /// Displacements u = n - n0 [m] and velocities [m/s] of all nodes. Waits for the device.
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

    /// Displacements, then velocities, four numbers a node: what a viewer binds to draw the object.
    #[must_use]
    pub fn state_buffer(&self) -> &wgpu::Buffer {
        &self.state.raw
    }
}

/// Inverse of 2M/T + B + (T/2) K, row-major.
fn inverse(object: &Object, period: f64) -> Result<Vec<f32>, FactorError> {
    let nodes = object.rest.len();
    let diagonal: Vec<f64> =
        object.mass.iter().zip(&object.damping).map(|(mass, damping)| 2.0 * mass / period + damping).collect();
    let factor = Factor::of(&object.stiffness, period / 2.0, &diagonal)?;
    let mut inverse = Vec::with_capacity(9 * nodes * nodes);
    let mut unit = vec![DVec3::ZERO; nodes];
    for row in 0..3 * nodes {
        unit.fill(DVec3::ZERO);
        unit[row / 3][row % 3] = 1.0;
        factor.solve(&mut unit);
        // Column `row` of a symmetric matrix.
        inverse.extend(unit.iter().flat_map(|v| v.as_vec3().to_array()));
    }
    Ok(inverse)
}

const DENSE: [Access; 8] = {
    use Access::{Read, Uniform, Write};
    [Uniform, Read, Read, Read, Read, Write, Read, Write]
};

const ITERATIVE: [Access; 8] = {
    use Access::{Read, Uniform, Write};
    [Uniform, Read, Read, Read, Read, Write, Write, Write]
};

fn dense_stages(
    context: &Context,
    parameters: &StorageBuffer,
    [structure, blocks, inertia, forces, state]: [&StorageBuffer; 5],
    [inverse, right]: [&StorageBuffer; 2],
    groups: u32,
    nodes: u32,
) -> Result<Vec<Stage>, GpuError> {
    let buffers = [parameters, structure, blocks, inertia, forces, state, inverse, right];
    let mut stages = Vec::new();
    for (shader, workgroups) in [(&shaders::FRAME_LOAD, groups), (&shaders::FRAME_ADVANCE, nodes)] {
        let kernel = Arc::new(Kernel::new(context, shader, &[], &DENSE)?);
        let bound = kernel.bind(context, &buffers)?;
        stages.push((kernel, bound, workgroups));
    }
    Ok(stages)
}

fn iterative_stages(
    context: &Context,
    parameters: [&StorageBuffer; 2],
    [structure, blocks, inertia, forces, state]: [&StorageBuffer; 5],
    [work, sums]: [&StorageBuffer; 2],
    groups: u32,
    iterations: u32,
) -> Result<Vec<Stage>, GpuError> {
    let stage = |shader, odd: u32| -> Result<Stage, GpuError> {
        let kernel = Arc::new(Kernel::new(context, shader, &[], &ITERATIVE)?);
        let buffers = [parameters[odd as usize], structure, blocks, inertia, forces, state, work, sums];
        let bound = kernel.bind(context, &buffers)?;
        Ok((kernel, bound, groups))
    };
    // The same kernel with the bindings of the odd iterations.
    let odd = |(kernel, _, _): &Stage| -> Result<Stage, GpuError> {
        let buffers = [parameters[1], structure, blocks, inertia, forces, state, work, sums];
        Ok((Arc::clone(kernel), kernel.bind(context, &buffers)?, groups))
    };
    let product = stage(&shaders::FRAME_PRODUCT, 0)?;
    let correct = stage(&shaders::FRAME_CORRECT, 0)?;
    let turn = stage(&shaders::FRAME_TURN, 0)?;
    let turns = [[product.clone(), correct.clone(), turn.clone()], [odd(&product)?, odd(&correct)?, odd(&turn)?]];
    let mut stages = vec![stage(&shaders::FRAME_BEGIN, 0)?];
    for iteration in 0..iterations.max(1) as usize {
        stages.extend_from_slice(&turns[iteration % 2]);
    }
    stages.push(stage(&shaders::FRAME_FINISH, 0)?);
    Ok(stages)
}
