//! Robots from URDF, the robot description of ROS (<http://wiki.ros.org/urdf/XML>).

use super::description::{Geometry, Inertial, Joint, JointType, Link, Mimic, Placed};
use super::document::{Source, child};
use crate::Error;
use crate::scene::positive_semidefinite;
use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};

/// Links and joints of the robot in `root`.
pub(super) fn read(source: &Source<'_>, root: Node<'_, '_>) -> Result<(Vec<Link>, Vec<Joint>), Error> {
    let elements =
        |name: &'static str| root.children().filter(move |child| child.is_element() && child.tag_name().name() == name);
    let mut links: Vec<Link> = Vec::new();
    let mut numbers = HashMap::new();
    for element in elements("link") {
        let link = link(source, element)?;
        if numbers.insert(link.name.clone(), links.len()).is_some() {
            let message = format!("two links are called {:?}: give each its own name", link.name);
            return Err(source.error(element.range(), message));
        }
        links.push(link);
    }
    let mut joints: Vec<Joint> = Vec::new();
    let (mut names, mut movers) = (HashSet::new(), HashMap::new());
    for element in elements("joint") {
        let joint = joint(source, element, &numbers)?;
        let refuse = |message: String| Err(source.error(element.range(), message));
        if !names.insert(joint.name.clone()) {
            return refuse(format!("two joints are called {:?}: give each its own name", joint.name));
        }
        if let Some(earlier) = movers.insert(joint.child, element.range().start) {
            let (link, line) = (&links[joint.child].name, source.line(earlier));
            return refuse(format!(
                "link {link:?} is the child of the joint on line {line} already: a robot is a tree; remove one of \
                 them"
            ));
        }
        joints.push(joint);
    }
    let mut roots = links.iter().enumerate().filter(|(number, _)| !movers.contains_key(number));
    if let (Some((_, first)), Some((_, second))) = (roots.next(), roots.next()) {
        let message = format!(
            "links {:?} and {:?} are both the child of no joint: a robot is a tree with one root; join them with a \
             fixed joint, or remove one",
            first.name, second.name
        );
        return Err(source.error(second.span.clone(), message));
    }
    Ok((links, joints))
}

impl JointType {
    /// The type that URDF calls `name`.
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
        origin: origin(source, node)?,
        axis,
        // The rounding of axes that were printed with six digits.
        was_scaled: moves && (direction.length() - 1.0).abs() > 1e-5,
        limits,
        effort: number("effort")?,
        velocity: number("velocity")?,
        rotor_inertia: None,
        mimic: child(node, "mimic").map(|node| mimic(source, node)).transpose()?,
        span: node.range(),
        name,
    })
}

/// Reads a `<link>`.
fn link(source: &Source<'_>, node: Node<'_, '_>) -> Result<Link, Error> {
    let of_kind = |kind: &str| node.children().filter(|child| child.tag_name().name() == kind).collect::<Vec<_>>();
    let collision = of_kind("collision");
    let is_visual = collision.is_empty();
    let mut link = Link { is_visual, ..Link::empty(source.required(node, "name")?.to_owned(), node.range()) };
    for element in if is_visual { of_kind("visual") } else { collision } {
        match shape(source, element)? {
            Some(shape) => link.shapes.push(shape),
            None => link.left_out.push((element.range(), "a shape of no size is left out".to_owned())),
        }
    }
    link.inertial = child(node, "inertial").map(|element| inertial(source, element)).transpose()?;
    Ok(link)
}

/// Reads the `<origin>` of an element: turned by roll, pitch and yaw about the fixed axes x, y, z, then moved. Identity
/// if there is none.
fn origin(source: &Source<'_>, node: Node<'_, '_>) -> Result<DAffine3, Error> {
    let Some(origin) = child(node, "origin") else { return Ok(DAffine3::IDENTITY) };
    let translation = source.vector(origin, "xyz")?.unwrap_or(DVec3::ZERO);
    let angles = source.vector(origin, "rpy")?.unwrap_or(DVec3::ZERO);
    let rotation = DQuat::from_euler(EulerRot::ZYX, angles.z, angles.y, angles.x);
    Ok(DAffine3::from_rotation_translation(rotation, translation))
}

