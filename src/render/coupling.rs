//! The spring-damper virtual coupling between device and proxy (section 3.1).
//!
//! Device position y_k is read at t_k; `w_k = (y_k - y_{k-1})/T_{k-1}`. With `v_hat_{k-1} = (x_k - x_{k-1})/T_{k-1}`,
//! `tau(t) = -bd ydot - Bvc (w_k - v_hat_{k-1}) - Kvc (y_k - x_k)`        on the device, held until t_{k+1};
//! `tau_k  = -bv v_hat_k - Bvc (v_hat_k - w_k) - Kvc (x_hat_k - y_k)`     on the proxy, implicit in v_hat_k, x_hat_k.
//! `bd ydot` is the damping that the device has of itself: it is no part of the motor command. The alternative,
//! four channels, adds to these torques (`channels.rs`).

use super::npmi::Load;
use crate::{JointVector, MAX_JOINTS, field::range::Stops, scene::HapticsSpec};

/// The coupling's gains, one per joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// Kvc (N m/rad).
    pub stiffness: JointVector,
    /// Bvc (N m s/rad).
    pub damping: JointVector,
    /// bv, between the proxy and the ground (N m s/rad).
    pub proxy_damping: JointVector,
    /// bd, of the device itself (N m s/rad).
    pub device_damping: JointVector,
}

impl Coupling {
    /// The gains of a scene.
    #[must_use]
    pub fn new(spec: &HapticsSpec) -> Self {
        Self {
            stiffness: spec.coupling_stiffness,
            damping: spec.coupling_damping,
            proxy_damping: spec.proxy_damping,
            device_damping: spec.device_damping,
        }
    }

    /// Torque for the device at `position` y_k moving at `velocity` w_k, the proxy at `proxy` x_k having moved at
    /// `proxy_velocity` v_hat_{k-1} (N m or N).
    #[must_use]
    pub fn device_torque(
        &self,
        position: &JointVector,
        velocity: &JointVector,
        proxy: &JointVector,
        proxy_velocity: &JointVector,
    ) -> JointVector {
        let mut torque = JointVector::zeros(position.len());
        for (a, torque) in torque.iter_mut().enumerate() {
            *torque =
                -self.damping[a] * (velocity[a] - proxy_velocity[a]) - self.stiffness[a] * (position[a] - proxy[a]);
        }
        torque
    }

    /// Returns the forces on the proxy: coupling, damping bv, the `contact` torque tau_bar and `stops`.
    #[must_use]
    pub fn proxy_load(
        &self,
        position: &JointVector,
        velocity: &JointVector,
        contact: &JointVector,
        stops: Stops,
    ) -> Load {
        let damping = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        let mut load = Load { stiffness: self.stiffness, target: *position, damping, torque: *contact, stops };
        for a in 0..position.len() {
            load.damping[a][a] = self.proxy_damping[a] + self.damping[a];
            load.torque[a] += self.damping[a] * velocity[a];
        }
        load
    }

    /// 1/2 Kvc |x - y|^2 (J).
    #[must_use]
    pub fn spring_energy(&self, proxy: &JointVector, device: &JointVector) -> f64 {
        let stretch = proxy.iter().zip(device.iter()).map(|(x, y)| (x - y) * (x - y));
        0.5 * self.stiffness.iter().zip(stretch).map(|(k, square)| k * square).sum::<f64>()
    }
}
