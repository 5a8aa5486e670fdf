//! The object as it is drawn: interpolated contact forces move its nodes, frame by frame (section 3.2).
//!
//! *Forces.* The extended contact force f_ex(q) of a grid point has f_j at its contacting nodes and zero elsewhere. Between
//! grid points `f_ex_bar(q) = share sum_c w_c f_ex(q_c)`, with the corners and weights of the torque and the factor that
//! boundary layer and fade put on it, so that what is seen and what is felt stay `tau_bar = -sum_i J_i^T f`.
//!
//! *Motion.* Non-iterative passive mechanical integration with a constant time T between frames, u = n - n0:
//! `(2M/T + B + (T/2) K) v_hat = (2M/T) v_k - K u_k + f`, `u_{k+1} = u_k + T v_hat`, `v_{k+1} = 2 v_hat - v_k`.
//! The matrix is constant, symmetric and positive definite: factorised once. To rounding, for any T and stiffness,
//! `Delta(1/2 v^T M v + 1/2 u^T K u) = T v_hat . f - T v_hat . B v_hat`: without forces energy never rises.
//!
//! `ObjectMotion::load` and `ObjectMotion::advance` are the twins of the entry points in `shaders/frame.wgsl`.

use super::stencil::{Lattice, LatticeError};
use crate::{
    dataset::Dataset,
    object::{Factor, FactorError, Object},
};
use glam::DVec3;

/// Contact forces of a dataset, copied out of its file.
pub struct ContactForces {
    lattice: Lattice,
    /// One more than there are grid points.
    offsets: Vec<usize>,
    nodes: Vec<u32>,
    /// [N]
    forces: Vec<[f32; 3]>,
}

/// The object cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GraphicsError {
    /// The dataset's grid is none.
    #[error(transparent)]
    Grid(#[from] LatticeError),
    /// The dataset has no contact forces.
    #[error("the dataset holds no contact forces: name [graphics] in its scene and bake it again")]
    NoForces,
    /// The compressed rows of the contact forces are not consistent with the grid or with the object.
    #[error("the dataset's contact forces do not fit its grid and an object of {nodes} nodes: bake it again")]
    Rows {
        /// Nodes of the object.
        nodes: usize,
    },
    /// The time between frames is not a positive number.
    #[error("the time between frames is {0} s; it must be a positive number")]
    Period(f64),
    /// The object's matrix cannot be factorised.
    #[error(transparent)]
    Factor(#[from] FactorError),
}

impl ContactForces {
    /// The contact forces of `dataset` on an object of `nodes` nodes.
    ///
    /// # Errors
    /// When there are none, or they do not fit.
    pub fn new(dataset: &Dataset, nodes: usize) -> Result<Self, GraphicsError> {
        let lattice = Lattice::new(&dataset.grid)?;
        let contacts = dataset.contacts.as_ref().ok_or(GraphicsError::NoForces)?;
        let count = contacts.nodes.len();
        let offsets: Vec<usize> = contacts.offsets.iter().map(|&o| usize::try_from(o).unwrap_or(usize::MAX)).collect();
        let fits = offsets.len() == lattice.points() + 1
            && offsets.is_sorted()
            && offsets.last() == Some(&count)
            && contacts.forces.len() == 3 * count
            && contacts.nodes.iter().all(|&node| (node as usize) < nodes)
            && contacts.forces.iter().all(|f| f.is_finite());
        if !fits {
            return Err(GraphicsError::Rows { nodes });
        }
        let forces = contacts.forces.chunks_exact(3).map(|f| [f[0], f[1], f[2]]).collect();
        Ok(Self { lattice, offsets, nodes: contacts.nodes.to_vec(), forces })
    }

    /// Writes f_ex_bar at `q`, times `share`, to `forces`, one entry per node of the object [N].
    pub fn interpolate(&self, q: &[f64], share: f64, forces: &mut [DVec3]) {
        forces.fill(DVec3::ZERO);
        for (point, weight) in self.lattice.locate(q).corners() {
            let scale = share * weight;
            if scale > 0.0 {
                let row = self.offsets[point]..self.offsets[point + 1];
                for (&node, force) in self.nodes[row.clone()].iter().zip(&self.forces[row]) {
                    forces[node as usize] += scale * DVec3::from(force.map(f64::from));
                }
            }
        }
    }
}

/// The object in motion: displacements and velocities of all its nodes.
pub struct ObjectMotion<'object> {
    object: &'object Object,
    factor: Factor,
    period: f64,
    /// u [m].
    displacement: Vec<DVec3>,
    /// v [m/s].
    velocity: Vec<DVec3>,
    /// Right-hand side, then v_hat.
    right: Vec<DVec3>,
}

