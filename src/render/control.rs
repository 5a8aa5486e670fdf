//! The passivity controller (Hannaford and Ryu 2002), for scenes that name it: damping that takes what an observer
//! finds to have come from nowhere, and acts only while there is such.
//!
//! With `E < 0` at the device's port, `tau = -alpha m w` on the device, w its velocity and m its inertia:
//! `alpha = -E / (T sum m w^2)` would take it all within a tick. With energy created at the object's port, the damping
//! `alpha M` on the proxy, implicit in its step: `alpha = E / (T v^T M v)`. Weighting by inertia gives joints of all
//! units their share.
//!
//! `alpha <= 1/T`. On the device, the torque comes from the mean velocity of the last tick and is held over the next: a
//! free inertia obeys `z^2 + (alpha T/2 - 1) z + alpha T/2 = 0`, stable below alpha T = 2; half of that leaves room.
//! Energy that is not taken in one tick is taken in the next ones.

use super::{accounts::Accounts, npmi::Motion};
use crate::{JointVector, scene::HapticsSpec};

/// Least energy of motion that a passivity controller brakes (J): a gram at a micrometre a second. Below, one tick's
/// damping could not take anything that counts.
const LEAST_MOVING_ENERGY: f64 = 1e-15;

/// The controller's constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassivityControl {
    /// m (kg m^2).
    device_inertia: JointVector,
}

impl PassivityControl {
    /// The controller of `spec`, if the scene names it.
    #[must_use]
    pub fn new(spec: &HapticsSpec) -> Option<Self> {
        spec.passivity_control.then_some(Self { device_inertia: spec.device_inertia })
    }

    /// Adds to `torque` on the device what takes the energy that its port has given from nowhere, the device moving at
    /// `velocity` w_k, over `elapsed` T (s).
    pub(super) fn brake_device(
        &self,
        accounts: &Accounts,
        elapsed: f64,
        velocity: &JointVector,
        torque: &mut JointVector,
    ) {
        let made = -accounts.device_port().unwrap_or(0.0);
        let moving: f64 = velocity.iter().zip(self.device_inertia.iter()).map(|(w, m)| m * w * w).sum();
        let alpha = rate(made, moving, elapsed);
        for (a, torque) in torque.iter_mut().enumerate() {
            *torque -= alpha * self.device_inertia[a] * velocity[a];
        }
    }

    /// alpha (1/s) of the damping alpha M on the proxy for a step of `interval` T (s) from `motion`. It acts until the
    /// object's port has the energy back, not only until as much is taken: what creates energy once does so again, and
    /// a proxy that is braked creates less (measured: a tenth).
    pub(super) fn proxy_rate(&self, accounts: &Accounts, interval: f64, motion: &Motion) -> f64 {
        rate(accounts.created(), 2.0 * motion.kinetic_energy(), interval)
    }
}

/// alpha that takes `made` (J) within `time` T (s) from what moves with twice the energy `moving` (J); at most 1/T.
fn rate(made: f64, moving: f64, time: f64) -> f64 {
    if made > 0.0 && moving > LEAST_MOVING_ENERGY { (made / moving).min(1.0) / time } else { 0.0 }
}
