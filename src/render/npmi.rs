//! Non-iterative passive mechanical integration of the proxy with constant inertia (section 3.1; theory of [3, 15]).
//!
//! With `v_hat = (v_k + v_{k+1})/2 = (x_{k+1} - x_k)/T` and `x_hat = (x_k + x_{k+1})/2` a step solves
//! `M (v_{k+1} - v_k)/T = f - D v_hat - K (x_hat - target) + lambda`, linear in v_hat:
//! `(M + (T/2) D + (T^2/4) K) v_hat = M v_k + (T/2)(f - K (x_k - target) + lambda)`, which needs no division by T.
//!
//! *Energy.* Multiplying by v_hat, for any sequence of steps T and to rounding,
//! `Delta(1/2 v^T M v) = T v_hat . f - T v_hat . D v_hat - Delta(1/2 |x - target|_K^2) + T v_hat . lambda`.
//!
//! *Torque of the contact field.* f holds tau_bar(x_k), the torque at the current configuration as in the paper. If
//! tau_bar = -grad U and U curves by at most K_tau, then `T v_hat . tau_bar(x_k) <= -Delta U + (T^2/2) v_hat . K_tau v_hat`:
//! the explicit torque acts like an implicit one with damping D - (T/2) K_tau, so that `b >= (T/2) K_tau` keeps the step
//! passive, and no smaller b does for a linear spring. That is the paper's condition Ks <= mu bv / T with mu <= 2.
//!
//! *Joint limits.* lambda are the torques of unilateral stops: v_hat minimises the step's convex quadratic form among
//! those that keep x_{k+1} within the limits, so that lambda acts inwards at limits that are reached and
//! `v_hat . lambda <= 0`. The impact is plastic: afterwards v is projected, orthogonally in M, on zero speed of the
//! stopped joints. Both only take energy.

use crate::{JointVector, MAX_JOINTS, proxy::JointMatrix, tolerances::STOP_ROUNDING};

/// Constant inertia M and joint limits of the proxy.
#[derive(Clone, Debug)]
pub struct Npmi {
    joints: usize,
    inertia: JointMatrix,
    limits: [[f64; 2]; MAX_JOINTS],
}

/// Position [rad or m] and velocity [rad/s or m/s] of the proxy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// x
    pub position: JointVector,
    /// v
    pub velocity: JointVector,
}

/// What acts on the proxy during a step, one number per joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// K, not negative [N m/rad].
    pub stiffness: JointVector,
    /// Where the springs K pull to [rad or m].
    pub target: JointVector,
    /// D, not negative [N m s/rad].
    pub damping: JointVector,
    /// f [N m or N].
    pub torque: JointVector,
}

/// What happened in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// v_hat [rad/s or m/s].
    pub velocity: JointVector,
    /// Work of the stops, impact included; never positive but for rounding [J].
    pub stop_work: f64,
    /// Joints that ended at a limit.
    pub stopped: [bool; MAX_JOINTS],
}

/// The proxy cannot be integrated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InertiaError {
    /// M is not symmetric positive definite.
    #[error("the proxy's inertia is not positive definite: give every joint a mass or a rotor inertia")]
    NotPositiveDefinite,
    /// A pair of limits is not finite or not ascending.
    #[error("joint {joint}'s limits {limits:?} are not ascending finite numbers")]
    Limits {
        /// Number of the joint, from zero.
        joint: usize,
        /// Least and greatest coordinate.
        limits: [f64; 2],
    },
}

impl Npmi {
    /// A proxy with inertia `inertia` [kg m^2] and one pair of limits [rad or m] per joint.
    ///
    /// # Errors
    /// When the inertia is not positive definite or a limit is none.
    pub fn new(inertia: &JointMatrix, limits: &[[f64; 2]]) -> Result<Self, InertiaError> {
        let joints = limits.len().min(MAX_JOINTS);
        for (joint, &[least, greatest]) in limits.iter().enumerate() {
            if !(least.is_finite() && greatest.is_finite() && least <= greatest) {
                return Err(InertiaError::Limits { joint, limits: [least, greatest] });
            }
        }
        let symmetric = (0..joints).all(|i| (0..i).all(|j| inertia[i][j] == inertia[j][i]));
        if !symmetric || cholesky(inertia, joints).is_none() {
            return Err(InertiaError::NotPositiveDefinite);
        }
        let mut all = [[0.0; 2]; MAX_JOINTS];
        all[..joints].copy_from_slice(&limits[..joints]);
        Ok(Self { joints, inertia: *inertia, limits: all })
    }

    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints
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

