//! Shapes of links: drawn, not felt. Nothing that is solved depends on them.

use super::ProxySpec;
use super::check::Checker;
use super::value::{edges, positive, rotation, vector};
use crate::Error;
use base64::{Engine, engine::general_purpose::STANDARD};
use glam::{DAffine3, DVec3};

/// Most shapes of an arm.
pub const MAX_SHAPES: usize = 512;

/// Most nodes and triangles together of a surface in a scene: its text stays below the longest line of a scan's log.
pub const MAX_SURFACE: usize = 6000;

/// Steps of a coordinate within a surface's bounds: a hundredth of a pixel of a picture.
const STEPS: f64 = u16::MAX as f64;

/// Bytes of the two counts at the head, and of a node or a triangle.
const HEAD: usize = 8;
const ROW: usize = 6;

/// A shape that moves with a link, in the link's frame, or stands still.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkShape {
    /// Number of the joint that moves it; `None` for what stands still, in the world's frame.
    pub joint: Option<usize>,
    /// From the form's frame to the link's.
    pub place: DAffine3,
    /// Its form.
    pub form: LinkForm,
}

/// A form about its origin.
#[derive(Clone, Debug, PartialEq)]
pub enum LinkForm {
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
    /// Triangles.
    Surface(LinkSurface),
}

/// Triangles, as a mesh file gave them.
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize)]
#[serde(try_from = "SurfaceTable")]
pub struct LinkSurface {
    /// (m)
    pub nodes: Vec<DVec3>,
    /// Three node numbers each.
    pub triangles: Vec<[u32; 3]>,
}

impl LinkSurface {
    /// Returns the least and the greatest coordinates (m).
    #[must_use]
    pub fn bounds(&self) -> [DVec3; 2] {
        let [least, greatest] = [DVec3::min, DVec3::max].map(|pick| self.nodes.iter().copied().reduce(pick));
        [least.unwrap_or_default(), greatest.unwrap_or_default()]
    }

    /// Returns the text of the key `data`: the numbers of nodes and triangles (u32), then three numbers (u16) for each,
    /// coordinates in steps within the bounds; little-endian, in base64.
    #[must_use]
    pub fn encode(&self) -> String {
        let [least, greatest] = self.bounds();
        let mut bytes = Vec::with_capacity(HEAD + ROW * (self.nodes.len() + self.triangles.len()));
        [self.nodes.len(), self.triangles.len()].iter().for_each(|count| bytes.extend((*count as u32).to_le_bytes()));
        let size = (greatest - least).max(DVec3::splat(f64::MIN_POSITIVE));
        for node in &self.nodes {
            let steps = (STEPS * (node - least) / size).round().to_array();
            steps.iter().for_each(|step| bytes.extend((*step as u16).to_le_bytes()));
        }
        self.triangles.as_flattened().iter().for_each(|node| bytes.extend((*node as u16).to_le_bytes()));
        STANDARD.encode(bytes)
    }

    /// Reads what [`LinkSurface::encode`] wrote, within `bounds` (m).
    ///
    /// # Errors
    /// In words, where `text` is none or is too large.
    pub fn decode(text: &str, [least, greatest]: [DVec3; 2]) -> Result<Self, String> {
        let bytes = STANDARD.decode(text).map_err(|error| format!("it is no base64: {error}"))?;
        let (head, rows) = bytes.split_at_checked(HEAD).ok_or("it is too short")?;
        let count = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]) as usize;
        let (nodes, triangles) = (count(0), count(4));
        if nodes.saturating_add(triangles) > MAX_SURFACE {
            return Err(format!("it has {nodes} nodes and {triangles} triangles: at most {MAX_SURFACE} together"));
        }
        if rows.len() != ROW * (nodes + triangles) {
            return Err(format!("it does not hold the {nodes} nodes and {triangles} triangles that it says"));
        }
        let row = |row: &[u8]| [0, 2, 4].map(|at| u16::from_le_bytes([row[at], row[at + 1]]));
        let (at_nodes, at_triangles) = rows.split_at(ROW * nodes);
        let node = |bytes: &[u8]| least + DVec3::from_array(row(bytes).map(f64::from)) / STEPS * (greatest - least);
        let surface = Self {
            nodes: at_nodes.chunks_exact(ROW).map(node).collect(),
            triangles: at_triangles.chunks_exact(ROW).map(|bytes| row(bytes).map(u32::from)).collect(),
        };
        match surface.triangles.as_flattened().iter().find(|node| **node as usize >= nodes) {
            Some(node) => Err(format!("a triangle names node {node} of {nodes}")),
            None => Ok(surface),
        }
    }
}

