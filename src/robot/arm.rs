//! The chain from the root to a tip link, in the frames that scenes use.
//!
//! At q = 0 a scene's link frames are parallel to the world, each with its origin at its joint. So with the pose (R, p)
//! of joint frame i in the root's frame at q = 0, the scene has origin_i = p_i - p_(i-1), axis_i = R_i axis, and a
//! point x of a link that is placed at (S, s) is at s + S x - p_i. What fixed and locked joints carry belongs to the
//! last moving joint before them, branches beside the chain included.

use super::group::Group;
use super::{Inertial, Joint, JointType, Mimic, Placed, Robot};
use crate::Error;
use crate::MAX_JOINTS;
use crate::names::listed;
use crate::scene::JointKind;
use glam::{DAffine3, DVec3};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// A joint that is held.
#[derive(Clone, Debug, PartialEq)]
pub struct Lock {
    /// Its name.
    pub joint: String,
    /// Where (rad or m).
    pub value: f64,
}

/// The chain from the root to the tip.
#[derive(Clone, Debug)]
pub struct Arm {
    /// Links that do not move.
    pub base: Vec<String>,
    /// Their shapes, in the root's frame.
    pub base_shapes: Vec<Placed>,
    /// From the base outwards.
    pub joints: Vec<ArmJoint>,
    /// Parts left out or assumed.
    pub notes: Vec<Note>,
}

/// A part that was left out of a robot file or assumed beyond it, for the user to read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// Line of the file, from 1.
    pub line: usize,
    /// One sentence.
    pub message: String,
}

/// A moving joint, and all that moves with it before the next.
#[derive(Clone, Debug)]
pub struct ArmJoint {
    /// As the file calls it.
    pub name: String,
    /// Turning or sliding.
    pub kind: JointKind,
    /// How it follows another joint of the chain, where it does.
    pub follows: Option<Mimic>,
    /// In the frame of the joint before, parallel to the world at q = 0 (m).
    pub origin: DVec3,
    /// Unit vector, parallel to the world at q = 0.
    pub axis: DVec3,
    /// Least and greatest coordinate (rad or m).
    pub limits: [f64; 2],
    /// Greatest torque, where the file gives it (N m or N).
    pub effort: Option<f64>,
    /// Greatest speed, where the file gives it (rad/s or m/s).
    pub velocity: Option<f64>,
    /// Inertia of its actuator as the joint feels it, where the file gives it (kg m^2 or kg).
    pub rotor_inertia: Option<f64>,
    /// Links that move with it.
    pub links: Vec<String>,
    /// Inertia of all of these together, in the joint's frame.
    pub inertial: Inertial,
    /// Their shapes, in the joint's frame.
    pub shapes: Vec<Placed>,
}

impl Arm {
    /// Returns the chain of `robot` to the link `tip`, joints of `locks` held.
    ///
    /// # Errors
    /// If `tip` or a lock names nothing, a lock is outside its limits, there are more than twelve joints or none, or a
    /// joint on the way is one that a scene does not have.
    pub fn new(robot: &Robot, tip: &str, locks: &[Lock]) -> Result<Self, Error> {
        let held = held(robot, locks)?;
        let way = way(robot, tip)?;
        let moving: Vec<&str> = way
            .iter()
            .filter(|number| !held.contains_key(*number))
            .map(|&number| robot.joints[number].name.as_str())
            .collect();
        if moving.is_empty() || moving.len() > MAX_JOINTS {
            let message = match moving.len() {
                0 => format!("no joint moves link {tip:?}: name a tip farther out"),
                count => format!(
                    "the chain to {tip:?} has {count} moving joints, {}: a scene takes {MAX_JOINTS}; hold some with \
                     --lock JOINT=VALUE",
                    moving.join(", ")
                ),
            };
            return Err(Error::at(&robot.path, message));
        }
        let mut builder = Builder { robot, held: &held, way: &way, children: children(robot), notes: Vec::new() };
        let root = way.first().map_or(0, |&number| robot.joints[number].parent);
        let base = builder.gather(root, DAffine3::IDENTITY);
        let (mut place, mut before) = (DAffine3::IDENTITY, DVec3::ZERO);
        let mut joints = Vec::new();
        for &number in &way {
            let joint = &robot.joints[number];
            place *= joint.origin;
            if let Some(motion) = held.get(&number) {
                place *= *motion;
                continue;
            }
            let (kind, limits) = builder.movement(joint)?;
            let group = builder.gather(joint.child, place).about(place.translation);
            builder.note_gaps(joint, &group);
            joints.push(ArmJoint {
                name: joint.name.clone(),
                kind,
                follows: builder.follows(number)?,
                origin: place.translation - before,
                axis: (place.matrix3 * joint.axis).normalize_or(joint.axis),
                limits,
                effort: joint.effort.filter(|effort| *effort > 0.0),
                velocity: joint.velocity.filter(|velocity| *velocity > 0.0),
                rotor_inertia: joint.rotor_inertia,
                links: group.names(robot),
                inertial: group.inertial(),
                shapes: group.shapes,
            });
            before = place.translation;
        }
        Ok(Self { base: base.names(robot), base_shapes: base.shapes, joints, notes: builder.notes })
    }
}

