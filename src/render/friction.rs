//! Coulomb friction of the proxy: one spring in C-space that yields, whatever the number of contacts (elastic-plastic,
//! of the family of Dahl; the map that does not drift is that of Kikuuwe, Takesue, Sano, Mochiyama and Fujimoto 2006).
//!
//! With N and B of the contacts ([`crate::contact::Slip`]), the state is a deflection z (m) of `d` numbers, its spring
//! k, and `rho = mu N / k` the deflection at which it yields. In a step with `dq = T v_hat`
//!
//! `z* = z + B dq`,  `z+ = z* min(1, rho / |z*|)`,  `tau = -k B (z + z+) / 2`.
//!
//! Sticking, the torque is that of a spring of k B B^T; sliding, its size `|B^-1 tau|` is mu N. mu is static for what
//! stuck in the last step, which makes a soft hand drag the finger along in jerks, kinetic for what slid.
//!
//! *Energy.* The spring keeps `H = k |z|^2 / 2`. With `r = z* - z+` the work of friction on the proxy is
//! `-k (z + z+)/2 . (z* - z) = -Delta H - k (z + z+)/2 . r`. Sliding, r is parallel to z+ and |z| at most |z+|, so that
//! the last term takes energy; sticking, r is zero. So friction gives nothing beyond what its spring kept, for any T, N
//! and B, however they change from step to step. Where rho falls below |z|, z is shortened first, which takes energy,
//! too.
//!
//! *Implicit.* z+ depends on v_hat. `z+ = alpha z*` with alpha = 1 or, where the speed of the step before leads
//! beyond rho, the ratio `rho / |z*|` at that speed: either makes the torque linear in v_hat, and one solve does. What
//! comes out beyond rho is shortened afterwards. A step that turns against the predicted one, in which a ratio would
//! give energy, is solved again with alpha = 1.

use super::{
    accounts::Extra,
    npmi::{Load, MidpointInertia, Motion, Npmi, Step},
};
use crate::{JointVector, contact::Slip, scene::FrictionSpec};

/// The constants of friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Friction {
    /// Kinetic and static mu (1).
    kinetic: f64,
    stiction: f64,
    /// k (N/m).
    stiffness: f64,
}

/// What friction hands from one step to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FrictionState {
    /// z (m).
    deflection: JointVector,
    /// Whether it slid in the last step.
    slid: bool,
}

/// A step of the proxy that is about to be made.
pub(super) struct Pending<'a> {
    /// Who makes it.
    pub npmi: &'a Npmi,
    /// Inertia in its middle.
    pub stage: &'a MidpointInertia,
    /// T (s).
    pub interval: f64,
    /// v_hat of the step before (rad/s or m/s).
    pub velocity: JointVector,
    /// Forces beside friction, which adds its own.
    pub load: &'a mut Load,
}

impl FrictionState {
    /// Relaxed.
    pub fn at_rest(joints: usize) -> Self {
        Self { deflection: JointVector::zeros(joints), slid: false }
    }
}

impl Friction {
    /// The friction of a scene.
    pub fn new(spec: &FrictionSpec) -> Self {
        Self {
            kinetic: spec.coefficient,
            stiction: spec.static_coefficient.unwrap_or(spec.coefficient),
            stiffness: spec.stiffness,
        }
    }

    /// The `pending` step of the proxy, whose contacts slip as `slip` says. Books into `extra`. Never allocates.
    pub fn step(
        &self,
        pending: Pending<'_>,
        slip: &Slip,
        state: &mut FrictionState,
        motion: &mut Motion,
        extra: &mut Extra,
    ) -> Step {
        let Pending { npmi, stage, interval, velocity, load } = pending;
        let reach = |coefficient| coefficient * slip.normal_force / self.stiffness;
        let sticking = reach(if state.slid { self.kinetic } else { self.stiction });
        let mut start = state.deflection.shortened(sticking);
        if slip.normal_force <= 0.0 {
            *state = FrictionState { deflection: start, slid: false };
            return npmi.advance(stage, motion, interval, load);
        }
        let mut alpha = 1.0;
        let predicted = moved(&start, slip, interval, &velocity);
        if predicted.dot(&predicted) > sticking * sticking {
            let kinetic = reach(self.kinetic);
            start = start.shortened(kinetic);
            alpha = (kinetic / moved(&start, slip, interval, &velocity).norm()).min(1.0);
        }
        let before = *motion;
        self.add_to(load, slip, &start, interval * alpha, 1.0 + alpha);
        let mut step = npmi.advance(stage, motion, interval, load);
        let mut end = moved(&start, slip, interval, &step.velocity);
        let mut kept = end.scaled(alpha);
        if alpha < 1.0 && start.dot(&kept) + kept.dot(&kept) < 0.0 {
            self.add_to(load, slip, &start, interval * (1.0 - alpha), 1.0 - alpha);
            alpha = 1.0;
            *motion = before;
            step = npmi.advance(stage, motion, interval, load);
            end = moved(&start, slip, interval, &step.velocity);
            kept = end;
        }
        let works = (0..start.len()).map(|a| (start[a] + kept[a]) * (end[a] - start[a]));
        extra.friction_work = -0.5 * self.stiffness * works.sum::<f64>();
        let slid = alpha < 1.0 || kept.dot(&kept) > sticking * sticking;
        if slid {
            kept = kept.shortened(reach(self.kinetic));
        }
        extra.presliding = 0.5 * self.stiffness * kept.dot(&kept);
        *state = FrictionState { deflection: kept, slid };
        step
    }

    /// Adds to `load` friction whose deflection goes from `start` z to alpha z*, `tau = -k/2 B (held z + time B v_hat)`
    /// with `held` 1 + alpha and `time` alpha T.
    fn add_to(&self, load: &mut Load, slip: &Slip, start: &JointVector, time: f64, held: f64) {
        slip.add_damper(0.5 * self.stiffness * time, &mut load.damping, start.len());
        let force = 0.5 * self.stiffness * held;
        for (torque, row) in load.torque.iter_mut().zip(&slip.jacobian) {
            *torque -= force * start.dot(row);
        }
    }
}

/// z + B T v (m).
fn moved(start: &JointVector, slip: &Slip, interval: f64, velocity: &JointVector) -> JointVector {
    slip.deflected(start, &velocity.scaled(interval))
}