    /// 1/2 v^T M v [J].
    #[must_use]
    pub fn kinetic_energy(&self, velocity: &[f64]) -> f64 {
        0.5 * velocity.iter().zip(self.momentum(velocity).iter()).map(|(v, p)| v * p).sum::<f64>()
    }

    /// M v.
    fn momentum(&self, velocity: &[f64]) -> JointVector {
        let mut momentum = JointVector::zeros(self.joints);
        for (p, row) in momentum.iter_mut().zip(&self.inertia) {
            *p = row.iter().zip(velocity).map(|(m, v)| m * v).sum();
        }
        momentum
    }

    /// Moves the proxy by one step of `interval` T > 0 [s] under `load`. `motion.position` must lie within the limits
    /// and lies there afterwards.
    pub fn step(&self, motion: &mut Motion, interval: f64, load: &Load) -> Step {
        let half = 0.5 * interval;
        let mut matrix = self.inertia;
        let mut right = self.momentum(&motion.velocity);
        let mut low = JointVector::zeros(self.joints);
        let mut high = low;
        for a in 0..self.joints {
            matrix[a][a] += half * load.damping[a] + half * half * load.stiffness[a];
            let x = motion.position[a];
            right[a] += half * (load.torque[a] - load.stiffness[a] * (x - load.target[a]));
            low[a] = (self.limits[a][0] - x) / interval;
            high[a] = (self.limits[a][1] - x) / interval;
        }
        let bound = minimise_in_box(&matrix, &right, &low, &high);
        let before = motion.velocity;
        for a in 0..self.joints {
            let moved = motion.position[a] + interval * bound.point[a];
            // A stop is reached exactly, and rounding must not push beyond one.
            motion.position[a] = match bound.side[a] {
                Side::Low => self.limits[a][0],
                Side::High => self.limits[a][1],
                Side::Inside => moved.max(self.limits[a][0]).min(self.limits[a][1]),
            };
            motion.velocity[a] = 2.0 * bound.point[a] - before[a];
        }
        let mut stop_work = 0.0;
        let stopped = bound.side.map(|side| side != Side::Inside);
        if stopped.contains(&true) {
            // (T/2) lambda = A v_hat - right.
            for a in (0..self.joints).filter(|&a| stopped[a]) {
                let row: f64 = matrix[a].iter().zip(bound.point.iter()).map(|(m, v)| m * v).sum();
                stop_work += 2.0 * (row - right[a]) * bound.point[a];
            }
            let rebound = self.kinetic_energy(&motion.velocity);
            self.stop(&mut motion.velocity, &stopped);
            stop_work += self.kinetic_energy(&motion.velocity) - rebound;
        }
        Step { velocity: bound.point, stop_work, stopped }
    }

    /// Projects `velocity`, orthogonally in M, on zero speed of the `stopped` joints: least kinetic energy given up.
    fn stop(&self, velocity: &mut JointVector, stopped: &[bool; MAX_JOINTS]) {
        let momentum = self.momentum(velocity);
        let mut target = *velocity;
        for a in (0..self.joints).filter(|&a| stopped[a]) {
            target[a] = 0.0;
        }
        // Momentum of the free joints is kept: M_FF v_F' = (M v)_F.
        *velocity = solve_held(&self.inertia, &momentum, &target, stopped);
    }
}

/// Whether a coordinate of the minimiser lies at a bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Inside,
    Low,
    High,
}

/// Minimiser of `1/2 v^T A v - r^T v` over a box.
struct BoxMinimum {
    point: JointVector,
    side: [Side; MAX_JOINTS],
}

/// Active sets that can differ: 3 states for each of [`MAX_JOINTS`] coordinates. The primal active-set method visits
/// none twice, because every change lowers the form; in practice it changes it once for each stop that is reached.
const MAX_ACTIVE_SETS: usize = 3_usize.pow(MAX_JOINTS as u32);

