//! COLLADA 1.4 and 1.5 files (Khronos, COLLADA Digital Asset Schema), as robots and Blender have them.
//!
//! Read are the faces of the scene, at the places of their nodes, in the file's unit. Coordinates stay as they are
//! whichever axis points up, as in RViz and in trimesh; materials, lights, cameras and animations are left out.

use super::{
    cell::{fan, strip},
    elements::Elements,
};
use crate::xml;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use roxmltree::{Document, Node};
use std::collections::HashMap;

/// What a file says that names the same parts again and again.
const REPEATED: &str =
    "parts are repeated so often that they have more corners than the file has bytes: join them into one mesh";

/// Reads a file.
pub(super) fn read(bytes: &[u8], elements: &mut Elements<'_>) -> Result<(), String> {
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    let document = xml::parse(&text).map_err(|error| error.sentence(&text))?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err("it is no COLLADA file: export the mesh again".to_owned());
    }
    let unit = child(root, "asset").and_then(|asset| child(asset, "unit")).and_then(|unit| unit.attribute("meter"));
    let unit = unit.map_or(Ok(1.0), |unit| unit.trim().parse::<f64>());
    let unit =
        unit.ok().filter(|unit| unit.is_finite() && *unit > 0.0).ok_or("its unit is no length: export it again")?;
    let ids = document.descendants().filter_map(|node| Some((node.attribute("id")?, node))).collect();
    let mut reader = Reader { text: &text, ids, elements };
    reader.scene(&document, DAffine3::from_scale(DVec3::splat(unit)))
}

/// The first child element of that name, in any namespace.
fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    children(node, name).next()
}

/// The child elements of that name.
fn children<'a, 'i>(node: Node<'a, 'i>, name: &str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |child| child.tag_name().name() == name)
}

struct Reader<'a, 'b, 'c> {
    text: &'a str,
    /// Elements by their `id`.
    ids: HashMap<&'a str, Node<'a, 'a>>,
    elements: &'b mut Elements<'c>,
}

impl<'a> Reader<'a, '_, '_> {
    fn error(&self, node: Node<'_, '_>, what: &str) -> String {
        format!("line {}: {what}", xml::line(self.text, node.range().start))
    }

    /// The element that the attribute `name` of `node` points to.
    fn target(&self, node: Node<'_, '_>, name: &str) -> Result<Node<'a, 'a>, String> {
        let id = node.attribute(name).and_then(|id| id.strip_prefix('#'));
        let target = id.and_then(|id| self.ids.get(id).copied());
        target.ok_or_else(|| self.error(node, "it names an element that is not in the file: export the mesh again"))
    }

    /// The numbers in an element.
    fn numbers<T: std::str::FromStr>(&self, node: Node<'_, '_>) -> Result<Vec<T>, String> {
        let words = node.text().unwrap_or_default().split_ascii_whitespace();
        let numbers = words.map(|word| word.parse().ok()).collect::<Option<Vec<T>>>();
        numbers.ok_or_else(|| self.error(node, "a number belongs here: export the mesh again"))
    }

    /// Adds the faces of the scene, or of all geometries where there is none.
    fn scene(&mut self, document: &'a Document<'a>, place: DAffine3) -> Result<(), String> {
        let scene = child(document.root_element(), "scene").and_then(|scene| child(scene, "instance_visual_scene"));
        let Some(scene) = scene else {
            let all = document.descendants().filter(|node| node.tag_name().name() == "geometry");
            return all.into_iter().try_for_each(|geometry| self.geometry(geometry, place));
        };
        let mut open = vec![(self.target(scene, "url")?, place)];
        let mut visits = 0;
        while let Some((node, place)) = open.pop() {
            visits += 1;
            if visits > self.text.len() {
                return Err(self.error(node, "its nodes contain one another: export the mesh again"));
            }
            let place = place * self.place(node)?;
            for part in node.children() {
                match part.tag_name().name() {
                    "node" => open.push((part, place)),
                    "instance_node" => open.push((self.target(part, "url")?, place)),
                    "instance_geometry" => self.geometry(self.target(part, "url")?, place)?,
                    "instance_controller" => {
                        return Err(self.error(part, "a skeleton bends the mesh: apply it before the export"));
                    }
                    _ => {}
                }
            }
        }
        Ok(())
    }

    /// From the frame of `node` to that of its parent: its transforms, the last of which acts first.
    fn place(&self, node: Node<'_, '_>) -> Result<DAffine3, String> {
        let mut place = DAffine3::IDENTITY;
        for part in node.children() {
            let name = part.tag_name().name();
            if matches!(name, "lookat" | "skew") {
                return Err(self.error(part, "such a transform is not read: apply it before the export"));
            }
            if !matches!(name, "matrix" | "translate" | "rotate" | "scale") {
                continue;
            }
            let numbers: Vec<f64> = self.numbers(part)?;
            place *= match (name, &numbers[..]) {
                ("translate", [x, y, z]) => DAffine3::from_translation(DVec3::new(*x, *y, *z)),
                ("scale", [x, y, z]) => DAffine3::from_scale(DVec3::new(*x, *y, *z)),
                ("rotate", [x, y, z, degrees]) => {
                    let axis = DVec3::new(*x, *y, *z).normalize_or_zero();
                    let is_turned = axis != DVec3::ZERO && degrees.is_finite();
                    let turn =
                        if is_turned { DQuat::from_axis_angle(axis, degrees.to_radians()) } else { DQuat::IDENTITY };
                    DAffine3::from_quat(turn)
                }
                ("matrix", numbers) if numbers.len() == 16 => {
                    DAffine3::from_mat4(DMat4::from_cols_slice(numbers).transpose())
                }
                _ => return Err(self.error(part, "the transform has another count of numbers: export the mesh again")),
            };
        }
        Ok(place)
    }

