//! `[[proxy.joint]]`: the chain, link by link.

use super::GRID_LINE;
use super::check::Checker;
use super::inertia::positive_semidefinite;
use super::shape::ShapeTable;
use super::value::{KEY, Range, count, direction, finite, interval, not_negative, positive, vector};
use crate::MAX_JOINTS;
use crate::{
    Error,
    names::{counted, listed},
};
use glam::{DMat3, DVec3};
use serde::de::{Deserialize, Deserializer, Error as _};
use std::fmt;

/// Default reflected inertia of the actuator of a revolute joint, that of a desktop device (kg m^2).
const ROTOR_INERTIA: f64 = 1e-3;
/// The same of a prismatic joint (kg).
const ROTOR_MASS: f64 = 0.05;
/// Longest name, in characters, that still fits a figure's legend.
const MAX_NAME: usize = 40;

/// Most contact nodes of a chain: far more than a chain of six links needs, few enough for one per thread on a GPU.
pub const MAX_CONTACT_NODES: usize = 4096;

/// The multi-link virtual proxy: a serial chain of one to twelve joints, followers included.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProxySpec {
    /// Those that move independently, from the base outwards: a configuration q has one coordinate for each.
    pub joints: Vec<JointSpec>,
    /// Those that follow one of them, from the base outwards.
    pub followers: Vec<Follower>,
}

/// A joint of the chain that follows another.
#[derive(Clone, Debug, PartialEq)]
pub struct Follower {
    /// The joint, whose `follows` is given.
    pub spec: JointSpec,
    /// Number of the independent joint that it follows.
    pub leader: usize,
    /// Its place in the chain: the number of joints between it and the base.
    pub link: usize,
}

impl fmt::Display for Follower {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(Follows { joint, multiplier, offset }) = &self.spec.follows else { return Ok(()) };
        write!(f, "{} = {multiplier} {joint} + {offset} {}", self.spec.name, self.spec.kind.unit())
    }
}

/// How a joint follows another: its coordinate is the affine function `multiplier * q + offset` of that one's.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Follows {
    /// Name of the joint that it follows.
    pub joint: String,
    /// Factor on that one's coordinate, not zero (1, m/rad or rad/m).
    #[serde(default = "one", deserialize_with = "factor")]
    pub multiplier: f64,
    /// Coordinate where that one is at zero (rad or m).
    #[serde(default, deserialize_with = "finite")]
    pub offset: f64,
}

/// One joint and the link that it moves.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointSpec {
    /// For axes of figures and columns of exports.
    #[serde(default, deserialize_with = "name")]
    pub name: String,
    /// Turning or sliding.
    pub kind: JointKind,
    /// How it follows another joint, where it does not move independently.
    #[serde(default)]
    pub follows: Option<Follows>,
    /// Joint frame's origin in the parent link's frame at q = 0 (m); all frames are parallel to the world at q = 0.
    #[serde(default, deserialize_with = "vector")]
    pub origin: DVec3,
    /// Axis of rotation or translation in the joint's frame; a unit vector after validation.
    #[serde(deserialize_with = "direction")]
    pub axis: DVec3,
    /// Least and greatest joint coordinate (rad or m).
    #[serde(deserialize_with = "interval")]
    pub limits: [f64; 2],
    /// Mass of the link (kg).
    #[serde(default, deserialize_with = "not_negative")]
    pub mass: f64,
    /// Centre of mass in the link's frame (m).
    #[serde(default, deserialize_with = "vector")]
    pub centre_of_mass: DVec3,
    /// Inertia about the centre of mass, along the link frame's axes, symmetric and positive semidefinite (kg m^2).
    #[serde(default = "no_inertia", deserialize_with = "inertia")]
    pub inertia: DMat3,
    /// Reflected inertia of the actuator about the joint, positive where it moves independently, so that the chain's
    /// inertia is positive definite in every configuration (kg m^2 or kg).
    #[serde(default, deserialize_with = "positive")]
    pub rotor_inertia: f64,
    /// Contact nodes of this link, in the link's frame.
    #[serde(default, deserialize_with = "nodes")]
    pub nodes: Vec<ProxyNodeSpec>,
}

/// How a joint moves its link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
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

/// `[proxy]` as it is written.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProxyTable {
    joint: Vec<JointSpec>,
    #[serde(default)]
    pub shape: Vec<ShapeTable>,
}

