//! What acts along joints, in words: a torque where a joint turns, a force where it slides.

use super::LEVER_ARM;

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

/// The factor of the torque of a joint with coordinates in `unit` in a norm over joints: [`LEVER_ARM`] for the force of
/// a sliding one (m), else 1.
#[must_use]
pub fn lever(unit: &str) -> f64 {
    if unit == "m" { LEVER_ARM } else { 1.0 }
}

/// The arm with which the forces of sliding joints count in a norm of torques over joints with coordinates in `units`
/// (m); absent where no joint slides.
#[must_use]
pub fn lever_arm<'a>(units: impl IntoIterator<Item = &'a str>) -> Option<f64> {
    units.into_iter().any(|unit| unit == "m").then_some(LEVER_ARM)
}

/// Says after a norm of torques with which arm the forces of sliding joints count in it, if there are such joints.
#[must_use]
pub fn arm_note(lever_arm: Option<f64>) -> String {
    lever_arm.map_or(String::new(), |arm| format!(" (forces of sliding joints times {arm} m)"))
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
        assert_eq!(lever_arm(["rad"]), None);
        assert_eq!(arm_note(lever_arm(["rad", "m"])), " (forces of sliding joints times 0.1 m)");
    }
}