    /// Adds the faces of a `<geometry>`.
    fn geometry(&mut self, geometry: Node<'a, 'a>, place: DAffine3) -> Result<(), String> {
        let Some(mesh) = child(geometry, "mesh") else { return Ok(()) };
        // A mirrored part is turned inside out again.
        let is_mirrored = place.matrix3.determinant() < 0.0;
        let mut first_nodes: HashMap<&str, u32> = HashMap::new();
        for primitive in mesh.children() {
            let kind = primitive.tag_name().name();
            if !matches!(kind, "triangles" | "polylist" | "polygons" | "tristrips" | "trifans") {
                continue;
            }
            let offset = |input: Node<'_, '_>| input.attribute("offset").and_then(|n| n.trim().parse::<usize>().ok());
            let inputs = || children(primitive, "input");
            let stride = inputs().filter_map(offset).max().unwrap_or(0).saturating_add(1);
            let Some(vertex) = inputs().find(|input| input.attribute("semantic") == Some("VERTEX")) else { continue };
            let at = offset(vertex).unwrap_or(0);
            let source = vertex.attribute("source").unwrap_or_default();
            let vertices = self.target(vertex, "source")?;
            let first = match first_nodes.get(source) {
                Some(first) => *first,
                None => {
                    let first = super::node_number(self.elements.nodes.len())?;
                    let positions = self.positions(vertices)?;
                    if self.elements.nodes.len() + positions.len() > self.text.len() {
                        return Err(self.error(primitive, REPEATED));
                    }
                    self.elements.nodes.extend(positions.into_iter().map(|node| place.transform_point3(node)));
                    *first_nodes.entry(source).or_insert(first)
                }
            };
            let lengths: Vec<usize> = child(primitive, "vcount").map_or(Ok(Vec::new()), |node| self.numbers(node))?;
            if child(primitive, "ph").is_some() {
                return Err(self.error(primitive, "a polygon has holes: triangulate on export"));
            }
            for list in children(primitive, "p") {
                let numbers: Vec<u32> = self.numbers(list)?;
                let corners: Option<Vec<u32>> =
                    numbers.iter().skip(at).step_by(stride).map(|corner| first.checked_add(*corner)).collect();
                let corners = corners.ok_or_else(|| self.error(list, "a face names a node that is not there"))?;
                if self.elements.corners_of_faces() + corners.len() > self.text.len() {
                    return Err(self.error(list, REPEATED));
                }
                for mut face in faces(kind, corners, &lengths)
                    .ok_or_else(|| self.error(list, "faces have more corners than are there: export the mesh again"))?
                {
                    if is_mirrored {
                        face.reverse();
                    }
                    self.elements.add_face(&face).map_err(|reason| self.error(list, &reason))?;
                }
            }
        }
        Ok(())
    }

    /// The positions of `<vertices>`.
    fn positions(&self, vertices: Node<'_, '_>) -> Result<Vec<DVec3>, String> {
        let input = children(vertices, "input").find(|input| input.attribute("semantic") == Some("POSITION"));
        let input = input.ok_or_else(|| self.error(vertices, "vertices have no POSITION: export the mesh again"))?;
        let source = self.target(input, "source")?;
        let array = child(source, "float_array").ok_or_else(|| self.error(source, "a source has no numbers"))?;
        let accessor = child(source, "technique_common").and_then(|common| child(common, "accessor"));
        let number = |name: &str| accessor.and_then(|accessor| accessor.attribute(name)?.trim().parse::<usize>().ok());
        let (stride, offset) = (number("stride").unwrap_or(3).max(3), number("offset").unwrap_or(0));
        let numbers: Vec<f64> = self.numbers(array)?;
        Ok(numbers
            .get(offset..)
            .unwrap_or_default()
            .chunks(stride)
            .filter(|at| at.len() >= 3)
            .map(DVec3::from_slice)
            .collect())
    }
}

/// The faces between `corners` of an element of that name; `lengths`: corners of each in a `polylist`.
fn faces(kind: &str, corners: Vec<u32>, lengths: &[usize]) -> Option<Vec<Vec<u32>>> {
    Some(match kind {
        "triangles" => corners.chunks_exact(3).map(<[u32]>::to_vec).collect(),
        "polygons" => vec![corners],
        "polylist" => {
            let mut rest = &corners[..];
            let mut face = |length: &usize| {
                let (face, others) = rest.split_at_checked(*length)?;
                rest = others;
                Some(face.to_vec())
            };
            lengths.iter().map(&mut face).collect::<Option<_>>()?
        }
        "tristrips" => strip(&corners),
        _ => fan(&corners),
    })
}
