//! Gains of the loop in the place of a scene's: what a program that drives its own device may change without a new
//! scene.

use super::{BOUNDARY_SLOPE, HapticsSpec, JointKind, LEVER_ARM};
use crate::{Error, JointVector, error, names::counted};
use Quantity::{Gain, Speed, Torque};

/// How a default changes from joints that turn to joints that slide, by a lever arm of 0.1 m.
#[derive(Clone, Copy)]
pub(super) enum Quantity {
    /// Stiffness, damping, inertia: over the square of the arm.
    Gain(f64),
    /// Torque and its rate: over the arm.
    Torque(f64),
    /// Times the arm.
    Speed(f64),
}

impl Quantity {
    pub fn of(self, kind: JointKind) -> f64 {
        match (self, kind) {
            (Self::Gain(value) | Self::Torque(value) | Self::Speed(value), JointKind::Revolute) => value,
            (Self::Gain(value), JointKind::Prismatic) => value / (LEVER_ARM * LEVER_ARM),
            (Self::Torque(value), JointKind::Prismatic) => value / LEVER_ARM,
            (Self::Speed(value), JointKind::Prismatic) => value * LEVER_ARM,
        }
    }
}

/// Key in its table of the scene, list, and default of a joint that turns.
pub(super) type List = (&'static str, fn(&mut HapticsSpec) -> &mut JointVector, Quantity);

/// The lists of `[haptics]` that programs may change, and whether zero may stand in them.
pub(super) const GAINS: [(List, bool); 8] = [
    (("boundary_slope", |spec| &mut spec.boundary_slope, Gain(BOUNDARY_SLOPE)), false),
    (("coupling_damping", |spec| &mut spec.coupling_damping, Gain(0.01)), true),
    (("coupling_stiffness", |spec| &mut spec.coupling_stiffness, Gain(20.0)), false),
    (("device_damping", |spec| &mut spec.device_damping, Gain(0.03)), true),
    (("proxy_damping", |spec| &mut spec.proxy_damping, Gain(0.02)), true),
    (("speed_limit", |spec| &mut spec.speed_limit, Speed(50.0)), false),
    (("torque_limit", |spec| &mut spec.torque_limit, Torque(1.5)), false),
    (("torque_rate_limit", |spec| &mut spec.torque_rate_limit, Torque(500.0)), false),
];

/// The other lists of `[haptics]`.
pub(super) const OF_THE_DEVICE: [List; 3] = [
    ("device_inertia", |spec| &mut spec.device_inertia, Gain(1e-3)),
    ("encoder_step", |spec| &mut spec.encoder_step, Torque(0.0)),
    ("device_friction", |spec| &mut spec.device_friction, Torque(0.0)),
];

/// The lists of `[haptics.hand]`.
pub(super) const OF_THE_HAND: [List; 3] = [
    ("stiffness", |spec| &mut spec.hand.stiffness, Gain(20.0)),
    ("damping", |spec| &mut spec.hand.damping, Gain(0.4)),
    ("inertia", |spec| &mut spec.hand.inertia, Gain(2e-3)),
];

impl HapticsSpec {
    /// Takes `values` for the gain that `[haptics]` calls `key`: one for all joints, or one each, in its units there.
    ///
    /// # Errors
    /// When there is no such gain, the numbers do not fit, or one is out of its range; nothing is taken then.
    pub fn set_gain(&mut self, key: &str, values: &[f64]) -> Result<(), Error> {
        let found = GAINS.into_iter().find(|((name, ..), _)| *name == key);
        let ((key, list, _), zero) = found.ok_or_else(|| {
            error!("there is no gain {key:?}: take one of {}", GAINS.map(|((key, ..), _)| key).join(", "))
        })?;
        let (gains, found) = (list(self), values.len());
        let joints = gains.len();
        if found != 1 && found != joints {
            return Err(error!(
                "{key} has {}: give one for all joints, or one for each of {}",
                counted(found, ["number", "numbers"]),
                counted(joints, ["joint", "joints"])
            ));
        }
        let is_good = |value: f64| value.is_finite() && (value > 0.0 || (zero && value == 0.0));
        if let Some(&value) = values.iter().find(|value| !is_good(**value)) {
            let range = if zero { "zero or more" } else { "more than zero" };
            return Err(error!("{key} is {value}: it must be {range}"));
        }
        gains.iter_mut().zip(values.iter().cycle()).for_each(|(gain, value)| *gain = *value);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn a_gain_is_taken_whole_or_not_at_all() {
        let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml")).unwrap();
        for ((key, list, _), zero) in GAINS {
            let mut spec = scene.haptics.clone();
            spec.set_gain(key, &[2.5]).unwrap();
            assert_eq!(**list(&mut spec), [2.5; 3], "{key}");
            spec.set_gain(key, &[1.0, 2.0, 3.0]).unwrap();
            assert_eq!(**list(&mut spec), [1.0, 2.0, 3.0], "{key}");
            assert_eq!(spec.set_gain(key, &[0.0]).is_ok(), zero, "{key}");
            let before = spec.clone();
            for bad in [&[][..], &[1.0, 2.0], &[1.0, -1.0, 1.0], &[f64::NAN], &[f64::INFINITY]] {
                assert!(spec.set_gain(key, bad).is_err(), "{key}");
            }
            assert_eq!(spec, before, "{key}");
        }
        let unknown = scene.haptics.clone().set_gain("stiffness", &[1.0]).unwrap_err().to_string();
        assert!(unknown.contains("coupling_stiffness"), "{unknown}");
    }
}
