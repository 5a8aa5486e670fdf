//! The object's nodes in motion, a step a frame (section 3.2), u = n - n0.
//!
//! K moves its own nodes; forces on the object's nodes act through N^T, and these follow by N (see `object::Attachment`).
//!
//! *Dynamics.* Non-iterative passive mechanical integration with a constant time T between frames:
//! `(2M/T + B + (T/2) K) v_hat = (2M/T) v_k - K u_k + f`, `u_{k+1} = u_k + T v_hat`, `v_{k+1} = 2 v_hat - v_k`.
//! The matrix is constant, symmetric and positive definite: factorised once. To rounding, for any T and stiffness,
//! `Delta(1/2 v^T M v + 1/2 u^T K u) = T v_hat . f - T v_hat . B v_hat`: without forces energy never rises.
//!
//! *Effects*, each absent unless it is named: gravity adds the nodes' weight to f, from the equilibrium under it on,
//! and its potential to the energy. Stiffening puts K1 in the place of K on the left and grad W(u) in that of K u on
//! the right, which keeps the step passive (see [`Stiffening`]). Quasi-static graphics has `u = K^-1 f` and neither M,
//! B nor v.
//!
//! A frame of an object so large that its factor does not fit a core's caches is shared out among threads of its own,
//! so that it waits for nothing else; the result is the same for any number of them.
//!
//! `ObjectMotion::load` and `ObjectMotion::advance` are the twins of the entry points in `shaders/frame.wgsl`.

use crate::{
    Error, error,
    object::{Factor, Mechanics, Object, Stiffening, settled},
    scene::GraphicsEffects,
    threads::refused,
};
use glam::DVec3;
use rayon::{ThreadPool, ThreadPoolBuilder, prelude::*};

/// Displacements of all nodes of K, and their velocities where there are dynamics.
pub struct ObjectMotion<'object> {
    object: &'object Object,
    mechanics: &'object Mechanics,
    period: f64,
    /// Absent in quasi-static graphics.
    dynamics: Option<Dynamics>,
    stiffening: Option<Stiffening>,
    /// M g of each node (N).
    weight: Option<Vec<DVec3>>,
    /// u (m).
    displacement: Vec<DVec3>,
    /// Forces on the nodes of K, then the right-hand side, then v_hat (m/s); in quasi-static graphics u.
    right: Vec<DVec3>,
    /// Where a frame is shared out.
    threads: Option<ThreadPool>,
}

/// Nodes that one thread takes at least: some microseconds of work.
const NODES_TOGETHER: usize = 1024;

/// State of an object with inertia.
struct Dynamics {
    /// Factor of 2M/T + B + (T/2) K.
    factor: Factor,
    /// Multiples of the identity that are the blocks of K, if it is isotropic (N/m).
    scales: Option<Vec<f64>>,
    /// v (m/s).
    velocity: Vec<DVec3>,
}

