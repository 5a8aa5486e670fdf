//! Links and joints as the file has them.

use super::document::{Source, child, read_text};
use super::{Link, link};
use crate::Error;
use glam::{DAffine3, DVec3};
use roxmltree::Node;
use std::{
    collections::{HashMap, HashSet},
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

impl JointType {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "fixed" => Self::Fixed,
            "revolute" => Self::Revolute,
            "continuous" => Self::Continuous,
            "prismatic" => Self::Prismatic,
            "floating" => Self::Floating,
            "planar" => Self::Planar,
            _ => return None,
        })
    }
}

impl Robot {
    /// Reads the robot file at `path`. No mesh is opened.
    ///
    /// # Errors
    /// If the file cannot be read, or is no URDF.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::parse(read_text(path)?, path)
    }

    /// Reads a robot from text; messages name `path`.
    ///
    /// # Errors
    /// If the text is no URDF.
    pub fn parse(text: String, path: impl AsRef<Path>) -> Result<Self, Error> {
        let source = Source { path: path.as_ref(), text: &text };
        let document = source.parse()?;
        let root = document.root_element();
        if root.tag_name().name() != "robot" {
            let other = root.tag_name().name();
            let message = format!("the root is <{other}>, not <robot>: only URDF is read (convert MJCF or SDF first)");
            return Err(source.error(root.range(), message));
        }
        let elements = |name: &'static str| {
            root.children().filter(move |child| child.is_element() && child.tag_name().name() == name)
        };
        let mut links: Vec<Link> = Vec::new();
        let mut numbers = HashMap::new();
        for element in elements("link") {
            let link = link::read(&source, element)?;
            if numbers.insert(link.name.clone(), links.len()).is_some() {
                let message = format!("two links are called {:?}: give each its own name", link.name);
                return Err(source.error(element.range(), message));
            }
            links.push(link);
        }
        let mut joints: Vec<Joint> = Vec::new();
        let (mut names, mut movers) = (HashSet::new(), HashMap::new());
        for element in elements("joint") {
            let joint = joint(&source, element, &numbers)?;
            let refuse = |message: String| Err(source.error(element.range(), message));
            if !names.insert(joint.name.clone()) {
                return refuse(format!("two joints are called {:?}: give each its own name", joint.name));
            }
            if let Some(earlier) = movers.insert(joint.child, element.range().start) {
                let (link, line) = (&links[joint.child].name, source.line(earlier));
                return refuse(format!(
                    "link {link:?} is the child of the joint on line {line} already: a URDF is a tree; remove one of \
                     them"
                ));
            }
            joints.push(joint);
        }
        let mut roots = links.iter().enumerate().filter(|(number, _)| !movers.contains_key(number));
        if let (Some((_, first)), Some((_, second))) = (roots.next(), roots.next()) {
            let message = format!(
                "links {:?} and {:?} are both the child of no joint: a URDF is a tree with one root; join them with a \
                 fixed joint, or remove one",
                first.name, second.name
            );
            return Err(source.error(second.span.clone(), message));
        }
        let name = root.attribute("name").unwrap_or("robot").to_owned();
        Ok(Self { path: path.as_ref().to_owned(), name, links, joints, text })
    }

    /// The text with its place, for messages.
    pub(super) fn source(&self) -> Source<'_> {
        Source { path: &self.path, text: &self.text }
    }
}

fn mimic(source: &Source<'_>, node: Node<'_, '_>) -> Result<Mimic, Error> {
    Ok(Mimic {
        joint: source.required(node, "joint")?.to_owned(),
        multiplier: source.number(node, "multiplier")?.unwrap_or(1.0),
        offset: source.number(node, "offset")?.unwrap_or(0.0),
    })
}

fn joint(source: &Source<'_>, node: Node<'_, '_>, links: &HashMap<String, usize>) -> Result<Joint, Error> {
    let name = source.required(node, "name")?.to_owned();
    let kind = source.required(node, "type")?;
    let kind = JointType::named(kind).ok_or_else(|| {
        let message =
            format!("{kind:?} is no type of joint: it is revolute, continuous, prismatic, fixed, floating or planar");
        source.error(node.range(), message)
    })?;
    let link = |end: &str| {
        let message = format!("joint {name:?} needs <{end} link=\"..\"/>");
        let element = child(node, end).ok_or_else(|| source.error(node.range(), message))?;
        let link = source.required(element, "link")?;
        links.get(link).copied().ok_or_else(|| {
            let message = format!("there is no link {link:?}: add it, or name another");
            source.error(element.range(), message)
        })
    };
    let direction = child(node, "axis").map(|axis| source.vector(axis, "xyz")).transpose()?.flatten();
    let direction = direction.unwrap_or(DVec3::X);
    let moves = !matches!(kind, JointType::Fixed | JointType::Floating);
    let axis = match direction.try_normalize() {
        Some(axis) => axis,
        None if !moves => DVec3::X,
        None => {
            return Err(source.error(node.range(), format!("joint {name:?} has the axis zero: give it a direction")));
        }
    };
    let limit = child(node, "limit");
    let number = |name: &str| limit.map_or(Ok(None), |limit| source.number(limit, name));
    let limits = match (number("lower")?, number("upper")?) {
        (None, None) => None,
        // What is not given is zero.
        (lower, upper) => Some([lower.unwrap_or(0.0), upper.unwrap_or(0.0)]),
    };
    Ok(Joint {
        kind,
        parent: link("parent")?,
        child: link("child")?,
        origin: link::origin(source, node)?,
        axis,
        // The rounding of axes that were printed with six digits.
        was_scaled: moves && (direction.length() - 1.0).abs() > 1e-5,
        limits,
        effort: number("effort")?,
        velocity: number("velocity")?,
        mimic: child(node, "mimic").map(|node| mimic(source, node)).transpose()?,
        span: node.range(),
        name,
    })
}
