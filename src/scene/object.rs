//! `[object]`: shape, material, ground.

use super::RelaxationSpec;
use super::check::Checker;
use super::skin::{SkinSpec, SkinTable};
use super::value::{KEY, Range, count, defaults, finite, not_negative, positive, rotation, vector};
use crate::Error;
use glam::DVec3;
use serde::de::{Deserialize, Deserializer, Error as _};
use std::path::PathBuf;

/// Most rings, and most nodes of a ring: their product must fit the node numbers; what memory allows is far less, and
/// checked when the object is built.
const MAX_RINGS: usize = 1 << 15;

/// Most halvings of an icosahedron's edges: more nodes than an object may have.
const MAX_SUBDIVISIONS: usize = 9;

/// Mean edge of an icosahedron on the unit sphere times the parts n that its edges are divided into: the edge of an
/// equilateral triangle that has a share 1 / (20 n^2) of the sphere's area, sqrt(4 pi / (5 sqrt 3)) (1).
const MEAN_EDGE: f64 = 1.2046;

/// The deformable virtual object (section 2.1).
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectSpec {
    /// Where the surface comes from.
    pub shape: Shape,
    /// Material that resists deformation beside the skin, Kn.
    pub material: Material,
    /// The skin of the surface, where it has one.
    pub skin: Option<SkinSpec>,
    /// Springs Kg to the mechanical ground; none where the skin's foundation holds the object.
    pub ground: Option<GroundSpec>,
    /// Mass of each node (kg).
    pub node_mass: f64,
    /// Damping of each node against the ground (N s/m).
    pub node_damping: f64,
}

/// Where the surface comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Two poles and `rings` rings of `segments` nodes on a sphere.
    Sphere {
        /// (m)
        centre: DVec3,
        /// (m)
        radius: f64,
        /// Rings between the poles, at equal steps of the polar angle.
        rings: usize,
        /// Nodes of each ring.
        segments: usize,
    },
    /// An icosahedron whose faces are divided, on a sphere: nearly equal triangles.
    Icosphere {
        /// (m)
        centre: DVec3,
        /// (m)
        radius: f64,
        /// Parts n of each edge of the icosahedron: 10 n^2 + 2 nodes.
        divisions: usize,
    },
    /// A closed triangle mesh, its format known by the file's extension.
    Mesh {
        /// Relative to the scene file's folder when the scene names it so; ready to open here.
        file: PathBuf,
        /// Where its coordinates lie in space.
        placement: Placement,
        /// Mean edge to which the surface is refined, where it is (m).
        refine: Option<f64>,
    },
    /// The tetrahedra of a file, whose surface is touched; otherwise as `Mesh`.
    Tetrahedra {
        /// See `Mesh`.
        file: PathBuf,
        /// See `Mesh`.
        placement: Placement,
    },
}

impl Shape {
    /// The key of a scene that names it.
    pub(crate) fn key(&self) -> &'static str {
        match self {
            Self::Sphere { .. } | Self::Icosphere { .. } => "object.sphere",
            Self::Mesh { .. } => "object.mesh.file",
            Self::Tetrahedra { .. } => "object.tetrahedra.file",
        }
    }

    /// The point that is moved to move the object: the centre of a sphere, the origin of a file's coordinates (m).
    #[must_use]
    pub fn centre(&self) -> DVec3 {
        match self {
            Self::Sphere { centre, .. } | Self::Icosphere { centre, .. } => *centre,
            Self::Mesh { placement, .. } | Self::Tetrahedra { placement, .. } => placement.centre,
        }
    }
}

/// Where a file's coordinates lie in space: they are scaled, then turned, then moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Factor on the coordinates: 0.001 for millimetres (m).
    pub scale: f64,
    /// Angles about x, then y, then z (rad).
    pub turn: DVec3,
    /// Where the origin comes to lie (m).
    pub centre: DVec3,
}

impl Placement {
    /// Coordinates in metres, where they lie.
    pub const METRES: Self = Self { scale: 1.0, turn: DVec3::ZERO, centre: DVec3::ZERO };

