//! Non-iterative passive mechanical integration of the proxy (section 3.1; theory of \[3, 15\]), with constant inertia
//! or with inertia that depends on the configuration.
//!
//! *Coordinates.* `M = L L^T`, and `p = L^T v` is kept from step to step: the kinetic energy is `1/2 |p|^2`. The
//! continuous motion `M vdot + C v = f` becomes `pdot = L^-1 (f - S v)` with `S = C - L Ldot^T`, which is skew because
//! C is Christoffel's. It is made exactly skew in numbers, and takes no part in the energy. Where M is constant, S is
//! zero. S is linear in the velocity and taken at v_k: the path is first order in T, the energy exact.
//!
//! *Step.* With `v_hat = (x_{k+1} - x_k)/T` and `x_hat = (x_k + x_{k+1})/2`, L and S at the predicted midpoint
//! `x_k + (T/2) v_k`, both constant over the step:
//! `L (p_{k+1} - p_k)/T = f - S v_hat - D v_hat - K (x_hat - target) + lambda`, `L^T v_hat = (p_k + p_{k+1})/2`, hence
//! `(M + (T/2)(S + D) + (T^2/4) K) v_hat = L p_k + (T/2)(f - K (x_k - target) + lambda)`, linear and without a division
//! by T; then `p_{k+1} = 2 L^T v_hat - p_k`.
//!
//! *Energy.* Multiplying by v_hat, for any sequence of steps T, at any speed, and to rounding,
//! `Delta(1/2 |p|^2) = T v_hat . f - T v_hat . D v_hat - Delta(1/2 |x - target|_K^2) + T v_hat . lambda`.
//!
//! *Torque of the contact field.* f holds tau_bar(x_k), the torque at the current configuration as in the paper. If
//! tau_bar = -grad U and U curves by at most K_tau, then
//! `T v_hat . tau_bar(x_k) <= -Delta U + (T^2/2) v_hat . K_tau v_hat`: the explicit torque acts like an implicit one
//! with damping D - (T/2) K_tau, so that `b >= (T/2) K_tau` keeps the step passive, and no smaller b does for a linear
//! spring. That is the paper's condition Ks <= mu bv / T with mu <= 2.
//!
//! *Stops.* lambda are the torques of unilateral stops (`stops.rs`): v_hat keeps x_{k+1} within the stops of the step,
//! the joint limits or, nearer, the border of the haptized range (`field/range.rs`). lambda acts inwards at stops that
//! are reached, so that `v_hat . lambda <= 0`. The impact is plastic: afterwards v is projected, orthogonally in M, on
//! zero speed of the stopped joints. Both only take energy, whatever the stops, as long as x_k lies between them.

mod linear;
mod stops;
#[cfg(test)]
mod tests;

use crate::{
    Error, JointMatrix, JointVector, MAX_JOINTS, error,
    field::range::Stops,
    joint_matrix::{cholesky, solve_transposed},
    proxy::Chain,
};
use linear::solve_held;
use std::borrow::Cow;
use stops::{Side, solve_in_box};

/// Size below which a decaying state of the haptic loop is set to zero, in its SI unit. It is far below anything that
/// can be felt or changes a torque; what stays has squares that are normal numbers, and arithmetic on subnormal numbers
/// takes tens of times as long.
const NEGLIGIBLE_STATE: f64 = 1e-150;

/// Inertia M and joint limits of the proxy.
#[derive(Clone, Debug)]
pub struct Npmi {
    joints: usize,
    inertia: Inertia,
    limits: Stops,
}

/// How M is found, chosen once per scene.
#[derive(Clone, Debug)]
enum Inertia {
    /// The same everywhere.
    Constant(Box<MidpointInertia>),
    /// That of the chain at each configuration.
    Chain(Chain),
}

/// M, its factor L and the gyroscopic S at the middle of a step.
#[derive(Clone, Copy, Debug)]
pub struct MidpointInertia {
    inertia: JointMatrix,
    factor: JointMatrix,
    gyroscopic: JointMatrix,
}

/// Position and momentum of the proxy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// x (rad or m).
    pub position: JointVector,
    /// v (rad/s or m/s).
    pub velocity: JointVector,
    /// p = L^T v (sqrt(J)).
    momentum: JointVector,
}

/// Forces on the proxy during a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// K of each joint, not negative (N m/rad).
    pub stiffness: JointVector,
    /// Where the springs K pull to (rad or m).
    pub target: JointVector,
    /// D, positive semidefinite (N m s/rad).
    pub damping: JointMatrix,
    /// f (N m or N).
    pub torque: JointVector,
    /// Least and greatest coordinate that each joint may reach; x_k lies between them (rad or m).
    pub stops: Stops,
}

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// v_hat (rad/s or m/s).
    pub velocity: JointVector,
    /// Work of the stops, impact included; never positive but for rounding (J).
    pub stop_work: f64,
    /// Joints that ended at a stop.
    pub stopped: [bool; MAX_JOINTS],
}

/// What is wrong with an M that is not symmetric positive definite.
const INDEFINITE: &str = "the proxy's inertia is not positive definite: give every joint a mass or a rotor inertia";