/// Primal active-set method from v = 0, which lies in the box; the form is strictly convex, the minimiser unique.
fn minimise_in_box(matrix: &JointMatrix, right: &JointVector, low: &JointVector, high: &JointVector) -> BoxMinimum {
    let joints = right.len();
    let mut side = [Side::Inside; MAX_JOINTS];
    let mut point = JointVector::zeros(joints);
    for _ in 0..MAX_ACTIVE_SETS {
        let held = side.map(|side| side != Side::Inside);
        let goal = solve_held(matrix, right, &point, &held);
        // The first bound on the way from the point to the goal.
        let (mut fraction, mut first) = (1.0, None);
        for a in (0..joints).filter(|&a| !held[a]) {
            let (reach, limit, at) = if goal[a] > high[a] {
                (goal[a] - point[a], high[a], Side::High)
            } else if goal[a] < low[a] {
                (goal[a] - point[a], low[a], Side::Low)
            } else {
                continue;
            };
            let share = if reach == 0.0 { 0.0 } else { ((limit - point[a]) / reach).clamp(0.0, 1.0) };
            if first.is_none() || share < fraction {
                (fraction, first) = (share, Some((a, limit, at)));
            }
        }
        if let Some((a, limit, at)) = first {
            for b in (0..joints).filter(|&b| !held[b]) {
                point[b] = (point[b] + fraction * (goal[b] - point[b])).max(low[b]).min(high[b]);
            }
            point[a] = limit;
            side[a] = at;
            continue;
        }
        point = goal;
        // Release the stop that pulls hardest, if one does by more than rounding.
        let mut release = (0.0, None);
        for a in 0..joints {
            let terms = || matrix[a].iter().zip(point.iter()).map(|(m, v)| m * v);
            let force = terms().sum::<f64>() - right[a];
            let rounding = STOP_ROUNDING * (terms().map(f64::abs).sum::<f64>() + right[a].abs());
            let pull = match side[a] {
                Side::Low => -force,
                Side::High => force,
                Side::Inside => continue,
            };
            if pull > rounding && pull > release.0 {
                release = (pull, Some(a));
            }
        }
        match release.1 {
            Some(a) => side[a] = Side::Inside,
            None => break,
        }
    }
    BoxMinimum { point, side }
}

/// Solves `(A v)_free = r_free` with `v_held` as in `at`; A symmetric positive definite.
fn solve_held(matrix: &JointMatrix, right: &JointVector, at: &JointVector, held: &[bool; MAX_JOINTS]) -> JointVector {
    let joints = right.len();
    let mut reduced = *matrix;
    let mut solution = *right;
    for a in 0..joints {
        for b in 0..joints {
            if held[b] && !held[a] {
                solution[a] -= matrix[a][b] * at[b];
            }
            if held[a] || held[b] {
                reduced[a][b] = if a == b { 1.0 } else { 0.0 };
            }
        }
    }
    for a in (0..joints).filter(|&a| held[a]) {
        solution[a] = at[a];
    }
    // A is the proxy's inertia, proven positive definite, plus what is not negative: the factor exists.
    let Some(factor) = cholesky(&reduced, joints) else { return JointVector::zeros(joints) };
    for i in 0..joints {
        let sum: f64 = (0..i).map(|j| factor[i][j] * solution[j]).sum();
        solution[i] = (solution[i] - sum) / factor[i][i];
    }
    for i in (0..joints).rev() {
        let sum: f64 = (i + 1..joints).map(|j| factor[j][i] * solution[j]).sum();
        solution[i] = (solution[i] - sum) / factor[i][i];
    }
    solution
}