    /// Returns `nodes` in space (m).
    #[must_use]
    pub fn place(&self, mut nodes: Vec<DVec3>) -> Vec<DVec3> {
        let turned = rotation(self.turn);
        nodes.iter_mut().for_each(|node| *node = turned * (self.scale * *node) + self.centre);
        nodes
    }
}

/// Material that resists deformation.
#[derive(Clone, Debug, PartialEq)]
pub enum Material {
    /// Springs along the edges of the surface, or of the tetrahedra.
    Springs(SpringSpec),
    /// A linearly elastic solid.
    Elastic(ElasticSpec),
    /// Nothing: the skin alone.
    Hollow,
}

/// An isotropic, linearly elastic solid, homogeneous but for its inclusions.
#[derive(Clone, Debug, PartialEq)]
pub struct ElasticSpec {
    /// Young's modulus E (Pa).
    pub young: f64,
    /// Poisson's ratio nu, above -1 and below 1/2 (1).
    pub poisson: f64,
    /// Size of the smallest cubes of the lattice that fills a surface (m). None where the shape is tetrahedra, or where
    /// the size follows from the surface.
    pub cell: Option<f64>,
    /// Parts with another stiffness; where two overlap, the later one counts.
    pub inclusions: Vec<InclusionSpec>,
}

/// A part of an elastic solid with a stiffness of its own, bonded to the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InclusionSpec {
    /// Which part.
    pub place: InclusionPlace,
    /// Young's modulus (Pa).
    pub young: f64,
    /// Poisson's ratio (1).
    pub poisson: f64,
}

/// Which part of a solid an inclusion is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InclusionPlace {
    /// The part inside a sphere.
    Sphere {
        /// (m)
        centre: DVec3,
        /// (m)
        radius: f64,
    },
    /// The tetrahedra of a region of the file, by its number: a physical volume in Gmsh.
    Region(u32),
}

impl std::fmt::Display for InclusionSpec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.place {
            InclusionPlace::Sphere { centre: DVec3 { x, y, z }, radius } => {
                write!(f, "sphere of {:.1} mm radius at ({x:.4}, {y:.4}, {z:.4}) m", radius * 1e3)?;
            }
            InclusionPlace::Region(region) => write!(f, "region {region}")?,
        }
        write!(f, ": Young's modulus {:.3e} Pa, Poisson's ratio {}", self.young, self.poisson)
    }
}

/// Springs along edges.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpringSpec {
    /// How each spring resists.
    pub kind: SpringKind,
    /// Stiffness of each spring (N/m).
    #[serde(deserialize_with = "positive")]
    pub stiffness: f64,
}

/// How a spring resists a relative displacement d of its two ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SpringKind {
    /// Along its rest direction e only: k e (e . d).
    Axial,
    /// In all directions alike: k d.
    Isotropic,
}

/// Ground springs Kg.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundSpec {
    /// How stiff it is, in all directions alike.
    pub stiffness: GroundStiffness,
    /// Which part it holds.
    pub nodes: GroundNodes,
}

/// Stiffness of the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GroundStiffness {
    /// At each grounded node of the surface (N/m).
    PerNode(f64),
    /// Per area of the grounded surface (N/m^3).
    PerArea(f64),
    /// Per volume of the grounded part of a solid (N/m^4).
    PerVolume(f64),
    /// The grounded surface of a solid does not move.
    Clamp,
}

impl GroundStiffness {
    /// The number (N/m, N/m^3 or N/m^4); none of a clamp.
    #[must_use]
    pub fn value(self) -> Option<f64> {
        match self {
            Self::PerNode(value) | Self::PerArea(value) | Self::PerVolume(value) => Some(value),
            Self::Clamp => None,
        }
    }
}

/// Which nodes the ground holds; per area it holds the nodes' own areas.
#[derive(Clone, Debug, PartialEq)]
pub enum GroundNodes {
    /// Every node of the object.
    All,
    /// Nodes by number.
    Listed(Vec<u32>),
    /// What lies below this height z at rest: nodes, or area or volume (m).
    Below(f64),
}

