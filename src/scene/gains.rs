//! Gains of the loop in the place of a scene's: what a program that drives its own device may change without a new
//! scene.

use super::HapticsSpec;
use crate::JointVector;

/// A gain that cannot be taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GainError {
    /// No gain of that name.
    #[error("there is no gain {key:?}: take one of {}", GAINS.map(|(key, ..)| key).join(", "))]
    Unknown {
        /// The name that was given.
        key: String,
    },
    /// Not one number for all joints, nor one each.
    #[error("{key} has {found} numbers: give one for all joints, or one for each of the {joints}")]
    Count {
        /// The gain.
        key: &'static str,
        /// Numbers given.
        found: usize,
        /// Joints of the loop.
        joints: usize,
    },
    /// A number that is not in its range.
    #[error("{key} is {value}: it must be {}", if *zero { "zero or more" } else { "more than zero" })]
    Value {
        /// The gain.
        key: &'static str,
        /// The value that was given.
        value: f64,
        /// Whether it may be zero.
        zero: bool,
    },
}

type List = fn(&mut HapticsSpec) -> &mut JointVector;

/// Key in `[haptics]`, list, and whether zero may stand in it.
const GAINS: [(&str, List, bool); 8] = [
    ("boundary_slope", |spec| &mut spec.boundary_slope, false),
    ("coupling_damping", |spec| &mut spec.coupling_damping, true),
    ("coupling_stiffness", |spec| &mut spec.coupling_stiffness, false),
    ("device_damping", |spec| &mut spec.device_damping, true),
    ("proxy_damping", |spec| &mut spec.proxy_damping, true),
    ("speed_limit", |spec| &mut spec.speed_limit, false),
    ("torque_limit", |spec| &mut spec.torque_limit, false),
    ("torque_rate_limit", |spec| &mut spec.torque_rate_limit, false),
];

impl HapticsSpec {
    /// Takes `values` for the gain that `[haptics]` calls `key`: one for all joints, or one each, in its units there.
    ///
    /// # Errors
    /// When there is no such gain, the numbers do not fit, or one is out of its range; nothing is taken then.
    pub fn set_gain(&mut self, key: &str, values: &[f64]) -> Result<(), GainError> {
        let found = GAINS.into_iter().find(|(name, ..)| *name == key);
        let (key, list, zero) = found.ok_or_else(|| GainError::Unknown { key: key.into() })?;
        let (gains, found) = (list(self), values.len());
        let joints = gains.len();
        if found != 1 && found != joints {
            return Err(GainError::Count { key, found, joints });
        }
        let is_good = |value: f64| value.is_finite() && (value > 0.0 || (zero && value == 0.0));
        if let Some(&value) = values.iter().find(|value| !is_good(**value)) {
            return Err(GainError::Value { key, value, zero });
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
        for (key, list, zero) in GAINS {
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
