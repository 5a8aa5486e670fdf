//! `[[proxy.shape]]`: what is drawn of the links.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::ShapeTable;
use super::super::{JointSpec, LinkForm, LinkShape, LinkSurface, MAX_SHAPES};
use glam::{DAffine3, DQuat, DVec3, EulerRot};
use toml::Spanned;

pub(super) fn convert(
    checker: &Checker<'_>,
    tables: &[Spanned<ShapeTable>],
    joints: &[JointSpec],
) -> Result<Vec<LinkShape>, SceneError> {
    if let Some(table) = tables.get(MAX_SHAPES) {
        return Err(checker.error(table.span(), format!("the arm has more than {MAX_SHAPES} shapes: leave some out")));
    }
    tables.iter().map(|table| shape(checker, table, joints)).collect()
}

fn shape(checker: &Checker<'_>, table: &Spanned<ShapeTable>, joints: &[JointSpec]) -> Result<LinkShape, SceneError> {
    let (span, table) = (table.span(), table.get_ref());
    let joint = match &table.joint {
        None => None,
        Some(name) => Some(joints.iter().position(|joint| joint.name == *name.get_ref()).ok_or_else(|| {
            let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
            checker
                .error(name.span(), format!("there is no joint {:?}: name one of {}", name.get_ref(), names.join(", ")))
        })?),
    };
    let form = match (&table.block, &table.cylinder, &table.sphere, &table.surface) {
        (Some(size), None, None, None) => {
            let edges = checker.vector("box", Some(size))?;
            if edges.min_element() <= 0.0 {
                return Err(checker.error(size.span(), "the edges of a box must be positive"));
            }
            LinkForm::Box(edges)
        }
        (None, Some(cylinder), None, None) => LinkForm::Cylinder {
            radius: checker.positive("radius", &cylinder.radius)?,
            length: checker.positive("length", &cylinder.length)?,
        },
        (None, None, Some(radius), None) => LinkForm::Sphere(checker.positive("sphere", radius)?),
        (None, None, None, Some(surface)) => {
            let bounds = [checker.vector("from", Some(&surface.from))?, checker.vector("to", Some(&surface.to))?];
            let decoded = LinkSurface::decode(surface.data.get_ref(), bounds);
            LinkForm::Surface(decoded.map_err(|what| {
                checker
                    .error(surface.data.span(), format!("the surface cannot be read, {what}: import the robot again"))
            })?)
        }
        _ => return Err(checker.error(span, "a shape is one of box, cylinder, sphere and surface: give one of them")),
    };
    let turn: DVec3 = checker.vector("turn", table.turn.as_ref())?;
    let rotation = DQuat::from_euler(EulerRot::ZYX, turn.z, turn.y, turn.x);
    let place = DAffine3::from_rotation_translation(rotation, checker.vector("at", table.at.as_ref())?);
    Ok(LinkShape { joint, place, form })
}
