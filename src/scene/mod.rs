//! The scene file: what is haptized, with what, how finely, and how it is rendered.
//!
//! A scene is TOML. [`Scene::load`] parses it, fills defaults and validates every number; an error points at the
//! file, the line and the remedy. All quantities are SI: metres, radians, newtons, kilograms, seconds.

use crate::JointVector;
use glam::DVec3;
use serde::Deserialize;
use std::path::PathBuf;

/// A whole scene, validated.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Where it was read from; relative paths in it are relative to this file's folder.
    pub path: PathBuf,
    /// The text itself: stored in every dataset baked from it.
    pub text: String,
    pub name: String,
    pub object: ObjectSpec,
    pub proxy: ProxySpec,
    pub contact: ContactSpec,
    pub grid: GridSpec,
    pub haptics: HapticsSpec,
    /// Absent: no graphics loop, and no contact forces are stored.
    pub graphics: Option<GraphicsSpec>,
    pub motion: MotionSpec,
}

/// The deformable virtual object (section 2.1).
#[derive(Clone, Debug)]
pub struct ObjectSpec {
    pub shape: Shape,
    pub springs: SpringSpec,
    pub ground: GroundSpec,
    /// Mass of each node [kg].
    pub node_mass: f64,
    /// Damping of each node against the ground [N s/m].
    pub node_damping: f64,
}

/// Where the surface comes from.
#[derive(Clone, Debug)]
pub enum Shape {
    /// Two poles and `rings` rings of `segments` nodes on a sphere.
    Sphere { centre: DVec3, radius: f64, rings: usize, segments: usize },
    /// A closed triangle mesh: OBJ, STL or PLY by the file's extension. `scale` multiplies its coordinates (0.001 for
    /// millimetres), `centre` is then added [m].
    Mesh { file: PathBuf, scale: f64, centre: DVec3 },
}

/// Springs along the edges of the surface.
#[derive(Clone, Copy, Debug)]
pub struct SpringSpec {
    pub kind: SpringKind,
    /// Stiffness of each spring [N/m].
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
#[derive(Clone, Debug)]
pub struct GroundSpec {
    /// Stiffness at each grounded node, in all directions alike [N/m].
    pub stiffness: f64,
    pub nodes: GroundNodes,
}

/// Which nodes the ground holds.
#[derive(Clone, Debug)]
pub enum GroundNodes {
    All,
    /// Nodes by number.
    Listed(Vec<u32>),
    /// Nodes whose rest position lies below this height z [m].
    Below(f64),
}

/// The multi-link virtual proxy: a serial chain of one to six joints.
#[derive(Clone, Debug)]
pub struct ProxySpec {
    pub joints: Vec<JointSpec>,
}

/// One joint and the link that it moves.
#[derive(Clone, Debug)]
pub struct JointSpec {
    pub name: String,
    pub kind: JointKind,
    /// Joint frame's origin in the parent link's frame at q = 0 [m]; all frames are parallel to the world at q = 0.
    pub origin: DVec3,
    /// Axis of rotation or translation in the joint's frame; a unit vector after validation.
    pub axis: DVec3,
    /// Least and greatest joint coordinate [rad or m].
    pub limits: [f64; 2],
    /// Mass of the link [kg].
    pub mass: f64,
    /// Centre of mass in the link's frame [m].
    pub centre_of_mass: DVec3,
    /// Principal moments of inertia about the centre of mass, along the link frame's axes [kg m^2].
    pub inertia: DVec3,
    /// Reflected inertia of the actuator about the joint [kg m^2 or kg].
    pub rotor_inertia: f64,
    /// Contact nodes of this link, in the link's frame.
    pub nodes: Vec<ProxyNodeSpec>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    Revolute,
    Prismatic,
}

/// A contact node of a link.
#[derive(Clone, Copy, Debug)]
pub struct ProxyNodeSpec {
    /// In the link's frame [m].
    pub position: DVec3,
    /// Zero for the paper's point nodes [m].
    pub radius: f64,
}

/// Equation (2) and how it is solved.
#[derive(Clone, Copy, Debug)]
pub struct ContactSpec {
    /// Contact stiffness: of one spring Kc between a proxy node and an object node; the energy form's stiffness at a
    /// contact point is kc = 3 Kc (three nodes of a triangle) [N/m].
    pub stiffness: f64,
    pub algorithm: Algorithm,
    /// Relative residual at which a configuration counts as converged [1].
    pub tolerance: f64,
    pub max_iterations: u32,
}

/// How equation (2) is solved for one configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Algorithm {
    /// Minimum of the stored energy; geometry follows the deformation.
    Energy,
    /// The paper's four-step iteration (section 2.1).
    Paper,
    /// Minimum of the stored energy with the geometry frozen at rest.
    Linearised,
}

/// The uniform grid over C-space.
#[derive(Clone, Debug)]
pub struct GridSpec {
    /// One per joint, in the chain's order.
    pub axes: Vec<AxisSpec>,
}

/// Grid coordinates `start + k step`, `k < count`.
#[derive(Clone, Copy, Debug)]
pub struct AxisSpec {
    pub start: f64,
    pub step: f64,
    pub count: usize,
}

/// The 1 kHz loop (section 3.1).
#[derive(Clone, Debug)]
pub struct HapticsSpec {
    /// Ticks per second [Hz].
    pub rate: f64,
    /// Contact where the interpolated contact index exceeds this, Ith [1].
    pub threshold: f64,
    /// Slope Ks of the boundary layer [N m/rad].
    pub boundary_slope: f64,
    /// mu of the passivity condition Ks <= mu bv / T [1].
    pub passivity_factor: f64,
    /// Extra damping bv of the proxy [N m s/rad].
    pub proxy_damping: f64,
    /// Virtual coupling Kvc [N m/rad], Bvc [N m s/rad].
    pub coupling_stiffness: f64,
    pub coupling_damping: f64,
    /// Device damping bd [N m s/rad].
    pub device_damping: f64,
    /// Apparent inertia of the device at each joint [kg m^2].
    pub device_inertia: f64,
    /// Torque limit of each joint [N m], and its greatest rate of change [N m/s].
    pub torque_limit: f64,
    pub torque_rate_limit: f64,
    pub hand: HandSpec,
}

/// The simulated hand: a spring-damper that pulls the device along the motion.
#[derive(Clone, Copy, Debug)]
pub struct HandSpec {
    /// [N m/rad], [N m s/rad], [kg m^2] at each joint.
    pub stiffness: f64,
    pub damping: f64,
    pub inertia: f64,
}

/// The graphics loop (section 3.2).
#[derive(Clone, Copy, Debug)]
pub struct GraphicsSpec {
    /// Frames per second [Hz].
    pub rate: f64,
}

/// Named motions of the hand, as waypoints in C-space.
#[derive(Clone, Debug)]
pub struct MotionSpec {
    pub press: Vec<Waypoint>,
    pub scrape: Vec<Waypoint>,
}

/// The hand passes `q` at `time`; between waypoints it moves along a smooth (minimum-jerk) path.
#[derive(Clone, Copy, Debug)]
pub struct Waypoint {
    /// [s]
    pub time: f64,
    pub q: JointVector,
}
