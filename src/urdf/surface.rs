//! Surfaces of shapes, as triangles.

use super::{Geometry, Placed, UrdfError, document::Source, package};
use crate::object;
use glam::DVec3;
use std::f64::consts::TAU;
use std::path::Path;

/// Sides of a cylinder: its surface is met to 0.12 % of the radius.
const SIDES: usize = 64;

/// Parts of an edge of the icosahedron that stands for a sphere: it is met to 0.4 % of the radius.
const DIVISIONS: usize = 8;

/// Largest coordinate of a mesh [m].
const LARGEST: f64 = 1e6;

/// Faces of a box, whose corner k has the upper x, y and z where bit 0, 1 and 2 of k are set.
const FACES: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

/// Nodes [m] and triangles of a surface, which may be open.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    pub nodes: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// Returns the surface of `shape` in the frame in which it is placed.
    pub fn of(shape: &Placed, source: &Source<'_>, packages: Option<&Path>) -> Result<Self, UrdfError> {
        let refuse = |message: String| source.error(shape.span.clone(), message);
        let mut surface = match &shape.geometry {
            Geometry::Box(size) => block(*size),
            Geometry::Cylinder { radius, length } => cylinder(*radius, *length),
            Geometry::Sphere(radius) => {
                let sphere = object::icosphere(DVec3::ZERO, *radius, DIVISIONS);
                let (nodes, triangles) = sphere.map_err(|error| refuse(error.to_string()))?;
                Self { nodes, triangles }
            }
            Geometry::Mesh { file, scale } => {
                let file = package::resolve(file, source.path, packages).map_err(refuse)?;
                if file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("dae")) {
                    let message = "COLLADA (.dae) is not read: convert the mesh to STL or OBJ (Blender, or `trimesh` \
                                   from pip), or give the link a <collision> with a box, a cylinder or a sphere";
                    return Err(refuse(message.into()));
                }
                // Merged nodes and dropped faces change no surface.
                let read = object::read_surface(&file, 1.0, DVec3::ZERO, &mut Vec::new());
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

    /// Returns corners of a triangle [m].
    pub fn corners(&self, triangle: [u32; 3]) -> [DVec3; 3] {
        triangle.map(|node| self.nodes[node as usize])
    }

    /// Returns the area of each triangle [m^2].
    pub fn areas(&self) -> impl Iterator<Item = f64> {
        self.triangles.iter().map(|&triangle| {
            let [a, b, c] = self.corners(triangle);
            0.5 * (b - a).cross(c - a).length()
        })
    }
}

fn block(size: DVec3) -> Surface {
    let corner =
        |k: u32| 0.5 * size * DVec3::from_array([0, 1, 2].map(|bit| if k >> bit & 1 == 1 { 1.0 } else { -1.0 }));
    let triangles = FACES.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    Surface { nodes: (0..8).map(corner).collect(), triangles: triangles.collect() }
}

fn cylinder(radius: f64, length: f64) -> Surface {
    let mut nodes = vec![DVec3::Z * -0.5 * length, DVec3::Z * 0.5 * length];
    for side in 0..SIDES {
        let (sin, cos) = (TAU * side as f64 / SIDES as f64).sin_cos();
        nodes.extend([-0.5, 0.5].map(|end| DVec3::new(radius * cos, radius * sin, end * length)));
    }
    let rim = |side: usize, end: u32| 2 + 2 * (side % SIDES) as u32 + end;
    let triangles = (0..SIDES).flat_map(|side| {
        let [a, b] = [0, 1].map(|end| rim(side, end));
        let [c, d] = [0, 1].map(|end| rim(side + 1, end));
        [[a, c, d], [a, d, b], [0, c, a], [1, b, d]]
    });
    Surface { triangles: triangles.collect(), nodes }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_closed_outward_and_have_the_area_and_volume_of_their_shape() {
        let volume = |surface: &Surface| -> f64 {
            surface.triangles.iter().map(|&t| surface.corners(t)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
        };
        let block = block(DVec3::new(0.1, 0.2, 0.3));
        assert!((block.areas().sum::<f64>() - 0.22).abs() < 1e-15 && (volume(&block) - 0.006).abs() < 1e-15);
        let cylinder = cylinder(0.1, 0.5);
        let area = TAU * 0.1 * 0.5 + TAU * 0.01;
        assert!((cylinder.areas().sum::<f64>() / area - 1.0).abs() < 2e-3);
        assert!((volume(&cylinder) / (0.5 * TAU * 0.01 * 0.5) - 1.0).abs() < 2e-3);
    }
}
