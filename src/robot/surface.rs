//! Surfaces of shapes, as triangles.

use super::{Geometry, Placed, document::Source, package};
use crate::{Error, object, proxy, scene::Placement};
use glam::DVec3;
use std::path::Path;

/// Largest coordinate of a mesh (m).
const LARGEST: f64 = 1e6;

/// Nodes (m) and triangles of a surface, which may be open.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    pub nodes: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// Returns the surface of `shape` in the frame in which it is placed.
    pub fn of(shape: &Placed, source: &Source<'_>, packages: Option<&Path>) -> Result<Self, Error> {
        let refuse = |message: String| source.error(shape.span.clone(), message);
        let mut surface = match &shape.geometry {
            Geometry::Box(size) => Self::from(proxy::block(*size)),
            Geometry::Cylinder { radius, length } => Self::from(proxy::cylinder(*radius, *length)),
            Geometry::Sphere(radius) => Self::from(proxy::sphere(*radius)),
            Geometry::Capsule { radius, length } => Self::from(proxy::capsule(*radius, *length)),
            Geometry::Mesh { file, scale } => {
                let file = package::resolve(file, source.path, packages).map_err(refuse)?;
                // Merged nodes and dropped faces change no surface.
                let read = object::read_surface(&file, &Placement::METRES, &mut Vec::new());
                let (mut nodes, triangles) = read.map_err(|error| refuse(error.to_string()))?;
                nodes.iter_mut().for_each(|node| *node *= *scale);
                let sound = triangles.as_flattened().iter().all(|&node| {
                    nodes.get(node as usize).is_some_and(|node: &DVec3| node.abs().max_element() <= LARGEST)
                });
                if triangles.is_empty() || !sound {
                    let what = if sound {
                        "has no triangles"
                    } else {
                        "has corners that are missing or beyond a thousand kilometres"
                    };
                    return Err(refuse(format!("{} {what}: export the mesh again", file.display())));
                }
                Self { nodes, triangles }
            }
        };
        surface.nodes.iter_mut().for_each(|node| *node = shape.place.transform_point3(*node));
        Ok(surface)
    }

    /// Returns what is told of a mesh too long for a link: it was drawn in millimetres.
    pub fn oversize(&self, shape: &Placed) -> Option<String> {
        let Geometry::Mesh { file, .. } = &shape.geometry else { return None };
        let length = object::length(&self.nodes);
        (length > object::MOST_METRES).then(|| {
            format!(
                "the mesh {file:?} is {length:.0} m long: if its coordinates are millimetres, give \
                 scale=\"0.001 0.001 0.001\" in its <mesh>"
            )
        })
    }

    /// Returns corners of a triangle (m).
    pub fn corners(&self, triangle: [u32; 3]) -> [DVec3; 3] {
        triangle.map(|node| self.nodes[node as usize])
    }

    /// Returns the area of each triangle (m^2).
    pub fn areas(&self) -> impl Iterator<Item = f64> {
        self.triangles.iter().map(|&triangle| {
            let [a, b, c] = self.corners(triangle);
            0.5 * (b - a).cross(c - a).length()
        })
    }
}

impl From<proxy::Triangles> for Surface {
    fn from((nodes, triangles): proxy::Triangles) -> Self {
        Self { nodes, triangles }
    }
}