impl ProxyTable {
    /// Takes the arm, and gives names and inertias to joints that the text gives none.
    pub fn check(&mut self, checker: &Checker<'_>) -> Result<ProxySpec, Error> {
        let mut joints = std::mem::take(&mut self.joint);
        let at = |message| Err(checker.at("proxy.joint", message));
        if joints.is_empty() || joints.len() > MAX_JOINTS {
            return at(format!("the proxy has {} joints: it must have 1 to {MAX_JOINTS}", joints.len()));
        }
        for number in 0..joints.len() {
            let (earlier, rest) = joints.split_at_mut(number);
            let Some(JointSpec { name, kind, follows, rotor_inertia, .. }) = rest.first_mut() else { break };
            if name.is_empty() {
                *name = format!("q{}", number + 1);
            }
            if *rotor_inertia == 0.0 && follows.is_none() {
                *rotor_inertia = if *kind == JointKind::Revolute { ROTOR_INERTIA } else { ROTOR_MASS };
            }
            if earlier.iter().any(|joint| joint.name == *name) {
                let message = format!("two joints are called {name:?}: give each its own name");
                return Err(checker.at(&format!("proxy.joint.{number}.name"), message));
            }
        }
        match joints.iter().map(|joint| joint.nodes.len()).sum() {
            0 => at("no link has contact nodes: give one of the joints a nodes list".into()),
            nodes if nodes > MAX_CONTACT_NODES => {
                at(format!("the proxy has {nodes} contact nodes: it may have at most {MAX_CONTACT_NODES}"))
            }
            _ => ProxySpec::new(joints)
                .map_err(|(number, why)| checker.at(&format!("proxy.joint.{number}.follows"), why)),
        }
    }
}

impl ProxySpec {
    /// The chain of `joints`, from the base outwards. The limits of followers narrow those of the joints they follow.
    ///
    /// # Errors
    /// The number of a joint and what is wrong, where it follows none that moves independently, or leaves that one no
    /// range.
    pub fn new(joints: Vec<JointSpec>) -> Result<Self, (usize, String)> {
        let follows = joints.iter().map(|joint| joint.follows.clone()).collect::<Vec<_>>();
        let numbered = joints.into_iter().enumerate();
        let (followers, independent): (Vec<_>, Vec<_>) = numbered.partition(|(number, _)| follows[*number].is_some());
        let mut joints: Vec<JointSpec> = independent.into_iter().map(|(_, joint)| joint).collect();
        let mut chain = Vec::new();
        for ((link, spec), Follows { joint, multiplier, offset }) in followers.into_iter().zip(follows.iter().flatten())
        {
            let Some(leader) = joints.iter().position(|other| other.name == *joint) else {
                let names: Vec<&String> = joints.iter().map(|joint| &joint.name).collect();
                let remedy = match names[..] {
                    [] => "let one joint follow none".into(),
                    _ => format!("name one of {}", listed(&names)),
                };
                return Err((link, format!("there is no joint {joint:?} that moves independently: {remedy}")));
            };
            let mut ends = spec.limits.map(|limit| (limit - offset) / multiplier);
            ends.sort_by(f64::total_cmp);
            let [least, greatest] = &mut joints[leader].limits;
            (*least, *greatest) = (least.max(ends[0]), greatest.min(ends[1]));
            if least >= greatest {
                let [low, high] = ends;
                let why = format!(
                    "its limits are met where {joint:?} is between {low} and {high}, out of that one's range: widen \
                     limits, or correct multiplier and offset"
                );
                return Err((link, why));
            }
            chain.push(Follower { spec, leader, link });
        }
        Ok(Self { joints, followers: chain })
    }

    /// All joints from the base outwards, each with the number of the independent one that moves it.
    #[must_use]
    pub fn links(&self) -> Vec<(usize, &JointSpec)> {
        let mut links: Vec<_> = self.joints.iter().enumerate().collect();
        for Follower { spec, leader, link } in &self.followers {
            links.insert((*link).min(links.len()), (*leader, spec));
        }
        links
    }

    /// Number of contact nodes of all links.
    #[must_use]
    pub fn contact_nodes(&self) -> usize {
        self.links().iter().map(|(_, joint)| joint.nodes.len()).sum()
    }
}

fn one() -> f64 {
    1.0
}

fn factor<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
    let factor: f64 = finite(value)?;
    let what = || D::Error::custom(format!("{KEY}is 0: a joint that does not move is part of the link before it"));
    (factor != 0.0).then_some(factor).ok_or_else(what)
}