/// Lower Cholesky factor of the leading `joints` rows and columns; `None` when they are not positive definite.
fn cholesky(matrix: &JointMatrix, joints: usize) -> Option<JointMatrix> {
    let mut factor = [[0.0; MAX_JOINTS]; MAX_JOINTS];
    for i in 0..joints {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let entry = matrix[i][j] - sum;
            if i == j {
                // Also false for what is not a number.
                if !(entry > 0.0 && entry.is_finite()) {
                    return None;
                }
                factor[i][i] = entry.sqrt();
            } else {
                factor[i][j] = entry / factor[j][j];
            }
        }
    }
    Some(factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between -1 and 1, the same every time.
    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }

        fn vector(&mut self, joints: usize, scale: f64) -> JointVector {
            let mut vector = JointVector::zeros(joints);
            vector.iter_mut().for_each(|x| *x = scale * self.next());
            vector
        }

        /// B B^T + 0.1 I.
        fn inertia(&mut self, joints: usize) -> JointMatrix {
            let factor: Vec<JointVector> = (0..joints).map(|_| self.vector(joints, 1.0)).collect();
            let mut inertia = [[0.0; MAX_JOINTS]; MAX_JOINTS];
            for i in 0..joints {
                for j in 0..joints {
                    inertia[i][j] = 0.01 * (factor[i].dot(&factor[j]) + if i == j { 0.1 } else { 0.0 });
                }
            }
            inertia
        }

        fn load(&mut self, joints: usize) -> Load {
            let positive = |mut v: JointVector| {
                v.iter_mut().for_each(|x| *x = x.abs());
                v
            };
            Load {
                stiffness: positive(self.vector(joints, 20.0)),
                target: self.vector(joints, 0.5),
                damping: positive(self.vector(joints, 0.2)),
                torque: self.vector(joints, 3.0),
            }
        }
    }

    const WIDE: [[f64; 2]; MAX_JOINTS] = [[-1e3, 1e3]; MAX_JOINTS];

    fn spring_energy(load: &Load, x: &JointVector) -> f64 {
        0.5 * (0..x.len()).map(|a| load.stiffness[a] * (x[a] - load.target[a]).powi(2)).sum::<f64>()
    }

    /// Change of stored energy less the work of everything, and the scale of its rounding [J].
    fn imbalance(npmi: &Npmi, motion: &mut Motion, interval: f64, load: &Load) -> (f64, f64) {
        let stored = |m: &Motion| npmi.kinetic_energy(&m.velocity) + spring_energy(load, &m.position);
        let before = stored(motion);
        let step = npmi.step(motion, interval, load);
        let after = stored(motion);
        let work = interval * step.velocity.dot(&load.torque);
        let loss: f64 = interval * (0..npmi.joints()).map(|a| load.damping[a] * step.velocity[a].powi(2)).sum::<f64>();
        assert!(step.stop_work <= 1e-12 * (before + after), "stops give energy: {}", step.stop_work);
        (after - before - work + loss - step.stop_work, before + after + work.abs() + loss + step.stop_work.abs())
    }

    #[test]
    fn energy_balances_to_rounding_for_any_sequence_of_steps() {
        let mut noise = Noise(7);
        for joints in 1..=MAX_JOINTS {
            let npmi = Npmi::new(&noise.inertia(joints), &WIDE[..joints]).unwrap();
            let mut motion = Motion { position: noise.vector(joints, 1.0), velocity: noise.vector(joints, 5.0) };
            for _ in 0..2000 {
                // 0.02 to 20 ms, jittering.
                let interval = 1e-3 * 10_f64.powf(1.5 * noise.next() - 0.2);
                let load = noise.load(joints);
                let (imbalance, scale) = imbalance(&npmi, &mut motion, interval, &load);
                assert!(imbalance.abs() < 1e-12 * scale, "{joints} joints: {imbalance} of {scale}");
            }
        }
    }

    #[test]
    fn the_balance_notices_a_wrong_step() {
        let mut noise = Noise(3);
        let npmi = Npmi::new(&noise.inertia(3), &WIDE[..3]).unwrap();
        let mut motion = Motion { position: noise.vector(3, 1.0), velocity: noise.vector(3, 1.0) };
        let load = noise.load(3);
        let stored = |m: &Motion| npmi.kinetic_energy(&m.velocity) + spring_energy(&load, &m.position);
        let before = stored(&motion);
        let step = npmi.step(&mut motion, 1e-3, &load);
        motion.velocity[1] *= 1.0 + 1e-6;
        let loss: f64 = (0..3).map(|a| load.damping[a] * step.velocity[a].powi(2)).sum();
        let wrong = stored(&motion) - before - 1e-3 * (step.velocity.dot(&load.torque) - loss);
        assert!(wrong.abs() > 1e-9 * before);
    }

    #[test]
    fn the_step_satisfies_the_equation_of_motion() {
        let mut noise = Noise(11);
        let inertia = noise.inertia(4);
        let npmi = Npmi::new(&inertia, &WIDE[..4]).unwrap();
        let start = Motion { position: noise.vector(4, 1.0), velocity: noise.vector(4, 1.0) };
        let (load, interval) = (noise.load(4), 3e-3);
        let mut end = start;
        let step = npmi.step(&mut end, interval, &load);
        for (a, row) in inertia.iter().enumerate().take(4) {
            let acceleration: f64 = (0..4).map(|b| row[b] * (end.velocity[b] - start.velocity[b])).sum();
            let midpoint = 0.5 * (start.position[a] + end.position[a]);
            let torque =
                load.torque[a] - load.damping[a] * step.velocity[a] - load.stiffness[a] * (midpoint - load.target[a]);
            assert!((acceleration / interval - torque).abs() < 1e-10);
        }
    }

    #[test]
    fn stops_hold_and_only_take_energy() {
        let mut noise = Noise(23);
        for joints in 1..=MAX_JOINTS {
            let limits = [[-0.1, 0.15]; MAX_JOINTS];
            let npmi = Npmi::new(&noise.inertia(joints), &limits[..joints]).unwrap();
            let mut motion = Motion { position: JointVector::zeros(joints), velocity: JointVector::zeros(joints) };
            let mut stops = 0;
            for _ in 0..4000 {
                let interval = 1e-3 * 10_f64.powf(1.2 * noise.next());
                let mut load = noise.load(joints);
                load.torque.iter_mut().for_each(|tau| *tau *= 5.0);
                let (imbalance, scale) = imbalance(&npmi, &mut motion, interval, &load);
                assert!(imbalance.abs() < 1e-11 * scale, "{joints} joints: {imbalance} of {scale}");
                assert!(motion.position.iter().all(|x| (-0.1..=0.15).contains(x)));
                stops += motion.position.iter().filter(|x| **x == -0.1 || **x == 0.15).count();
            }
            assert!(stops > 500, "the stops were reached {stops} times only");
        }
    }

    #[test]
    fn a_stop_pushes_and_never_holds_back() {
        let npmi = Npmi::new(&Noise(1).inertia(2), &[[-1.0, 0.0], [-1.0, 1.0]]).unwrap();
        let mut motion = Motion { position: JointVector::zeros(2), velocity: JointVector::zeros(2) };
        let mut load = Noise(1).load(2);
        load.stiffness = JointVector::zeros(2);
        load.torque = JointVector::from_slice(&[1.0, 0.0]);
        let step = npmi.step(&mut motion, 1e-3, &load);
        assert!(step.stopped[0] && motion.position[0] == 0.0 && motion.velocity[0] == 0.0);
        load.torque = JointVector::from_slice(&[-1.0, 0.0]);
        let step = npmi.step(&mut motion, 1e-3, &load);
        assert!(!step.stopped[0] && motion.position[0] < 0.0);
    }

    #[test]
    fn an_explicit_spring_is_bounded_at_the_bound_and_diverges_below_it() {
        let mut inertia = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        inertia[0][0] = 1e-4;
        let npmi = Npmi::new(&inertia, &WIDE[..1]).unwrap();
        let (stiffness, interval) = (50.0, 1e-3);
        let swing = |share: f64| {
            let one = |x: f64| JointVector::from_slice(&[x]);
            let mut motion = Motion { position: one(0.01), velocity: one(0.0) };
            let mut greatest: f64 = 0.0;
            for _ in 0..20_000 {
                let load = Load {
                    stiffness: one(0.0),
                    target: one(0.0),
                    damping: one(share * stiffness * interval),
                    torque: one(-stiffness * motion.position[0]),
                };
                npmi.step(&mut motion, interval, &load);
                greatest = greatest.max(motion.position[0].abs());
            }
            greatest
        };
        assert!(swing(0.5) < 0.02, "{}", swing(0.5));
        assert!(swing(0.4) > 10.0, "{}", swing(0.4));
    }

    #[test]
    fn impossible_proxies_are_refused() {
        let mut inertia = Noise(5).inertia(3);
        assert!(matches!(Npmi::new(&inertia, &[[0.0, f64::NAN]; 3]), Err(InertiaError::Limits { joint: 0, .. })));
        assert!(matches!(Npmi::new(&inertia, &[[1.0, 0.0]; 3]), Err(InertiaError::Limits { .. })));
        inertia[2][2] = 0.0;
        assert_eq!(Npmi::new(&inertia, &WIDE[..3]).err(), Some(InertiaError::NotPositiveDefinite));
        inertia[2][2] = f64::NAN;
        assert_eq!(Npmi::new(&inertia, &WIDE[..3]).err(), Some(InertiaError::NotPositiveDefinite));
    }
}
