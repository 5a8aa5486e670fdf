//! `[object]`: shape, springs, ground.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::{GroundTable, MeshTable, ObjectTable, SphereTable};
use super::super::{GroundNodes, GroundSpec, ObjectSpec, Shape, SpringSpec};
use toml::Spanned;

/// Default mass of a node [kg].
const NODE_MASS: f64 = 0.005;
/// Default damping of a node against the ground [N s/m].
const NODE_DAMPING: f64 = 0.5;

/// Most rings, and most nodes of a ring: their product must fit the node numbers; what memory allows is far less, and
/// checked when the object is built.
const MAX_RINGS: usize = 1 << 15;

pub(super) fn convert(checker: &Checker<'_>, table: &Spanned<ObjectTable>) -> Result<ObjectSpec, SceneError> {
    let span = table.span();
    let table = table.get_ref();
    let shape = match (&table.sphere, &table.mesh) {
        (Some(sphere), None) => sphere_shape(checker, sphere)?,
        (None, Some(mesh)) => mesh_shape(checker, mesh)?,
        (None, None) => {
            return Err(checker.error(span, "the object has no shape: add [object.sphere] or [object.mesh]"));
        }
        (Some(_), Some(_)) => {
            let message = "the object has two shapes: keep either [object.sphere] or [object.mesh]";
            return Err(checker.error(span, message));
        }
    };
    let node_mass = table.node_mass.as_ref().map(|value| checker.positive("node_mass", value));
    let node_damping = table.node_damping.as_ref().map(|value| checker.not_negative("node_damping", value));
    Ok(ObjectSpec {
        shape,
        springs: SpringSpec {
            kind: table.springs.kind,
            stiffness: checker.positive("stiffness", &table.springs.stiffness)?,
        },
        ground: ground(checker, &table.ground)?,
        node_mass: node_mass.unwrap_or(Ok(NODE_MASS))?,
        node_damping: node_damping.unwrap_or(Ok(NODE_DAMPING))?,
    })
}

fn sphere_shape(checker: &Checker<'_>, table: &SphereTable) -> Result<Shape, SceneError> {
    Ok(Shape::Sphere {
        centre: checker.vector("centre", table.centre.as_ref())?,
        radius: checker.positive("radius", &table.radius)?,
        rings: checker.count("rings", &table.rings, 1, MAX_RINGS)?,
        segments: checker.count("segments", &table.segments, 3, MAX_RINGS)?,
    })
}

fn mesh_shape(checker: &Checker<'_>, table: &MeshTable) -> Result<Shape, SceneError> {
    if table.file.get_ref().is_empty() {
        return Err(checker.error(table.file.span(), "file is empty: name an OBJ, STL or PLY file"));
    }
    let scale = table.scale.as_ref().map(|value| checker.positive("scale", value));
    let folder = checker.path.parent().unwrap_or(checker.path);
    Ok(Shape::Mesh {
        file: folder.join(table.file.get_ref()),
        scale: scale.unwrap_or(Ok(1.0))?,
        centre: checker.vector("centre", table.centre.as_ref())?,
    })
}

fn ground(checker: &Checker<'_>, table: &GroundTable) -> Result<GroundSpec, SceneError> {
    let nodes = match (&table.nodes, &table.below) {
        (None, None) => GroundNodes::All,
        (Some(list), None) if list.get_ref().is_empty() => {
            return Err(checker.error(list.span(), "nodes is empty: list nodes, or leave the key out to ground all"));
        }
        (Some(list), None) => GroundNodes::Listed(list.get_ref().clone()),
        (None, Some(height)) => GroundNodes::Below(checker.finite("below", height)?),
        (Some(_), Some(height)) => {
            return Err(checker.error(height.span(), "the ground has both nodes and below: keep one of them"));
        }
    };
    Ok(GroundSpec { stiffness: checker.positive("stiffness", &table.stiffness)?, nodes })
}