impl<'object> ObjectMotion<'object> {
    /// `object` in equilibrium under no forces but its weight, where there is one, to be moved by `period` T (s) at a
    /// time.
    ///
    /// # Errors
    /// When `period` is not positive, or there is no memory for the factor or no threads for a large one.
    pub fn new(object: &'object Object, period: f64, effects: &GraphicsEffects) -> Result<Self, Error> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(error!("the time between frames is {period} s; it must be a positive number"));
        }
        let mechanics = object.mechanics()?;
        let zero = vec![DVec3::ZERO; mechanics.moved.len()];
        let stiffening = effects.stiffening.map(|spec| Stiffening::new(mechanics, spec.factor, spec.strain));
        let dynamics = if effects.quasi_static {
            None
        } else {
            let inertia = mechanics.mass.iter().zip(&mechanics.damping);
            let diagonal: Vec<f64> = inertia.map(|(m, b)| 2.0 * m / period + b).collect();
            let stiffness = stiffening.as_ref().map_or(&mechanics.stiffness, Stiffening::bound);
            let factor = Factor::of(stiffness, 0.5 * period, &diagonal)?;
            Some(Dynamics { factor, scales: stiffness.scales(), velocity: zero.clone() })
        };
        let weight: Option<Vec<DVec3>> = effects.gravity.map(|g| mechanics.mass.iter().map(|m| *m * g).collect());
        let displacement = match &weight {
            Some(weight) => settled(mechanics, weight, stiffening.as_ref())?,
            None => zero.clone(),
        };
        let factor = dynamics.as_ref().map_or(&mechanics.factor, |dynamics| &dynamics.factor);
        let threads =
            factor.is_shared().then(|| ThreadPoolBuilder::new().thread_name(|k| format!("frame {k}")).build());
        let threads = threads.transpose().map_err(refused)?;
        Ok(Self { object, mechanics, period, dynamics, stiffening, weight, displacement, right: zero, threads })
    }

    /// Whether it has velocities; none in quasi-static graphics.
    #[must_use]
    pub fn has_dynamics(&self) -> bool {
        self.dynamics.is_some()
    }

    /// T (s).
    #[must_use]
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Positions n = n0 + N u of the object's nodes (m).
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = DVec3> {
        self.object.rest.iter().zip(self.displacements()).map(|(rest, displacement)| rest + displacement)
    }

    /// Displacements N u of the object's nodes (m).
    pub fn displacements(&self) -> impl ExactSizeIterator<Item = DVec3> {
        (0..self.object.rest.len()).map(|node| self.mechanics.attachment.follow(node, &self.displacement))
    }

    /// Displacements u of the nodes of K (m).
    #[must_use]
    pub fn displacement(&self) -> &[DVec3] {
        &self.displacement
    }

    /// Their velocities v (m/s); none in quasi-static graphics.
    #[must_use]
    pub fn velocity(&self) -> &[DVec3] {
        self.dynamics.as_ref().map_or(&[], |dynamics| &dynamics.velocity)
    }

    /// Kinetic, elastic and gravitational energy (J): what no step raises without forces.
    #[must_use]
    pub fn energy(&self) -> f64 {
        self.energy_of(&self.displacement, self.velocity())
    }

    /// The same with the nodes displaced by `displacement` (m) and moving at `velocity` (m/s).
    #[must_use]
    pub fn energy_of(&self, displacement: &[DVec3], velocity: &[DVec3]) -> f64 {
        let moving = self.mechanics.mass.iter().zip(velocity);
        let kinetic = 0.5 * moving.map(|(m, v)| m * v.length_squared()).sum::<f64>();
        let elastic = match &self.stiffening {
            Some(stiffening) => stiffening.energy(self.mechanics, displacement),
            None => self.mechanics.stiffness.energy(displacement),
        };
        let weight = self.weight.iter().flatten().zip(displacement);
        kinetic + elastic - weight.map(|(w, u)| w.dot(*u)).sum::<f64>()
    }

    /// Memory of the state and of what advances it, beside the object (B).
    #[must_use]
    pub fn bytes(&self) -> usize {
        let weight = self.weight.as_ref().map_or(0, Vec::len);
        let vectors = self.displacement.len() + self.right.len() + self.velocity().len() + weight;
        let factor = self.dynamics.as_ref().map_or(0, |dynamics| {
            dynamics.factor.bytes() + dynamics.scales.as_ref().map_or(0, |scales| size_of_val(&**scales))
        });
        let stiffening = self.stiffening.as_ref().map_or(0, |stiffening| {
            size_of_val(&*stiffening.bound().blocks) + size_of_val(stiffening.unit_strain_force())
        });
        vectors * size_of::<DVec3>() + factor + stiffening
    }

    /// One frame under `forces`, one per node of the object (N). Returns v_hat of the nodes of K (m/s); in quasi-static
    /// graphics their displacements.
    pub fn step(&mut self, forces: &[DVec3]) -> &[DVec3] {
        self.mechanics.attachment.spread(forces, &mut self.right);
        match self.threads.take() {
            None => self.frame(false),
            Some(threads) => {
                threads.install(|| self.frame(true));
                self.threads = Some(threads);
            }
        }
        &self.right
    }

    fn frame(&mut self, shared: bool) {
        let mut right = std::mem::take(&mut self.right);
        self.load(&mut right, shared);
        self.right = right;
        self.advance();
    }

    /// Adds (2M/T) v - grad W(u) and the weight to the forces in `right`; in quasi-static graphics the weight alone.
    fn load(&self, right: &mut [DVec3], shared: bool) {
        let Self { mechanics, dynamics, stiffening, weight, displacement, .. } = self;
        let stiffness = stiffening.as_ref().map_or(&mechanics.stiffness, Stiffening::bound);
        let of_node = |(node, right): (usize, &mut DVec3)| {
            if let Some(Dynamics { velocity, scales, .. }) = dynamics {
                let momentum = (2.0 * mechanics.mass[node] / self.period) * velocity[node];
                let held = match scales {
                    Some(scales) => stiffness.force_by_scales(scales, node, displacement),
                    None => stiffness.force_on(node, displacement),
                };
                *right = *right + momentum - held;
            }
            if let Some(stiffening) = stiffening {
                *right += stiffening.relief_on(node, displacement);
            }
            if let Some(weight) = weight {
                *right += weight[node];
            }
        };
        if shared {
            right.par_iter_mut().with_min_len(NODES_TOGETHER).enumerate().for_each(of_node);
        } else {
            right.iter_mut().enumerate().for_each(of_node);
        }
    }

    /// v_hat from the right-hand side, and the new state. An object at rest that nothing touches costs nothing.
    fn advance(&mut self) {
        let at_rest = self.right.iter().all(|right| *right == DVec3::ZERO);
        let solve = |factor: &Factor, right: &mut [DVec3]| {
            if !at_rest {
                factor.solve(right)
            }
        };
        let Some(Dynamics { factor, velocity, .. }) = &mut self.dynamics else {
            solve(&self.mechanics.factor, &mut self.right);
            self.displacement.copy_from_slice(&self.right);
            return;
        };
        solve(factor, &mut self.right);
        for (node, v_hat) in self.right.iter().enumerate() {
            self.displacement[node] += self.period * v_hat;
            velocity[node] = 2.0 * v_hat - velocity[node];
        }
    }
}
