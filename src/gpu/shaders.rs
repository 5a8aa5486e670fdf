//! The shaders of `shaders/`, embedded, and how a stage is put together from parts.
//!
//! WGSL has no include: a stage is the generated constants, then shared structs and functions, then the stage's own
//! file. Constants that both sides need have one source, here in Rust; sizes and switches are override constants.

use crate::{
    MAX_AXES,
    contact::{
        Status,
        geometry::{facet, smooth::CARRIERS},
        law::depth,
    },
};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

/// Stands for "no distance yet" in kernels (m): above any distance in a scene, and its square is still finite.
pub(super) const GPU_FAR_AWAY: f32 = 1e18;

/// Least divisor in kernels: a hundred times the least normal number (1.2e-38), below which a device may flush to
/// zero. Squared edge lengths stay above it down to 1e-18 m.
pub const GPU_LEAST_DIVISOR: f32 = 1e-36;

/// The least step of the search for the closest point of a bent facet (1): some roundings of a weight.
const GPU_FACET_STEP: f32 = 4.0 * f32::EPSILON;

/// Step of the closest point, over the mean edge, in the differences of the depth's gradient on both sides of a proxy
/// node (1). The gradient is rounded by about 1e-7 of itself, which leaves 1e-5 of its change over an edge; what the
/// differences leave out falls with the square of the step. Greatest error of the tangent, over the greatest tangent, on
/// the sphere of 102 nodes, where the closest point is about to leap: 0.11 at 0.05, 0.016 at 0.02, 0.001 at 0.005.
pub(super) const DIFFERENCE_STEP: f32 = 0.005;

/// The same of a proxy node next to an edge or vertex, over the distance from that (1): the direction is rounded by
/// 1e-9 m over the distance.
const TURNING_STEP: f32 = 0.02;

/// Nodes of a facet at most, in whole fours.
pub(super) const MOST_CARRIERS: u32 = CARRIERS.next_multiple_of(4) as u32;

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
}

const fn stage(
    name: &'static str,
    entry: &'static str,
    parts: &'static [&'static str],
    overrides: &'static [&'static [(&'static str, f64)]],
) -> Shader {
    Shader { name, entry, parts, overrides }
}

const DISPATCH: &str = include_str!("../../shaders/dispatch.wgsl");
const FRAME: &str = include_str!("../../shaders/frame.wgsl");

/// The compliance or the inverse has one number for a pair of nodes.
const ISOTROPIC: &[(&str, f64)] = &[("ISOTROPIC", 1.0)];

/// Contact with the surface at rest, from joints to torque.
pub static REST: Shader = stage(
    "rest",
    "main",
    &[
        include_str!("../../shaders/rest_types.wgsl"),
        include_str!("../../shaders/kinematics.wgsl"),
        include_str!("../../shaders/closest_point.wgsl"),
        include_str!("../../shaders/mesh.wgsl"),
        include_str!("../../shaders/facet.wgsl"),
        include_str!("../../shaders/closest_facet.wgsl"),
        include_str!("../../shaders/together.wgsl"),
        include_str!("../../shaders/depth_row.wgsl"),
        include_str!("../../shaders/nonnegative.wgsl"),
        include_str!("../../shaders/rest_tangent.wgsl"),
        include_str!("../../shaders/rest.wgsl"),
    ],
    &[&[], &[("SMOOTH", 1.0)], ISOTROPIC, &[("WITH_TANGENT", 1.0), ("DEEPENINGS", 96.0)], &[("WHOLE", 0.0)]],
);

/// The inverse has nine numbers for a pair of nodes, or one.
const INVERSES: &[&[(&str, f64)]] = &[&[], ISOTROPIC];

/// Frame update: right-hand side.
pub static FRAME_LOAD: Shader = stage("frame", "load", &[FRAME], INVERSES);

/// Frame update: new state.
pub static FRAME_ADVANCE: Shader = stage("frame", "advance", &[FRAME], INVERSES);

/// Every shader of the engine.
pub static ALL: &[Shader] = &[REST, FRAME_LOAD, FRAME_ADVANCE];

/// Constants that both sides use, as WGSL.
fn constants() -> String {
    let mut text = String::new();
    for (name, count) in [
        ("STATUS_FREE", Status::Free as u32),
        ("STATUS_CONTACT", Status::Contact as u32),
        ("STATUS_UNCONVERGED", Status::Unconverged as u32),
        ("STATUS_OVERFLOW", Status::Overflow as u32),
        ("FACET_ITERATIONS", facet::FACET_ITERATIONS as u32),
        ("JOINTS", MAX_AXES as u32),
        ("CARRIERS", MOST_CARRIERS / 4),
    ] {
        text.push_str(&format!("const {name}: u32 = {count}u;\n"));
    }
    for (name, value) in [
        ("FAR_AWAY", GPU_FAR_AWAY),
        ("LEAST_DIVISOR", GPU_LEAST_DIVISOR),
        ("LEAST_CONVEXITY", depth::LEAST_CONVEXITY as f32),
        ("FACET_STEP", GPU_FACET_STEP),
        ("PIVOT_ROUNDING", f32::EPSILON),
        ("TURNING_STEP", TURNING_STEP),
    ] {
        text.push_str(&format!("const {name}: f32 = {value:e}f;\n"));
    }
    text
}

impl Shader {
    /// The whole text, as the device compiles it.
    #[must_use]
    pub fn source(&self) -> String {
        let mut text = constants();
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
    let validated = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(module);
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
        let broken = Shader { name: "broken", entry: "main", parts: &["fn main( {"], ..REST };
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