impl Motion {
    /// At rest at `position`.
    #[must_use]
    pub fn at_rest(position: &JointVector) -> Self {
        let zero = JointVector::zeros(position.len());
        Self { position: *position, velocity: zero, momentum: zero }
    }

    /// 1/2 |p|^2 (J).
    #[must_use]
    pub fn kinetic_energy(&self) -> f64 {
        0.5 * self.momentum.dot(&self.momentum)
    }
}

impl Npmi {
    /// A proxy of constant inertia `inertia` (kg m^2) and one pair of limits (rad or m) per joint.
    ///
    /// # Errors
    /// When the inertia is not positive definite or a limit is none.
    pub fn new(inertia: &JointMatrix, limits: &[[f64; 2]]) -> Result<Self, Error> {
        let (joints, limits) = checked(limits)?;
        let symmetric = (0..joints).all(|i| (0..i).all(|j| inertia[i][j] == inertia[j][i]));
        let factor = cholesky(inertia, joints).filter(|_| symmetric).ok_or(INDEFINITE)?;
        let stage = MidpointInertia { inertia: *inertia, factor, gyroscopic: [[0.0; MAX_JOINTS]; MAX_JOINTS] };
        Ok(Self { joints, inertia: Inertia::Constant(Box::new(stage)), limits })
    }

    /// A proxy with the inertia and the joint limits of `chain`, configuration by configuration.
    ///
    /// # Errors
    /// When the inertia is not positive definite in every configuration, for want of a rotor inertia, or a limit is
    /// none.
    pub fn of_chain(chain: &Chain) -> Result<Self, Error> {
        let limits: Vec<[f64; 2]> = chain.joints.iter().map(|joint| joint.limits).collect();
        let (joints, limits) = checked(&limits)?;
        if !chain.joints.iter().all(|joint| joint.rotor_inertia > 0.0) {
            return Err(INDEFINITE.into());
        }
        Ok(Self { joints, inertia: Inertia::Chain(chain.clone()), limits })
    }

    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// The joint limits (rad or m).
    #[must_use]
    pub fn limits(&self) -> &Stops {
        &self.limits
    }

    /// The configuration within the limits that is closest to `q`, joint by joint.
    #[must_use]
    pub fn within_limits(&self, q: &JointVector) -> JointVector {
        let mut inside = *q;
        for (x, [least, greatest]) in inside.iter_mut().zip(self.limits) {
            *x = x.clamp(least, greatest);
        }
        inside
    }

    /// The motion through `position` at `velocity`.
    #[must_use]
    pub fn moving(&self, position: &JointVector, velocity: &JointVector) -> Motion {
        let motion = Motion { velocity: *velocity, ..Motion::at_rest(position) };
        let stage = self.stage(&motion, 0.0);
        Motion { momentum: stage.momentum_of(velocity), ..motion }
    }

    /// L, M and S for a step of `interval` T (s) from `motion`.
    #[must_use]
    pub fn stage(&self, motion: &Motion, interval: f64) -> Cow<'_, MidpointInertia> {
        match &self.inertia {
            Inertia::Constant(stage) => Cow::Borrowed(stage),
            Inertia::Chain(chain) => Cow::Owned(MidpointInertia::of(chain, motion, interval)),
        }
    }

    /// Moves the proxy by one step of `interval` T > 0 (s) under `load`. `motion.position` must lie between the stops
    /// of `load` and lies there afterwards.
    pub fn step(&self, motion: &mut Motion, interval: f64, load: &Load) -> Step {
        self.advance(&self.stage(motion, interval), motion, interval, load)
    }

    /// [`Npmi::step`] with the `stage` of the same motion and interval, for those who try several loads.
    pub fn advance(&self, stage: &MidpointInertia, motion: &mut Motion, interval: f64, load: &Load) -> Step {
        let half = 0.5 * interval;
        let mut matrix = stage.inertia;
        let mut right = product(&stage.factor, &motion.momentum);
        let mut low = JointVector::zeros(self.joints);
        let mut high = low;
        for a in 0..self.joints {
            let added = stage.gyroscopic[a].iter().zip(&load.damping[a]);
            for (entry, (gyroscopic, damping)) in matrix[a].iter_mut().zip(added) {
                *entry += half * (gyroscopic + damping);
            }
            matrix[a][a] += half * half * load.stiffness[a];
            let x = motion.position[a];
            right[a] += half * (load.torque[a] - load.stiffness[a] * (x - load.target[a]));
            low[a] = (load.stops[a][0] - x) / interval;
            high[a] = (load.stops[a][1] - x) / interval;
        }
        let mut solved = solve_in_box(&matrix, &right, &low, &high);
        solved.point.iter_mut().for_each(flush);
        let v_hat = solved.point;
        let twice = stage.momentum_of(&v_hat);
        for a in 0..self.joints {
            let moved = motion.position[a] + interval * v_hat[a];
            // A stop is reached exactly, and rounding must not push beyond one.
            motion.position[a] = match solved.side[a] {
                Side::Low => load.stops[a][0],
                Side::High => load.stops[a][1],
                Side::Inside => moved.max(load.stops[a][0]).min(load.stops[a][1]),
            };
            motion.momentum[a] = 2.0 * twice[a] - motion.momentum[a];
            motion.velocity[a] = 2.0 * v_hat[a] - motion.velocity[a];
        }
        let mut stop_work = 0.0;
        let stopped = solved.side.map(|side| side != Side::Inside);
        if stopped.contains(&true) {
            // (T/2) lambda = A v_hat - right.
            for a in (0..self.joints).filter(|&a| stopped[a]) {
                let row: f64 = matrix[a].iter().zip(v_hat.iter()).map(|(m, v)| m * v).sum();
                stop_work += 2.0 * (row - right[a]) * v_hat[a];
            }
            let rebound = motion.kinetic_energy();
            // Momentum M v = L p of the free joints is kept: least kinetic energy given up.
            let momentum = product(&stage.factor, &motion.momentum);
            motion.velocity = solve_held(&stage.inertia, &momentum, &JointVector::zeros(self.joints), &stopped);
            motion.momentum = stage.momentum_of(&motion.velocity);
            stop_work += motion.kinetic_energy() - rebound;
        } else if let Inertia::Chain(_) = self.inertia {
            motion.velocity = stage.velocity_of(&motion.momentum);
        }
        motion.momentum.iter_mut().chain(motion.velocity.iter_mut()).for_each(flush);
        Step { velocity: v_hat, stop_work, stopped }
    }
}

