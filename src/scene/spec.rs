//! The content of a scene, validated: plain data that the other rooms read.
//!
//! All quantities are SI. Gains of the haptic loop are given joint by joint, because the coordinates of a chain may mix
//! radians and metres: where a doc says (N m/rad), a prismatic joint has (N/m), and so on.

use crate::JointVector;
use glam::{DMat3, DVec3};
use serde::Deserialize;
use std::ops::Range;
use std::path::PathBuf;

/// Greatest time between two ticks (s): a whole period of a hand's fastest motion, 10 Hz. After more, the position
/// before says nothing about the velocity.
pub const GREATEST_INTERVAL: f64 = 0.1;

/// Lever arm with which a prismatic joint counts among revolute ones (m): a tenth of a metre, the size of a tool in a
/// hand. Gains' defaults and errors over joints of both kinds are converted with it.
pub const LEVER_ARM: f64 = 0.1;

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
    /// A closed triangle mesh: OBJ, STL or PLY by the file's extension. `scale` multiplies its coordinates (0.001 for
    /// millimetres), `centre` is then added (m).
    Mesh {
        /// Relative to the scene file's folder when the scene names it so; ready to open here.
        file: PathBuf,
        /// (1)
        scale: f64,
        /// (m)
        centre: DVec3,
        /// Mean edge to which the surface is refined, where it is (m).
        refine: Option<f64>,
    },
    /// The tetrahedra of a Gmsh file, whose surface is touched; otherwise as `Mesh`.
    Tetrahedra {
        /// See `Mesh`.
        file: PathBuf,
        /// (1)
        scale: f64,
        /// (m)
        centre: DVec3,
    },
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

/// A skin on the surface, per area: the same body on every mesh. At least one of the three is positive, none is
/// negative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkinSpec {
    /// Membrane tension T: resists a gradient of the displacement, in all directions alike (N/m).
    pub tension: f64,
    /// Bending stiffness b: resists a Laplacian of the displacement (N m).
    pub bending: f64,
    /// Foundation k: resists displacement (N/m^3).
    pub foundation: f64,
}

/// An isotropic, linearly elastic solid, homogeneous but for its inclusions.
#[derive(Clone, Debug, PartialEq)]
pub struct ElasticSpec {
    /// Young's modulus E (Pa).
    pub young: f64,
    /// Poisson's ratio nu, above -1 and below 1/2 (1).
    pub poisson: f64,
    /// Size of the cubes of the lattice that fills a surface; none where the shape is tetrahedra (m).
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
    /// The tetrahedra of a physical volume of the Gmsh file, by its number.
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringSpec {
    /// How each spring resists.
    pub kind: SpringKind,
    /// Stiffness of each spring (N/m).
    pub stiffness: f64,
}

/// How a spring resists a relative displacement d of its two ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
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
    /// Stiffness at each grounded node, in all directions alike (N/m).
    pub stiffness: f64,
    /// Which nodes it holds.
    pub nodes: GroundNodes,
}

/// Which nodes the ground holds.
#[derive(Clone, Debug, PartialEq)]
pub enum GroundNodes {
    /// Every node of the object.
    All,
    /// Nodes by number.
    Listed(Vec<u32>),
    /// Nodes whose rest position lies below this height z (m).
    Below(f64),
}

/// Most contact nodes of a chain: far more than a chain of six links needs, few enough for one per thread on a GPU.
pub const MAX_CONTACT_NODES: usize = 4096;

/// The multi-link virtual proxy: a serial chain of one to six joints.
#[derive(Clone, Debug, PartialEq)]
pub struct ProxySpec {
    /// From the base outwards.
    pub joints: Vec<JointSpec>,
}