/// Names become columns of tables and legends of figures.
fn name<'de, D: Deserializer<'de>>(value: D) -> Result<String, D::Error> {
    let name = String::deserialize(value)?;
    let fits = |c: char| c.is_alphanumeric() || matches!(c, ' ' | '_' | '-');
    if name.trim().is_empty() || name.chars().count() > MAX_NAME || !name.chars().all(fits) {
        let what = format!("{KEY}must be 1 to {MAX_NAME} letters, digits, spaces, _ or -");
        return Err(D::Error::custom(what));
    }
    Ok(name)
}

fn no_inertia() -> DMat3 {
    DMat3::ZERO
}

/// Reads moments, or moments and products, of inertia as a matrix (kg m^2).
fn inertia<'de, D: Deserializer<'de>>(value: D) -> Result<DMat3, D::Error> {
    let list = Range::Finite.list(value)?;
    let [xx, yy, zz, xy, xz, yz] = match list[..] {
        [xx, yy, zz] => [xx, yy, zz, 0.0, 0.0, 0.0],
        [xx, yy, zz, xy, xz, yz] => [xx, yy, zz, xy, xz, yz],
        _ => {
            return Err(D::Error::custom(format!(
                "{KEY}has {}: it is a list of three moments [xx, yy, zz], or of moments and products [xx, yy, \
                 zz, xy, xz, yz]",
                counted(list.len(), ["number", "numbers"])
            )));
        }
    };
    let message = "no body has this inertia, since its matrix has a negative eigenvalue: moments are zero or \
                   positive, and products of inertia are no larger than those moments allow";
    positive_semidefinite(DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]))
        .ok_or_else(|| D::Error::custom(message))
}

/// One node `at` a point, or nodes on the line `from` .. `to`, both ends included: `count` of them, or at most
/// `spacing` apart.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct NodesTable {
    #[serde(default, deserialize_with = "vector")]
    at: Option<DVec3>,
    #[serde(default, deserialize_with = "vector")]
    from: Option<DVec3>,
    #[serde(default, deserialize_with = "vector")]
    to: Option<DVec3>,
    #[serde(default, deserialize_with = "count::<2, MAX_CONTACT_NODES, _, _>")]
    count: Option<usize>,
    #[serde(default, deserialize_with = "positive")]
    spacing: Option<f64>,
    #[serde(default, deserialize_with = "not_negative")]
    radius: f64,
}

/// Reads the nodes of a link.
fn nodes<'de, D: Deserializer<'de>>(value: D) -> Result<Vec<ProxyNodeSpec>, D::Error> {
    #[derive(serde::Deserialize)]
    #[serde(try_from = "NodesTable")]
    struct Nodes(Vec<ProxyNodeSpec>);

    impl TryFrom<NodesTable> for Nodes {
        type Error = String;

        fn try_from(table: NodesTable) -> Result<Self, String> {
            table.nodes().map(Self)
        }
    }

    /// By way of a newtype, whose errors have the place of the entry.
    #[derive(serde::Deserialize)]
    struct Entry(Nodes);

    let entries = Vec::<Entry>::deserialize(value)?;
    Ok(entries.into_iter().flat_map(|Entry(Nodes(nodes))| nodes).collect())
}

impl NodesTable {
    fn nodes(self) -> Result<Vec<ProxyNodeSpec>, String> {
        let radius = self.radius;
        let (from, to, intervals) = match (self.at, self.from, self.to, self.count, self.spacing) {
            (Some(position), None, None, None, None) => {
                return Ok(vec![ProxyNodeSpec { position, radius, length: 0.0 }]);
            }
            (None, Some(from), Some(to), Some(count), None) => (from, to, count - 1),
            (None, Some(from), Some(to), None, Some(spacing)) => (from, to, intervals(from.distance(to), spacing)?),
            _ => {
                return Err(
                    "nodes need either { at = [x, y, z] } or { from = [x, y, z], to = [x, y, z] } with one of \
                            count = n and spacing = s, and may have a radius"
                        .into(),
                );
            }
        };
        let step = from.distance(to) / intervals as f64;
        let node = |k| ProxyNodeSpec {
            position: from.lerp(to, k as f64 / intervals as f64),
            radius,
            // The trapezoidal rule.
            length: if k == 0 || k == intervals { 0.5 * step } else { step },
        };
        Ok((0..=intervals).map(node).collect())
    }
}

/// Number of equal parts, each at most `spacing` long, of a line of `length` (m).
fn intervals(length: f64, spacing: f64) -> Result<usize, String> {
    let parts = (length / spacing - GRID_LINE).ceil().max(1.0);
    if parts >= MAX_CONTACT_NODES as f64 {
        return Err(format!(
            "spacing makes {parts:.0} parts of a line: a chain may have at most {MAX_CONTACT_NODES} nodes"
        ));
    }
    Ok(parts as usize)
}