impl MidpointInertia {
    /// Evaluates `chain` at the predicted midpoint of a step of `interval` T (s) from `motion`.
    fn of(chain: &Chain, motion: &Motion, interval: f64) -> Self {
        let joints = motion.position.len();
        let mut middle = motion.position;
        for (x, v) in middle.iter_mut().zip(motion.velocity.iter()) {
            *x += 0.5 * interval * v;
        }
        let dynamics = chain.dynamics(&middle, &motion.velocity);
        if let Some(factor) = cholesky(&dynamics.inertia, joints) {
            let gyroscopic = linear::gyroscopic(&factor, &dynamics, joints);
            return Self { inertia: dynamics.inertia, factor, gyroscopic };
        }
        // Masses so large that rounding swallows the rotors (1e15 times as large): the rotors alone.
        let zero = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        let mut stage = Self { inertia: zero, factor: zero, gyroscopic: zero };
        for (a, joint) in chain.joints.iter().enumerate().take(joints) {
            stage.inertia[a][a] = joint.rotor_inertia;
            stage.factor[a][a] = joint.rotor_inertia.sqrt();
        }
        stage
    }

    /// M vdot (N m).
    #[must_use]
    pub fn inertial_torque(&self, acceleration: &JointVector) -> JointVector {
        product(&self.inertia, acceleration)
    }

    /// Adds `rate` M to `damping` (1/s).
    pub(super) fn add_inertia(&self, rate: f64, damping: &mut JointMatrix) {
        for (entry, inertia) in damping.iter_mut().flatten().zip(self.inertia.iter().flatten()) {
            *entry += rate * inertia;
        }
    }

    /// v^T M v (J).
    pub(super) fn twice_kinetic_energy(&self, velocity: &JointVector) -> f64 {
        velocity.dot(&self.inertial_torque(velocity))
    }

    /// L^T v.
    fn momentum_of(&self, velocity: &JointVector) -> JointVector {
        let mut momentum = JointVector::zeros(velocity.len());
        for (i, v) in velocity.iter().enumerate() {
            for (p, entry) in momentum.iter_mut().zip(&self.factor[i][..=i]) {
                *p += entry * v;
            }
        }
        momentum
    }

    /// L^-T p.
    fn velocity_of(&self, momentum: &JointVector) -> JointVector {
        let mut velocity = *momentum;
        solve_transposed(&self.factor, &mut velocity);
        velocity
    }
}

/// Sets `state` to zero where it has decayed to nothing.
pub(super) fn flush(state: &mut f64) {
    if state.abs() < NEGLIGIBLE_STATE {
        *state = 0.0;
    }
}

/// Number of joints and their `limits`, checked.
fn checked(limits: &[[f64; 2]]) -> Result<(usize, Stops), Error> {
    let joints = limits.len().min(MAX_JOINTS);
    for (joint, &[least, greatest]) in limits.iter().enumerate() {
        if !(least.is_finite() && greatest.is_finite() && least <= greatest) {
            return Err(error!("joint {joint}'s limits {:?} are not ascending finite numbers", [least, greatest]));
        }
    }
    let mut all = [[0.0; 2]; MAX_JOINTS];
    all[..joints].copy_from_slice(&limits[..joints]);
    Ok((joints, all))
}

/// `matrix` times `vector`.
fn product(matrix: &JointMatrix, vector: &JointVector) -> JointVector {
    let mut result = JointVector::zeros(vector.len());
    for (sum, row) in result.iter_mut().zip(matrix) {
        *sum = vector.dot(row);
    }
    result
}