/// One joint and the link that it moves.
#[derive(Clone, Debug, PartialEq)]
pub struct JointSpec {
    /// For axes of figures and columns of exports.
    pub name: String,
    /// Turning or sliding.
    pub kind: JointKind,
    /// Joint frame's origin in the parent link's frame at q = 0 (m); all frames are parallel to the world at q = 0.
    pub origin: DVec3,
    /// Axis of rotation or translation in the joint's frame; a unit vector after validation.
    pub axis: DVec3,
    /// Least and greatest joint coordinate (rad or m).
    pub limits: [f64; 2],
    /// Mass of the link (kg).
    pub mass: f64,
    /// Centre of mass in the link's frame (m).
    pub centre_of_mass: DVec3,
    /// Inertia about the centre of mass, along the link frame's axes, symmetric and positive semidefinite (kg m^2).
    pub inertia: DMat3,
    /// Reflected inertia of the actuator about the joint, positive, so that the chain's inertia is positive definite in
    /// every configuration (kg m^2 or kg).
    pub rotor_inertia: f64,
    /// Contact nodes of this link, in the link's frame.
    pub nodes: Vec<ProxyNodeSpec>,
}

/// How a joint moves its link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// Turns about its axis; its coordinate is an angle (rad).
    Revolute,
    /// Slides along its axis; its coordinate is a length (m).
    Prismatic,
}

impl JointKind {
    /// Unit of its coordinate.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Revolute => "rad",
            Self::Prismatic => "m",
        }
    }

    /// Unit of the torque, or force, that acts along it.
    #[must_use]
    pub fn effort_unit(self) -> &'static str {
        super::effort_unit(self.unit())
    }
}

/// A contact node of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProxyNodeSpec {
    /// In the link's frame (m).
    pub position: DVec3,
    /// Zero for the paper's point nodes (m).
    pub radius: f64,
    /// Length of the link that the node stands for; zero for a node by itself (m).
    pub length: f64,
}

/// Equation (2) and how it is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSpec {
    /// Contact stiffness: of one spring Kc between a proxy node and an object node; the energy form's stiffness at a
    /// contact point is kc = 3 Kc (three nodes of a triangle). Infinity is rigid contact. Where the scene gives a
    /// stiffness per length instead, that of a node that stands for the mean length; [`ContactSpec::node_stiffness`]
    /// gives each node's own (N/m).
    pub stiffness: f64,
    /// Contact stiffness of a link per length of it, in the energy form, where the scene gives that (N/m^2).
    pub stiffness_per_length: Option<f64>,
    /// How equation (2) is solved.
    pub algorithm: Algorithm,
    /// Relative residual at which a configuration counts as converged (1).
    pub tolerance: f64,
    /// After as many a configuration that has not converged is flagged.
    pub max_iterations: u32,
    /// Which surface the proxy feels.
    pub surface: ContactSurface,
}

/// Which surface of a mesh the proxy feels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContactSurface {
    /// The triangles.
    #[default]
    Facets,
    /// A smooth surface through the mesh's nodes: the limit of Loop's subdivision.
    Smooth,
}

impl ContactSpec {
    /// The surface that the algorithm feels: the paper's iteration is defined on facets.
    #[must_use]
    pub fn felt_surface(&self) -> ContactSurface {
        if self.algorithm == Algorithm::Paper { ContactSurface::Facets } else { self.surface }
    }

    /// Returns Kc of a node that stands for `length` of a link (m), in (N/m): with a stiffness per length k' the third
    /// part of k' times the length, so that the contact point's kc = 3 Kc is k' times the length, and the whole link's
    /// does not depend on the number of its nodes.
    #[must_use]
    pub fn node_stiffness(&self, length: f64) -> f64 {
        match self.stiffness_per_length {
            Some(per_length) if length > 0.0 => per_length * length / 3.0,
            _ => self.stiffness,
        }
    }

    /// The same over [`ContactSpec::stiffness`] (1).
    #[must_use]
    pub fn share(&self, length: f64) -> f64 {
        if self.stiffness_per_length.is_some() { self.node_stiffness(length) / self.stiffness } else { 1.0 }
    }
}

/// How equation (2) is solved for one configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Algorithm {
    /// Minimum of the stored energy; geometry follows the deformation.
    Energy,
    /// The paper's four-step iteration (section 2.1).
    Paper,
    /// Minimum of the stored energy with depths and directions before the surface at rest: a convex problem, with one
    /// solution.
    Rest,
}

impl Algorithm {
    /// As the scene names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Energy => "energy",
            Self::Paper => "paper",
            Self::Rest => "rest",
        }
    }
}

/// The uniform grid over C-space.
#[derive(Clone, Debug, PartialEq)]
pub struct GridSpec {
    /// One per joint, in the chain's order; none where the scene leaves the grid out.
    pub axes: Vec<AxisSpec>,
}

