//! Four-channel coupling (Lawrence 1993; section 3.1 names it as the alternative to the spring and damper): force and
//! acceleration channels beside the spring and damper of `coupling.rs`, which stays as the local controller.
//!
//! Device and proxy have the impedances `Zm = m s + bd` and `Zs = M s + bv`. With shares c1 to c4 of the ideal
//! `C1 = Zs`, `C2 = C3 = 1`, `C4 = -Zm` the channels add
//!
//! `c2 tau_bar + c4 (m vdot + bd v)` on the device, v the proxy's velocity, and
//! `c3 f_h + c1 (M wdot + bv w)`     on the proxy, w the device's velocity and f_h the force of the hand.
//!
//! *Why.* Through spring and damper alone the hand feels the object in series with Kvc, and the proxy lags by tau/Kvc.
//! At rest with c2 = c3 = 1 the balances of both ends, `f_h = Kvc (y - x) - tau_bar` and
//! `tau_bar + Kvc (y - x) + f_h = 0`, give y = x and f_h = -tau_bar: the object as it is. c1 and c4 take the inertias
//! out of free motion; one would make the pair massless and leave nothing for the filter's delay, hence a half by
//! default.
//!
//! *Force of the hand.* Not measured but estimated, `f_h = m wdot + bd w - tau`, tau the torque held since the last
//! tick; it and the accelerations pass a low-pass filter of time constant `filter`: an encoder's step, divided twice by
//! T, would be felt as a blow.
//!
//! *What it costs.* The channels are not passive by themselves: they hand the object's own stiffness to the device's
//! hold, so that Colgate's condition counts `Kvc + c2 Ks` (`passivity.rs`). The accounts book their work, the passivity
//! controller and the guard of `haptic.rs` act on it as on all else.

use super::npmi::{MidpointInertia, flush};
use crate::{
    JointVector,
    scene::{FourChannelSpec, HapticsSpec},
};

/// The channels' constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channels {
    spec: FourChannelSpec,
    /// m (kg m^2).
    device_inertia: JointVector,
    /// bd (N m s/rad).
    device_damping: JointVector,
    /// bv (N m s/rad).
    proxy_damping: JointVector,
}

/// State of the channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelState {
    /// w_{k-1} (rad/s).
    device_velocity: JointVector,
    /// v_hat_{k-2} (rad/s).
    proxy_velocity: JointVector,
    /// wdot, filtered (rad/s^2).
    device_acceleration: JointVector,
    /// vdot, filtered (rad/s^2).
    proxy_acceleration: JointVector,
    /// f_h, filtered (N m).
    hand: JointVector,
}

impl Channels {
    /// The channels of `spec` in a loop with the gains of `haptics`.
    #[must_use]
    pub fn new(spec: FourChannelSpec, haptics: &HapticsSpec) -> Self {
        Self {
            spec,
            device_inertia: haptics.device_inertia,
            device_damping: haptics.device_damping,
            proxy_damping: haptics.proxy_damping,
        }
    }

    /// At rest, untouched.
    #[must_use]
    pub fn start(&self) -> ChannelState {
        let zero = JointVector::zeros(self.device_inertia.len());
        ChannelState {
            device_velocity: zero,
            proxy_velocity: zero,
            device_acceleration: zero,
            proxy_acceleration: zero,
            hand: zero,
        }
    }

    /// Takes in that the device moved at `device` w_k and the proxy at `proxy` v_hat_{k-1} during the last `elapsed`
    /// T_{k-1} (s), the device under `held` torque (N m).
    pub fn observe(
        &self,
        state: &mut ChannelState,
        elapsed: f64,
        device: &JointVector,
        proxy: &JointVector,
        held: &JointVector,
    ) {
        // The exact response of the filter to what is constant over the tick.
        let share = 1.0 - (-elapsed / self.spec.filter).exp();
        for a in 0..device.len() {
            let acceleration = (device[a] - state.device_velocity[a]) / elapsed;
            let hand = self.device_inertia[a] * acceleration + self.device_damping[a] * device[a] - held[a];
            let follow = |old: &mut f64, new: f64| {
                *old += share * (new - *old);
                flush(old);
            };
            follow(&mut state.device_acceleration[a], acceleration);
            follow(&mut state.hand[a], hand);
            follow(&mut state.proxy_acceleration[a], (proxy[a] - state.proxy_velocity[a]) / elapsed);
        }
        state.device_velocity = *device;
        state.proxy_velocity = *proxy;
    }

    /// Returns what the channels add to the torque on the device under the `contact` torque tau_bar on the proxy (N m).
    #[must_use]
    pub fn device_torque(&self, state: &ChannelState, contact: &JointVector) -> JointVector {
        let [_, c2, _, c4] = self.spec.channels;
        let mut torque = *contact;
        for (a, torque) in torque.iter_mut().enumerate() {
            let impedance =
                self.device_inertia[a] * state.proxy_acceleration[a] + self.device_damping[a] * state.proxy_velocity[a];
            *torque = c2 * *torque + c4 * impedance;
        }
        torque
    }

    /// Returns what the channels add to the torque on the proxy, whose inertia is that of `stage` (N m).
    #[must_use]
    pub fn proxy_torque(&self, state: &ChannelState, stage: &MidpointInertia) -> JointVector {
        let [c1, _, c3, _] = self.spec.channels;
        let mut torque = stage.inertial_torque(&state.device_acceleration);
        for (a, torque) in torque.iter_mut().enumerate() {
            *torque = c3 * state.hand[a] + c1 * (*torque + self.proxy_damping[a] * state.device_velocity[a]);
        }
        torque
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn filters_that_are_left_alone_reach_zero_and_no_subnormal_number() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sphere.toml");
        let haptics = Scene::load(path).unwrap().haptics;
        let channels = Channels::new(FourChannelSpec { channels: [0.5, 1.0, 1.0, 0.5], filter: 0.005 }, &haptics);
        let joints = haptics.device_inertia.len();
        let (mut state, still) = (channels.start(), JointVector::zeros(joints));
        let mut moving = still;
        moving.fill(0.3);
        channels.observe(&mut state, 1e-3, &moving, &moving, &still);
        assert!(state.hand[0] != 0.0);
        for _ in 0..20_000 {
            channels.observe(&mut state, 1e-3, &still, &still, &still);
            let filtered = [state.hand, state.device_acceleration, state.proxy_acceleration];
            assert!(!filtered.iter().flat_map(|v| v.iter()).any(|x| x.is_subnormal()), "{state:?}");
        }
        assert_eq!(state.hand, still);
    }
}
