//! The shaders of `shaders/`, embedded, and how a stage is put together from parts.
//!
//! WGSL has no include: a stage is the generated constants, with the type of its numbers, then shared structs and
//! functions, then the stage's own file. Constants that both sides need have one source, here in Rust; sizes and
//! switches are override constants.

use super::precision::Precision;
use crate::contact::{
    MINIMUM_SQUARE, Status,
    equilibrium::{energy, newton, tangent},
    geometry::{LENGTH_ROUNDING, facet},
    law::depth,
};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

/// Stands for "no distance yet" in f32 kernels (m): above any distance in a scene, and its square is still finite.
pub(super) const GPU_FAR_AWAY: f32 = 1e18;

/// Least divisor in f32 kernels: a hundred times the least normal number (1.2e-38), below which a device may flush to
/// zero. Squared edge lengths stay above it down to 1e-18 m.
pub const GPU_LEAST_DIVISOR: f32 = 1e-36;

/// Widening of distances within which f32 kernels search, relative to these (1): they follow from sums of up to some
/// hundred products, each rounded by 6e-8.
const GPU_SEARCH_SLACK: f64 = 1e-4;

/// The least step of the search for the closest point of a bent facet, for f32 (1): some roundings of a weight.
const GPU_FACET_STEP: f64 = 4.0 * f32::EPSILON as f64;

/// [`energy::ENERGY_ROUNDING`] for f32, whose eps is 1.2e-7.
const GPU_ENERGY_ROUNDING: f64 = 16.0 * f32::EPSILON as f64;

/// [`energy::GIVE_UP_LENGTH`] for f32: coordinates do not change visibly under a step this much smaller than the first.
const GPU_GIVE_UP_LENGTH: f64 = 1e-6;

/// [`energy::INNER_TOLERANCE_FLOOR`] for f32: eps times the about 1e3 by which rounding grows over some tens of
/// iterations.
const GPU_INNER_TOLERANCE_FLOOR: f64 = 1e-4;