/// Grid coordinates `start + k step`, `k < count`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisSpec {
    /// (rad or m)
    pub start: f64,
    /// Positive (rad or m).
    pub step: f64,
    /// At least 2.
    pub count: usize,
}

/// How far beyond an end a grid line may lie and still count, in steps (1): spacings such as pi/60 are written with a
/// handful of digits, and 1e-6 of a step changes no torque that is interpolated between lines.
pub const GRID_STEP_SLACK: f64 = 1e-6;

/// A grid line this fraction of a step outside the samples' range still lies on its end.
pub const GRID_LINE: f64 = 1e-9;

/// Threshold Ith of the contact index unless the scene names one (1): the paper's.
pub const THRESHOLD: f64 = 0.5;

/// Slope Ks of the boundary layer at a revolute joint unless the scene names one (N m/rad).
pub const BOUNDARY_SLOPE: f64 = 15.0;

/// The 1 kHz loop (section 3.1).
#[derive(Clone, Debug, PartialEq)]
pub struct HapticsSpec {
    /// Ticks per second (Hz).
    pub rate: f64,
    /// Contact where the interpolated contact index exceeds this, Ith (1).
    pub threshold: f64,
    /// How the torque is interpolated between grid points.
    pub interpolation: Interpolation,
    /// Slope Ks of the boundary layer at each joint (N m/rad).
    pub boundary_slope: JointVector,
    /// mu of the passivity condition Ks <= mu bv / T (1).
    pub passivity_factor: f64,
    /// Extra damping bv of the proxy at each joint (N m s/rad).
    pub proxy_damping: JointVector,
    /// Whether the scene leaves bv to the dataset, which raises it as far as passivity asks.
    pub proxy_damping_is_free: bool,
    /// Which inertia the proxy moves with.
    pub proxy_inertia: ProxyInertia,
    /// Stiffness Kvc of the virtual coupling at each joint (N m/rad).
    pub coupling_stiffness: JointVector,
    /// Damping Bvc of the virtual coupling at each joint (N m s/rad).
    pub coupling_damping: JointVector,
    /// Device damping bd at each joint (N m s/rad).
    pub device_damping: JointVector,
    /// Apparent inertia of the device at each joint (kg m^2).
    pub device_inertia: JointVector,
    /// Greatest torque of each joint, in size (N m).
    pub torque_limit: JointVector,
    /// Greatest rate of change of each joint's torque, in size (N m/s).
    pub torque_rate_limit: JointVector,
    /// Greatest speed of each joint of the device; what moves faster is taken for a fault of the device (rad/s).
    pub speed_limit: JointVector,
    /// Resolution of each joint's encoder; zero if not given (rad).
    pub encoder_step: JointVector,
    /// Dry friction of each joint of the device; zero if not given (N m).
    pub device_friction: JointVector,
    /// Effects of the tick beyond the paper's, if any.
    pub effects: HapticEffects,
    /// The hand that holds the device.
    pub hand: HandSpec,
}

/// Effects of the tick: each absent unless the scene names it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HapticEffects {
    /// Friction between the proxy and the object.
    pub friction: Option<FrictionSpec>,
    /// Damping along the contact normals.
    pub contact_damping: Option<ContactDampingSpec>,
    /// Force channels beside the spring and damper of the virtual coupling.
    pub four_channel: Option<FourChannelSpec>,
    /// Whether a passivity controller acts when the passivity observer is negative.
    pub passivity_control: bool,
}

impl HapticEffects {
    /// The first effect that acts at contacts, and so needs their forces: its key, and where the scene's text names it.
    #[must_use]
    pub fn at_contacts(&self) -> Option<(&'static str, &Range<usize>)> {
        let friction = self.friction.as_ref().map(|friction| ("friction", &friction.place));
        friction.or(self.contact_damping.as_ref().map(|damping| ("contact_damping", &damping.place)))
    }
}