/// `[[proxy.shape]]` as it is written: one of four forms, drawn with the link of a joint.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShapeTable {
    joint: Option<String>,
    #[serde(default, rename = "box", deserialize_with = "edges")]
    block: Option<DVec3>,
    cylinder: Option<CylinderTable>,
    #[serde(default, deserialize_with = "positive")]
    sphere: Option<f64>,
    surface: Option<LinkSurface>,
    #[serde(default, deserialize_with = "vector")]
    at: DVec3,
    #[serde(default, deserialize_with = "vector")]
    turn: DVec3,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct CylinderTable {
    #[serde(deserialize_with = "positive")]
    radius: f64,
    #[serde(deserialize_with = "positive")]
    length: f64,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct SurfaceTable {
    #[serde(deserialize_with = "vector")]
    from: DVec3,
    #[serde(deserialize_with = "vector")]
    to: DVec3,
    data: String,
}

impl TryFrom<SurfaceTable> for LinkSurface {
    type Error = String;

    fn try_from(SurfaceTable { from, to, data }: SurfaceTable) -> Result<Self, String> {
        let again = |what| format!("the surface cannot be read, {what}: import the robot again");
        Self::decode(&data, [from, to]).map_err(again)
    }
}

/// The shapes of the arm `proxy`.
pub(super) fn check(
    checker: &Checker<'_>,
    tables: Vec<ShapeTable>,
    proxy: &ProxySpec,
) -> Result<Vec<LinkShape>, Error> {
    if tables.len() > MAX_SHAPES {
        let message = format!("the arm has more than {MAX_SHAPES} shapes: leave some out");
        return Err(checker.at(&format!("proxy.shape.{MAX_SHAPES}"), message));
    }
    let names: Vec<&str> = proxy.links().into_iter().map(|(_, joint)| joint.name.as_str()).collect();
    let shapes = tables.into_iter().enumerate();
    shapes.map(|(number, table)| table.check(checker, &format!("proxy.shape.{number}"), &names)).collect()
}

impl ShapeTable {
    fn check(self, checker: &Checker<'_>, path: &str, names: &[&str]) -> Result<LinkShape, Error> {
        let number = |name: String| {
            names.iter().position(|joint| *joint == name).ok_or_else(|| {
                let message = format!("there is no joint {name:?}: name one of {}", names.join(", "));
                checker.at(&format!("{path}.joint"), message)
            })
        };
        let joint = self.joint.map(number).transpose()?;
        let form = match (self.block, self.cylinder, self.sphere, self.surface) {
            (Some(edges), None, None, None) => LinkForm::Box(edges),
            (None, Some(CylinderTable { radius, length }), None, None) => LinkForm::Cylinder { radius, length },
            (None, None, Some(radius), None) => LinkForm::Sphere(radius),
            (None, None, None, Some(surface)) => LinkForm::Surface(surface),
            _ => {
                let message = "a shape is one of box, cylinder, sphere and surface: give one of them";
                return Err(checker.at(path, message));
            }
        };
        let rotation = rotation(self.turn);
        Ok(LinkShape { joint, place: DAffine3::from_rotation_translation(rotation, self.at), form })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_comes_back_to_within_its_steps_and_nothing_else_is_read() {
        let nodes =
            vec![DVec3::ZERO, DVec3::new(0.2, 0.0, 0.0), DVec3::new(0.0, 0.1, 0.0), DVec3::new(0.1, 0.03, -0.3)];
        let surface = LinkSurface { nodes, triangles: vec![[0, 1, 2], [1, 2, 3]] };
        let (text, bounds) = (surface.encode(), surface.bounds());
        let again = LinkSurface::decode(&text, bounds).unwrap();
        assert_eq!(again.triangles, surface.triangles);
        for (a, b) in again.nodes.iter().zip(&surface.nodes) {
            assert!((*a - *b).abs().max_element() <= 0.5 * 0.3 / STEPS + 1e-15, "{a} {b}");
        }
        let mut bytes = STANDARD.decode(&text).unwrap();
        let refused = |bytes: &[u8]| LinkSurface::decode(&STANDARD.encode(bytes), bounds).unwrap_err();
        assert!(LinkSurface::decode("%", bounds).unwrap_err().contains("base64"));
        assert!(refused(&bytes[..5]).contains("short"));
        assert!(refused(&bytes[..bytes.len() - 1]).contains("does not hold"));
        let last = bytes.len() - 2;
        bytes[last] = 4;
        assert!(refused(&bytes).contains("node 4 of 4"));
        bytes[3] = 0xff;
        assert!(refused(&bytes).contains("at most"));
    }
}