/// One entry point with everything it needs.
#[derive(Clone, Copy, Debug)]
pub struct Shader {
    /// The stage's file without its ending.
    pub name: &'static str,
    /// Entry point.
    pub entry: &'static str,
    pub(super) parts: &'static [&'static str],
    /// Every set of override constants that the engine uses.
    pub overrides: &'static [&'static [(&'static str, f64)]],
    /// The type of its numbers.
    pub precision: Precision,
}

/// A stage in f32.
const fn stage(
    name: &'static str,
    entry: &'static str,
    parts: &'static [&'static str],
    overrides: &'static [&'static [(&'static str, f64)]],
) -> Shader {
    Shader { name, entry, parts, overrides, precision: Precision::Single }
}

/// A stage of the same text in either precision.
pub(super) const fn in_both(shader: Shader) -> [Shader; 2] {
    [Shader { precision: Precision::Single, ..shader }, Shader { precision: Precision::Double, ..shader }]
}

const DISPATCH: &str = include_str!("../../shaders/dispatch.wgsl");
pub(super) const TYPES: &str = include_str!("../../shaders/types.wgsl");
pub(super) const CLOSEST_POINT: &str = include_str!("../../shaders/closest_point.wgsl");
pub(super) const MESH: &str = include_str!("../../shaders/mesh.wgsl");
pub(super) const FACET: &str = include_str!("../../shaders/facet.wgsl");
const LEAST_OF: &str = include_str!("../../shaders/least_of.wgsl");
const ROTATION: &str = include_str!("../../shaders/rotation.wgsl");
const BOUNDING_SPHERES: &str = include_str!("../../shaders/bounding_spheres.wgsl");
const CLOSEST_FACET: &str = include_str!("../../shaders/closest_facet.wgsl");
const SHARED_SEARCH: &str = include_str!("../../shaders/shared_search.wgsl");
pub(super) const DEPTH_ROWS: &str = include_str!("../../shaders/depth_rows.wgsl");
pub(super) const DEFORMED_FACET: &str = include_str!("../../shaders/deformed_facet.wgsl");
pub(super) const SEARCH_TYPES: &str = include_str!("../../shaders/search_types.wgsl");
pub(super) const SEARCH_STATE: &str = include_str!("../../shaders/search_state.wgsl");
pub(super) const SEARCH_SUPPORT: &str = include_str!("../../shaders/search_support.wgsl");
const SEARCH_RESULTS: &str = include_str!("../../shaders/search_results.wgsl");
pub(super) const WORKSPACE: &str = include_str!("../../shaders/workspace.wgsl");
pub(super) const LISTING: &str = include_str!("../../shaders/listing.wgsl");
const PREFIX_SUM: &str = include_str!("../../shaders/prefix_sum.wgsl");
const FRAME_COMMON: &str = include_str!("../../shaders/frame_common.wgsl");
const FRAME: &str = include_str!("../../shaders/frame.wgsl");
const FRAME_ITERATIVE: &str = include_str!("../../shaders/frame_iterative.wgsl");

/// Node positions for a batch of configurations.
pub static KINEMATICS: [Shader; 2] =
    in_both(stage("kinematics", "main", &[TYPES, ROTATION, include_str!("../../shaders/kinematics.wgsl")], &[&[]]));

/// Gap of every proxy node to the flat triangles at rest.
pub static DETECTION: Shader = stage(
    "detection",
    "main",
    &[
        TYPES,
        CLOSEST_POINT,
        MESH,
        FACET,
        BOUNDING_SPHERES,
        CLOSEST_FACET,
        LEAST_OF,
        include_str!("../../shaders/detection.wgsl"),
    ],
    &[&[]],
);

/// Smallest gap of every configuration.
pub static GAP: [Shader; 2] = in_both(stage(
    "gap",
    "main",
    &[
        TYPES,
        CLOSEST_POINT,
        MESH,
        FACET,
        CLOSEST_FACET,
        SHARED_SEARCH,
        LEAST_OF,
        include_str!("../../shaders/gap.wgsl"),
    ],
    &[&[], SMOOTH],
));

/// Facets are of degree four.
const SMOOTH: &[(&str, f64)] = &[("SMOOTH", 1.0)];

/// The compliance has one number for a pair of nodes.
const ISOTROPIC: &[(&str, f64)] = &[("ISOTROPIC", 1.0)];

/// Search: workspaces and joint axes.
pub static SEARCH_ARM: [Shader; 2] = in_both(stage(
    "search_arm",
    "main",
    &[SEARCH_TYPES, WORKSPACE, ROTATION, include_str!("../../shaders/search_arm.wgsl")],
    &[&[]],
));

/// Search: the trial's displacement, and its contacts and near misses.
pub static SEARCH_DETECT: [Shader; 2] = in_both(stage(
    "search_detect",
    "main",
    &[
        SEARCH_TYPES,
        WORKSPACE,
        SEARCH_STATE,
        LISTING,
        CLOSEST_POINT,
        MESH,
        FACET,
        DEFORMED_FACET,
        CLOSEST_FACET,
        SHARED_SEARCH,
        DEPTH_ROWS,
        include_str!("../../shaders/search_detect.wgsl"),
    ],
    &[&[], SMOOTH, ISOTROPIC],
));

/// Search: the trial judged.
pub static SEARCH_JUDGE: [Shader; 2] = in_both(stage(
    "search_judge",
    "main",
    &[SEARCH_TYPES, WORKSPACE, SEARCH_STATE, LISTING, SEARCH_SUPPORT, include_str!("../../shaders/search_judge.wgsl")],
    &[&[], ISOTROPIC],
));

/// Search: from one trial to the next.
pub static SEARCH_STEP: [Shader; 2] = in_both(stage(
    "search_step",
    "main",
    &[
        SEARCH_TYPES,
        WORKSPACE,
        SEARCH_STATE,
        LISTING,
        BOUNDING_SPHERES,
        SEARCH_SUPPORT,
        include_str!("../../shaders/search_woodbury.wgsl"),
        include_str!("../../shaders/search_step.wgsl"),
    ],
    &[&[], ISOTROPIC],
));

/// Search: what is not done.
pub static SEARCH_UNFINISHED: [Shader; 2] = in_both(stage(
    "search_unfinished",
    "main",
    &[SEARCH_TYPES, PREFIX_SUM, include_str!("../../shaders/search_unfinished.wgsl")],
    &[&[]],
));

/// Search: where the touches of each configuration go.
pub static SEARCH_COUNT: [Shader; 2] =
    in_both(stage("search_results", "count", &[SEARCH_TYPES, PREFIX_SUM, WORKSPACE, SEARCH_RESULTS], &[&[]]));

/// Search: records, and touches without gaps.
pub static SEARCH_GATHER: [Shader; 2] =
    in_both(stage("search_results", "gather", &[SEARCH_TYPES, PREFIX_SUM, WORKSPACE, SEARCH_RESULTS], &[&[]]));

/// Graphics with dynamics, and without.
const MOTIONS: &[&[(&str, f64)]] = &[&[], &[("QUASI_STATIC", 1.0)]];

/// The same for the inverse, with nine numbers for a pair of nodes and with one.
const INVERSES: &[&[(&str, f64)]] =
    &[&[], &[("QUASI_STATIC", 1.0)], ISOTROPIC, &[("QUASI_STATIC", 1.0), ("ISOTROPIC", 1.0)]];

/// Frame update: what stiffening springs add to the loads.
pub static FRAME_STIFFENING: Shader = stage(
    "frame_stiffening",
    "relieve",
    &[FRAME_COMMON, include_str!("../../shaders/frame_stiffening.wgsl")],
    &[&[("FACTOR", 8.0), ("STRAIN", 0.1)]],
);

/// Frame update: nodes that follow those of K.
pub static FRAME_SURFACE: Shader =
    stage("frame_surface", "main", &[include_str!("../../shaders/frame_surface.wgsl")], &[&[]]);

/// Frame update by the inverse: right-hand side.
pub static FRAME_LOAD: Shader = stage("frame", "load", &[FRAME_COMMON, FRAME], INVERSES);

/// Frame update by the inverse: new state.
pub static FRAME_ADVANCE: Shader = stage("frame", "advance", &[FRAME_COMMON, FRAME], INVERSES);

/// Frame update by conjugate gradients: first residual and direction.
pub static FRAME_BEGIN: Shader = stage("frame_iterative", "begin", &[FRAME_COMMON, FRAME_ITERATIVE], MOTIONS);

/// Frame update by conjugate gradients: matrix times direction.
pub static FRAME_PRODUCT: Shader = stage("frame_iterative", "product", &[FRAME_COMMON, FRAME_ITERATIVE], MOTIONS);

/// Frame update by conjugate gradients: step along the direction.
pub static FRAME_CORRECT: Shader = stage("frame_iterative", "correct", &[FRAME_COMMON, FRAME_ITERATIVE], MOTIONS);

/// Frame update by conjugate gradients: next direction.
pub static FRAME_TURN: Shader = stage("frame_iterative", "turn", &[FRAME_COMMON, FRAME_ITERATIVE], MOTIONS);

/// Frame update by conjugate gradients: new state.
pub static FRAME_FINISH: Shader = stage("frame_iterative", "finish", &[FRAME_COMMON, FRAME_ITERATIVE], MOTIONS);

/// Every shader of the engine.
pub static ALL: &[&[Shader]] = &[
    &KINEMATICS,
    &GAP,
    &SEARCH_ARM,
    &SEARCH_DETECT,
    &SEARCH_JUDGE,
    &SEARCH_STEP,
    &SEARCH_UNFINISHED,
    &SEARCH_COUNT,
    &SEARCH_GATHER,
    std::slice::from_ref(&DETECTION),
    std::slice::from_ref(&FRAME_STIFFENING),
    std::slice::from_ref(&FRAME_SURFACE),
    std::slice::from_ref(&FRAME_LOAD),
    std::slice::from_ref(&FRAME_ADVANCE),
    std::slice::from_ref(&FRAME_BEGIN),
    std::slice::from_ref(&FRAME_PRODUCT),
    std::slice::from_ref(&FRAME_CORRECT),
    std::slice::from_ref(&FRAME_TURN),
    std::slice::from_ref(&FRAME_FINISH),
];

/// Constants that both sides use, as WGSL.
fn constants(precision: Precision) -> String {
    let mut text = String::new();
    for (name, status) in [
        ("FREE", Status::Free),
        ("CONTACT", Status::Contact),
        ("UNCONVERGED", Status::Unconverged),
        ("OVERFLOW", Status::Overflow),
    ] {
        text.push_str(&format!("const STATUS_{name}: u32 = {}u;\n", status as u8));
    }
    for (name, count) in [
        ("INNER_ITERATIONS_PER_UNKNOWN", newton::INNER_ITERATIONS_PER_UNKNOWN),
        ("MODEL_PASSES", newton::MODEL_PASSES),
        ("FACET_ITERATIONS", facet::FACET_ITERATIONS),
        ("DAMPING_ATTEMPTS", newton::DAMPING_ATTEMPTS as usize),
        ("NUDGE_HALVINGS", energy::NUDGE_HALVINGS as usize),
    ] {
        text.push_str(&format!("const {name}: u32 = {count}u;\n"));
    }
    let (real, suffix) = match precision {
        Precision::Single => ("f32", "f"),
        Precision::Double => ("f64", "lf"),
    };
    text.push_str(&format!("// Numbers of this stage.\nalias real = {real};\n"));
    for (name, value) in NUMBERS {
        text.push_str(&format!("const {name}: real = {value:e}{suffix};\n"));
    }
    for (name, single, double) in ROUNDED {
        let value = if precision == Precision::Double { double } else { single };
        text.push_str(&format!("const {name}: real = {value:e}{suffix};\n"));
    }
    text
}

/// Numbers that rounding has nothing to do with.
const NUMBERS: [(&str, f64); 17] = [
    ("FAR_AWAY", GPU_FAR_AWAY as f64),
    ("LEAST_CONVEXITY", depth::LEAST_CONVEXITY),
    ("RESIDUAL_FLOOR", energy::RESIDUAL_FLOOR),
    ("ACCEPTED_SHARE", energy::ACCEPTED_SHARE),
    ("POOR_SHARE", energy::POOR_SHARE),
    ("GOOD_SHARE", energy::GOOD_SHARE),
    ("INNER_TOLERANCE", energy::INNER_TOLERANCE),
    ("PROBE_TOLERANCE", energy::PROBE_TOLERANCE),
    ("RESPONSE_TOLERANCE", tangent::RESPONSE_TOLERANCE),
    ("CONTINUATION_FACTOR", energy::CONTINUATION_FACTOR),
    ("STAGE_TOLERANCE", energy::STAGE_TOLERANCE),
    ("STALLED_LENGTH", energy::STALLED_LENGTH),
    ("NUDGE_LENGTH", energy::NUDGE_LENGTH),
    ("LEAST_DAMPING", newton::LEAST_DAMPING),
    ("DAMPING_GROWTH", newton::DAMPING_GROWTH),
    ("DAMPING_DECAY", newton::DAMPING_DECAY),
    ("CURVATURE_MARGIN", newton::CURVATURE_MARGIN),
];

/// Numbers that follow from rounding: in f32, and in f64.
const ROUNDED: [(&str, f64, f64); 7] = [
    ("LEAST_DIVISOR", GPU_LEAST_DIVISOR as f64, MINIMUM_SQUARE),
    ("FACET_STEP", GPU_FACET_STEP, facet::FACET_STEP),
    ("LENGTH_ROUNDING", GPU_SEARCH_SLACK, LENGTH_ROUNDING),
    ("ENERGY_ROUNDING", GPU_ENERGY_ROUNDING, energy::ENERGY_ROUNDING),
    ("PIVOT_ROUNDING", f32::EPSILON as f64, f64::EPSILON),
    ("INNER_TOLERANCE_FLOOR", GPU_INNER_TOLERANCE_FLOOR, energy::INNER_TOLERANCE_FLOOR),
    ("GIVE_UP_LENGTH", GPU_GIVE_UP_LENGTH, energy::GIVE_UP_LENGTH),
];

impl Shader {
    /// The whole text, as the device compiles it.
    #[must_use]
    pub fn source(&self) -> String {
        let mut text = constants(self.precision);
        for part in [DISPATCH].iter().chain(self.parts) {
            text.push('\n');
            text.push_str(part);
        }
        text
    }
}

/// Parses a shader without a device.
///
/// # Errors
/// naga's message with the offending line.
pub fn parse(shader: &Shader) -> Result<naga::Module, String> {
    let source = shader.source();
    naga::front::wgsl::parse_str(&source).map_err(|error| error.emit_to_string_with_path(&source, shader.name))
}

/// Validates a shader that was parsed.
///
/// # Errors
/// naga's message with the offending line.
pub(super) fn validate(shader: &Shader, module: &naga::Module) -> Result<ModuleInfo, String> {
    let capabilities =
        if shader.precision == Precision::Double { Capabilities::FLOAT64 } else { Capabilities::empty() };
    let validated = Validator::new(ValidationFlags::all(), capabilities).validate(module);
    validated.map_err(|error| format!("{}: {}", shader.name, error.emit_to_string(&shader.source())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shader_is_valid_with_every_override_set_in_use() {
        let mut checked = 0;
        for shader in ALL.iter().copied().flatten() {
            let module = parse(shader).unwrap_or_else(|message| panic!("{message}"));
            assert!(
                module.entry_points.iter().any(|point| point.name == shader.entry),
                "{} has no entry point {}",
                shader.name,
                shader.entry
            );
            let info = validate(shader, &module).unwrap_or_else(|message| panic!("{message}"));
            assert!(!shader.overrides.is_empty(), "{}: at least the empty set", shader.name);
            for set in shader.overrides {
                let constants = set.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
                let entry = Some((naga::ShaderStage::Compute, shader.entry));
                let (specialised, _) =
                    naga::back::pipeline_constants::process_overrides(&module, &info, entry, &constants)
                        .unwrap_or_else(|error| panic!("{} {set:?}: {error}", shader.name));
                assert!(specialised.overrides.iter().all(|(_, o)| o.init.is_some()), "{} {set:?}", shader.name);
                for (name, _) in *set {
                    assert!(
                        module.overrides.iter().any(|(_, o)| o.name.as_deref() == Some(*name)),
                        "{} has no override {name}",
                        shader.name
                    );
                }
                checked += 1;
            }
        }
        assert!(checked >= ALL.len() && checked >= 6, "only {checked} shaders found");
    }

    #[test]
    fn a_broken_shader_is_refused_with_its_line() {
        let broken = Shader { name: "broken", entry: "main", parts: &[TYPES, "fn main( {"], ..DETECTION };
        let message = parse(&broken).expect_err("not WGSL");
        assert!(message.contains("fn main( {"), "{message}");
    }

    #[test]
    fn no_shader_calls_functions_of_unbounded_error() {
        for shader in ALL.iter().copied().flatten() {
            for function in ["sin(", "cos(", "tan(", "determinant("] {
                assert!(!shader.source().contains(function), "{} calls {function}", shader.name);
            }
        }
    }
}