impl<'object> ObjectMotion<'object> {
    /// `object` at rest, to be moved by `period` T [s] at a time.
    ///
    /// # Errors
    /// When `period` is not positive, or there is no memory for the factor.
    pub fn new(object: &'object Object, period: f64) -> Result<Self, GraphicsError> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(GraphicsError::Period(period));
        }
        let diagonal: Vec<f64> = object.mass.iter().zip(&object.damping).map(|(m, b)| 2.0 * m / period + b).collect();
        let factor = Factor::of(&object.stiffness, 0.5 * period, &diagonal)?;
        let zero = vec![DVec3::ZERO; object.rest.len()];
        Ok(Self { object, factor, period, displacement: zero.clone(), velocity: zero.clone(), right: zero })
    }

    /// T [s].
    #[must_use]
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Node positions n = n0 + u [m].
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = DVec3> {
        self.object.rest.iter().zip(&self.displacement).map(|(rest, u)| rest + u)
    }

    /// Displacements u [m].
    #[must_use]
    pub fn displacement(&self) -> &[DVec3] {
        &self.displacement
    }

    /// Velocities v [m/s].
    #[must_use]
    pub fn velocity(&self) -> &[DVec3] {
        &self.velocity
    }

    /// One frame under `forces`, one per node [N]. Returns v_hat [m/s].
    pub fn step(&mut self, forces: &[DVec3]) -> &[DVec3] {
        self.load(forces);
        self.advance();
        &self.right
    }

    /// Right-hand side (2M/T) v - K u + f.
    fn load(&mut self, forces: &[DVec3]) {
        self.object.stiffness.apply(&self.displacement, &mut self.right);
        for (node, right) in self.right.iter_mut().enumerate() {
            *right = forces[node] + (2.0 * self.object.mass[node] / self.period) * self.velocity[node] - *right;
        }
    }

    /// v_hat from the right-hand side, and the new state.
    fn advance(&mut self) {
        self.factor.solve(&mut self.right);
        for (node, v_hat) in self.right.iter().enumerate() {
            self.displacement[node] += self.period * v_hat;
            self.velocity[node] = 2.0 * v_hat - self.velocity[node];
        }
    }
}

/// The graphics loop's part of a session.
pub struct Graphics<'object> {
    contact: ContactForces,
    motion: ObjectMotion<'object>,
    forces: Vec<DVec3>,
}

impl<'object> Graphics<'object> {
    /// `object`, deformed by the forces of `dataset`, at `rate` frames a second [Hz].
    ///
    /// # Errors
    /// When forces, object and rate do not make a loop.
    pub fn new(dataset: &Dataset, object: &'object Object, rate: f64) -> Result<Self, GraphicsError> {
        let contact = ContactForces::new(dataset, object.rest.len())?;
        let motion = ObjectMotion::new(object, 1.0 / rate)?;
        Ok(Self { contact, motion, forces: vec![DVec3::ZERO; object.rest.len()] })
    }

    /// One frame with the proxy at `q`, where the field puts `share` on the dataset's torque; zero out of contact.
    pub fn frame(&mut self, q: &[f64], share: f64) {
        self.contact.interpolate(q, share, &mut self.forces);
        self.motion.step(&self.forces);
    }

    /// The object as it is now.
    #[must_use]
    pub fn motion(&self) -> &ObjectMotion<'object> {
        &self.motion
    }
}
