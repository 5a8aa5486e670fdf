//! Robots from MJCF, MuJoCo's description of models (MuJoCo 3 documentation, "XML Reference").
//!
//! A body is a link. Of several joints of a body, each but the last moves a link of no size. A link's frame has its
//! origin at its joint, which MJCF puts anywhere in the body. Read are bodies, frames, joints, geoms, meshes, inertias,
//! default classes, the compiler's angles, folders and orders of turns, and joints that an equality couples.

use super::description::{Geometry, Inertial, Joint, JointType, Link, Mimic, Placed};
use super::document::{Source, child};
use super::urdf::inertia;
use crate::Error;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};
use std::f64::consts::PI;

/// Name of the default class that holds for all.
const MAIN: &str = "main";

/// What stands before names of links and of joints where they are held against others of their kind.
const LINK: &str = "link/";
const JOINT: &str = "joint/";

/// Most names that are made of one: no file has as many bodies.
const MOST_NUMBERED: usize = 1 << 20;

/// Links and joints of the model in `root`.
pub(super) fn read(source: &Source<'_>, root: Node<'_, '_>) -> Result<(Vec<Link>, Vec<Joint>), Error> {
    if let Some(include) = root.descendants().find(|node| node.has_tag_name("include")) {
        let message = "included files are not read: give the file that holds the bodies, or the whole model as MuJoCo \
                       saves it (mj_saveLastXML)";
        return Err(source.error(include.range(), message));
    }
    let mut reader = Reader {
        source,
        classes: HashMap::new(),
        compiler: Compiler::default(),
        meshes: HashMap::new(),
        links: Vec::new(),
        joints: Vec::new(),
        names: HashSet::new(),
        references: HashMap::new(),
    };
    elements(root, "compiler").try_for_each(|compiler| reader.compiler.read(source, compiler))?;
    elements(root, "default").for_each(|default| reader.add_classes(default));
    for mesh in elements(root, "asset").flat_map(|asset| elements(asset, "mesh")) {
        reader.add_mesh(mesh)?;
    }
    let world = child(root, "worldbody").ok_or_else(|| {
        source.error(root.range(), "the model has no <worldbody>: give the file that holds the bodies")
    })?;
    reader.add_bodies(world)?;
    for equality in elements(root, "equality").flat_map(|equality| elements(equality, "joint")) {
        reader.couple(equality)?;
    }
    Ok((reader.links, reader.joints))
}

/// The child elements of that name.
fn elements<'a, 'i, 'n>(node: Node<'a, 'i>, name: &'n str) -> impl Iterator<Item = Node<'a, 'i>> + use<'a, 'i, 'n> {
    node.children().filter(move |child| child.has_tag_name(name))
}

/// What `<compiler>` says.
struct Compiler {
    /// Unit of angles (rad).
    angle: f64,
    /// Axes of the turns of `euler`: small letters turn with the frame, capitals stay.
    order: String,
    /// Whether a range is a limit unless it is said not to be.
    has_auto_limits: bool,
    /// Whether `<inertial>` counts.
    takes_inertia: bool,
    /// Folders of meshes.
    mesh_folder: Option<String>,
    asset_folder: Option<String>,
}

impl Default for Compiler {
    fn default() -> Self {
        Self {
            angle: PI / 180.0,
            order: "xyz".into(),
            has_auto_limits: true,
            takes_inertia: true,
            mesh_folder: None,
            asset_folder: None,
        }
    }
}

impl Compiler {
    fn read(&mut self, source: &Source<'_>, node: Node<'_, '_>) -> Result<(), Error> {
        let refuse = |message: &str| Err(source.error(node.range(), message));
        for attribute in node.attributes() {
            let value = attribute.value().trim();
            match attribute.name() {
                "coordinate" if value == "global" => {
                    return refuse("global coordinates are of MuJoCo 2: save the model by MuJoCo 3");
                }
                "angle" => self.angle = if value == "radian" { 1.0 } else { PI / 180.0 },
                "eulerseq" if value.len() != 3 || !value.chars().all(|axis| "xyzXYZ".contains(axis)) => {
                    return refuse("eulerseq must be three of x, y, z, X, Y, Z");
                }
                "eulerseq" => self.order = value.to_owned(),
                "autolimits" => self.has_auto_limits = value != "false",
                "inertiafromgeom" => self.takes_inertia = value != "true",
                "meshdir" => self.mesh_folder = Some(value.to_owned()),
                "assetdir" => self.asset_folder = Some(value.to_owned()),
                _ => {}
            }
        }
        Ok(())
    }
}