/// Motions of the joints that do not move: identity if fixed, that of its value if locked or if it follows a locked one,
/// or one by no multiple.
fn held(robot: &Robot, locks: &[Lock]) -> Result<HashMap<usize, DAffine3>, Error> {
    let fixed = || robot.joints.iter().enumerate().filter(|(_, joint)| joint.kind == JointType::Fixed);
    let mut held: HashMap<usize, DAffine3> = fixed().map(|(number, _)| (number, DAffine3::IDENTITY)).collect();
    let mut values: HashMap<&str, f64> = fixed().map(|(_, joint)| (joint.name.as_str(), 0.0)).collect();
    for Lock { joint: name, value } in locks {
        let refuse = |message: String| Err(Error::at(&robot.path, message));
        let Some(number) = robot.joints.iter().position(|joint| joint.name == *name) else {
            let joints = robot.joints.iter().filter(|joint| joint.kind != JointType::Fixed);
            let names: Vec<&str> = joints.map(|joint| joint.name.as_str()).collect();
            return refuse(format!("there is no joint {name:?} to lock: {}", listed(&names)));
        };
        let joint = &robot.joints[number];
        let within = |[lower, upper]: [f64; 2]| *value >= lower && *value <= upper;
        if let Some([lower, upper]) =
            joint.limits.filter(|limits| joint.kind != JointType::Continuous && !within(*limits))
        {
            return refuse(format!("joint {name:?} cannot be locked at {value}: its limits are {lower} and {upper}"));
        }
        let Some(motion) = joint.motion(*value) else {
            return refuse(match joint.kind {
                JointType::Fixed => format!("joint {name:?} is fixed already: leave out its --lock"),
                _ => format!("joint {name:?} has more than one coordinate: make it fixed in the file"),
            });
        };
        if held.insert(number, motion).is_some() {
            return refuse(format!("joint {name:?} is locked twice: keep one --lock"));
        }
        values.insert(name, *value);
    }
    // A joint may follow one that follows another: each round goes one farther.
    loop {
        let before = held.len();
        for (number, joint) in robot.joints.iter().enumerate().filter(|(_, joint)| joint.mimic.is_some()) {
            let value = joint.mimic.as_ref().and_then(|Mimic { joint, multiplier, offset }| {
                let leader = values.get(joint.as_str()).copied().or((*multiplier == 0.0).then_some(0.0));
                leader.map(|value| multiplier * value + offset)
            });
            let motion = value.and_then(|value| Some((value, joint.motion(value)?)));
            if let (Some((value, motion)), false) = (motion, held.contains_key(&number)) {
                held.insert(number, motion);
                values.insert(&joint.name, value);
            }
        }
        if held.len() == before {
            return Ok(held);
        }
    }
}