fn inertial(source: &Source<'_>, node: Node<'_, '_>) -> Result<Inertial, Error> {
    let place = origin(source, node)?;
    let mass =
        child(node, "mass").ok_or_else(|| source.error(node.range(), "<inertial> needs <mass value=\"..\"/>"))?;
    source.required(mass, "value")?;
    let value = source.number(mass, "value")?.unwrap_or(0.0);
    if value < 0.0 {
        return Err(source.error(mass.range(), format!("the mass is {value} kg: it must be zero or positive")));
    }
    let mut tensor = DMat3::ZERO;
    if let Some(element) = child(node, "inertia") {
        let number = |name| -> Result<f64, Error> { Ok(source.number(element, name)?.unwrap_or(0.0)) };
        let [xx, yy, zz] = [number("ixx")?, number("iyy")?, number("izz")?];
        let [xy, xz, yz] = [number("ixy")?, number("ixz")?, number("iyz")?];
        tensor = self::inertia(source, element, [xx, yy, zz, xy, xz, yz])?;
    }
    let inertia = place.matrix3 * tensor * place.matrix3.transpose();
    Ok(Inertial { mass: value, centre: place.translation, inertia })
}

/// The matrix of moments and products of inertia xx, yy, zz, xy, xz, yz (kg m^2).
pub(super) fn inertia(source: &Source<'_>, node: Node<'_, '_>, moments: [f64; 6]) -> Result<DMat3, Error> {
    let [xx, yy, zz, xy, xz, yz] = moments;
    let message = "no body has this inertia, since the matrix has a negative eigenvalue: correct it, or leave it out";
    positive_semidefinite(DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]))
        .ok_or_else(|| source.error(node.range(), message))
}

/// Reads a shape; `None` where it has no size.
fn shape(source: &Source<'_>, node: Node<'_, '_>) -> Result<Option<Placed>, Error> {
    let missing = |what: &str| source.error(node.range(), format!("<{}> needs {what}", node.tag_name().name()));
    let geometry = child(node, "geometry").ok_or_else(|| missing("<geometry>"))?;
    let form = geometry.children().find(Node::is_element).ok_or_else(|| missing("a shape in its <geometry>"))?;
    let sizes: &[&str] = match form.tag_name().name() {
        "box" => &["size"],
        "cylinder" => &["radius", "length"],
        "sphere" => &["radius"],
        _ => &[],
    };
    let is_zero =
        |name: &&str| form.attribute(*name).is_some_and(|text| text.split_whitespace().all(|x| x.parse() == Ok(0.0)));
    if !sizes.is_empty() && sizes.iter().all(is_zero) {
        return Ok(None);
    }
    let geometry = match form.tag_name().name() {
        "box" => {
            source.required(form, "size")?;
            let size = source.vector(form, "size")?.unwrap_or(DVec3::ZERO);
            if size.min_element() <= 0.0 {
                return Err(source.error(form.range(), "the edges of a box must be positive"));
            }
            Geometry::Box(size)
        }
        "cylinder" => {
            Geometry::Cylinder { radius: source.positive(form, "radius")?, length: source.positive(form, "length")? }
        }
        "sphere" => Geometry::Sphere(source.positive(form, "radius")?),
        "mesh" => {
            let scale = source.vector(form, "scale")?.unwrap_or(DVec3::ONE);
            if scale.to_array().contains(&0.0) {
                return Err(source.error(form.range(), "a scale of zero makes a mesh flat: give other factors"));
            }
            Geometry::Mesh { file: source.required(form, "filename")?.to_owned(), scale }
        }
        other => {
            let message = format!("<{other}> is no shape of URDF: use box, cylinder, sphere or mesh");
            return Err(source.error(form.range(), message));
        }
    };
    Ok(Some(Placed { place: origin(source, node)?, geometry, span: form.range() }))
}
