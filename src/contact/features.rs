//! All features of the surface that a node of radius r feels, and how often each counts.
//!
//! A ball in a hollow touches more than one wall. The depth r - (least distance) would then have a kink, on which nothing
//! balances; so walls are springs of their own. With phi(d) = max(0, r - d)^2 and d the distance of the node to a closed
//! face, edge or vertex, the node's energy is
//! `kc/2 (sum over faces phi - sum over edges phi + sum over vertices phi)`.
//! Every term has a continuous gradient, and so has the sum, wherever the node goes. A cell whose closest point lies on
//! its rim cancels against the smaller cell there; so, gathered by where the closest points lie, few terms are left (this
//! is the Euler characteristic of the surface within reach): over a flat, convex or gently hollow surface the one closest
//! point, as for a point node; in a crease its two walls, +1 each, and -1 for the edge between them where that is within
//! reach, so that the second wall is not felt before there is one.
//!
//! Where the centre passes the surface itself, E has a kink at the edges and vertices of dents: inside it is the closest feature that
//! pushes, in any direction of a cone. A ball about as soft as the object may come to rest there: see [`super::pins`]. Blended facets
//! have no such place.
//!
//! Only what is seen from outside counts (the pseudonormal decides): the far side of a thin wall does not push.

use super::closest_point::{ClosestPoint, Feature, point_at};
use super::surface;
use crate::object::Topology;
use crate::tolerances::MINIMUM_SQUARE;
use glam::DVec3;

/// A feature with a closest point of its own.
#[derive(Clone, Copy, Debug)]
pub struct Felt {
    /// Triangle that has the feature.
    pub triangle: u32,
    /// Closest point.
    pub point: ClosestPoint,
    /// How often it counts: one for a wall, minus one for an edge between two.
    pub share: i32,
    /// Its pseudonormal, turned towards the node where sides make no difference.
    pub normal: DVec3,
    /// Whether the node lies on its outer side.
    pub outer: bool,
    /// Distance of the node [m].
    pub distance: f64,
    /// Face, edge or vertex of the whole surface: which of them, and its triangle, its two nodes or its node.
    key: (u8, u32, u32),
}

/// Gathers the features that one node feels; its lists are reused from node to node.
#[derive(Default)]
pub struct Features {
    /// Triangles within reach, with their closest points.
    near: Vec<(u32, ClosestPoint)>,
    felt: Vec<Felt>,
}

impl Features {
    /// No triangles.
    pub fn clear(&mut self) {
        self.near.clear();
    }

    /// Takes in a triangle within reach.
    pub fn push(&mut self, triangle: u32, point: ClosestPoint) {
        self.near.push((triangle, point));
    }

    /// The features, with what they count, that the node at `x` with `radius` feels through the triangles taken in, which
    /// must be all within reach; not `joined`, each triangle counts by itself, seen from either side.
    pub fn gather(
        &mut self,
        x: DVec3,
        radius: f64,
        positions: &[DVec3],
        triangles: &[[u32; 3]],
        topology: &Topology,
        joined: bool,
    ) -> &[Felt] {
        let Self { near, felt } = self;
        felt.clear();
        let reach = radius * radius;
        for &(t, point) in near.iter() {
            add(felt, triangles, t, point, 1);
            if !joined {
                continue;
            }
            let nodes = triangles[t as usize];
            let corners = surface::corners(positions, nodes);
            for k in 0..3 {
                if t < topology.across[t as usize][k] {
                    let point = closest_on_edge(x, corners, k);
                    if x.distance_squared(point_at(corners, point.weights)) < reach {
                        add(felt, triangles, t, point, -1);
                    }
                }
                let first = topology.around[topology.around_offsets[nodes[k] as usize] as usize];
                if t == first && x.distance_squared(corners[k]) < reach {
                    let mut weights = [0.0; 3];
                    weights[k] = 1.0;
                    add(felt, triangles, t, ClosestPoint { weights, feature: Feature::Vertex(k) }, 1);
                }
            }
        }
        felt.retain(|felt| felt.share != 0);
        for felt in felt.iter_mut() {
            let t = felt.triangle as usize;
            let offset = x - point_at(surface::corners(positions, triangles[t]), felt.point.weights);
            let normal = surface::pseudonormal(positions, triangles, topology, t, felt.point.feature);
            felt.normal = if !joined && offset.dot(normal) <= 0.0 { -normal } else { normal };
            felt.outer = offset.dot(felt.normal) > 0.0;
            felt.distance = offset.length();
        }
        felt
    }
}

/// Counts a cell's closest point for the feature that it lies on.
fn add(felt: &mut Vec<Felt>, triangles: &[[u32; 3]], t: u32, point: ClosestPoint, share: i32) {
    let nodes = triangles[t as usize];
    let key = match point.feature {
        Feature::Face => (0, t, t),
        Feature::Edge(k) => {
            let (a, b) = (nodes[k], nodes[(k + 1) % 3]);
            (1, a.min(b), a.max(b))
        }
        Feature::Vertex(k) => (2, nodes[k], nodes[k]),
    };
    match felt.iter_mut().find(|felt| felt.key == key) {
        Some(felt) => felt.share += share,
        None => felt.push(Felt { triangle: t, point, share, normal: DVec3::ZERO, outer: false, distance: 0.0, key }),
    }
}

/// Closest point of edge k.
pub fn closest_on_edge(x: DVec3, corners: [DVec3; 3], k: usize) -> ClosestPoint {
    let (a, b) = (corners[k], corners[(k + 1) % 3]);
    let along = b - a;
    let share = (x - a).dot(along) / along.length_squared().max(MINIMUM_SQUARE);
    let mut weights = [0.0; 3];
    let feature = if share <= 0.0 {
        weights[k] = 1.0;
        Feature::Vertex(k)
    } else if share >= 1.0 {
        weights[(k + 1) % 3] = 1.0;
        Feature::Vertex((k + 1) % 3)
    } else {
        weights[k] = 1.0 - share;
        weights[(k + 1) % 3] = share;
        Feature::Edge(k)
    };
    ClosestPoint { weights, feature }
}