/// A default class.
struct Class<'a> {
    parent: Option<&'a str>,
    node: Node<'a, 'a>,
}

struct Reader<'a, 'r> {
    source: &'r Source<'r>,
    classes: HashMap<&'a str, Class<'a>>,
    compiler: Compiler,
    meshes: HashMap<String, Geometry>,
    links: Vec<Link>,
    joints: Vec<Joint>,
    /// Names of links and of joints, each behind its kind.
    names: HashSet<String>,
    /// Coordinates of joints where their bodies lie as the file says (rad or m), where these are not zero.
    references: HashMap<String, f64>,
}

/// A body that is still to be read.
struct Open<'a> {
    part: Part<'a>,
    /// Number of the link that carries it.
    parent: usize,
}

/// An element in the frame of something, and the class of what is around it.
#[derive(Clone, Copy)]
struct Part<'a> {
    node: Node<'a, 'a>,
    place: DAffine3,
    class: Option<&'a str>,
}

impl<'a> Reader<'a, '_> {
    fn add_classes(&mut self, node: Node<'a, 'a>) {
        let mut open = vec![(node, None)];
        while let Some((node, parent)) = open.pop() {
            let name = node.attribute("class").unwrap_or(MAIN);
            self.classes.insert(name, Class { parent, node });
            open.extend(elements(node, "default").map(|inner| (inner, Some(name))));
        }
    }

    /// The element that has the attribute `name` of `part`: itself, an entry of its default classes, or none of them,
    /// and then itself.
    fn holder(&self, part: Part<'a>, name: &str) -> Node<'a, 'a> {
        let Part { node, class, .. } = part;
        let mut class = node.attribute("class").or(class).or(Some(MAIN));
        let mut holder = Some(node);
        // As many steps as there are classes: each has one parent.
        for _ in 0..=self.classes.len() {
            if let Some(holder) = holder.filter(|holder| holder.has_attribute(name)) {
                return holder;
            }
            let Some(entry) = class.and_then(|class| self.classes.get(class)) else { break };
            holder = elements(entry.node, node.tag_name().name()).next();
            class = entry.parent;
        }
        node
    }

    fn text(&self, part: Part<'a>, name: &str) -> Option<&'a str> {
        self.holder(part, name).attribute(name).map(str::trim)
    }

    fn list(&self, part: Part<'a>, name: &str) -> Result<Option<Vec<f64>>, Error> {
        self.source.list(self.holder(part, name), name)
    }

    fn numbers<const N: usize>(&self, part: Part<'a>, name: &str) -> Result<Option<[f64; N]>, Error> {
        self.source.numbers(self.holder(part, name), name)
    }

    fn vector(&self, part: Part<'a>, name: &str) -> Result<Option<DVec3>, Error> {
        Ok(self.numbers(part, name)?.map(DVec3::from_array))
    }

    /// From the frame of `part` to that of what it is in: `pos`, and one of the ways of turning.
    fn place(&self, part: Part<'a>) -> Result<DAffine3, Error> {
        let position = self.vector(part, "pos")?.unwrap_or(DVec3::ZERO);
        Ok(DAffine3::from_rotation_translation(self.rotation(part)?, position))
    }

    fn rotation(&self, part: Part<'a>) -> Result<DQuat, Error> {
        let bad = |what: &str| self.source.error(part.node.range(), what);
        let unit = |axis: DVec3| axis.try_normalize().ok_or_else(|| bad("a direction is zero: give it a length"));
        if let Some([w, x, y, z]) = self.numbers(part, "quat")? {
            let quat = DQuat::from_xyzw(x, y, z, w);
            return if quat.length() > 0.0 { Ok(quat.normalize()) } else { Err(bad("quat is zero: give it a length")) };
        }
        if let Some([x, y, z, angle]) = self.numbers(part, "axisangle")? {
            return Ok(DQuat::from_axis_angle(unit(DVec3::new(x, y, z))?, self.compiler.angle * angle));
        }
        if let Some(angles) = self.numbers::<3>(part, "euler")? {
            let turns = self.compiler.order.chars().zip(angles);
            return Ok(turns.fold(DQuat::IDENTITY, |turned, (axis, angle)| {
                let direction = match axis.to_ascii_lowercase() {
                    'x' => DVec3::X,
                    'y' => DVec3::Y,
                    _ => DVec3::Z,
                };
                let turn = DQuat::from_axis_angle(direction, self.compiler.angle * angle);
                if axis.is_ascii_lowercase() { turned * turn } else { turn * turned }
            }));
        }
        if let Some([a, b, c, d, e, f]) = self.numbers(part, "xyaxes")? {
            let x = unit(DVec3::new(a, b, c))?;
            let y = DVec3::new(d, e, f);
            let y = unit(y - y.dot(x) * x)?;
            return Ok(DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))));
        }
        if let Some(axis) = self.vector(part, "zaxis")? {
            return Ok(DQuat::from_rotation_arc(DVec3::Z, unit(axis)?));
        }
        Ok(DQuat::IDENTITY)
    }

    /// The name of `node`, which no other has of its kind, or one that is made of `other`. `kind`: stands before it.
    fn name(&mut self, node: Node<'a, 'a>, other: &str, kind: &str) -> Result<String, Error> {
        if !node.has_attribute("name") {
            return self.free_name(node, other, kind);
        }
        let own = self.source.required(node, "name")?;
        if !self.names.insert(format!("{kind}{own}")) {
            let message = format!("two elements are called {own:?}: give each its own name");
            return Err(self.source.error(node.range(), message));
        }
        Ok(own.to_owned())
    }

    /// A name that begins with `base` and that no other has of its kind.
    fn free_name(&mut self, node: Node<'a, 'a>, base: &str, kind: &str) -> Result<String, Error> {
        let names = &mut self.names;
        let numbered = (2..MOST_NUMBERED).map(|number| format!("{base} {number}"));
        let mut all = std::iter::once(base.to_owned()).chain(numbered);
        let name = all.find(|name| names.insert(format!("{kind}{name}")));
        name.ok_or_else(|| self.source.error(node.range(), "there are too many elements without a name"))
    }

    fn add_mesh(&mut self, node: Node<'a, 'a>) -> Result<(), Error> {
        let part = Part { node, place: DAffine3::IDENTITY, class: None };
        let Some(file) = node.attribute("file").map(str::trim).filter(|file| !file.is_empty()) else { return Ok(()) };
        let scale = self.vector(part, "scale")?.unwrap_or(DVec3::ONE);
        for moved in ["refpos", "refquat"] {
            if let Some(attribute) = node.attribute_node(moved) {
                let message = format!("{moved} moves a mesh in its own frame: apply it to the mesh, and leave it out");
                return Err(self.source.error(attribute.range(), message));
            }
        }
        let stem =
            file.rsplit(['/', '\\']).next().and_then(|name| name.rsplit_once('.')).map_or(file, |(stem, _)| stem);
        let name = node.attribute("name").unwrap_or(stem).to_owned();
        let folder = self.compiler.mesh_folder.as_ref().or(self.compiler.asset_folder.as_ref());
        let file = match folder {
            Some(folder) if !folder.is_empty() => format!("{}/{file}", folder.trim_end_matches('/')),
            _ => file.to_owned(),
        };
        if self.meshes.insert(name.clone(), Geometry::Mesh { file, scale }).is_some() {
            return Err(self
                .source
                .error(node.range(), format!("two meshes are called {name:?}: give each its own name")));
        }
        Ok(())
    }

    /// The children of `part`, in its frame; those of a `<frame>` stand for it.
    fn parts(&self, part: Part<'a>) -> Result<Vec<Part<'a>>, Error> {
        let class = part.node.attribute("childclass").or(part.class);
        let inner = |of: Part<'a>, class| {
            let all = of.node.children().filter(Node::is_element);
            all.map(|node| Part { node, place: of.place, class }).collect::<Vec<_>>()
        };
        let mut open = inner(Part { place: DAffine3::IDENTITY, ..part }, class);
        open.reverse();
        let mut parts = Vec::new();
        while let Some(part) = open.pop() {
            match part.node.tag_name().name() {
                "frame" => {
                    let class = part.node.attribute("childclass").or(part.class);
                    let place = part.place * self.place(part)?;
                    open.extend(inner(Part { place, ..part }, class).into_iter().rev());
                }
                "attach" | "replicate" | "composite" | "flexcomp" => {
                    let name = part.node.tag_name().name();
                    let message =
                        format!("<{name}> is not read: give the whole model as MuJoCo saves it (mj_saveLastXML)");
                    return Err(self.source.error(part.node.range(), message));
                }
                _ => parts.push(part),
            }
        }
        Ok(parts)
    }

    /// Adds the link of the world and all bodies in it.
    fn add_bodies(&mut self, world: Node<'a, 'a>) -> Result<(), Error> {
        let mut open = vec![Open { part: Part { node: world, place: DAffine3::IDENTITY, class: None }, parent: 0 }];
        while let Some(Open { part, parent }) = open.pop() {
            let inside = self.parts(part)?;
            let is_world = part.node == world;
            let (parent, offset) = if is_world { (0, DVec3::ZERO) } else { self.add_joints(part, &inside, parent)? };
            let mut link = self.link(part, &inside, offset)?;
            if is_world {
                link.name = self.name(world, "world", LINK)?;
                self.links.push(link);
            } else {
                link.name = std::mem::take(&mut self.links[parent].name);
                self.links[parent] = link;
            }
            let bodies = inside.iter().filter(|inner| inner.node.has_tag_name("body")).rev();
            for inner in bodies {
                let place = DAffine3::from_translation(-offset) * inner.place * self.place(*inner)?;
                open.push(Open { part: Part { place, ..*inner }, parent });
            }
        }
        Ok(())
    }

    /// Adds the joints of a body and a link for each; the number of the last one and its origin in the body's frame.
    fn add_joints(&mut self, body: Part<'a>, inside: &[Part<'a>], mut parent: usize) -> Result<(usize, DVec3), Error> {
        let name = self.name(body.node, "body", LINK)?;
        let is_joint = |part: &&Part<'_>| matches!(part.node.tag_name().name(), "joint" | "freejoint");
        let joints: Vec<Part<'a>> = inside.iter().filter(is_joint).copied().collect();
        let (mut place, mut offset) = (body.place, DVec3::ZERO);
        for (number, part) in joints.iter().enumerate() {
            let is_last = number + 1 == joints.len();
            let joint_name = self.name(part.node, &format!("joint of {name}"), JOINT)?;
            let position = part.place.transform_point3(self.vector(*part, "pos")?.unwrap_or(DVec3::ZERO));
            let child = self.links.len();
            let link_name = if is_last {
                name.clone()
            } else {
                self.free_name(part.node, &format!("{name} at {joint_name}"), LINK)?
            };
            self.links.push(Link::empty(link_name, part.node.range()));
            let origin = place * DAffine3::from_translation(position - offset);
            let joint = self.joint(*part, joint_name, [parent, child], origin)?;
            self.joints.push(joint);
            (place, offset, parent) = (DAffine3::IDENTITY, position, child);
        }
        if joints.is_empty() {
            let child = self.links.len();
            let fixed = self.free_name(body.node, &format!("fixed {name}"), JOINT)?;
            self.links.push(Link::empty(name, body.node.range()));
            self.joints.push(Joint::fixed(fixed, body.node.range(), [parent, child], place));
            parent = child;
        }
        Ok((parent, offset))
    }

    fn joint(
        &mut self,
        part: Part<'a>,
        name: String,
        [parent, child]: [usize; 2],
        origin: DAffine3,
    ) -> Result<Joint, Error> {
        let kind =
            if part.node.has_tag_name("freejoint") { "free" } else { self.text(part, "type").unwrap_or("hinge") };
        let bad = |message: String| self.source.error(part.node.range(), message);
        let range = self.numbers::<2>(part, "range")?;
        let is_limited = match self.text(part, "limited").unwrap_or("auto") {
            "true" => true,
            "false" => false,
            _ => self.compiler.has_auto_limits && range.is_some(),
        };
        let (kind, unit) = match kind {
            "hinge" if is_limited => (JointType::Revolute, self.compiler.angle),
            "hinge" => (JointType::Continuous, self.compiler.angle),
            "slide" => (JointType::Prismatic, 1.0),
            "ball" | "free" => (JointType::Floating, 1.0),
            other => return Err(bad(format!("{other:?} is no type of joint: it is hinge, slide, ball or free"))),
        };
        let direction = part.place.matrix3 * self.vector(part, "axis")?.unwrap_or(DVec3::Z);
        let axis = direction
            .try_normalize()
            .ok_or_else(|| bad(format!("joint {name:?} has the axis zero: give it a direction")))?;
        let number = |name: &str| Ok::<f64, Error>(self.numbers::<1>(part, name)?.map_or(0.0, |[number]| number));
        let force = self.numbers::<2>(part, "actuatorfrcrange")?;
        let fixed = Joint::fixed(name, part.node.range(), [parent, child], origin);
        let mut joint = Joint {
            kind,
            axis,
            limits: range.filter(|_| is_limited).map(|range| range.map(|limit| limit * unit)),
            effort: force.map(|[least, greatest]| least.abs().max(greatest.abs())),
            rotor_inertia: Some(number("armature")?).filter(|armature| *armature > 0.0),
            ..fixed
        };
        // The body lies as the file says where the coordinate is `ref`.
        let reference = unit * number("ref")?;
        self.references.insert(joint.name.clone(), reference);
        joint.origin *= joint.motion(-reference).unwrap_or(DAffine3::IDENTITY);
        Ok(joint)
    }

    /// Inertia and shapes of a body, whose link's origin is at `offset` in the body's frame.
    fn link(&self, body: Part<'a>, inside: &[Part<'a>], offset: DVec3) -> Result<Link, Error> {
        let place = DAffine3::from_translation(-offset);
        let mut link = Link::empty(String::new(), body.node.range());
        let mut visual = Vec::new();
        for part in inside {
            match part.node.tag_name().name() {
                "inertial" if self.compiler.takes_inertia => {
                    link.inertial = Some(self.inertial(*part, place * part.place)?)
                }
                "geom" => {
                    let shape = match self.geometry(*part)? {
                        Ok((geometry, own)) => {
                            Placed { place: place * part.place * own, geometry, span: part.node.range() }
                        }
                        Err(reason) => {
                            link.left_out.push((part.node.range(), reason));
                            continue;
                        }
                    };
                    let touches = |name| Ok::<bool, Error>(self.numbers::<1>(*part, name)? != Some([0.0]));
                    let is_felt = touches("contype")? || touches("conaffinity")?;
                    if is_felt { link.shapes.push(shape) } else { visual.push(shape) }
                }
                _ => {}
            }
        }
        if link.shapes.is_empty() {
            (link.shapes, link.is_visual) = (visual, true);
        }
        Ok(link)
    }

    fn inertial(&self, part: Part<'a>, place: DAffine3) -> Result<Inertial, Error> {
        let place = place * self.place(part)?;
        self.source.required(part.node, "mass")?;
        let mass = self.source.number(part.node, "mass")?.unwrap_or(0.0);
        if mass < 0.0 {
            return Err(self
                .source
                .error(part.node.range(), format!("the mass is {mass} kg: it must be zero or positive")));
        }
        let tensor = match (self.numbers(part, "fullinertia")?, self.numbers(part, "diaginertia")?) {
            (Some(full), _) => full,
            (None, Some([xx, yy, zz])) => [xx, yy, zz, 0.0, 0.0, 0.0],
            (None, None) => [0.0; 6],
        };
        let inertia = inertia(self.source, part.node, tensor)?;
        let inertia = place.matrix3 * inertia * place.matrix3.transpose();
        Ok(Inertial { mass, centre: place.translation, inertia })
    }

    /// The form of a geom and its place in its body, or why it is left out.
    fn geometry(&self, part: Part<'a>) -> Result<Result<(Geometry, DAffine3), String>, Error> {
        let bad = |message: &str| self.source.error(part.node.range(), message);
        let kind = self.text(part, "type").unwrap_or("sphere");
        let size = self.list(part, "size")?.unwrap_or_default();
        let mut place = self.place(part)?;
        if kind == "mesh" {
            let name = self.text(part, "mesh").ok_or_else(|| bad("a geom of type mesh needs the attribute mesh"))?;
            let mesh = self.meshes.get(name).cloned();
            return mesh
                .map(|mesh| Ok((mesh, place)))
                .ok_or_else(|| bad(&format!("there is no mesh {name:?} with a file: add it to <asset>")));
        }
        if self.text(part, "mesh").is_some() {
            return Ok(Err(format!("a {kind} that is fitted to a mesh is left out")));
        }
        let dimension = |k: usize| {
            size.get(k)
                .copied()
                .filter(|size| *size > 0.0)
                .ok_or_else(|| bad("a size is missing or zero: give it a positive one"))
        };
        let mut half_length = None;
        if let (Some([a, b, c, d, e, f]), "capsule" | "cylinder") = (self.numbers(part, "fromto")?, kind) {
            let (from, to) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
            let axis =
                (to - from).try_normalize().ok_or_else(|| bad("fromto has no length: give two different points"))?;
            half_length = Some(0.5 * from.distance(to));
            place = DAffine3::from_rotation_translation(DQuat::from_rotation_arc(DVec3::Z, axis), from.midpoint(to));
        } else if self.holder(part, "fromto").has_attribute("fromto") && matches!(kind, "box" | "ellipsoid") {
            return Ok(Err(format!("a {kind} between two points (fromto) is left out")));
        }
        let length = || half_length.map_or_else(|| dimension(1), Ok).map(|half| 2.0 * half);
        let geometry = match kind {
            "sphere" => Geometry::Sphere(dimension(0)?),
            "capsule" => Geometry::Capsule { radius: dimension(0)?, length: length()? },
            "cylinder" => Geometry::Cylinder { radius: dimension(0)?, length: length()? },
            "box" => Geometry::Box(2.0 * DVec3::new(dimension(0)?, dimension(1)?, dimension(2)?)),
            other => return Ok(Err(format!("a geom of type {other} is left out"))),
        };
        Ok(Ok((geometry, place)))
    }

    /// Couples two joints as an equality says: the first is a polynomial of the second, which must be linear.
    fn couple(&mut self, node: Node<'a, 'a>) -> Result<(), Error> {
        let part = Part { node, place: DAffine3::IDENTITY, class: None };
        let (Some(leader), true) = (node.attribute("joint2"), self.text(part, "active") != Some("false")) else {
            return Ok(());
        };
        let follower = self.source.required(node, "joint1")?;
        let polynomial = self.list(part, "polycoef")?.unwrap_or_else(|| vec![0.0, 1.0]);
        let Some(joint) = self.joints.iter_mut().find(|joint| joint.name == follower) else {
            return Err(self.source.error(node.range(), format!("there is no joint {follower:?}: correct the name")));
        };
        if polynomial.iter().skip(2).any(|coefficient| *coefficient != 0.0) {
            let reason =
                format!("joint {follower:?} follows {leader:?} by a polynomial, and moves by itself in the scene");
            self.links[joint.child].left_out.push((node.range(), reason));
            return Ok(());
        }
        let coefficient = |k: usize| polynomial.get(k).copied().unwrap_or(0.0);
        // Both are counted from where their bodies lie as the file says.
        let [own, of_leader] = [follower, leader].map(|name| self.references.get(name).copied().unwrap_or(0.0));
        let offset = own + coefficient(0) - coefficient(1) * of_leader;
        joint.mimic = Some(Mimic { joint: leader.to_owned(), multiplier: coefficient(1), offset });
        Ok(())
    }
}
