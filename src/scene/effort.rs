//! What acts along joints, in words: a torque where a joint turns, a force where it slides.

use super::{LEVER_ARM, Scene};
use crate::JointVector;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Returns the unit of what acts along a coordinate in `unit`: a torque, or a force where that is a length.
#[must_use]
pub fn effort_unit(unit: &str) -> &'static str {
    if unit == "m" { "N" } else { "N m" }
}

/// Writes one number a joint, each with the joint's name and the unit of what acts along it; `joints` are their names
/// and the units of their coordinates.
#[must_use]
pub fn efforts<'a>(values: &[f64], joints: impl IntoIterator<Item = (&'a str, &'a str)>) -> String {
    let one = |(value, (name, unit)): (&f64, (&str, &str))| format!("{name} {value:.5} {}", effort_unit(unit));
    values.iter().zip(joints).map(one).collect::<Vec<_>>().join(", ")
}

/// Writes the norm of the torques of joints that turn, and that of the forces of joints that slide, of those that are
/// among joints with coordinates in `units`.
#[must_use]
pub fn effort_norms<'a>([torque, force]: [f64; 2], units: impl IntoIterator<Item = &'a str>) -> String {
    let (mut turns, mut slides) = (false, false);
    units.into_iter().for_each(|unit| *(if unit == "m" { &mut slides } else { &mut turns }) = true);
    match (turns, slides) {
        (true, true) => format!("{torque:.4} N m and {force:.4} N"),
        (false, true) => format!("{force:.4} N"),
        _ => format!("{torque:.4} N m"),
    }
}

/// The Euclidean norm over joints of what acts along them, of a difference of torques for example.
///
/// Where all joints slide it is a norm of forces (N). Else it is one of torques (N m), in which the force of a joint that
/// slides counts with an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EffortNorm {
    factors: JointVector,
    /// What its values are measured in.
    pub unit: NormUnit,
}

impl EffortNorm {
    /// The norm over joints with coordinates in `units`.
    #[must_use]
    pub fn new<'a>(units: impl IntoIterator<Item = &'a str>) -> Self {
        let slides: Vec<bool> = units.into_iter().map(|unit| unit == "m").collect();
        let (forces, mixed) = (slides.iter().all(|slides| *slides), slides.contains(&true));
        let lever_arm = (mixed && !forces).then_some(LEVER_ARM);
        let factors: Vec<f64> = slides.iter().map(|slides| lever_arm.filter(|_| *slides).unwrap_or(1.0)).collect();
        Self { factors: JointVector::from_slice(&factors), unit: NormUnit { forces, lever_arm } }
    }

    /// The norm over the joints of the arm of `scene`.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        Self::new(scene.proxy.joints.iter().map(|joint| joint.kind.unit()))
    }

    /// How many joints there are.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.factors.len()
    }

    /// Squared distance of two vectors of torques and forces (N^2 m^2, or N^2).
    #[must_use]
    pub fn square(&self, a: &JointVector, b: &JointVector) -> f64 {
        let parts = a.iter().zip(b.iter()).zip(self.factors.iter());
        parts.map(|((a, b), factor)| (factor * (a - b)).powi(2)).sum()
    }
}

/// What the values of an [`EffortNorm`] are measured in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NormUnit {
    /// Whether they are forces (N), since all joints slide, and not torques (N m).
    #[serde(default, skip_serializing_if = "is_false")]
    pub forces: bool,
    /// Arm with which the forces of sliding joints count in a norm of torques (m); absent where there are none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lever_arm: Option<f64>,
}

/// Whether a flag is left out of a file.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_false(flag: &bool) -> bool {
    !*flag
}

impl NormUnit {
    /// The unit alone.
    #[must_use]
    pub fn name(&self) -> &'static str {
        if self.forces { "N" } else { "N m" }
    }
}

/// The unit, and with which arm the forces of sliding joints count, if there are such joints.
impl fmt::Display for NormUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        self.lever_arm.map_or(Ok(()), |arm| write!(f, " (forces of sliding joints times {arm} m)"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_has_the_unit_of_its_joint() {
        assert_eq!(efforts(&[1.0, 2.0], [("elbow", "rad"), ("lift", "m")]), "elbow 1.00000 N m, lift 2.00000 N");
        let norms = |units: &[&str]| effort_norms([1.0, 2.0], units.iter().copied());
        assert_eq!(norms(&["rad", "rad"]), "1.0000 N m");
        assert_eq!(norms(&["m"]), "2.0000 N");
        assert_eq!(norms(&["rad", "m"]), "1.0000 N m and 2.0000 N");
    }

    #[test]
    fn a_norm_is_one_of_forces_where_all_joints_slide() {
        let zero = JointVector::from_slice(&[0.0, 0.0]);
        let of = |units: [&str; 2]| {
            let norm = EffortNorm::new(units);
            (norm.square(&JointVector::from_slice(&[3.0, 4.0]), &zero), norm.unit.to_string())
        };
        assert_eq!(of(["rad", "rad"]), (25.0, "N m".into()));
        assert_eq!(of(["m", "m"]), (25.0, "N".into()));
        let (square, unit) = of(["rad", "m"]);
        assert!((square - 9.16).abs() < 1e-12, "{square}");
        assert_eq!(unit, "N m (forces of sliding joints times 0.1 m)");
    }

    #[test]
    fn files_from_before_forces_had_a_norm_keep_their_unit() {
        let read = |text: &str| serde_json::from_str::<NormUnit>(text).unwrap().to_string();
        assert_eq!(read("{}"), "N m");
        assert_eq!(read(r#"{"lever_arm":0.1}"#), "N m (forces of sliding joints times 0.1 m)");
        assert_eq!(read(r#"{"forces":true}"#), "N");
    }
}
