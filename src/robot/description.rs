//! Links and joints of a robot, whatever the format of its file.

use super::document::{Source, read_text};
use super::{mjcf, urdf};
use crate::Error;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::{
    ops::Range,
    path::{Path, PathBuf},
};

/// A robot: links joined to a tree.
#[derive(Clone, Debug)]
pub struct Robot {
    /// The file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// As the file calls it.
    pub name: String,
    /// In the file's order.
    pub links: Vec<Link>,
    /// In the file's order; each link is the child of at most one.
    pub joints: Vec<Joint>,
}

/// A joint.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Each joint's own.
    pub name: String,
    /// Place in the file (B).
    pub span: Range<usize>,
    /// How it moves.
    pub kind: JointType,
    /// Number of the link that carries it.
    pub parent: usize,
    /// Number of the link that it moves.
    pub child: usize,
    /// From the joint's frame to the parent link's, at zero.
    pub origin: DAffine3,
    /// In the joint's frame; a unit vector.
    pub axis: DVec3,
    /// Whether the file's axis was not a unit vector.
    pub was_scaled: bool,
    /// Least and greatest coordinate; absent where the file gives none (rad or m).
    pub limits: Option<[f64; 2]>,
    /// Greatest torque, where the file gives it (N m or N).
    pub effort: Option<f64>,
    /// Greatest speed, where the file gives it (rad/s or m/s).
    pub velocity: Option<f64>,
    /// Inertia of its actuator as the joint feels it, where the file gives it (kg m^2 or kg).
    pub rotor_inertia: Option<f64>,
    /// How it follows another joint, where it does.
    pub mimic: Option<Mimic>,
}

/// How a joint follows another: its coordinate is an affine function of that one's.
#[derive(Clone, Debug, PartialEq)]
pub struct Mimic {
    /// Name of the joint that it follows.
    pub joint: String,
    /// Factor on that one's coordinate (1, m/rad or rad/m).
    pub multiplier: f64,
    /// Coordinate where that one is at zero (rad or m).
    pub offset: f64,
}

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointType {
    /// Not at all.
    Fixed,
    /// Turns between limits.
    Revolute,
    /// Turns without end.
    Continuous,
    /// Slides.
    Prismatic,
    /// Moves freely.
    Floating,
    /// Moves in a plane.
    Planar,
}

impl Robot {
    /// Reads the robot file at `path`. No mesh is opened.
    ///
    /// # Errors
    /// If the file cannot be read, or is neither URDF nor MJCF.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::parse(read_text(path)?, path)
    }

    /// Reads a robot from text; messages name `path`.
    ///
    /// # Errors
    /// If the text is neither URDF nor MJCF.
    pub fn parse(text: String, path: impl AsRef<Path>) -> Result<Self, Error> {
        let source = Source { path: path.as_ref(), text: &text };
        let document = source.parse()?;
        let root = document.root_element();
        let (name, (links, joints)) = match root.tag_name().name() {
            "robot" => ("name", urdf::read(&source, root)?),
            "mujoco" => ("model", mjcf::read(&source, root)?),
            other => {
                let message = format!(
                    "the root is <{other}>: only URDF (<robot>) and MJCF (<mujoco>) are read; convert SDF first"
                );
                return Err(source.error(root.range(), message));
            }
        };
        let name = root.attribute(name).unwrap_or("robot").to_owned();
        Ok(Self { path: path.as_ref().to_owned(), name, links, joints, text })
    }

    /// The text with its place, for messages.
    pub(super) fn source(&self) -> Source<'_> {
        Source { path: &self.path, text: &self.text }
    }
}

impl Joint {
    /// Returns a joint that does not move, between `[parent, child]`.
    pub(super) fn fixed(name: String, span: Range<usize>, [parent, child]: [usize; 2], origin: DAffine3) -> Self {
        Self {
            name,
            span,
            kind: JointType::Fixed,
            parent,
            child,
            origin,
            axis: DVec3::X,
            was_scaled: false,
            limits: None,
            effort: None,
            velocity: None,
            rotor_inertia: None,
            mimic: None,
        }
    }

    /// Returns the motion of its child where it has the coordinate `value` (rad or m); `None` if it has no coordinate,
    /// or more than one.
    #[must_use]
    pub fn motion(&self, value: f64) -> Option<DAffine3> {
        match self.kind {
            JointType::Revolute | JointType::Continuous => {
                Some(DAffine3::from_quat(DQuat::from_axis_angle(self.axis, value)))
            }
            JointType::Prismatic => Some(DAffine3::from_translation(value * self.axis)),
            JointType::Fixed | JointType::Floating | JointType::Planar => None,
        }
    }
}

impl Link {
    /// Returns a link without inertia and shapes.
    pub(super) fn empty(name: String, span: Range<usize>) -> Self {
        Self { name, span, inertial: None, shapes: Vec::new(), is_visual: false, left_out: Vec::new() }
    }
}

/// A link.
#[derive(Clone, Debug)]
pub struct Link {
    /// Each link's own.
    pub name: String,
    /// Place in the file (B).
    pub span: Range<usize>,
    /// Absent if the file gives none.
    pub inertial: Option<Inertial>,
    /// Collision shapes; visual ones if there are none.
    pub shapes: Vec<Placed>,
    /// Whether `shapes` are visual ones.
    pub is_visual: bool,
    /// What of it is left out: places in the file (B), and why.
    pub left_out: Vec<(Range<usize>, String)>,
}

/// Mass and inertia of a link.
#[derive(Clone, Copy, Debug)]
pub struct Inertial {
    /// (kg)
    pub mass: f64,
    /// Centre of mass in the link's frame (m).
    pub centre: DVec3,
    /// Inertia about the centre of mass, along the axes of the link's frame (kg m^2).
    pub inertia: DMat3,
}

/// A shape of a link.
#[derive(Clone, Debug)]
pub struct Placed {
    /// From the shape's frame to the link's.
    pub place: DAffine3,
    /// Its form.
    pub geometry: Geometry,
    /// Place in the file (B).
    pub span: Range<usize>,
}

/// Form of a shape, about its origin.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// Edges along the axes (m).
    Box(DVec3),
    /// Along z.
    Cylinder {
        /// (m)
        radius: f64,
        /// (m)
        length: f64,
    },
    /// By its radius (m).
    Sphere(f64),
    /// Along z, with half a sphere at each end.
    Capsule {
        /// (m)
        radius: f64,
        /// Between the middles of its spheres (m).
        length: f64,
    },
    /// A mesh file.
    Mesh {
        /// As the file names it.
        file: String,
        /// Factors on its coordinates (1).
        scale: DVec3,
    },
}
