//! The scene of a twin: that of the scan, with an elastic solid in the place of the real object.

use super::{Approaches, ScannedShape};
use crate::{
    Error,
    object::{Draft, LengthUnit},
    scene::{Scene, SceneText},
    toml_text::{entry, heading, number},
};
use glam::DVec3;
use std::{fmt::Write as _, path::Path};

/// Height up to which the ground holds the body, in spacings (1): its underside, and hardly its sides.
const LAYER: f64 = 0.1;

/// Points of the grid, about: solved in some seconds.
const GRID_POINTS: f64 = 4000.0;

/// Returns the scene at `path`, made of the `text` of a scan's scene: the solid in the surface `shape`, which the OBJ file
/// `mesh` holds and the scene calls `name`, of Young's modulus `young` (Pa) under a skin of `width` (m), lying on the
/// ground where that clamps it; rigid contact; and a grid over the rows of the scan.
///
/// # Errors
/// When the file cannot be read, or the scene of the scan is not valid.
pub fn twin_scene(
    (text, path): (&str, &Path),
    mesh: (&Path, &str),
    (shape, approaches): (&ScannedShape, &Approaches),
    young: f64,
    width: Option<f64>,
) -> Result<Scene, Error> {
    let low = shape.nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = shape.nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let held = LAYER * shape.spacing / (high.z - low.z);
    let draft = Draft::new(mesh, Some(LengthUnit::M), DVec3::ZERO, young, (width, held))?;
    let mut tables = draft.tables;
    // Writing to a string fails only where memory does.
    let _ = write_tables(&mut tables, approaches);
    let mut scene = SceneText::new(text, path)?;
    scene.remove("scan");
    scene.replace(&tables)?;
    // The draft lies in the middle of the world.
    scene.move_object(low.midpoint(high));
    Scene::parse(&scene.to_string(), path)
}

/// Contact, and a grid over the configurations of the scan.
fn write_tables(text: &mut String, approaches: &Approaches) -> std::fmt::Result {
    heading(text, "Contact, equation (2)")?;
    writeln!(text, "[contact]")?;
    entry(text, "surface", "\"smooth\"", "")?;
    entry(text, "stiffness", "\"rigid\"", "a scan knows the object's stiffness alone")?;
    heading(text, "C-space, where it was scanned")?;
    writeln!(text, "[grid]\naxes = [")?;
    let rows = || approaches.free.iter().chain(approaches.contact.iter().map(|row| &row.q));
    let joints = rows().next().map_or(0, |q| q.len());
    let count = GRID_POINTS.powf(1.0 / joints.max(1) as f64).max(3.0) as usize;
    for joint in 0..joints {
        let low = rows().map(|q| q[joint]).fold(f64::INFINITY, f64::min);
        let high = rows().map(|q| q[joint]).fold(f64::NEG_INFINITY, f64::max);
        writeln!(text, "    {{ start = {}, stop = {}, count = {count} }},", number(low, 4), number(high, 4))?;
    }
    writeln!(text, "]")
}
