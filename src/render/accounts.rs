//! Energy accounts of the haptic loop: who gave, who took, and whether anything came from nowhere.
//!
//! Over any sequence of steps T_k, the proxy with its coupling obeys to rounding
//! `Delta(kinetic + spring + presliding) = coupling_work + channel_work + field_work + stop_work - proxy_dissipation -
//! coupling_dissipation - friction_dissipation - control_dissipation`,
//! so that `coupling_work + channel_work + field_work >= 0` from rest: it never gives more than was put in (sections 3,
//! 3.1). Terms of effects that the scene does not name stay zero.
//!
//! *Passivity observers* (Hannaford and Ryu 2002) watch what the loop can still create, which lies outside this
//! balance. At the object's port, [`Accounts::created`]: a torque that is held for a time step, and a torque field that
//! is not exactly a gradient, give more than was stored. At the device's port, [`Accounts::device_port`]: the torque
//! that is held between two ticks gives more than the hand put in ([`Accounts::hold_gain`]), which the device's own
//! damping has to take.
//!
//! The device's end of the coupling moves in two ways. When y jumps from y_{k-1} to y_k with the proxy at x_k, the
//! spring takes in `Kvc ((y_{k-1} + y_k)/2 - x_k) . (y_k - y_{k-1})`; during the step it is the damper's end that
//! moves, at w_k, and takes in `T Bvc (w_k - v_hat_k) . w_k`, of which `T Bvc |w_k - v_hat_k|^2` becomes heat.

use super::{coupling::Coupling, npmi::Step};
use crate::JointVector;

/// Energy balance error, relative to the energy exchanged, that is rounding (1): each of up to a million ticks adds
/// some terms, rounded by eps of the sums so far: eps times the square root of their number, 1e-13, if they are
/// random, and a thousand times that if they are not.
pub const ACCOUNT_ROUNDING: f64 = 1e-10;

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
    /// Work of the four-channel coupling's channels on the proxy.
    pub channel_work: f64,
    /// Work of the contact torque on the proxy, sum of T v_hat . tau_bar.
    pub field_work: f64,
    /// Work of the joint stops on the proxy; never positive.
    pub stop_work: f64,
    /// Taken by the proxy's damping bv.
    pub proxy_dissipation: f64,
    /// Taken by the coupling's damping Bvc.
    pub coupling_dissipation: f64,
    /// Kept by contact friction before it slides.
    pub presliding: f64,
    /// Taken by contact friction.
    pub friction_dissipation: f64,
    /// Taken by the passivity controller at the object's port.
    pub control_dissipation: f64,
    /// Energy stored in the object: U, interpolated, or what is left of it where the object relaxes; zero for datasets
    /// without it.
    pub stored: f64,
    /// Lost in the object where it relaxes, and taken by the drag of fresh material.
    pub relaxed: f64,
    /// Energy stored in the object at the first tick. If the dataset does not hold it: zero if the loop began out of
    /// contact; else nothing is known until contact first ends, and what was given by then is taken for it.
    pub first_stored: Option<f64>,
    /// Energy that the contact torque gave beyond what the object had stored, field_work + stored + relaxed - first:
    /// made by the time step, and by interpolation unless that has a potential; zero for datasets without energy.
    pub leak: f64,
    /// Energy that the device's port took in: minus the sum of (torque on the device) . (device displacement).
    pub port_work: f64,
    /// Least that the device's own damping bd took, sum of T bd w_k^2.
    pub device_dissipation: f64,
    /// Energy exchanged: the sum of the magnitudes of all works, heats and changes of stored energy, the scale of the
    /// rounding in [`Accounts::residual`].
    pub exchanged: f64,
}

/// Loads on the proxy during a step beside coupling, contact torque and stops; zero if the scene names no such
/// effect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Extra {
    /// Torque of the four-channel coupling's channels (N m).
    pub channels: JointVector,
    /// Work of contact friction on the proxy (J).
    pub friction_work: f64,
    /// Energy that friction keeps after the step (J).
    pub presliding: f64,
    /// Taken by the drag of fresh material, a part of the contact torque (J).
    pub drag: f64,
    /// Taken by the passivity controller (J).
    pub control_dissipation: f64,
}

