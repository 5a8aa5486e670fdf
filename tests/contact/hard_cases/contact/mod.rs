//! Hard cases of contact: stiffness, geometry, meshes, units, kinematics, and the torque as a field over C-space.

mod equilibria;
mod field;
mod geometry;
mod kinematics;
mod meshes;
mod processor;
mod stiffness;
mod units;

use crate::hard_cases::Case;

/// All of them.
pub fn cases() -> Vec<Case> {
    let case = |name, run| Case { room: "contact", name, run };
    vec![
        case("stiffness", stiffness::run),
        case("exact places", geometry::exact_places),
        case("coincident nodes", geometry::coincident_nodes),
        case("right through", geometry::right_through),
        case("concave object", geometry::concave),
        case("two regions", geometry::two_regions),
        case("broken meshes", meshes::run),
        case("units", units::units),
        case("far from the origin", units::far_away),
        case("continuous torque", field::continuity),
        case("torque from energy", field::curl),
        case("lowest equilibrium", equilibria::run),
        case("singular arms", kinematics::run),
    ]
}
