//! The end of the scene file: what is drawn of the links.

use crate::scene::{LinkForm, LinkShape, ProxySpec};
use crate::toml_text::{entry, heading, number, vector};
use glam::{DQuat, DVec3, EulerRot};
use std::fmt::Write;

/// Writes `shapes`, which joints of `proxy` move.
pub(super) fn write(text: &mut String, proxy: &ProxySpec, shapes: &[LinkShape]) -> std::fmt::Result {
    if shapes.is_empty() {
        return Ok(());
    }
    heading(text, "The links' shapes: drawn, not felt")?;
    writeln!(text, "# Without a joint: what stands still. Leave out what you do not want to see.")?;
    let links = proxy.links();
    for LinkShape { joint, place, form } in shapes {
        writeln!(text, "\n[[proxy.shape]]")?;
        if let Some((_, joint)) = joint.and_then(|joint| links.get(joint)) {
            entry(text, "joint", &format!("{:?}", joint.name), "")?;
        }
        match form {
            LinkForm::Box(size) => entry(text, "box", &vector(*size, 6), "m, edges")?,
            LinkForm::Cylinder { radius, length } => {
                let size = format!("{{ radius = {}, length = {} }}", number(*radius, 6), number(*length, 6));
                entry(text, "cylinder", &size, "m, along its z")?;
            }
            LinkForm::Sphere(radius) => entry(text, "sphere", &number(*radius, 6), "m, radius")?,
            LinkForm::Surface(surface) => {
                let [least, greatest] = surface.bounds();
                writeln!(
                    text,
                    "# {} triangles of meshes, in the joint's frame within these bounds [m]\n\
                     surface = {{ from = {}, to = {}, data = \"{}\" }}",
                    surface.triangles.len(),
                    vector(least, 6),
                    vector(greatest, 6),
                    surface.encode()
                )?;
                continue;
            }
        }
        let (yaw, pitch, roll) = DQuat::from_mat3(&place.matrix3).to_euler(EulerRot::ZYX);
        if place.translation.length() > 0.0 {
            entry(text, "at", &vector(place.translation, 6), "m")?;
        }
        let turn = vector(DVec3::new(roll, pitch, yaw), 6);
        if turn != vector(DVec3::ZERO, 6) {
            entry(text, "turn", &turn, "rad, about x, then y, then z of the joint's frame")?;
        }
    }
    Ok(())
}
