//! The deformable virtual object: surface, springs, and the stiffness K with its factor.
//!
//! [`Object::build`] makes the surface that the scene names, checks it, joins its nodes by springs or fills it with an
//! elastic solid, adds its skin, and proves K = Kn + Kg symmetric positive definite by factorising it (section 2.1,
//! equation (2)). An object that the ground does not hold, or a surface that is not closed, is refused with the reason.
//! The [`Compliance`] C = K^-1 is for contact alone, which forms it from the factor; graphics never does.

mod attachment;
mod body;
mod cell;
mod compliance;
mod condensation;
mod crossing;
mod draft;
mod element;
mod elimination;
mod factor;
mod ground;
mod icosphere;
mod import;
mod inclusion;
mod lattice;
mod lattice_error;
mod level;
mod mechanics;
mod mesh_summary;
mod ordering;
mod outlook;
mod refine;
mod settled;
mod skin;
mod solid;
mod spacing;
mod sphere;
mod springs;
mod stiffening;
mod stiffness;
mod substitution;
mod supernodes;
mod tetrahedra;
mod topology;

pub use attachment::Attachment;
pub use body::Body;
pub use compliance::Compliance;
pub use draft::{Draft, LengthUnit};
pub use factor::Factor;
pub(crate) use icosphere::generate as icosphere;
pub(crate) use import::{MOST_METRES, corners, endings as mesh_endings, length, read as read_surface};
pub use lattice_error::LatticeError;
pub use mechanics::Mechanics;
pub use mesh_summary::MeshSummary;
pub use settled::settled;
pub use skin::Skin;
pub use stiffening::Stiffening;
pub use stiffness::Stiffness;
pub use topology::Topology;

use crate::{
    Error,
    cache::Cache,
    error, memory,
    scene::{
        ElasticSpec, GroundSpec, GroundStiffness, InclusionPlace, InclusionSpec, Material, ObjectSpec, Shape, SkinSpec,
    },
};
use glam::DVec3;
use std::sync::{Arc, OnceLock};

/// A deformable object at rest.
///
/// Nodes `0..surface_nodes` lie on the surface and are the only ones that triangles name; interior nodes of a mesh of
/// tetrahedra follow.
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
    /// Nodes in the middles of their edges, as in [`Body`]; empty if the edges are straight.
    pub mid_nodes: Vec<[u32; 6]>,
    /// Physical volume of each tetrahedron; empty if the mesh names none.
    pub regions: Vec<u32>,
    /// Neighbours on the surface.
    pub topology: Topology,
    /// The skin of the surface, where it has one.
    pub skin: Option<Skin>,
    /// Repairs made on the way, one sentence each, for the user to read.
    pub warnings: Vec<String>,
    /// What it was built of, the size of its cubes included.
    spec: ObjectSpec,
    /// Size of cubes that would suit its surface, where larger ones were taken (m): see [`cell`].
    suitable_cell: Option<f64>,
    /// See [`Object::key`].
    key: Arc<[u8]>,
    /// Rows of K per node, where an earlier run has found that it is positive definite.
    proven: Option<usize>,
    /// See [`Object::mechanics`].
    mechanics: OnceLock<Arc<Mechanics>>,
}

/// Nodes (m) and triangles of a surface.
type Shell = (Vec<DVec3>, Vec<[u32; 3]>);

impl Object {
    /// The object that a scene asks for; reads the mesh file if the scene names one.
    ///
    /// # Errors
    /// When the file cannot be read, the surface is not closed and orientable, a number is out of range, or the ground
    /// does not hold the object.
    pub fn build(spec: &ObjectSpec) -> Result<Self, Error> {
        let object = Self::unproven(spec)?;
        object.prove()?;
        Ok(object)
    }

    /// The same for who asks for its surface alone: whether the ground holds it is seen in [`Object::prove`], or when it
    /// is first asked for what it resists by.
    ///
    /// # Errors
    /// As for [`Object::build`], but for the ground.
    pub fn unproven(spec: &ObjectSpec) -> Result<Self, Error> {
        let mut warnings = Vec::new();
        let body = Self::shape(spec, &mut warnings).map_err(|error| error.about(spec.shape.key()))?;
        Self::assemble(spec, body, warnings, cell::limit())
    }

