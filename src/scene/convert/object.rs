//! `[object]`: shape, material, ground.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::{GroundTable, InclusionTable, MeshTable, ObjectTable, SphereTable};
use super::super::{
    ElasticSpec, GroundNodes, GroundSpec, InclusionPlace, InclusionSpec, Material, ObjectSpec, Shape, SpringSpec,
};
use super::skin;
use glam::DVec3;
use std::ops::Range;
use std::path::PathBuf;
use toml::Spanned;

/// Default mass of a node (kg).
const NODE_MASS: f64 = 0.005;
/// Default damping of a node against the ground (N s/m).
const NODE_DAMPING: f64 = 0.5;

/// Most rings, and most nodes of a ring: their product must fit the node numbers; what memory allows is far less, and
/// checked when the object is built.
const MAX_RINGS: usize = 1 << 15;

/// Most halvings of an icosahedron's edges: more nodes than an object may have.
const MAX_SUBDIVISIONS: usize = 9;

/// Mean edge of an icosahedron on the unit sphere times the parts n that its edges are divided into: the edge of an
/// equilateral triangle that has a share 1 / (20 n^2) of the sphere's area, sqrt(4 pi / (5 sqrt 3)) (1).
const MEAN_EDGE: f64 = 1.2046;

pub(super) fn convert(checker: &Checker<'_>, table: &Spanned<ObjectTable>) -> Result<ObjectSpec, SceneError> {
    let span = table.span();
    let table = table.get_ref();
    let shape = match (&table.sphere, &table.mesh, &table.tetrahedra) {
        (Some(sphere), None, None) => sphere_shape(checker, sphere)?,
        (None, Some(mesh), None) => {
            let (file, scale, centre) = mesh_file(checker, mesh)?;
            let refine = mesh.refine.as_ref().map(|edge| checker.positive("refine", edge)).transpose()?;
            Shape::Mesh { file, scale, centre, refine }
        }
        (None, None, Some(mesh)) => {
            let (file, scale, centre) = mesh_file(checker, mesh)?;
            if let Some(refine) = &mesh.refine {
                return Err(checker.error(refine.span(), "tetrahedra are not refined: mesh the solid finer"));
            }
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
    let material = material(checker, table, span.clone())?;
    let skin = table.skin.as_ref().map(|skin| skin::convert(checker, skin, &material)).transpose()?;
    let ground = table.ground.as_ref().map(|own| ground(checker, own)).transpose()?;
    if ground.is_none() && skin.is_none_or(|skin| skin.foundation == 0.0) {
        let message = "nothing holds the object: add [object.ground], or a foundation to [object.skin]";
        return Err(checker.error(span, message));
    }
    let node_mass = table.node_mass.as_ref().map(|value| checker.positive("node_mass", value));
    let node_damping = table.node_damping.as_ref().map(|value| checker.not_negative("node_damping", value));
    Ok(ObjectSpec {
        shape,
        material,
        skin,
        ground,
        node_mass: node_mass.unwrap_or(Ok(NODE_MASS))?,
        node_damping: node_damping.unwrap_or(Ok(NODE_DAMPING))?,
    })
}

fn sphere_shape(checker: &Checker<'_>, table: &SphereTable) -> Result<Shape, SceneError> {
    let centre = checker.vector("centre", table.centre.as_ref())?;
    let radius = checker.positive("radius", &table.radius)?;
    match (&table.rings, &table.segments, &table.subdivisions, &table.edge) {
        (Some(rings), Some(segments), None, None) => Ok(Shape::Sphere {
            centre,
            radius,
            rings: checker.count("rings", rings, 1, MAX_RINGS)?,
            segments: checker.count("segments", segments, 3, MAX_RINGS)?,
        }),
        (None, None, Some(subdivisions), None) => {
            let divisions = 1 << checker.count("subdivisions", subdivisions, 0, MAX_SUBDIVISIONS)?;
            Ok(Shape::Icosphere { centre, radius, divisions })
        }
        (None, None, None, Some(edge)) => {
            let least = MEAN_EDGE * radius / f64::from(1 << MAX_SUBDIVISIONS);
            let edge = checker.between("edge", edge, least, 2.0 * radius)?;
            Ok(Shape::Icosphere { centre, radius, divisions: (MEAN_EDGE * radius / edge).ceil() as usize })
        }
        _ => {
            let message = "a sphere needs one of edge (length of its triangles' edges [m]), subdivisions (how often an \
                           icosahedron's edges are halved), or rings with segments";
            Err(checker.error(table.radius.span(), message))
        }
    }
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
            let poisson = checker.between("poisson", &elasticity.poisson, -1.0, 0.5)?;
            let has_regions = table.tetrahedra.is_some();
            let inclusions: Result<Vec<InclusionSpec>, SceneError> =
                elasticity.inclusion.iter().map(|own| inclusion(checker, own, poisson, has_regions)).collect();
            Ok(Material::Elastic(ElasticSpec { young, poisson, cell, inclusions: inclusions? }))
        }
        (None, None) if table.skin.is_some() && table.tetrahedra.is_none() => Ok(Material::Hollow),
        (None, None) => {
            let message = "the object has no material: add [object.springs] or [object.elasticity], \
                           or to a surface [object.skin]";
            Err(checker.error(span, message))
        }
        (Some(_), Some(elasticity)) => {
            let message = "the object has two materials: keep either [object.springs] or [object.elasticity]";
            Err(checker.error(elasticity.span(), message))
        }
    }
}

/// `poisson`: of the solid around; `has_regions`: whether its shape is a Gmsh file.
fn inclusion(
    checker: &Checker<'_>,
    table: &Spanned<InclusionTable>,
    poisson: f64,
    has_regions: bool,
) -> Result<InclusionSpec, SceneError> {
    let (span, table) = (table.span(), table.get_ref());
    let place = match (&table.sphere, &table.region) {
        (Some(sphere), None) => InclusionPlace::Sphere {
            centre: checker.vector("centre", Some(&sphere.centre))?,
            radius: checker.positive("radius", &sphere.radius)?,
        },
        (None, Some(region)) if has_regions => InclusionPlace::Region(*region.get_ref()),
        (None, Some(region)) => {
            let message = "a region is a physical volume of a Gmsh file, and the object has none: give a sphere, or \
                           [object.tetrahedra]";
            return Err(checker.error(region.span(), message));
        }
        _ => {
            let message = "an inclusion needs one of sphere = { centre = [x, y, z], radius = r } and region = n";
            return Err(checker.error(span, message));
        }
    };
    let own = table.poisson.as_ref().map(|value| checker.between("poisson", value, -1.0, 0.5));
    Ok(InclusionSpec { place, young: checker.positive("young", &table.young)?, poisson: own.unwrap_or(Ok(poisson))? })
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