impl Accounts {
    /// Every account by its name, in the order of their balance, and what it leaves; none where it is not known (J).
    #[must_use]
    pub fn named(&self) -> [(&'static str, Option<f64>); 20] {
        [
            ("initial", Some(self.initial)),
            ("kinetic", Some(self.kinetic)),
            ("spring", Some(self.spring)),
            ("presliding", Some(self.presliding)),
            ("coupling work", Some(self.coupling_work)),
            ("channel work", Some(self.channel_work)),
            ("field work", Some(self.field_work)),
            ("stop work", Some(self.stop_work)),
            ("proxy dissipation", Some(self.proxy_dissipation)),
            ("coupling dissipation", Some(self.coupling_dissipation)),
            ("friction dissipation", Some(self.friction_dissipation)),
            ("control dissipation", Some(self.control_dissipation)),
            ("residual", Some(self.residual())),
            ("exchanged", Some(self.exchanged)),
            ("stored", Some(self.stored)),
            ("relaxed", Some(self.relaxed)),
            ("first stored", self.first_stored),
            ("leak", Some(self.leak)),
            ("port work", Some(self.port_work)),
            ("device dissipation", Some(self.device_dissipation)),
        ]
    }

    /// Returns the residual of the balance of proxy and coupling: rounding, and nothing else (J).
    #[must_use]
    pub fn residual(&self) -> f64 {
        let given = self.initial + self.absorbed() + self.stop_work;
        let taken =
            self.proxy_dissipation + self.coupling_dissipation + self.friction_dissipation + self.control_dissipation;
        given - taken - self.kinetic - self.spring - self.presliding
    }

    /// Returns the energy that the proxy and its coupling have taken in and not given back (J): never less than
    /// `-initial`.
    #[must_use]
    pub fn absorbed(&self) -> f64 {
        self.coupling_work + self.channel_work + self.field_work
    }

    /// Energy made by sampling: what reached the coupling beyond what the device's port took in (J). Positive while
    /// the held torque feeds the device; the device's own damping has to take it (Colgate's condition).
    #[must_use]
    pub fn hold_gain(&self) -> f64 {
        self.coupling_work - self.port_work
    }

    /// The passivity observer of the device's port (J): what there was at the beginning, and what came in through the
    /// port or went into the device's own damping since. Negative: the hand has been given energy from nowhere. `None`
    /// while it is not known what the object had stored at the beginning.
    #[must_use]
    pub fn device_port(&self) -> Option<f64> {
        self.first_stored.map(|stored| self.initial + stored + self.port_work + self.device_dissipation)
    }

    /// The passivity observer of the object's port, turned round (J): what the contact torque has given beyond what the
    /// object had stored. Positive: energy from nowhere. With the dataset's energy U it is the leak; without, what is
    /// more than the object can have had.
    #[must_use]
    pub fn created(&self) -> f64 {
        self.first_stored.map_or(0.0, |first| self.field_work + self.stored + self.relaxed - first)
    }

    /// Books the state at a tick: what the object has stored, if the dataset holds it, and has lost since the tick
    /// before; and whether it is touched.
    pub(super) fn at_tick(&mut self, kinetic: f64, spring: f64, (stored, relaxed): (Option<f64>, f64), touched: bool) {
        self.kinetic = kinetic;
        self.spring = spring;
        self.stored = stored.unwrap_or(0.0);
        self.relaxed += relaxed;
        if self.first_stored.is_none() {
            self.first_stored = stored.or((!touched).then_some(self.field_work.max(0.0)));
        }
        if stored.is_some() {
            self.leak = self.created();
        }
    }

    /// Books the device's move from y_{k-1} to y_k in `elapsed` (s): the proxy is at `proxy` x_k, the device was under
    /// `held` torque.
    pub(super) fn device_moved(
        &mut self,
        coupling: &Coupling,
        elapsed: f64,
        [from, to]: [&JointVector; 2],
        proxy: &JointVector,
        held: &JointVector,
    ) {
        for a in 0..from.len() {
            let moved = to[a] - from[a];
            let work = coupling.stiffness[a] * (0.5 * (from[a] + to[a]) - proxy[a]) * moved;
            self.coupling_work += work;
            self.port_work -= held[a] * moved;
            self.device_dissipation += coupling.device_damping[a] * moved * moved / elapsed;
            self.exchanged += work.abs();
        }
    }

    /// Books a step of the proxy over `interval` T, the device's end of the damper moving at `velocity` w_k, under the
    /// `contact` torque tau_bar and what `extra` there was.
    pub(super) fn stepped(
        &mut self,
        coupling: &Coupling,
        interval: f64,
        velocity: &JointVector,
        contact: &JointVector,
        step: &Step,
        extra: &Extra,
    ) {
        for a in 0..velocity.len() {
            let slip = velocity[a] - step.velocity[a];
            let damper = interval * coupling.damping[a] * slip * velocity[a];
            let heat = interval * coupling.damping[a] * slip * slip;
            let drag = interval * coupling.proxy_damping[a] * step.velocity[a] * step.velocity[a];
            let field = interval * contact[a] * step.velocity[a];
            let channel = interval * extra.channels[a] * step.velocity[a];
            self.coupling_work += damper;
            self.coupling_dissipation += heat;
            self.proxy_dissipation += drag;
            self.field_work += field;
            self.channel_work += channel;
            self.exchanged += damper.abs() + heat + drag + field.abs() + channel.abs();
        }
        self.field_work -= extra.drag;
        self.stop_work += step.stop_work;
        self.friction_dissipation += self.presliding - extra.presliding - extra.friction_work;
        self.presliding = extra.presliding;
        self.control_dissipation += extra.control_dissipation;
        self.exchanged += step.stop_work.abs() + extra.friction_work.abs() + extra.drag + extra.control_dissipation;
    }
}
