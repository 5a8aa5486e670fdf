//! `[object]`: shape, springs, ground.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::{GroundTable, MeshTable, ObjectTable, SphereTable};
use super::super::{ElasticSpec, GroundNodes, GroundSpec, Material, ObjectSpec, Shape, SpringSpec};
use glam::DVec3;
use std::ops::Range;
use std::path::PathBuf;
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
    let shape = match (&table.sphere, &table.mesh, &table.tetrahedra) {
        (Some(sphere), None, None) => sphere_shape(checker, sphere)?,
        (None, Some(mesh), None) => {
            let (file, scale, centre) = mesh_file(checker, mesh)?;
            Shape::Mesh { file, scale, centre }
        }
        (None, None, Some(mesh)) => {
            let (file, scale, centre) = mesh_file(checker, mesh)?;
            Shape::Tetrahedra { file, scale, centre }
        }
        (None, None, None) => {
            let message = "the object has no shape: add [object.sphere], [object.mesh] or [object.tetrahedra]";
            return Err(checker.error(span, message));
        }
        _ => {
            let message = "the object has two shapes: keep one of [object.sphere], [object.mesh], [object.tetrahedra]";
            return Err(checker.error(span, message));
        }
    };
    let material = material(checker, table, span)?;
    let node_mass = table.node_mass.as_ref().map(|value| checker.positive("node_mass", value));
    let node_damping = table.node_damping.as_ref().map(|value| checker.not_negative("node_damping", value));
    Ok(ObjectSpec {
        shape,
        material,
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

fn mesh_file(checker: &Checker<'_>, table: &MeshTable) -> Result<(PathBuf, f64, DVec3), SceneError> {
    if table.file.get_ref().is_empty() {
        return Err(checker.error(table.file.span(), "file is empty: name an OBJ, STL, PLY or MSH file"));
    }
    let scale = table.scale.as_ref().map(|value| checker.positive("scale", value));
    let folder = checker.path.parent().unwrap_or(checker.path);
    let centre = checker.vector("centre", table.centre.as_ref())?;
    Ok((folder.join(table.file.get_ref()), scale.unwrap_or(Ok(1.0))?, centre))
}

fn material(checker: &Checker<'_>, table: &ObjectTable, span: Range<usize>) -> Result<Material, SceneError> {
    match (&table.springs, &table.elasticity) {
        (Some(springs), None) => {
            let springs = springs.get_ref();
            let stiffness = checker.positive("stiffness", &springs.stiffness)?;
            Ok(Material::Springs(SpringSpec { kind: springs.kind, stiffness }))
        }
        (None, Some(elasticity)) => {
            let place = elasticity.span();
            let elasticity = elasticity.get_ref();
            let cell = elasticity.cell.as_ref().map(|cell| checker.positive("cell", cell)).transpose()?;
            if cell.is_none() && table.tetrahedra.is_none() {
                let message = "elasticity needs cell, the size of the lattice that fills the surface [m]";
                return Err(checker.error(place, message));
            }
            if let (Some(cell), Some(_)) = (&elasticity.cell, &table.tetrahedra) {
                return Err(checker.error(cell.span(), "tetrahedra are solid already: leave cell out"));
            }
            let young = checker.positive("young", &elasticity.young)?;
            Ok(Material::Elastic(ElasticSpec {
                young,
                poisson: checker.between("poisson", &elasticity.poisson, -1.0, 0.5)?,
                cell,
            }))
        }
        (None, None) => {
            Err(checker.error(span, "the object has no material: add [object.springs] or [object.elasticity]"))
        }
        (Some(_), Some(elasticity)) => {
            let message = "the object has two materials: keep either [object.springs] or [object.elasticity]";
            Err(checker.error(elasticity.span(), message))
        }
    }
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
