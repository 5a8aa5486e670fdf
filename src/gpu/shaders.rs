//! The shaders of `shaders/`, embedded, and how a stage is put together from parts.
//!
//! WGSL has no include: a stage is the generated constants, then `types.wgsl`, then shared functions, then the stage's
//! own file. Constants that both sides need have one source, here in Rust; sizes and switches are override constants.

use crate::{contact::Status, tolerances};

/// One entry point with everything it needs.
#[derive(Debug)]
pub struct Shader {
    /// The stage's file without its ending.
    pub name: &'static str,
    /// Entry point.
    pub entry: &'static str,
    parts: &'static [&'static str],
    /// Every set of override constants that the engine uses.
    pub overrides: &'static [&'static [(&'static str, f64)]],
}

const TYPES: &str = include_str!("../../shaders/types.wgsl");
const SURFACE: &str = include_str!("../../shaders/surface.wgsl");
const FRAME: &str = include_str!("../../shaders/frame.wgsl");

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
    parts: &[TYPES, SURFACE, include_str!("../../shaders/detection.wgsl")],
    overrides: &[&[]],
};

/// Free or in contact.
pub static CLASSIFICATION: Shader = Shader {
    name: "classification",
    entry: "main",
    parts: &[TYPES, include_str!("../../shaders/classification.wgsl")],
    overrides: &[&[]],
};

/// List of the configurations in contact.
pub static COMPACTION: Shader = Shader {
    name: "compaction",
    entry: "main",
    parts: &[TYPES, include_str!("../../shaders/compaction.wgsl")],
    overrides: &[&[]],
};

/// Right-hand side of the object's frame update.
pub static FRAME_LOAD: Shader = Shader { name: "frame", entry: "load", parts: &[TYPES, FRAME], overrides: &[&[]] };

/// New state of the object's nodes.
pub static FRAME_ADVANCE: Shader =
    Shader { name: "frame", entry: "advance", parts: &[TYPES, FRAME], overrides: &[&[]] };

/// Every shader of the engine.
pub static ALL: &[&Shader] = &[&KINEMATICS, &DETECTION, &CLASSIFICATION, &COMPACTION, &FRAME_LOAD, &FRAME_ADVANCE];

/// Constants that both sides use, as WGSL.
fn constants() -> String {
    let mut text = String::new();
    for (name, status) in [
        ("FREE", Status::Free),
        ("CONTACT", Status::Contact),
        ("UNCONVERGED", Status::Unconverged),
        ("OVERFLOW", Status::Overflow),
    ] {
        text.push_str(&format!("const STATUS_{name}: u32 = {}u;\n", status as u8));
    }
    for (name, value) in [("FAR_AWAY", tolerances::GPU_FAR_AWAY), ("LEAST_DIVISOR", tolerances::GPU_LEAST_DIVISOR)] {
        text.push_str(&format!("const {name}: f32 = {value:e}f;\n"));
    }
    text
}

impl Shader {
    /// The whole text, as the device compiles it.
    #[must_use]
    pub fn source(&self) -> String {
        self.with_parts(&[])
    }

    /// The same with `more` behind it: a test's kernel on the engine's own functions.
    #[must_use]
    pub fn with_parts(&self, more: &[&str]) -> String {
        let mut text = constants();
        for part in self.parts.iter().chain(more) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use naga::valid::{Capabilities, ValidationFlags, Validator};

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
            let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
                .validate(&module)
                .unwrap_or_else(|error| panic!("{}: {}", shader.name, error.emit_to_string(&shader.source())));
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
