//! The deformable virtual object: surface, springs, and the compliance C = K^-1 that contact needs.
//!
//! [`Object::build`] makes the surface that the scene names, checks it, joins its nodes by springs, proves
//! K = Kn + Kg symmetric positive definite by factorising it (section 2.1, equation (2)), and inverts it on the
//! surface nodes. An object that the ground does not hold, or a surface that is not closed, is refused with the reason.

mod compliance;
mod error;
mod factor;
mod ground;
mod import;
mod sphere;
mod springs;
mod stiffness;
mod topology;

pub use compliance::Compliance;
pub use error::{ObjectError, SurfaceDefect};
pub use factor::{Factor, FactorError};
pub use stiffness::Stiffness;
pub use topology::Topology;

use crate::scene::{ObjectSpec, Shape};
use glam::DVec3;

/// A deformable object at rest.
///
/// Nodes `0..surface_nodes` lie on the surface and are the only ones that triangles name; interior nodes follow.
#[derive(Clone, Debug)]
pub struct Object {
    /// Rest positions n0 of all nodes [m].
    pub rest: Vec<DVec3>,
    /// Number S of surface nodes.
    pub surface_nodes: usize,
    /// Outward-oriented closed surface, corner nodes counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Neighbours on the surface.
    pub topology: Topology,
    /// K = Kn + Kg over all nodes [N/m].
    pub stiffness: Stiffness,
    /// C = K^-1 on the surface nodes, exact static condensation [m/N].
    pub compliance: Compliance,
    /// Mass of each node [kg].
    pub mass: Vec<f64>,
    /// Damping of each node against the ground [N s/m].
    pub damping: Vec<f64>,
    /// What was repaired on the way, one sentence each, for the user to read.
    pub warnings: Vec<String>,
}

impl Object {
    /// The object that a scene asks for; reads the mesh file if the scene names one.
    ///
    /// # Errors
    /// When the file cannot be read, the surface is not closed and orientable, a number is out of range, or the ground
    /// does not hold the object.
    pub fn build(spec: &ObjectSpec) -> Result<Self, ObjectError> {
        let mut warnings = Vec::new();
        let (nodes, triangles) = match &spec.shape {
            Shape::Sphere { centre, radius, rings, segments } => {
                check_order(rings.saturating_mul(*segments).saturating_add(2))?;
                sphere::generate(*centre, *radius, *rings, *segments)?
            }
            Shape::Mesh { file, scale, centre } => import::read(file, *scale, *centre, &mut warnings)?,
        };
        Self::assemble(spec, nodes, triangles, warnings)
    }

    /// The same object on a surface that is already at hand, such as the one stored in a dataset: the shape that the
    /// scene names is not read.
    ///
    /// # Errors
    /// As for [`Object::build`], except for the file.
    pub fn from_surface(spec: &ObjectSpec, nodes: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, ObjectError> {
        Self::assemble(spec, nodes, triangles, Vec::new())
    }

    fn assemble(
        spec: &ObjectSpec,
        nodes: Vec<DVec3>,
        mut triangles: Vec<[u32; 3]>,
        mut warnings: Vec<String>,
    ) -> Result<Self, ObjectError> {
        check_parameters(spec)?;
        check_order(nodes.len())?;
        let surface = topology::close(&nodes, &mut triangles)
            .map_err(|defect| ObjectError::Surface { surface: surface_name(spec), defect })?;
        warnings.extend(surface.warnings);
        let grounded = ground::select(&spec.ground, &nodes)?;
        ground::check_components(&surface.components, &grounded)?;
        let stiffness = springs::assemble(spec, &nodes, &surface.edges, &grounded)?;
        let factor = factor::prove_positive_definite(&stiffness)?;
        let compliance = Compliance::of(&factor, nodes.len(), nodes.len());
        Ok(Self {
            surface_nodes: nodes.len(),
            mass: vec![spec.node_mass; nodes.len()],
            damping: vec![spec.node_damping; nodes.len()],
            rest: nodes,
            triangles,
            topology: surface.topology,
            stiffness,
            compliance,
            warnings,
        })
    }
}

/// Most memory that the dense compliance may take [B]: it is what a laptop can hold beside everything else.
const MAX_COMPLIANCE_BYTES: usize = 4 << 30;

/// Refuses an object whose dense compliance of (3S)^2 numbers would not fit in memory, before anything is allocated.
fn check_order(nodes: usize) -> Result<(), ObjectError> {
    let order = nodes.saturating_mul(3);
    let bytes = order.saturating_mul(order).saturating_mul(size_of::<f64>());
    if bytes > MAX_COMPLIANCE_BYTES {
        return Err(ObjectError::TooLarge { nodes, bytes, limit: MAX_COMPLIANCE_BYTES });
    }
    Ok(())
}

/// Numbers that a scene file has had checked already, and a specification made in code has not.
fn check_parameters(spec: &ObjectSpec) -> Result<(), ObjectError> {
    let positive = [
        ("spring stiffness", spec.springs.stiffness),
        ("ground stiffness", spec.ground.stiffness),
        ("node mass", spec.node_mass),
    ];
    for (name, value) in positive {
        if !(value > 0.0 && value.is_finite()) {
            return Err(ObjectError::Parameter { name, value, range: "positive and finite" });
        }
    }
    if !(spec.node_damping >= 0.0 && spec.node_damping.is_finite()) {
        let value = spec.node_damping;
        return Err(ObjectError::Parameter { name: "node damping", value, range: "zero or positive, and finite" });
    }
    Ok(())
}

/// How messages call the surface.
fn surface_name(spec: &ObjectSpec) -> String {
    match &spec.shape {
        Shape::Sphere { .. } => "sphere".to_owned(),
        Shape::Mesh { file, .. } => file.display().to_string(),
    }
}