    /// Generates or reads the geometry.
    fn shape(spec: &ObjectSpec, warnings: &mut Vec<String>) -> Result<Body, Error> {
        Ok(match &spec.shape {
            Shape::Sphere { centre, radius, rings, segments } => {
                check_count(rings.saturating_mul(*segments).saturating_add(2))?;
                Body::shell(sphere::generate(*centre, *radius, *rings, *segments)?)
            }
            Shape::Icosphere { centre, radius, divisions } => {
                check_count(divisions.saturating_mul(*divisions).saturating_mul(10).saturating_add(2))?;
                Body::shell(icosphere::generate(*centre, *radius, *divisions)?)
            }
            Shape::Mesh { file, placement, refine } => {
                let mut shell = import::read(file, placement, warnings)?;
                if let Some(edge) = refine {
                    let refuse = |defect: String| refused(spec, &defect);
                    shell = refine::refine(shell, *edge, warnings, refuse)?;
                }
                Body::shell(shell)
            }
            Shape::Tetrahedra { file, placement } => {
                let inclusions = match &spec.material {
                    Material::Elastic(elastic) => &elastic.inclusions[..],
                    _ => &[],
                };
                let region = |inclusion: &InclusionSpec| match inclusion.place {
                    InclusionPlace::Region(region) => Some(region),
                    InclusionPlace::Sphere { .. } => None,
                };
                let wanted: Vec<u32> = inclusions.iter().filter_map(region).collect();
                import::read_tetrahedra(file, placement, &wanted, warnings)?
            }
        })
    }