/// Joints from the root to the link `tip`.
fn way(robot: &Robot, tip: &str) -> Result<Vec<usize>, Error> {
    let Some(mut link) = robot.links.iter().position(|link| link.name == tip) else {
        let parents: std::collections::HashSet<usize> = robot.joints.iter().map(|joint| joint.parent).collect();
        let ends: Vec<_> = robot.links.iter().enumerate().filter(|(number, _)| !parents.contains(number)).collect();
        let known = if robot.links.is_empty() {
            "the robot has no links at all: give a file that describes one".into()
        } else if ends.is_empty() {
            "no chain ends, for its joints form a circle: a robot is a tree; remove one of them".into()
        } else {
            format!("chains end at {}", listed(&ends.iter().map(|(_, link)| &link.name).collect::<Vec<_>>()))
        };
        let message = format!("there is no link {tip:?}; {known}");
        return Err(Error::at(&robot.path, message));
    };
    let movers: HashMap<usize, usize> =
        robot.joints.iter().enumerate().map(|(number, joint)| (joint.child, number)).collect();
    let mut way = Vec::new();
    while let Some(&number) = movers.get(&link) {
        let joint = &robot.joints[number];
        if way.len() == robot.joints.len() {
            let message =
                format!("joint {:?} belongs to a circle of joints: a robot is a tree; remove one of them", joint.name);
            return Err(robot.source().error(joint.span.clone(), message));
        }
        way.push(number);
        link = joint.parent;
    }
    way.reverse();
    Ok(way)
}

/// Least range of a joint (rad or m): ten times the digits with which a scene shows its grid.
const LEAST_RANGE: f64 = 1e-4;

/// Most notes on a robot: more than anybody reads, and each counts the lines before its own.
const MOST_NOTES: usize = 200;

/// Joints that each link carries.
fn children(robot: &Robot) -> Vec<Vec<usize>> {
    let mut children = vec![Vec::new(); robot.links.len()];
    for (number, joint) in robot.joints.iter().enumerate() {
        children[joint.parent].push(number);
    }
    children
}

struct Builder<'a> {
    robot: &'a Robot,
    held: &'a HashMap<usize, DAffine3>,
    way: &'a [usize],
    children: Vec<Vec<usize>>,
    notes: Vec<Note>,
}

