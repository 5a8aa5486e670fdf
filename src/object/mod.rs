//! The deformable virtual object: surface, springs, and the stiffness K with its factor.
//!
//! [`Object::build`] makes the surface that the scene names, checks it, joins its nodes by springs or fills it with an
//! elastic solid, adds its skin, and proves K = Kn + Kg symmetric positive definite by factorising it (section 2.1,
//! equation (2)). An object that the ground does not hold, or a surface that is not closed, is refused with the reason.
//! The [`Compliance`] C = K^-1 is for contact alone, which forms it from the factor; graphics never does.

mod body;
mod compliance;
mod crossing;
mod elasticity;
mod error;
mod factor;
mod fill;
mod ground;
mod icosphere;
mod import;
mod inclusion;
mod ordering;
mod refine;
mod settled;
mod skin;
mod solid;
mod sphere;
mod springs;
mod stiffening;
mod stiffness;
mod substitution;
mod topology;

pub use body::Body;
pub use compliance::Compliance;
pub use error::{ObjectError, SurfaceDefect};
pub use factor::{Factor, FactorError};
pub(crate) use icosphere::generate as icosphere;
pub(crate) use import::{MOST_METRES, length, read as read_surface};
pub use settled::settled;
pub use skin::Skin;
pub use stiffening::Stiffening;
pub use stiffness::Stiffness;
pub use topology::Topology;

use crate::{
    memory,
    scene::{ElasticSpec, InclusionPlace, InclusionSpec, Material, ObjectSpec, Shape},
};
use glam::{DMat3, DVec3};
use skin::Laplacian;
use solid::Solid;

/// A deformable object at rest.
///
/// Nodes `0..surface_nodes` lie on the surface and are the only ones that triangles name; interior nodes follow.
#[derive(Clone, Debug)]
pub struct Object {
    /// Rest positions n0 of all nodes (m).
    pub rest: Vec<DVec3>,
    /// Number S of surface nodes.
    pub surface_nodes: usize,
    /// Outward-oriented closed surface, corner nodes counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Corners of the tetrahedra of a mesh of such; empty for a surface, whatever fills it.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Physical volume of each tetrahedron; empty if the mesh names none.
    pub regions: Vec<u32>,
    /// Neighbours on the surface.
    pub topology: Topology,
    /// The skin of the surface, where it has one.
    pub skin: Option<Skin>,
    /// K = Kn + Kg over all nodes, the skin's included (N/m).
    pub stiffness: Stiffness,
    /// Cholesky factor of K.
    pub factor: Factor,
    /// Mass of each node (kg).
    pub mass: Vec<f64>,
    /// Damping of each node against the ground (N s/m).
    pub damping: Vec<f64>,
    /// Repairs made on the way, one sentence each, for the user to read.
    pub warnings: Vec<String>,
}

/// Nodes (m) and triangles of a surface.
type Shell = (Vec<DVec3>, Vec<[u32; 3]>);

impl Object {
    /// The object that a scene asks for; reads the mesh file if the scene names one.
    ///
    /// # Errors
    /// When the file cannot be read, the surface is not closed and orientable, a number is out of range, or the ground
    /// does not hold the object.
    pub fn build(spec: &ObjectSpec) -> Result<Self, ObjectError> {
        let mut warnings = Vec::new();
        let body = match &spec.shape {
            Shape::Sphere { centre, radius, rings, segments } => {
                check_count(rings.saturating_mul(*segments).saturating_add(2))?;
                Body::shell(sphere::generate(*centre, *radius, *rings, *segments)?)
            }
            Shape::Icosphere { centre, radius, divisions } => {
                check_count(divisions.saturating_mul(*divisions).saturating_mul(10).saturating_add(2))?;
                Body::shell(icosphere::generate(*centre, *radius, *divisions)?)
            }
            Shape::Mesh { file, scale, centre, refine } => {
                let mut shell = import::read(file, *scale, *centre, &mut warnings)?;
                if let Some(edge) = refine {
                    let refuse = |defect| ObjectError::Surface { surface: surface_name(spec), defect };
                    shell = refine::refine(shell, *edge, &mut warnings, refuse)?;
                }
                Body::shell(shell)
            }
            Shape::Tetrahedra { file, scale, centre } => {
                let inclusions = match &spec.material {
                    Material::Elastic(elastic) => &elastic.inclusions[..],
                    _ => &[],
                };
                let region = |inclusion: &InclusionSpec| match inclusion.place {
                    InclusionPlace::Region(region) => Some(region),
                    InclusionPlace::Sphere { .. } => None,
                };
                let wanted: Vec<u32> = inclusions.iter().filter_map(region).collect();
                import::read_tetrahedra(file, *scale, *centre, &wanted, &mut warnings)?
            }
        };
        Self::assemble(spec, body, warnings)
    }