    /// Builds the object of `spec` on another surface; no file is read.
    ///
    /// # Errors
    /// As for [`Object::from_body`].
    pub fn from_surface(spec: &ObjectSpec, nodes: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, Error> {
        Self::from_body(spec, Body::shell((nodes, triangles)))
    }

    /// Builds the object of `spec` on the geometry that a dataset holds of it; no file is read.
    ///
    /// # Errors As for [`Object::build`], except for files; also when one of `spec` and `body` has tetrahedra and the
    /// other none, or `body` names nodes that it lacks.
    pub fn from_body(spec: &ObjectSpec, body: Body) -> Result<Self, Error> {
        if matches!(spec.shape, Shape::Tetrahedra { .. }) == body.tetrahedra.is_empty() {
            return Err(
                "the tetrahedra of the scene's object and those that are stored do not agree, as in datasets of earlier \
                 versions, which held none: bake the scene again"
                    .into(),
            );
        }
        body.check()?;
        let object = Self::assemble(spec, body, Vec::new(), cell::limit())?;
        object.prove()?;
        Ok(object)
    }

    /// `limit`: most memory that a lattice may take whose cubes have no size given (B).
    fn assemble(spec: &ObjectSpec, mut body: Body, mut warnings: Vec<String>, limit: f64) -> Result<Self, Error> {
        check_parameters(spec)?;
        check_count(body.nodes.len()).map_err(|error| error.about(spec.shape.key()))?;
        let surface = topology::close(&body.nodes[..body.surface_nodes], &mut body.triangles)
            .map_err(|defect| refused(spec, &defect))?;
        warnings.extend(surface.warnings);
        // Before the work that may be in vain.
        warnings.iter().for_each(|warning| log::warn!("{warning}"));
        let is_solid = !body.tetrahedra.is_empty() || matches!(spec.material, Material::Elastic(_));
        let held_everywhere = spec.skin.is_some_and(|skin| skin.foundation > 0.0);
        if !is_solid && !held_everywhere {
            let grounded = spec.ground.as_ref().map(|ground| ground::select(ground, &body.nodes)).transpose()?;
            ground::check_components(&body.nodes, &surface.components, grounded.as_deref().unwrap_or_default())?;
        }
        let (mut spec, mut suitable_cell) = (spec.clone(), None);
        if let Material::Elastic(elastic) = &mut spec.material
            && elastic.cell.is_none()
            && body.tetrahedra.is_empty()
        {
            let bends = spec.skin.is_some_and(|skin| skin.bending > 0.0);
            let [suitable, size] = cell::sizes((&body.nodes, &body.triangles), elastic, bends, limit);
            elastic.cell = Some(size);
            suitable_cell = (size > suitable).then_some(suitable);
        }
        if let Material::Elastic(ElasticSpec { cell: Some(size), .. }) = spec.material
            && body.tetrahedra.is_empty()
            && surface.components.len() > 1
        {
            let gap =
                level::Level::around(&body.nodes, size)?.bridged(&body.nodes, &body.triangles, &surface.components);
            let warning = |(place, width): (DVec3, f64)| {
                format!(
                    "cubes of {:.2} mm join parts of the object that are {:.2} mm apart at {}: set object.elasticity.cell to \
                     less than {:.5}, or take the parts for objects of their own",
                    1e3 * size,
                    1e3 * width,
                    topology::point(place),
                    width / 2.0
                )
            };
            gap.map(warning).into_iter().for_each(|warning| {
                log::warn!("{warning}");
                warnings.push(warning);
            });
        }
        let key: Arc<[u8]> = key(&spec, &body).into();
        let Body { nodes, surface_nodes, triangles, tetrahedra, mid_nodes, regions } = body;
        Ok(Self {
            proven: Cache::used().and_then(|cache| cache.find(&key)?.first().map(|rows| usize::from(*rows))),
            skin: spec.skin.map(|skin| Skin::new(skin, &nodes[..surface_nodes], &triangles)),
            rest: nodes,
            surface_nodes,
            triangles,
            tetrahedra,
            mid_nodes,
            regions,
            topology: surface.topology,
            warnings,
            spec,
            suitable_cell,
            key,
            mechanics: OnceLock::new(),
        })
    }

    /// Proves that the ground holds it, where no earlier run has done so: what that run has kept may be enough.
    ///
    /// # Errors
    /// When the ground does not hold it, or there is no memory.
    pub fn prove(&self) -> Result<(), Error> {
        if self.proven.is_none() { self.mechanics().map(|_| ()) } else { Ok(()) }
    }

    /// What its nodes resist by: formed when it is first asked for.
    ///
    /// # Errors
    /// As for [`Object::prove`].
    pub fn mechanics(&self) -> Result<&Mechanics, Error> {
        if let Some(mechanics) = self.mechanics.get() {
            return Ok(mechanics);
        }
        let formed = Arc::new(Mechanics::new(self)?);
        if self.proven.is_none() {
            let rows_per_node = formed.factor.rows_per_node() as u8;
            Cache::used().into_iter().for_each(|cache| cache.keep(&self.key, &[rows_per_node]));
        }
        Ok(self.mechanics.get_or_init(|| formed))
    }

    /// [`Mechanics::displacement_under`] that an earlier run has kept, or that is found, and kept for later ones.
    ///
    /// # Errors
    /// As for [`Object::mechanics`].
    pub fn displacement_under(&self, forces: &[DVec3]) -> Result<Vec<DVec3>, Error> {
        let loads: Vec<f64> = forces.iter().flat_map(DVec3::to_array).collect();
        let key = [&self.key[..], b"displacement", bytemuck::cast_slice(&loads)].concat();
        let moved = Cache::numbers(&key, || {
            let moved = self.mechanics()?.displacement_under(forces);
            Ok::<_, Error>(moved.iter().flat_map(DVec3::to_array).collect())
        })?;
        Ok(moved.chunks_exact(3).map(DVec3::from_slice).collect())
    }

    /// All that its compliance is made of, byte for byte.
    #[must_use]
    pub fn key(&self) -> &[u8] {
        &self.key
    }
}

/// See [`Object::key`]. Files count by what was read from them; mass and damping do not resist.
fn key(spec: &ObjectSpec, body: &Body) -> Vec<u8> {
    let ObjectSpec { shape: _, material, skin, ground, node_mass: _, node_damping: _ } = spec;
    let Body { nodes, surface_nodes, triangles, tetrahedra, mid_nodes, regions } = body;
    let counts = [nodes.len(), *surface_nodes, triangles.len(), tetrahedra.len(), mid_nodes.len(), regions.len()];
    let mut key = format!("{material:?} {skin:?} {ground:?} {counts:?}").into_bytes();
    nodes.iter().for_each(|node| key.extend(bytemuck::cast_slice(&node.to_array())));
    for numbers in [triangles.as_flattened(), tetrahedra.as_flattened(), mid_nodes.as_flattened(), regions] {
        key.extend_from_slice(bytemuck::cast_slice(numbers));
    }
    key
}

/// Most nodes of an object: its factor takes some GB then.
const MAX_NODES: usize = 1 << 20;

/// Refuses an object whose stiffness and factor would not fit in memory, before anything is allocated.
fn check_count(nodes: usize) -> Result<(), Error> {
    if nodes > MAX_NODES {
        return Err(error!(
            "an object of {nodes} nodes is more than the {MAX_NODES} that are taken: use a coarser surface, or a larger object.elasticity.cell"
        ));
    }
    let needed = nodes * LEAST_BYTES_PER_NODE;
    let enough = if needed > memory::SMALL { memory::check(needed) } else { Ok(()) };
    enough.map_err(|shortage| error!("an object of {nodes} nodes: {shortage}, or use a coarser surface"))
}

/// Least memory that a node takes (bytes): nine numbers for the node and for half of the six neighbours that it has on
/// a surface. The factor takes more, which is known once its pattern is.
const LEAST_BYTES_PER_NODE: usize = 4 * 9 * size_of::<f64>();

/// Numbers that a scene file has had checked already, and a specification made in code has not.
fn check_parameters(spec: &ObjectSpec) -> Result<(), Error> {
    let positive = |name, value: f64| (name, value, "positive and finite", value > 0.0 && value.is_finite());
    let at_least_zero =
        |name, value: f64| (name, value, "zero or positive, and finite", value >= 0.0 && value.is_finite());
    let ratio = |value: f64| ("Poisson's ratio", value, "above -1 and below 0.5", value > -1.0 && value < 0.5);
    let mut checks = vec![positive("node mass", spec.node_mass), at_least_zero("node damping", spec.node_damping)];
    match &spec.material {
        Material::Springs(springs) => checks.push(positive("spring stiffness", springs.stiffness)),
        Material::Elastic(ElasticSpec { young, poisson, cell, inclusions }) => {
            checks.extend([positive("Young's modulus", *young), ratio(*poisson)]);
            checks.extend(cell.map(|cell| positive("cell", cell)));
            checks.extend(inclusions.iter().map(|inclusion| ratio(inclusion.poisson)));
            checks.extend(inclusions.iter().map(|inclusion| positive("inclusion's Young's modulus", inclusion.young)));
        }
        Material::Hollow => {}
    }
    if let Some(GroundSpec { stiffness, .. }) = &spec.ground {
        checks.extend(stiffness.value().map(|value| positive("ground stiffness", value)));
        let needs_solid = matches!(stiffness, GroundStiffness::Clamp | GroundStiffness::PerVolume(_));
        if needs_solid && !matches!(spec.material, Material::Elastic(_)) {
            return Err(
                "a ground per volume, or one that clamps, needs an elastic solid: give a stiffness per node or per \
                        area"
                    .into(),
            );
        }
    }
    if let Some(SkinSpec { tension, bending, foundation }) = spec.skin {
        checks.push(positive("skin's greatest coefficient", tension.max(bending).max(foundation)));
        checks.push(at_least_zero("tension of the skin", tension));
        checks.push(at_least_zero("bending stiffness of the skin", bending));
        checks.push(at_least_zero("foundation of the skin", foundation));
    }
    match checks.into_iter().find(|(.., holds)| !holds) {
        Some((name, value, range, _)) => Err(out_of_range(name, value, range)),
        None => Ok(()),
    }
}

/// The error of a surface on which contact cannot be computed, because of `defect`.
fn refused(spec: &ObjectSpec, defect: &str) -> Error {
    let error = match &spec.shape {
        Shape::Sphere { .. } | Shape::Icosphere { .. } => error!("sphere: {defect}"),
        Shape::Mesh { file, .. } | Shape::Tetrahedra { file, .. } => Error::at(file, defect),
    };
    error.about(spec.shape.key())
}

/// The error of the number `name` that is `value`, and must be in `range`.
fn out_of_range(name: &str, value: f64, range: &str) -> Error {
    error!("{name} is {value}: it must be {range}")
}