/// `[object]` as it is written.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectTable {
    sphere: Option<SphereTable>,
    mesh: Option<MeshTable>,
    tetrahedra: Option<MeshTable>,
    springs: Option<SpringSpec>,
    elasticity: Option<ElasticityTable>,
    skin: Option<SkinTable>,
    ground: Option<GroundTable>,
    /// Of the haptic loop.
    pub relaxation: Option<RelaxationSpec>,
    #[serde(default = "node_mass", deserialize_with = "positive")]
    node_mass: f64,
    #[serde(default = "node_damping", deserialize_with = "not_negative")]
    node_damping: f64,
}

defaults! {
    /// Default mass of a node (kg).
    node_mass: f64 = 0.005;
    /// Default damping of a node against the ground (N s/m).
    node_damping: f64 = 0.5;
    /// Default scale of a mesh (1).
    scale: f64 = 1.0;
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct SphereTable {
    #[serde(default, deserialize_with = "vector")]
    centre: DVec3,
    #[serde(deserialize_with = "positive")]
    radius: f64,
    #[serde(default, deserialize_with = "count::<1, MAX_RINGS, _, _>")]
    rings: Option<usize>,
    #[serde(default, deserialize_with = "count::<3, MAX_RINGS, _, _>")]
    segments: Option<usize>,
    #[serde(default, deserialize_with = "count::<0, MAX_SUBDIVISIONS, _, _>")]
    subdivisions: Option<usize>,
    #[serde(default, deserialize_with = "finite")]
    edge: Option<f64>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshTable {
    #[serde(deserialize_with = "file")]
    file: PathBuf,
    #[serde(default = "scale", deserialize_with = "positive")]
    scale: f64,
    #[serde(default, deserialize_with = "vector")]
    turn: DVec3,
    #[serde(default, deserialize_with = "vector")]
    centre: DVec3,
    #[serde(default, deserialize_with = "positive")]
    refine: Option<f64>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct ElasticityTable {
    #[serde(deserialize_with = "positive")]
    young: f64,
    #[serde(deserialize_with = "poisson")]
    poisson: f64,
    #[serde(default, deserialize_with = "positive")]
    cell: Option<f64>,
    #[serde(default)]
    inclusion: Vec<InclusionTable>,
}

/// A part of the solid, by a sphere or by the number of a physical volume.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct InclusionTable {
    sphere: Option<InclusionSphereTable>,
    region: Option<u32>,
    #[serde(deserialize_with = "positive")]
    young: f64,
    #[serde(default, deserialize_with = "poisson")]
    poisson: Option<f64>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct InclusionSphereTable {
    #[serde(deserialize_with = "vector")]
    centre: DVec3,
    #[serde(deserialize_with = "positive")]
    radius: f64,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct GroundTable {
    #[serde(default, deserialize_with = "positive")]
    stiffness: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    per_area: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    per_volume: Option<f64>,
    #[serde(default)]
    clamp: bool,
    #[serde(default, deserialize_with = "grounded")]
    nodes: Option<Vec<u32>>,
    #[serde(default, deserialize_with = "finite")]
    below: Option<f64>,
}

fn poisson<'de, T: From<f64>, D: Deserializer<'de>>(value: D) -> Result<T, D::Error> {
    Range::Between(-1.0, 0.5).number(value)
}

fn file<'de, D: Deserializer<'de>>(value: D) -> Result<PathBuf, D::Error> {
    let file = PathBuf::deserialize(value)?;
    if file.as_os_str().is_empty() {
        return Err(D::Error::custom(format!("{KEY}is empty: name the file of a mesh")));
    }
    Ok(file)
}

fn grounded<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Vec<u32>>, D::Error> {
    let nodes = Vec::deserialize(value)?;
    if nodes.is_empty() {
        return Err(D::Error::custom(format!("{KEY}is empty: list nodes, or leave the key out to ground all")));
    }
    Ok(Some(nodes))
}

impl ObjectTable {
    /// Whether it describes nothing of the object but what a measurement tells: how it relaxes.
    pub fn is_measured(&self) -> bool {
        self.relaxation.is_some() && self.sphere.is_none() && self.mesh.is_none() && self.tetrahedra.is_none()
    }

    /// The object.
    pub fn check(self, checker: &Checker<'_>) -> Result<ObjectSpec, Error> {
        let Self { sphere, mesh, tetrahedra, springs, elasticity, skin, ground, node_mass, node_damping, .. } = self;
        let folder = checker.path.parent().unwrap_or(checker.path);
        let is_solid = tetrahedra.is_some();
        let shape = match (sphere, mesh, tetrahedra) {
            (Some(sphere), None, None) => sphere.check(checker)?,
            (None, Some(MeshTable { file, scale, turn, centre, refine }), None) => {
                Shape::Mesh { file: folder.join(file), placement: Placement { scale, turn, centre }, refine }
            }
            (None, None, Some(MeshTable { refine: Some(_), .. })) => {
                let message = "tetrahedra are not refined: mesh the solid finer";
                return Err(checker.at("object.tetrahedra.refine", message));
            }
            (None, None, Some(MeshTable { file, scale, turn, centre, .. })) => {
                Shape::Tetrahedra { file: folder.join(file), placement: Placement { scale, turn, centre } }
            }
            (None, None, None) => {
                let message = "the object has no shape: add [object.sphere], [object.mesh] or [object.tetrahedra]";
                return Err(checker.at("object", message));
            }
            _ => {
                let message =
                    "the object has two shapes: keep one of [object.sphere], [object.mesh], [object.tetrahedra]";
                return Err(checker.at("object", message));
            }
        };
        let material = match (springs, elasticity) {
            (Some(springs), None) => Material::Springs(springs),
            (None, Some(elasticity)) => Material::Elastic(elasticity.check(checker, is_solid)?),
            (None, None) if skin.is_some() && !is_solid => Material::Hollow,
            (None, None) => {
                let message = "the object has no material: add [object.springs] or [object.elasticity], or to a \
                               surface [object.skin]";
                return Err(checker.at("object", message));
            }
            (Some(_), Some(_)) => {
                let message = "the object has two materials: keep either [object.springs] or [object.elasticity]";
                return Err(checker.at("object.elasticity", message));
            }
        };
        let skin = skin.map(|skin| skin.check(checker, &material)).transpose()?;
        let ground = ground.map(|ground| ground.check(checker, &material)).transpose()?;
        if ground.is_none() && skin.is_none_or(|skin| skin.foundation == 0.0) {
            let message = "nothing holds the object: add [object.ground], or a foundation to [object.skin]";
            return Err(checker.at("object", message));
        }
        Ok(ObjectSpec { shape, material, skin, ground, node_mass, node_damping })
    }
}

impl SphereTable {
    fn check(self, checker: &Checker<'_>) -> Result<Shape, Error> {
        let Self { centre, radius, .. } = self;
        match (self.rings, self.segments, self.subdivisions, self.edge) {
            (Some(rings), Some(segments), None, None) => Ok(Shape::Sphere { centre, radius, rings, segments }),
            (None, None, Some(subdivisions), None) => {
                Ok(Shape::Icosphere { centre, radius, divisions: 1 << subdivisions })
            }
            (None, None, None, Some(edge)) => {
                let range = Range::Between(MEAN_EDGE * radius / f64::from(1 << MAX_SUBDIVISIONS), 2.0 * radius);
                if !range.holds(edge) {
                    let message = format!("edge is {edge}: it must be {range}");
                    return Err(checker.at("object.sphere.edge", message));
                }
                Ok(Shape::Icosphere { centre, radius, divisions: (MEAN_EDGE * radius / edge).ceil() as usize })
            }
            _ => {
                let message = "a sphere needs one of edge (length of its triangles' edges [m]), subdivisions (how \
                               often an icosahedron's edges are halved), or rings with segments";
                Err(checker.at("object.sphere.radius", message))
            }
        }
    }
}

impl ElasticityTable {
    /// `is_solid`: whether the shape is the tetrahedra of a file.
    fn check(self, checker: &Checker<'_>, is_solid: bool) -> Result<ElasticSpec, Error> {
        let Self { young, poisson, cell, inclusion } = self;
        if cell.is_some() && is_solid {
            return Err(checker.at("object.elasticity.cell", "tetrahedra are solid already: leave cell out"));
        }
        let spec = |(number, table): (usize, InclusionTable)| {
            let at = |key, message| Err(checker.at(&format!("object.elasticity.inclusion.{number}{key}"), message));
            let place = match (table.sphere, table.region) {
                (Some(InclusionSphereTable { centre, radius }), None) => InclusionPlace::Sphere { centre, radius },
                (None, Some(region)) if is_solid => InclusionPlace::Region(region),
                (None, Some(_)) => {
                    let message = "a region is a part of a solid's file, such as a physical volume of Gmsh, and the object has none: give a \
                                   sphere, or [object.tetrahedra]";
                    return at(".region", message);
                }
                _ => {
                    let message =
                        "an inclusion needs one of sphere = { centre = [x, y, z], radius = r } and region = n";
                    return at("", message);
                }
            };
            Ok(InclusionSpec { place, young: table.young, poisson: table.poisson.unwrap_or(poisson) })
        };
        let inclusions = inclusion.into_iter().enumerate().map(spec).collect::<Result<_, _>>()?;
        Ok(ElasticSpec { young, poisson, cell, inclusions })
    }
}

impl GroundTable {
    fn check(self, checker: &Checker<'_>, material: &Material) -> Result<GroundSpec, Error> {
        let stiffness = match (self.stiffness, self.per_area, self.per_volume, self.clamp) {
            (Some(k), None, None, false) => GroundStiffness::PerNode(k),
            (None, Some(k), None, false) => GroundStiffness::PerArea(k),
            (None, None, Some(k), false) => GroundStiffness::PerVolume(k),
            (None, None, None, true) => GroundStiffness::Clamp,
            _ => {
                let message = "the ground needs one of per_area [N/m^3], per_volume [N/m^4], clamp = true, and \
                               stiffness, of each node [N/m]";
                return Err(checker.at("object.ground", message));
            }
        };
        let key = match stiffness {
            GroundStiffness::PerVolume(_) => "per_volume",
            GroundStiffness::Clamp => "clamp",
            GroundStiffness::PerNode(_) | GroundStiffness::PerArea(_) => "",
        };
        if !key.is_empty() && !matches!(material, Material::Elastic(_)) {
            let message = format!("{key} needs [object.elasticity]: give per_area, or stiffness of each node");
            return Err(checker.at(&format!("object.ground.{key}"), message));
        }
        if matches!(stiffness, GroundStiffness::PerVolume(_)) && self.nodes.is_some() {
            let message = "a volume has no nodes of its own: give below, or leave nodes out";
            return Err(checker.at("object.ground.nodes", message));
        }
        let nodes = match (self.nodes, self.below) {
            (None, None) => GroundNodes::All,
            (Some(nodes), None) => GroundNodes::Listed(nodes),
            (None, Some(height)) => GroundNodes::Below(height),
            (Some(_), Some(_)) => {
                let message = "the ground has both nodes and below: keep one of them";
                return Err(checker.at("object.ground.below", message));
            }
        };
        Ok(GroundSpec { stiffness, nodes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn coordinates_are_scaled_then_turned_about_x_y_and_z_then_moved() {
        let placement = Placement { scale: 2.0, turn: DVec3::new(FRAC_PI_2, 0.0, FRAC_PI_2), centre: DVec3::X };
        let placed = placement.place(vec![DVec3::X, DVec3::Y, DVec3::Z]);
        // About x, y goes to z and z to -y; then about z, x goes to y and -y to x.
        let expected = [DVec3::new(1.0, 2.0, 0.0), DVec3::new(1.0, 0.0, 2.0), DVec3::new(3.0, 0.0, 0.0)];
        placed.iter().zip(expected).for_each(|(x, expected)| assert!(x.distance(expected) < 1e-12, "{placed:?}"));
    }
}