impl Builder<'_> {
    fn note(&mut self, span: &std::ops::Range<usize>, message: String) {
        if self.notes.len() < MOST_NOTES {
            self.notes.push(Note { line: self.robot.source().line(span.start), message });
        } else if self.notes.len() == MOST_NOTES {
            let message = format!("there is more to note than these {MOST_NOTES} lines, which are all that are told");
            self.notes.push(Note { line: self.robot.source().line(span.start), message });
        }
    }

    /// Returns all that does not move against `link`, which is at `place` in the root's frame.
    fn gather(&mut self, link: usize, place: DAffine3) -> Group {
        let mut group = Group::default();
        let mut open = vec![(link, place)];
        while let Some((link, place)) = open.pop() {
            group.add(link, &self.robot.links[link], place);
            for number in self.children[link].clone() {
                let joint = &self.robot.joints[number];
                if let Some(motion) = self.held.get(&number) {
                    open.push((joint.child, place * joint.origin * *motion));
                } else if self.notes.len() <= MOST_NOTES && !self.way.contains(&number) {
                    let message = format!(
                        "joint {:?} moves beside the chain: link {:?} and what it carries are left out; --lock \
                         {}=VALUE keeps them",
                        joint.name, self.robot.links[joint.child].name, joint.name
                    );
                    self.note(&joint.span, message);
                }
            }
        }
        group
    }

    /// Returns how joint `number` follows another of the chain: the one that it names, or where that is not in the chain,
    /// the first that follows it, too.
    fn follows(&mut self, number: usize) -> Result<Option<Mimic>, Error> {
        let joint = &self.robot.joints[number];
        let Some(Mimic { joint: named, .. }) = &joint.mimic else { return Ok(None) };
        let moving = self.way.iter().filter(|number| !self.held.contains_key(number));
        let roots = moving.map(|&number| Ok((number, self.root(number)?))).collect::<Result<Vec<_>, Error>>()?;
        let own = self.root(number)?;
        let mut fellows = roots.iter().filter(|(_, other)| other.joint == own.joint);
        let is_root = |(other, _): &&(usize, Mimic)| self.robot.joints[*other].name == own.joint;
        let leader = fellows.clone().find(is_root).or_else(|| fellows.next());
        Ok(match leader {
            Some((other, of_leader)) if *other != number => {
                let multiplier = own.multiplier / of_leader.multiplier;
                let offset = own.offset - multiplier * of_leader.offset;
                Some(Mimic { joint: self.robot.joints[*other].name.clone(), multiplier, offset })
            }
            _ => {
                let message = format!(
                    "joint {:?} follows {named:?} (mimic), which is not in the chain: it moves by itself in the scene",
                    joint.name
                );
                self.note(&joint.span, message);
                None
            }
        })
    }

    /// Returns how joint `number` follows the one that follows no other, itself where it does not.
    fn root(&self, number: usize) -> Result<Mimic, Error> {
        let mut joint = &self.robot.joints[number];
        let (mut multiplier, mut offset) = (1.0, 0.0);
        for _ in &self.robot.joints {
            let Some(mimic) = &joint.mimic else { break };
            offset += multiplier * mimic.offset;
            multiplier *= mimic.multiplier;
            let leader = self.robot.joints.iter().find(|other| other.name == mimic.joint);
            let Some(leader) = leader else {
                return Ok(Mimic { joint: mimic.joint.clone(), multiplier, offset });
            };
            joint = leader;
        }
        if joint.mimic.is_some() {
            let message = format!("joint {:?} follows itself (mimic): remove one <mimic>", joint.name);
            return Err(self.robot.source().error(joint.span.clone(), message));
        }
        Ok(Mimic { joint: joint.name.clone(), multiplier, offset })
    }

    /// Returns kind and limits of a joint of the chain.
    fn movement(&mut self, joint: &Joint) -> Result<(JointKind, [f64; 2]), Error> {
        let name = &joint.name;
        let refuse = |message: String| Err(self.robot.source().error(joint.span.clone(), message));
        let kind = match joint.kind {
            JointType::Prismatic => JointKind::Prismatic,
            JointType::Floating | JointType::Planar => {
                let kind = if joint.kind == JointType::Planar { "planar" } else { "floating" };
                return refuse(format!(
                    "joint {name:?} is {kind}, and the joints of a scene turn or slide: make it fixed, or write it as \
                     such joints"
                ));
            }
            JointType::Fixed | JointType::Revolute | JointType::Continuous => JointKind::Revolute,
        };
        let limits = match joint.limits {
            _ if joint.kind == JointType::Continuous => [-PI, PI],
            Some([lower, upper]) if upper - lower >= LEAST_RANGE => [lower, upper],
            Some([lower, upper]) => {
                return refuse(format!(
                    "joint {name:?} moves from {lower} to {upper}: the lower limit must be less than the upper, by \
                     {LEAST_RANGE} or more"
                ));
            }
            None => {
                return refuse(format!(
                    "joint {name:?} has no limits: add <limit lower=\"..\" upper=\"..\"/>, in MJCF range=\"..\""
                ));
            }
        };
        if joint.kind == JointType::Continuous {
            self.note(&joint.span, format!("joint {name:?} turns without end: its limits in the scene are -pi and pi"));
        } else if kind == JointKind::Revolute && limits[1] - limits[0] > TAU {
            let message = format!(
                "joint {name:?} turns by more than a revolution: angles a revolution apart are different configurations"
            );
            self.note(&joint.span, message);
        }
        if joint.was_scaled {
            self.note(&joint.span, format!("the axis of joint {name:?} is no unit vector: its direction is taken"));
        }
        Ok((kind, limits))
    }

    /// Notes what the links that `joint` moves lack.
    fn note_gaps(&mut self, joint: &Joint, group: &Group) {
        if group.inertial().mass == 0.0 {
            let message = format!(
                "nothing that joint {:?} moves has an <inertial> with a mass: the scene gives it none",
                joint.name
            );
            self.note(&joint.span, message);
        }
        if group.shapes.is_empty() {
            let message = format!("nothing that joint {:?} moves has a shape: it gets no contact nodes", joint.name);
            self.note(&joint.span, message);
        }
        for &link in &group.links {
            let link = &self.robot.links[link];
            if link.is_visual && !link.shapes.is_empty() {
                self.note(&link.span, format!("link {:?} has no <collision>: its <visual> shapes are used", link.name));
            }
            for (span, reason) in &link.left_out {
                self.note(span, format!("link {:?}: {reason}", link.name));
            }
            if link.inertial.is_none() && !link.shapes.is_empty() && group.inertial().mass > 0.0 {
                self.note(&link.span, format!("link {:?} has no <inertial>: it counts as massless", link.name));
            }
        }
    }
}