    /// Builds the object of `spec` on another surface; no file is read.
    ///
    /// # Errors
    /// As for [`Object::from_body`].
    pub fn from_surface(spec: &ObjectSpec, nodes: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, ObjectError> {
        Self::from_body(spec, Body::shell((nodes, triangles)))
    }

    /// Builds the object of `spec` on the geometry that a dataset holds of it; no file is read.
    ///
    /// # Errors
    /// As for [`Object::build`], except for files; [`ObjectError::OtherTetrahedra`] if one of `spec` and `body` has
    /// tetrahedra and the other none; [`ObjectError::TetrahedronNode`] and [`ObjectError::SurfaceNodes`] if `body`
    /// names nodes that it lacks.
    pub fn from_body(spec: &ObjectSpec, body: Body) -> Result<Self, ObjectError> {
        if matches!(spec.shape, Shape::Tetrahedra { .. }) == body.tetrahedra.is_empty() {
            return Err(ObjectError::OtherTetrahedra);
        }
        body.check()?;
        Self::assemble(spec, body, Vec::new())
    }

    fn assemble(spec: &ObjectSpec, body: Body, mut warnings: Vec<String>) -> Result<Self, ObjectError> {
        check_parameters(spec)?;
        check_count(body.nodes.len())?;
        let Body { mut nodes, surface_nodes, mut triangles, tetrahedra, regions } = body;
        let surface = topology::close(&nodes[..surface_nodes], &mut triangles)
            .map_err(|defect| ObjectError::Surface { surface: surface_name(spec), defect })?;
        warnings.extend(surface.warnings);
        let mut solid = Solid {
            filled: vec![1.0; tetrahedra.len()],
            tetrahedra: tetrahedra.clone(),
            regions: regions.clone(),
            ..Solid::default()
        };
        if let (Material::Elastic(ElasticSpec { cell, .. }), true) = (&spec.material, solid.tetrahedra.is_empty()) {
            let cell = cell.ok_or_else(|| ObjectError::NoCell { surface: surface_name(spec) })?;
            solid = fill::fill(&mut nodes, &triangles, cell)?;
            check_count(nodes.len())?;
        }
        let edges = match &spec.material {
            Material::Hollow => Vec::new(),
            _ if solid.tetrahedra.is_empty() => surface.edges,
            _ => solid.edges(),
        };
        let laplacian = spec.skin.map(|skin| (skin, Laplacian::new(&nodes[..surface_nodes], &triangles)));
        let mut pattern = edges.clone();
        pattern.extend(laplacian.iter().flat_map(|(skin, laplacian)| laplacian.pairs(*skin)));
        let mut stiffness = Stiffness::with_pattern(nodes.len(), &pattern);
        stiffness.ordering = ordering::nested_dissection(&stiffness, &nodes);
        let held_everywhere = spec.skin.is_some_and(|skin| skin.foundation > 0.0);
        let grounded = spec.ground.as_ref().map(|ground| ground::select(ground, &nodes)).transpose()?;
        if solid.tetrahedra.is_empty() && !held_everywhere {
            ground::check_components(&surface.components, grounded.as_deref().unwrap_or_default())?;
        }
        for (ground, grounded) in spec.ground.iter().zip(&grounded) {
            for (node, _) in grounded.iter().enumerate().filter(|(_, held)| **held) {
                stiffness.add(node, node, DMat3::from_diagonal(DVec3::splat(ground.stiffness)));
            }
        }
        match &spec.material {
            Material::Springs(springs) => springs::add(spec, *springs, &nodes, &edges, &mut stiffness)?,
            Material::Elastic(elastic) => solid.add(elastic, &nodes, &mut stiffness)?,
            Material::Hollow => {}
        }
        laplacian.iter().for_each(|(skin, laplacian)| laplacian.add(*skin, &mut stiffness));
        let factor = factor::prove_positive_definite(&stiffness)?;
        Ok(Self {
            surface_nodes,
            skin: spec.skin.map(|skin| Skin::new(skin, &nodes[..surface_nodes], &triangles)),
            mass: vec![spec.node_mass; nodes.len()],
            damping: vec![spec.node_damping; nodes.len()],
            rest: nodes,
            triangles,
            tetrahedra,
            regions,
            topology: surface.topology,
            stiffness,
            factor,
            warnings,
        })
    }
}

/// Most nodes of an object: its factor takes some GB then.
const MAX_NODES: usize = 1 << 20;

/// Refuses an object whose stiffness and factor would not fit in memory, before anything is allocated.
fn check_count(nodes: usize) -> Result<(), ObjectError> {
    if nodes > MAX_NODES {
        return Err(ObjectError::TooManyNodes { nodes, limit: MAX_NODES });
    }
    let needed = nodes * LEAST_BYTES_PER_NODE;
    let enough = if needed > memory::SMALL { memory::check(needed) } else { Ok(()) };
    enough.map_err(|shortage| ObjectError::Memory { nodes, shortage })
}

/// Least memory that a node takes (bytes): nine numbers for the node and for half of the six neighbours that it has on
/// a surface. The factor takes more, which is known once its pattern is.
const LEAST_BYTES_PER_NODE: usize = 4 * 9 * size_of::<f64>();

/// Numbers that a scene file has had checked already, and a specification made in code has not.
fn check_parameters(spec: &ObjectSpec) -> Result<(), ObjectError> {
    let material = match &spec.material {
        Material::Springs(springs) => Some(("spring stiffness", springs.stiffness)),
        Material::Elastic(elastic) => Some(("Young's modulus", elastic.young)),
        Material::Hollow => None,
    };
    let ground = spec.ground.as_ref().map(|ground| ("ground stiffness", ground.stiffness));
    let skin =
        spec.skin.map(|skin| ("skin's greatest coefficient", skin.tension.max(skin.bending).max(skin.foundation)));
    for (name, value) in material.into_iter().chain(ground).chain(skin).chain([("node mass", spec.node_mass)]) {
        if !(value > 0.0 && value.is_finite()) {
            return Err(ObjectError::Parameter { name, value, range: "positive and finite" });
        }
    }
    let skin = spec.skin.map_or([0.0; 3], |skin| [skin.tension, skin.bending, skin.foundation]);
    let names = ["tension of the skin", "bending stiffness of the skin", "foundation of the skin"];
    let damping = ("node damping", spec.node_damping);
    for (name, value) in names.into_iter().zip(skin).chain([damping]) {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(ObjectError::Parameter { name, value, range: "zero or positive, and finite" });
        }
    }
    if let Material::Elastic(ElasticSpec { poisson, cell, inclusions, .. }) = &spec.material {
        for value in inclusions.iter().map(|inclusion| inclusion.poisson).chain([*poisson]) {
            if !(value > -1.0 && value < 0.5) {
                return Err(ObjectError::Parameter { name: "Poisson's ratio", value, range: "above -1 and below 0.5" });
            }
        }
        for value in inclusions.iter().map(|inclusion| inclusion.young) {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ObjectError::Parameter {
                    name: "inclusion's Young's modulus",
                    value,
                    range: "positive and finite",
                });
            }
        }
        if let Some(value) = cell.filter(|cell| !(*cell > 0.0 && cell.is_finite())) {
            return Err(ObjectError::Parameter { name: "cell", value, range: "positive and finite" });
        }
    }
    Ok(())
}

/// Returns how messages call the surface.
fn surface_name(spec: &ObjectSpec) -> String {
    match &spec.shape {
        Shape::Sphere { .. } | Shape::Icosphere { .. } => "sphere".to_owned(),
        Shape::Mesh { file, .. } | Shape::Tetrahedra { file, .. } => file.display().to_string(),
    }
}
