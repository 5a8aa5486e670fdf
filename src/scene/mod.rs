//! The scene file: what is haptized, with what, how finely, and how it is rendered.
//!
//! A scene is TOML. [`Scene::load`] parses it, fills defaults and validates every number; an error points at the
//! file, the line and the remedy. All quantities are SI: metres, radians, newtons, kilograms, seconds.

mod spec;

pub use spec::{
    Algorithm, AxisSpec, ContactSpec, GraphicsSpec, GridSpec, GroundNodes, GroundSpec, HandSpec, HapticsSpec,
    JointKind, JointSpec, MotionSpec, ObjectSpec, ProxyNodeSpec, ProxySpec, Shape, SpringKind, SpringSpec, Waypoint,
};

use std::path::PathBuf;

/// A whole scene, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Where it was read from; relative paths in it are relative to this file's folder.
    pub path: PathBuf,
    /// The text itself: stored in every dataset baked from it.
    pub text: String,
    /// For titles and lists.
    pub name: String,
    /// The deformable virtual object.
    pub object: ObjectSpec,
    /// The multi-link virtual proxy.
    pub proxy: ProxySpec,
    /// Equation (2) and how it is solved.
    pub contact: ContactSpec,
    /// Where in C-space it is solved.
    pub grid: GridSpec,
    /// The 1 kHz loop.
    pub haptics: HapticsSpec,
    /// The graphics loop. Absent: no graphics loop, and no contact forces are stored.
    pub graphics: Option<GraphicsSpec>,
    /// Motions to play.
    pub motion: MotionSpec,
}
