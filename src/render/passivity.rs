//! Which gains are safe: passivity bounds of the loop, computed before it starts, with the value that would do.
//!
//! - Boundary layer and object, per joint: `Ks <= mu bv / T` (section 3.1); by the discrete energy balance of the step it
//!   is sharp at mu = 2 (`npmi.rs`). The same bound holds for the stiffness of the dataset's torque itself.
//! - Coupling, per joint, against the device's own damping: Colgate's wall, `bd > Kvc T/2 + |Bvc|`. It does without the
//!   hand; a hand that holds the device adds its damping to bd.

use super::{field::TorqueField, trace::JointLabel};
use crate::scene::HapticsSpec;

/// A gain beyond its passivity bound: the loop runs, and may create energy.
#[derive(Clone, Debug, PartialEq)]
pub struct Exceeded {
    /// What is too large, in words, with its joint.
    pub what: String,
    /// Its value [N m/rad; 1 for a ratio].
    pub value: f64,
    /// Largest value that is safe, in the same unit.
    pub safe: f64,
    /// How to make it so.
    pub remedy: String,
}

impl std::fmt::Display for Exceeded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} is {:.4}, beyond the passive {:.4}: {}", self.what, self.value, self.safe, self.remedy)
    }
}

/// All gains of `spec` that exceed their bound, with `field` and the names of the joints.
#[must_use]
pub fn exceeded(spec: &HapticsSpec, field: &TorqueField, joints: &[JointLabel]) -> Vec<Exceeded> {
    let period = 1.0 / spec.rate;
    let mut found = Vec::new();
    let mut safe_slopes = spec.proxy_damping;
    for (a, joint) in joints.iter().enumerate().take(field.joints()) {
        let slope = spec.passivity_factor * spec.proxy_damping[a] / period;
        safe_slopes[a] = slope;
        if spec.boundary_slope[a] > slope {
            found.push(Exceeded {
                what: format!("boundary slope Ks of joint {}", joint.name),
                value: spec.boundary_slope[a],
                safe: slope,
                remedy: format!(
                    "lower Ks to {slope:.4} N m/rad, or raise the proxy's damping bv to {:.4} N m s/rad",
                    spec.boundary_slope[a] * period / spec.passivity_factor
                ),
            });
        }
        let stiffness = 2.0 * (spec.device_damping[a] - spec.coupling_damping[a]) / period;
        if spec.coupling_stiffness[a] > stiffness {
            found.push(Exceeded {
                what: format!("coupling stiffness Kvc of joint {}", joint.name),
                value: spec.coupling_stiffness[a],
                safe: stiffness.max(0.0),
                remedy: format!(
                    "lower it, or give the device a damping bd of {:.4} N m s/rad (a hand on the device adds to it)",
                    0.5 * spec.coupling_stiffness[a] * period + spec.coupling_damping[a]
                ),
            });
        }
    }
    if safe_slopes.iter().all(|slope| *slope > 0.0) {
        let ratio = field.relative_stiffness(&safe_slopes);
        if ratio > 1.0 {
            found.push(Exceeded {
                what: "stiffness of the dataset's torque over mu bv / T".into(),
                value: ratio,
                safe: 1.0,
                remedy: format!("raise the proxy's damping bv {ratio:.2}-fold, or keep to a slope Ks that is passive"),
            });
        }
    }
    found
}
