//! The shaders of `shaders/`, embedded, and how a stage is put together from parts.
//!
//! WGSL has no include: a stage is the generated constants, then `types.wgsl`, then shared functions, then the stage's
//! own file. Constants that both sides need have one source, here in Rust; sizes and switches are override constants.

use crate::{
    contact::{
        Status,
        equilibrium::{energy, newton, tangent},
        geometry::facet,
        law::depth,
    },
    tolerances,
};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

/// One entry point with everything it needs.
#[derive(Debug)]
pub struct Shader {
    /// The stage's file without its ending.
    pub name: &'static str,
    /// Entry point.
    pub entry: &'static str,
    pub(super) parts: &'static [&'static str],
    /// Every set of override constants that the engine uses.
    pub overrides: &'static [&'static [(&'static str, f64)]],
}

pub(super) const TYPES: &str = include_str!("../../shaders/types.wgsl");
pub(super) const CLOSEST_POINT: &str = include_str!("../../shaders/closest_point.wgsl");
pub(super) const MESH: &str = include_str!("../../shaders/mesh.wgsl");
pub(super) const SURFACE: &str = include_str!("../../shaders/surface.wgsl");
pub(super) const DEPTH: &str = include_str!("../../shaders/depth.wgsl");
pub(super) const DOUBLE_TYPES: &str = include_str!("../../shaders/double_types.wgsl");
pub(super) const FACET: &str = include_str!("../../shaders/facet.wgsl");
const ROTATION: &str = include_str!("../../shaders/rotation.wgsl");
const BOUNDING_SPHERES: &str = include_str!("../../shaders/bounding_spheres.wgsl");
const CLOSEST_FACET: &str = include_str!("../../shaders/closest_facet.wgsl");
const DEFORMED_FACET: &str = include_str!("../../shaders/deformed_facet.wgsl");
const SEARCH_TYPES: &str = include_str!("../../shaders/search_types.wgsl");
const SEARCH_STATE: &str = include_str!("../../shaders/search_state.wgsl");
const SEARCH_SUPPORT: &str = include_str!("../../shaders/search_support.wgsl");
const SEARCH_RESULTS: &str = include_str!("../../shaders/search_results.wgsl");
const WORKSPACE: &str = include_str!("../../shaders/workspace.wgsl");
const LISTING: &str = include_str!("../../shaders/listing.wgsl");
const PREFIX_SUM: &str = include_str!("../../shaders/prefix_sum.wgsl");
const COMPACT: &str = include_str!("../../shaders/compaction.wgsl");
const RESULTS: &str = include_str!("../../shaders/results.wgsl");
const SUPPORT: &str = include_str!("../../shaders/support.wgsl");
const DEFORMED: &str = include_str!("../../shaders/deformed.wgsl");
const SPRINGS: &str = include_str!("../../shaders/springs.wgsl");
const TRUST_REGION: &str = include_str!("../../shaders/trust_region.wgsl");
const ENERGY_SEARCH: &str = include_str!("../../shaders/energy.wgsl");
const FRAME_COMMON: &str = include_str!("../../shaders/frame_common.wgsl");
const FRAME: &str = include_str!("../../shaders/frame.wgsl");
const FRAME_ITERATIVE: &str = include_str!("../../shaders/frame_iterative.wgsl");

/// Node positions for a batch of configurations.
pub static KINEMATICS: Shader = Shader {
    name: "kinematics",
    entry: "main",
    parts: &[TYPES, include_str!("../../shaders/kinematics.wgsl")],
    overrides: &[&[]],
};

/// Gap of every proxy node at rest.
pub static DETECTION: Shader = Shader {
    name: "detection",
    entry: "main",
    parts: &[TYPES, CLOSEST_POINT, MESH, SURFACE, include_str!("../../shaders/detection.wgsl")],
    overrides: &[&[]],
};

/// Smallest gap of every configuration.
pub static CLASSIFICATION: Shader = Shader {
    name: "classification",
    entry: "main",
    parts: &[TYPES, include_str!("../../shaders/classification.wgsl")],
    overrides: &[&[]],
};

/// List of the configurations in contact.
pub static COMPACTION: Shader =
    Shader { name: "compaction", entry: "main", parts: &[TYPES, PREFIX_SUM, COMPACT], overrides: &[&[]] };

/// Node positions in f64.
pub static DOUBLE_KINEMATICS: Shader = Shader {
    name: "double_kinematics",
    entry: "main",
    parts: &[DOUBLE_TYPES, ROTATION, include_str!("../../shaders/double_kinematics.wgsl")],
    overrides: &[&[]],
};

/// Smallest gap of every configuration in f64.
pub static DOUBLE_GAP: Shader = Shader {
    name: "double_gap",
    entry: "main",
    parts: &[
        DOUBLE_TYPES,
        CLOSEST_POINT,
        MESH,
        FACET,
        BOUNDING_SPHERES,
        CLOSEST_FACET,
        include_str!("../../shaders/double_gap.wgsl"),
    ],
    overrides: &[&[], SMOOTH],
};

/// List of the configurations in contact, by gaps in f64.
pub static DOUBLE_COMPACTION: Shader =
    Shader { name: "double_compaction", entry: "main", parts: &[DOUBLE_TYPES, PREFIX_SUM, COMPACT], overrides: &[&[]] };

/// Triangles that share a bounding sphere in searches for the closest one.
pub(super) const CLUSTER: usize = 8;

/// Clusters in a group of them, for searches in f64.
pub(super) const GROUP: usize = 8;

/// Object nodes that the search displaces together.
pub(super) const NODES_TOGETHER: usize = 64;

/// Facets are of degree four.
const SMOOTH: &[(&str, f64)] = &[("SMOOTH", 1.0)];

/// The compliance covers a part of a large object.
const PARTIAL: &[(&str, f64)] = &[("PARTIAL", 1.0)];

/// The compliance has one number for a pair of nodes.
const ISOTROPIC: &[(&str, f64)] = &[("ISOTROPIC", 1.0)];

/// Least room for contacts and support that the engine uses: tests of the overflow path.
const CRAMPED: &[(&str, f64)] = &[("CONTACTS", 2.0)];

/// Equilibrium by the energy form.
pub static ENERGY: Shader = Shader {
    name: "energy",
    entry: "main",
    parts: &[TYPES, CLOSEST_POINT, MESH, SURFACE, DEPTH, SUPPORT, DEFORMED, SPRINGS, TRUST_REGION, ENERGY_SEARCH],
    overrides: &[&[], &[("FROZEN", 1.0)], PARTIAL, ISOTROPIC, CRAMPED],
};

/// Equilibrium by the paper's iteration.
pub static PAPER: Shader = Shader {
    name: "paper",
    entry: "main",
    parts: &[
        TYPES,
        CLOSEST_POINT,
        MESH,
        SURFACE,
        DEPTH,
        SUPPORT,
        DEFORMED,
        SPRINGS,
        include_str!("../../shaders/paper.wgsl"),
    ],
    overrides: &[&[], ISOTROPIC, CRAMPED],
};

/// Search in f64: workspaces and joint axes.
pub static SEARCH_ARM: Shader = Shader {
    name: "search_arm",
    entry: "main",
    parts: &[SEARCH_TYPES, ROTATION, include_str!("../../shaders/search_arm.wgsl")],
    overrides: &[&[], ISOTROPIC],
};

/// Search in f64: the trial's displacement, and its contacts and near misses.
pub static SEARCH_DETECT: Shader = Shader {
    name: "search_detect",
    entry: "main",
    parts: &[
        SEARCH_TYPES,
        WORKSPACE,
        SEARCH_STATE,
        LISTING,
        CLOSEST_POINT,
        MESH,
        FACET,
        BOUNDING_SPHERES,
        DEFORMED_FACET,
        CLOSEST_FACET,
        include_str!("../../shaders/depth_rows.wgsl"),
        include_str!("../../shaders/search_detect.wgsl"),
    ],
    overrides: &[&[], SMOOTH, ISOTROPIC],
};

/// Search in f64: the trial judged.
pub static SEARCH_JUDGE: Shader = Shader {
    name: "search_judge",
    entry: "main",
    parts: &[
        SEARCH_TYPES,
        WORKSPACE,
        SEARCH_STATE,
        LISTING,
        SEARCH_SUPPORT,
        include_str!("../../shaders/search_judge.wgsl"),
    ],
    overrides: &[&[], ISOTROPIC],
};

/// Search in f64: from one trial to the next.
pub static SEARCH_STEP: Shader = Shader {
    name: "search_step",
    entry: "main",
    parts: &[
        SEARCH_TYPES,
        WORKSPACE,
        SEARCH_STATE,
        LISTING,
        BOUNDING_SPHERES,
        SEARCH_SUPPORT,
        include_str!("../../shaders/search_step.wgsl"),
    ],
    overrides: &[&[], ISOTROPIC],
};

/// Search in f64: what is not done.
pub static SEARCH_UNFINISHED: Shader = Shader {
    name: "search_unfinished",
    entry: "main",
    parts: &[SEARCH_TYPES, PREFIX_SUM, include_str!("../../shaders/search_unfinished.wgsl")],
    overrides: &[&[], ISOTROPIC],
};

/// Search in f64: where the touches of each configuration go.
pub static SEARCH_COUNT: Shader = Shader {
    name: "search_results",
    entry: "count",
    parts: &[SEARCH_TYPES, PREFIX_SUM, WORKSPACE, SEARCH_RESULTS],
    overrides: &[&[], ISOTROPIC],
};

/// Search in f64: records, and touches without gaps.
pub static SEARCH_GATHER: Shader = Shader {
    name: "search_results",
    entry: "gather",
    parts: &[SEARCH_TYPES, PREFIX_SUM, WORKSPACE, SEARCH_RESULTS],
    overrides: &[&[], ISOTROPIC],
};

/// Where the touches of each configuration go.
pub static RESULTS_COUNT: Shader =
    Shader { name: "results", entry: "count", parts: &[TYPES, PREFIX_SUM, RESULTS], overrides: &[&[], CRAMPED] };

/// Touches without gaps.
pub static RESULTS_GATHER: Shader =
    Shader { name: "results", entry: "gather", parts: &[TYPES, PREFIX_SUM, RESULTS], overrides: &[&[], CRAMPED] };

/// Graphics with dynamics, and without.
const MOTIONS: &[&[(&str, f64)]] = &[&[], &[("QUASI_STATIC", 1.0)]];

/// The same for the inverse, with nine numbers for a pair of nodes and with one.
const INVERSES: &[&[(&str, f64)]] =
    &[&[], &[("QUASI_STATIC", 1.0)], ISOTROPIC, &[("QUASI_STATIC", 1.0), ("ISOTROPIC", 1.0)]];

/// Frame update: what stiffening springs add to the loads.
pub static FRAME_STIFFENING: Shader = Shader {
    name: "frame_stiffening",
    entry: "relieve",
    parts: &[TYPES, FRAME_COMMON, include_str!("../../shaders/frame_stiffening.wgsl")],
    overrides: &[&[("FACTOR", 8.0), ("STRAIN", 0.1)]],
};

/// Frame update by the inverse: right-hand side.
pub static FRAME_LOAD: Shader =
    Shader { name: "frame", entry: "load", parts: &[TYPES, FRAME_COMMON, FRAME], overrides: INVERSES };

/// Frame update by the inverse: new state.
pub static FRAME_ADVANCE: Shader =
    Shader { name: "frame", entry: "advance", parts: &[TYPES, FRAME_COMMON, FRAME], overrides: INVERSES };

/// Frame update by conjugate gradients: first residual and direction.
pub static FRAME_BEGIN: Shader = Shader {
    name: "frame_iterative",
    entry: "begin",
    parts: &[TYPES, FRAME_COMMON, FRAME_ITERATIVE],
    overrides: MOTIONS,
};

/// Frame update by conjugate gradients: matrix times direction.
pub static FRAME_PRODUCT: Shader = Shader {
    name: "frame_iterative",
    entry: "product",
    parts: &[TYPES, FRAME_COMMON, FRAME_ITERATIVE],
    overrides: MOTIONS,
};

/// Frame update by conjugate gradients: step along the direction.
pub static FRAME_CORRECT: Shader = Shader {
    name: "frame_iterative",
    entry: "correct",
    parts: &[TYPES, FRAME_COMMON, FRAME_ITERATIVE],
    overrides: MOTIONS,
};

/// Frame update by conjugate gradients: next direction.
pub static FRAME_TURN: Shader = Shader {
    name: "frame_iterative",
    entry: "turn",
    parts: &[TYPES, FRAME_COMMON, FRAME_ITERATIVE],
    overrides: MOTIONS,
};

/// Frame update by conjugate gradients: new state.
pub static FRAME_FINISH: Shader = Shader {
    name: "frame_iterative",
    entry: "finish",
    parts: &[TYPES, FRAME_COMMON, FRAME_ITERATIVE],
    overrides: MOTIONS,
};

/// Every shader of the engine.
pub static ALL: &[&Shader] = &[
    &KINEMATICS,
    &DETECTION,
    &CLASSIFICATION,
    &COMPACTION,
    &DOUBLE_KINEMATICS,
    &DOUBLE_GAP,
    &DOUBLE_COMPACTION,
    &SEARCH_ARM,
    &SEARCH_DETECT,
    &SEARCH_JUDGE,
    &SEARCH_STEP,
    &SEARCH_UNFINISHED,
    &SEARCH_COUNT,
    &SEARCH_GATHER,
    &ENERGY,
    &PAPER,
    &RESULTS_COUNT,
    &RESULTS_GATHER,
    &FRAME_STIFFENING,
    &FRAME_LOAD,
    &FRAME_ADVANCE,
    &FRAME_BEGIN,
    &FRAME_PRODUCT,
    &FRAME_CORRECT,
    &FRAME_TURN,
    &FRAME_FINISH,
];

/// Constants that both sides use, as WGSL.
fn constants(double: bool) -> String {
    let mut text = String::new();
    for (name, status) in [
        ("FREE", Status::Free),
        ("CONTACT", Status::Contact),
        ("UNCONVERGED", Status::Unconverged),
        ("OVERFLOW", Status::Overflow),
    ] {
        text.push_str(&format!("const STATUS_{name}: u32 = {}u;\n", status as u8));
    }
    text.push_str(&if double { double_constants() } else { single_constants() });
    for (name, count) in [
        ("INNER_ITERATIONS_PER_UNKNOWN", tolerances::INNER_ITERATIONS_PER_UNKNOWN),
        ("MODEL_PASSES", tolerances::MODEL_PASSES),
        ("FACET_ITERATIONS", facet::FACET_ITERATIONS),
        ("DAMPING_ATTEMPTS", newton::DAMPING_ATTEMPTS as usize),
        ("NUDGE_HALVINGS", energy::NUDGE_HALVINGS as usize),
        ("CLUSTER", CLUSTER),
        ("GROUP", GROUP),
        ("NODES_TOGETHER", NODES_TOGETHER),
    ] {
        text.push_str(&format!("const {name}: u32 = {count}u;\n"));
    }
    text
}

fn single_constants() -> String {
    let mut text = String::new();
    for (name, value) in [
        ("FAR_AWAY", tolerances::GPU_FAR_AWAY),
        ("LEAST_DIVISOR", tolerances::GPU_LEAST_DIVISOR),
        ("SEARCH_SLACK", tolerances::GPU_SEARCH_SLACK),
        ("RESIDUAL_FLOOR", tolerances::RESIDUAL_FLOOR as f32),
        ("ACCEPTED_SHARE", tolerances::ACCEPTED_SHARE as f32),
        ("POOR_SHARE", tolerances::POOR_SHARE as f32),
        ("GOOD_SHARE", tolerances::GOOD_SHARE as f32),
        ("SHRINK", tolerances::SHRINK as f32),
        ("WIDEN", tolerances::WIDEN as f32),
        ("INNER_TOLERANCE", tolerances::INNER_TOLERANCE as f32),
        ("INNER_TOLERANCE_FLOOR", tolerances::GPU_INNER_TOLERANCE_FLOOR),
        ("CONTINUATION_START", tolerances::CONTINUATION_START as f32),
        ("CONTINUATION_FACTOR", tolerances::CONTINUATION_FACTOR as f32),
        ("STAGE_TOLERANCE", tolerances::STAGE_TOLERANCE as f32),
        ("STALLED_RADIUS", tolerances::STALLED_LENGTH as f32),
        ("ENERGY_ROUNDING", tolerances::GPU_ENERGY_ROUNDING),
        ("GIVE_UP_RADIUS", tolerances::GPU_GIVE_UP_RADIUS),
        ("PAPER_INNER_TOLERANCE", tolerances::GPU_PAPER_INNER_TOLERANCE),
    ] {
        text.push_str(&format!("const {name}: f32 = {value:e}f;\n"));
    }
    text
}

fn double_constants() -> String {
    let constants = [
        ("FAR_AWAY", f64::from(tolerances::GPU_FAR_AWAY)),
        ("LEAST_DIVISOR", tolerances::MINIMUM_SQUARE),
        ("FACET_STEP", facet::FACET_STEP),
        ("LENGTH_ROUNDING", tolerances::LENGTH_ROUNDING),
        ("ENERGY_ROUNDING", tolerances::ENERGY_ROUNDING),
        ("PIVOT_ROUNDING", f64::EPSILON),
        ("MINIMUM_CURVATURE_RADIUS", depth::MINIMUM_CURVATURE_RADIUS),
        ("LEAST_CONVEXITY", depth::LEAST_CONVEXITY),
        ("RESIDUAL_FLOOR", tolerances::RESIDUAL_FLOOR),
        ("ACCEPTED_SHARE", tolerances::ACCEPTED_SHARE),
        ("POOR_SHARE", tolerances::POOR_SHARE),
        ("GOOD_SHARE", tolerances::GOOD_SHARE),
        ("INNER_TOLERANCE", tolerances::INNER_TOLERANCE),
        ("INNER_TOLERANCE_FLOOR", tolerances::INNER_TOLERANCE_FLOOR),
        ("PROBE_TOLERANCE", energy::PROBE_TOLERANCE),
        ("RESPONSE_TOLERANCE", tangent::RESPONSE_TOLERANCE),
        ("CONTINUATION_FACTOR", tolerances::CONTINUATION_FACTOR),
        ("STAGE_TOLERANCE", tolerances::STAGE_TOLERANCE),
        ("STALLED_LENGTH", tolerances::STALLED_LENGTH),
        ("GIVE_UP_LENGTH", energy::GIVE_UP_LENGTH),
        ("NUDGE_LENGTH", energy::NUDGE_LENGTH),
        ("LEAST_DAMPING", newton::LEAST_DAMPING),
        ("DAMPING_GROWTH", newton::DAMPING_GROWTH),
        ("DAMPING_DECAY", newton::DAMPING_DECAY),
        ("CURVATURE_MARGIN", newton::CURVATURE_MARGIN),
    ];
    constants.map(|(name, value)| format!("const {name}: f64 = {value:e}lf;\n")).concat()
}

impl Shader {
    /// Whether it computes in f64.
    pub(super) fn is_double(&self) -> bool {
        self.parts.contains(&DOUBLE_TYPES) || self.parts.contains(&SEARCH_TYPES)
    }

    /// The whole text, as the device compiles it.
    #[must_use]
    pub fn source(&self) -> String {
        let mut text = constants(self.is_double());
        for part in self.parts {
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
    let capabilities = if shader.is_double() { Capabilities::FLOAT64 } else { Capabilities::empty() };
    let validated = Validator::new(ValidationFlags::all(), capabilities).validate(module);
    validated.map_err(|error| format!("{}: {}", shader.name, error.emit_to_string(&shader.source())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shader_is_valid_with_every_override_set_in_use() {
        let mut checked = 0;
        for shader in ALL {
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
        let broken = Shader { name: "broken", entry: "main", parts: &[TYPES, "fn main( {"], overrides: &[&[]] };
        let message = parse(&broken).expect_err("not WGSL");
        assert!(message.contains("fn main( {"), "{message}");
    }

    #[test]
    fn no_shader_calls_functions_of_unbounded_error() {
        for shader in ALL {
            for function in ["sin(", "cos(", "tan(", "determinant("] {
                assert!(!shader.source().contains(function), "{} calls {function}", shader.name);
            }
        }
    }
}