/// Coulomb friction of elastic-plastic bristles, one at each proxy node in contact.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionSpec {
    /// Tangential over normal force while slipping (1).
    pub coefficient: f64,
    /// Tangential over normal force at which sticking ends; at least `coefficient` (1).
    pub static_coefficient: f64,
    /// Stiffness of a bristle: how fast friction builds up while sticking (N/m).
    pub stiffness: f64,
    /// Damping of a bristle while sticking (N s/m).
    pub damping: f64,
    /// Where the scene's text names it (bytes).
    pub place: Range<usize>,
}

/// Dampers along the normals of the contacts.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactDampingSpec {
    /// c of one contact (N s/m).
    pub damping: f64,
    /// Where the scene's text names it (bytes).
    pub place: Range<usize>,
}

/// Four-channel coupling (Lawrence 1993).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FourChannelSpec {
    /// C1 to C4 as shares of their ideal values Zs, 1, 1 and -Zm, from 0 to 1 (1).
    pub channels: [f64; 4],
    /// Time constant of the low-pass filter on accelerations and on the estimated force of the hand (s).
    pub filter: f64,
}

/// Which inertia the proxy moves with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ProxyInertia {
    /// That of the chain in the middle of the grid, everywhere.
    Constant,
    /// That of the chain in each configuration.
    Configuration,
}

/// How the torque is interpolated between grid points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Multilinear torque behind the boundary of the contact index (section 3.1).
    Linear,
    /// Minus the gradient of a smoothly interpolated energy: makes no energy around any loop.
    Potential,
    /// The equilibrium itself, solved beside the loop, and its tangent until the next one; where that is late, and in a
    /// dataset, `potential`.
    Direct,
}

impl Interpolation {
    /// All between the points of a grid, from the roughest on.
    pub const ALL: [Self; 2] = [Self::Linear, Self::Potential];

    /// The one of [`Interpolation::ALL`] by which a dataset answers where the scene names this one.
    #[must_use]
    pub fn in_a_dataset(self) -> Self {
        if self == Self::Direct { Self::Potential } else { self }
    }

    /// As the scene names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Potential => "potential",
            Self::Direct => "direct",
        }
    }
}

/// The simulated hand: a mass on the device, pulled along the motion by a spring and a damper at each joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandSpec {
    /// Between the motion and the hand (N m/rad).
    pub stiffness: JointVector,
    /// Between the motion and the hand (N m s/rad).
    pub damping: JointVector,
    /// Inertia of the hand itself, moving with the device (kg m^2).
    pub inertia: JointVector,
}

/// The graphics loop (section 3.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GraphicsSpec {
    /// Frames per second (Hz).
    pub rate: f64,
    /// Effects beyond the paper's.
    pub effects: GraphicsEffects,
}

/// Effects of the graphics loop: each absent unless the scene names it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GraphicsEffects {
    /// Acceleration of gravity on the object's nodes (m/s^2).
    pub gravity: Option<DVec3>,
    /// Springs stiffen with strain.
    pub stiffening: Option<StiffeningSpec>,
    /// Time constant of a low-pass filter on the contact forces that move the object (s).
    pub smoothing: Option<f64>,
    /// The object has no dynamics: n = n0 + C f.
    pub quasi_static: bool,
}

impl GraphicsEffects {
    /// The key of the first effect that the scene names.
    #[must_use]
    pub fn named(&self) -> Option<&'static str> {
        [
            ("gravity", self.gravity.is_some()),
            ("stiffening", self.stiffening.is_some()),
            ("smoothing", self.smoothing.is_some()),
            ("quasi_static", self.quasi_static),
        ]
        .into_iter()
        .find_map(|(key, is_named)| is_named.then_some(key))
    }
}

/// How springs stiffen with strain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StiffeningSpec {
    /// Stiffness at large strains over that at rest, kappa; more than 1 (1).
    pub factor: f64,
    /// Strain around which it rises, eps (1).
    pub strain: f64,
}

/// Named motions of the hand, as waypoints in C-space.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSpec {
    /// Approach, press into the object, release; empty where the scene has none.
    pub press: Vec<Waypoint>,
    /// Slide across the object in contact; empty where the scene has none.
    pub scrape: Vec<Waypoint>,
}

/// The hand passes `q` at `time`; between waypoints it moves along a smooth (minimum-jerk) path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Since the motion began (s).
    pub time: f64,
    /// Configuration (rad or m).
    pub q: JointVector,
}
