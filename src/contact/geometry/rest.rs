//! The surface at rest: what of its geometry is computed once and shared by all threads.

use super::bounding_volumes::BoundingVolumes;
use super::closest_point::{Closest, Feature, point_at};
use super::distance_bounds::DistanceBounds;
use super::normals;
use crate::object::{Object, Topology};
use glam::DVec3;

/// A closed surface of triangles at rest, prepared for searches.
pub struct RestSurface<'a> {
    /// Middle of the surface's box [m]. All contact geometry is relative to it, so that an object far from the world's origin
    /// loses no digits.
    pub centre: DVec3,
    /// Distance of the farthest node from the centre [m].
    pub extent: f64,
    /// Positions of the nodes, relative to the centre [m].
    pub positions: Vec<DVec3>,
    /// Nodes of each triangle, anticlockwise seen from outside.
    pub triangles: &'a [[u32; 3]],
    /// Which triangles lie side by side.
    pub topology: &'a Topology,
    /// The triangles, for closest-point queries.
    pub bounds: BoundingVolumes,
    /// What is known of distances without such a query.
    pub distance_bounds: DistanceBounds,
    /// Mean length of the edges [m].
    pub mean_edge: f64,
    /// Unit normals of the triangles.
    pub normals: Vec<DVec3>,
    /// Angle-weighted pseudonormals of the nodes, not of length one.
    pub pseudonormals: Vec<DVec3>,
}

impl<'a> RestSurface<'a> {
    /// The surface of `object`.
    #[must_use]
    pub fn new(object: &'a Object) -> Self {
        let Object { triangles, topology, .. } = object;
        let nodes = &object.rest[..object.surface_nodes];
        let low = nodes.iter().copied().fold(DVec3::MAX, DVec3::min);
        let high = nodes.iter().copied().fold(DVec3::MIN, DVec3::max);
        let centre = low.midpoint(high);
        let positions: Vec<DVec3> = nodes.iter().map(|&position| position - centre).collect();
        let pseudonormal = |t, feature| normals::pseudonormal(&positions, triangles, topology, t, feature);
        let mut pseudonormals = vec![DVec3::ZERO; positions.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            for (k, &node) in triangle.iter().enumerate() {
                pseudonormals[node as usize] = pseudonormal(t, Feature::Vertex(k));
            }
        }
        let mut surface = Self {
            centre,
            extent: positions.iter().map(|position| position.length()).fold(0.0, f64::max),
            bounds: BoundingVolumes::new(&positions, triangles),
            distance_bounds: DistanceBounds::none(),
            mean_edge: normals::mean_edge(&positions, triangles),
            normals: (0..triangles.len()).map(|t| pseudonormal(t, Feature::Face)).collect(),
            pseudonormals,
            positions,
            triangles,
            topology,
        };
        surface.distance_bounds = DistanceBounds::new(&surface);
        surface
    }

    /// Corners of triangle `t` [m].
    #[inline]
    #[must_use]
    pub fn corners(&self, t: u32) -> [DVec3; 3] {
        normals::corners(&self.positions, self.triangles[t as usize])
    }

    /// Pseudonormal of a feature of triangle `t`, outward, not of length one.
    #[must_use]
    pub fn pseudonormal(&self, t: u32, feature: Feature) -> DVec3 {
        let t = t as usize;
        match feature {
            Feature::Face => self.normals[t],
            Feature::Edge(k) => self.normals[t] + self.normals[self.topology.across[t][k] as usize],
            Feature::Vertex(k) => self.pseudonormals[self.triangles[t][k] as usize],
        }
    }

    /// Closest feature to `x`; `near` is a triangle near by, if any is known.
    #[must_use]
    pub fn closest(&self, x: DVec3, near: u32) -> Closest {
        let mut closest = Closest::none();
        if (near as usize) < self.triangles.len() {
            closest.consider(x, self.corners(near), near);
        }
        self.bounds.search(x, closest.distance_squared, |t| {
            if t != near {
                closest.consider(x, self.corners(t), t);
            }
            closest.distance_squared
        });
        closest
    }

    /// Whether `x`, to which `closest` is closest, lies inside.
    #[must_use]
    pub fn is_inside(&self, x: DVec3, closest: &Closest) -> bool {
        if closest.triangle == u32::MAX {
            return false;
        }
        let offset = point_at(self.corners(closest.triangle), closest.point.weights) - x;
        offset.dot(self.pseudonormal(closest.triangle, closest.point.feature)) > 0.0
    }
}
