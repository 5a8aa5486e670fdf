//! The scene of a twin: that of the scan, with an elastic solid in the place of the real object.

use super::{KnownRange, ScannedShape};
use crate::{
    Error,
    object::{Draft, LengthUnit},
    scene::{Scene, SceneText},
    toml_text::{entry, heading, number, significant},
};
use glam::DVec3;
use std::{fmt::Write as _, path::Path};

/// Height up to which the ground holds the body, in spacings (1): its underside, and hardly its sides.
const LAYER: f64 = 0.1;

/// What torques do not say of a twin, and a person may.
#[derive(Clone, Copy, Debug, Default)]
pub struct Given {
    /// Width over which the skin rounds a dent (m); by default three edges of the surface.
    pub width: Option<f64>,
    /// Edge of the cubes that fill the body (m); by default as its surface asks for.
    pub cell: Option<f64>,
}

/// Returns the scene at `path`, made of the `text` of a scan's scene: the solid in the surface `shape`, which the OBJ
/// file `mesh` holds and the scene calls `name`, of Young's modulus `young` (Pa), lying on the ground where that clamps
/// it; rigid contact; a damping of the proxy that is passive; and a grid over `range`.
///
/// # Errors
/// When the file cannot be read, or the scene of the scan is not valid.
pub fn twin_scene(
    (text, path): (&str, &Path),
    mesh: (&Path, &str),
    (shape, range): (&ScannedShape, &KnownRange),
    young: f64,
    Given { width, cell }: Given,
) -> Result<Scene, Error> {
    let low = shape.nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = shape.nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let held = LAYER * shape.spacing / (high.z - low.z);
    let draft = Draft::new(mesh, Some(LengthUnit::M), DVec3::ZERO, young, (width, held))?;
    let mut tables = draft.tables;
    if let Some(cell) = cell {
        let table = "[object.elasticity]\n";
        tables = tables.replace(table, &format!("{table}cell = {}\n", significant(cell)));
    }
    // Writing to a string fails only where memory does.
    let _ = write_tables(&mut tables, range);
    let mut scene = SceneText::new(text, path)?;
    scene.remove("scan");
    // Left out, it is as much as the torque needs to be passive: the scan's device knows nothing of the twin.
    scene.remove("haptics.proxy_damping");
    scene.replace(&tables)?;
    // The draft lies in the middle of the world.
    scene.move_object(low.midpoint(high));
    Scene::parse(&scene.to_string(), path)
}

/// Contact, and a grid over `range`.
fn write_tables(text: &mut String, range: &KnownRange) -> std::fmt::Result {
    heading(text, "Contact, equation (2)")?;
    writeln!(text, "[contact]")?;
    entry(text, "surface", "\"smooth\"", "")?;
    entry(text, "stiffness", "\"rigid\"", "a scan knows the object's stiffness alone")?;
    heading(text, "C-space, where the twin is known")?;
    writeln!(text, "[grid]\naxes = [")?;
    for [low, high] in &range.joints {
        let (low, high, count) = (number(*low, 4), number(*high, 4), range.lines());
        writeln!(text, "    {{ start = {low}, stop = {high}, count = {count} }},")?;
    }
    writeln!(text, "]")
}
