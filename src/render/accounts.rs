//! Energy accounts of the haptic loop: who gave, who took, and whether anything came from nowhere.
//!
//! Over any sequence of steps T_k, the proxy with its coupling obeys to rounding
//! `Delta(kinetic + spring) = coupling_work + field_work + stop_work - proxy_dissipation - coupling_dissipation`,
//! so that `coupling_work + field_work >= 0` from rest: it never gives more than was put in (sections 3, 3.1).
//! What the loop can still create lies outside this balance and is booked beside it: `leak`, by a torque field that
//! is not exactly a gradient, and [`Accounts::hold_gain`], by holding the torque on the device between two ticks.
//!
//! The device's end of the coupling moves in two ways. When y jumps from y_{k-1} to y_k with the proxy at x_k, the spring
//! takes in `Kvc ((y_{k-1} + y_k)/2 - x_k) . (y_k - y_{k-1})`; during the step it is the damper's end that moves, at w_k,
//! and takes in `T Bvc (w_k - v_hat_k) . w_k`, of which `T Bvc |w_k - v_hat_k|^2` becomes heat.

use super::{coupling::Coupling, npmi::Step};
use crate::JointVector;

/// The accounts at the beginning of a tick, from the first tick on; all in joules.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accounts {
    /// Kinetic energy of the proxy, 1/2 v^T M v.
    pub kinetic: f64,
    /// Energy of the coupling's spring, 1/2 Kvc |x - y|^2.
    pub spring: f64,
    /// Kinetic and spring energy at the first tick.
    pub initial: f64,
    /// Work of the device's end of the coupling on the coupling, at the coupling's own torque.
    pub coupling_work: f64,
    /// Work of the contact torque on the proxy, sum of T v_hat . tau_bar.
    pub field_work: f64,
    /// Work of the joint stops on the proxy; never positive.
    pub stop_work: f64,
    /// Taken by the proxy's damping bv.
    pub proxy_dissipation: f64,
    /// Taken by the coupling's damping Bvc.
    pub coupling_dissipation: f64,
    /// Energy U stored in the object, interpolated; zero for datasets without it.
    pub stored: f64,
    /// Energy that the contact torque gave beyond what the object had stored, field_work + U - U_0; zero for datasets
    /// without energy.
    pub leak: f64,
    /// What the device's port took in: minus the sum of (torque on the device) . (device displacement).
    pub port_work: f64,
    /// Sum of the magnitudes of everything booked: the scale of the rounding in [`Accounts::residual`].
    pub turnover: f64,
}

impl Accounts {
    /// What the balance of proxy and coupling leaves unexplained: rounding, and nothing else [J].
    #[must_use]
    pub fn residual(&self) -> f64 {
        let given = self.initial + self.coupling_work + self.field_work + self.stop_work;
        given - self.proxy_dissipation - self.coupling_dissipation - self.kinetic - self.spring
    }

    /// What the proxy and its coupling have taken in and not given back [J]: never less than `-initial`.
    #[must_use]
    pub fn absorbed(&self) -> f64 {
        self.coupling_work + self.field_work
    }

    /// Energy made by sampling: what reached the coupling beyond what the device's port took in [J]. Positive while
    /// the held torque feeds the device; the device's own damping has to take it (Colgate's condition).
    #[must_use]
    pub fn hold_gain(&self) -> f64 {
        self.coupling_work - self.port_work
    }

    /// Books the device's move from y_{k-1} to y_k: the proxy is at `proxy` x_k, the device was under `held` torque.
    pub(super) fn device_moved(
        &mut self,
        coupling: &Coupling,
        from: &JointVector,
        to: &JointVector,
        proxy: &JointVector,
        held: &JointVector,
    ) {
        for a in 0..from.len() {
            let moved = to[a] - from[a];
            let work = coupling.stiffness[a] * (0.5 * (from[a] + to[a]) - proxy[a]) * moved;
            self.coupling_work += work;
            self.port_work -= held[a] * moved;
            self.turnover += work.abs();
        }
    }

    /// Books a step of the proxy over `interval` T, the device's end of the damper moving at `velocity` w_k, under the
    /// `contact` torque tau_bar.
    pub(super) fn stepped(
        &mut self,
        coupling: &Coupling,
        interval: f64,
        velocity: &JointVector,
        contact: &JointVector,
        step: &Step,
    ) {
        for a in 0..velocity.len() {
            let slip = velocity[a] - step.velocity[a];
            let damper = interval * coupling.damping[a] * slip * velocity[a];
            let heat = interval * coupling.damping[a] * slip * slip;
            let drag = interval * coupling.proxy_damping[a] * step.velocity[a] * step.velocity[a];
            let field = interval * contact[a] * step.velocity[a];
            self.coupling_work += damper;
            self.coupling_dissipation += heat;
            self.proxy_dissipation += drag;
            self.field_work += field;
            self.turnover += damper.abs() + heat + drag + field.abs();
        }
        self.stop_work += step.stop_work;
        self.turnover += step.stop_work.abs();
    }
}
