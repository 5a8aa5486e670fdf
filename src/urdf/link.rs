//! One link of a robot: its inertia and its shapes.

use super::document::{Source, child};
use crate::Error;
use crate::scene::positive_semidefinite;
use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot};
use roxmltree::Node;
use std::ops::Range;

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
    /// Places in the file of shapes of no size, which are left out (B).
    pub empty: Vec<Range<usize>>,
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
    /// A mesh file.
    Mesh {
        /// As the file names it.
        file: String,
        /// Factors on its coordinates (1).
        scale: DVec3,
    },
}

/// Reads a `<link>`.
pub(super) fn read(source: &Source<'_>, node: Node<'_, '_>) -> Result<Link, Error> {
    let of_kind = |kind: &str| node.children().filter(|child| child.tag_name().name() == kind).collect::<Vec<_>>();
    let collision = of_kind("collision");
    let is_visual = collision.is_empty();
    let (mut shapes, mut empty) = (Vec::new(), Vec::new());
    for element in if is_visual { of_kind("visual") } else { collision } {
        match shape(source, element)? {
            Some(shape) => shapes.push(shape),
            None => empty.push(element.range()),
        }
    }
    Ok(Link {
        name: source.required(node, "name")?.to_owned(),
        span: node.range(),
        inertial: child(node, "inertial").map(|element| inertial(source, element)).transpose()?,
        shapes,
        is_visual,
        empty,
    })
}

/// Reads the `<origin>` of an element: turned by roll, pitch and yaw about the fixed axes x, y, z, then moved. Identity
/// if there is none.
pub(super) fn origin(source: &Source<'_>, node: Node<'_, '_>) -> Result<DAffine3, Error> {
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
        let message =
            "no body has this inertia, since the matrix has a negative eigenvalue: correct it, or remove <inertia>";
        tensor = positive_semidefinite(DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]))
            .ok_or_else(|| source.error(element.range(), message))?;
    }
    let inertia = place.matrix3 * tensor * place.matrix3.transpose();
    Ok(Inertial { mass: value, centre: place.translation, inertia })
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
