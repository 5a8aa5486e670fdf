//! The deformed surface, for searches near a point. Nodes are displaced, and packets of triangles placed, when a search
//! first comes to them, so that what a search costs does not grow with the size of the mesh.

use crate::contact::geometry::bounding_volumes::{Leaf, Volume};
use crate::contact::geometry::closest_point::{ClosestPoint, Feature};
use crate::contact::geometry::facet::Facet;
use crate::contact::geometry::packet::Packet;
use crate::contact::model::{Model, MotionBound};
use crate::object::Compliance;
use glam::DVec3;

/// A leaf's triangles where they are now.
#[derive(Clone)]
struct Place {
    /// The surface's number when they were placed.
    surface: u64,
    packet: Packet,
    /// Box around them.
    volume: Volume,
}

/// The surface, as displaced last.
pub struct Deformation {
    /// How many surfaces there have been.
    surface: u64,
    /// How far its points have moved at most.
    pub bound: MotionBound,
    /// Forces that displace it: where the rows of C begin at the nodes that carry them, and the forces (N).
    loads: Vec<(usize, [f64; 3])>,
    /// The surface's number when each node was displaced.
    displaced: Vec<u64>,
    /// Displacement of the nodes that are displaced (m).
    displacement: Vec<DVec3>,
    /// Their positions (m).
    pub positions: Vec<DVec3>,
    places: Vec<Place>,
    /// Facets that were formed last: neighbouring proxy nodes look at the same few.
    formed: Vec<Formed>,
}

/// A facet where it is now.
#[derive(Clone)]
struct Formed {
    /// The surface's number when it was formed, and the facet's.
    surface: u64,
    triangle: u32,
    facet: Facet,
}

/// Facets that are kept: more than the forearm of any scene that ships looks at.
const KEPT: usize = 256;

impl Deformation {
    /// For the surface of `model`.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let place = |leaf: &Leaf| Place { surface: 0, packet: Packet::default(), volume: leaf.volume };
        Self {
            surface: 0,
            bound: MotionBound::default(),
            loads: Vec::with_capacity(model.surface.positions.len()),
            displaced: vec![0; model.surface.positions.len()],
            displacement: vec![DVec3::ZERO; model.surface.positions.len()],
            positions: model.surface.positions.clone(),
            places: model.surface.bounds.leaves.iter().map(place).collect(),
            formed: vec![Formed { surface: 0, triangle: 0, facet: Facet::flat([DVec3::ZERO; 3]) }; KEPT],
        }
    }

    /// Another surface, displaced by `forces` on `nodes`, three numbers a node (N), within `bound`.
    pub fn take(&mut self, model: &Model, nodes: &[u32], forces: &[f64], bound: MotionBound) {
        self.surface += 1;
        self.bound = bound;
        let Compliance { rows_per_node, .. } = *model.compliance;
        let block = rows_per_node * model.compliance.order();
        self.loads.clear();
        self.loads.extend(nodes.iter().zip(forces.as_chunks().0).filter_map(|(&node, &force)| {
            let place = (force != [0.0; 3]).then(|| model.compliance.place(node)).flatten()?;
            Some((place * block, force))
        }));
    }

    /// Displacement of a node; zero where the compliance does not cover it (m).
    pub fn displacement(&mut self, model: &Model, node: u32) -> DVec3 {
        self.displace(model, node);
        self.displacement[node as usize]
    }

    fn displace(&mut self, model: &Model, node: u32) {
        let j = node as usize;
        if self.displaced[j] == self.surface {
            return;
        }
        self.displaced[j] = self.surface;
        let mut u = DVec3::ZERO;
        if let Some(place) = model.compliance.place(node) {
            let entries = &model.compliance.entries;
            if model.compliance.rows_per_node == 1 {
                for &(start, force) in &self.loads {
                    u += DVec3::from_array(force) * entries[start + place];
                }
            } else {
                // C is symmetric: the rows of the node that carries force are columns of this one.
                let order = model.compliance.order();
                for &(start, force) in &self.loads {
                    for (a, component) in force.into_iter().enumerate() {
                        u += DVec3::from_slice(&entries[start + a * order + 3 * place..]) * component;
                    }
                }
            }
        }
        self.displacement[j] = u;
        self.positions[j] = model.surface.positions[j] + u;
    }

    /// Pseudonormal at `point` of facet `t`, outward, not of length one.
    pub fn pseudonormal(&mut self, model: &Model, t: u32, point: &ClosestPoint) -> DVec3 {
        let (triangles, topology) = (&model.object.triangles, &model.object.topology);
        match point.feature {
            Feature::Face => return self.facet(model, t).normal(point.weights),
            Feature::Edge(k) => {
                self.displace_facet(model, t);
                self.displace_facet(model, topology.across[t as usize][k]);
            }
            Feature::Vertex(k) => {
                let around = topology.triangles_around(triangles[t as usize][k] as usize);
                around.iter().for_each(|&around| self.displace_facet(model, around));
            }
        }
        model.surface.pseudonormal(&self.positions, t, point)
    }

    fn displace_facet(&mut self, model: &Model, t: u32) {
        model.surface.carriers(t).0.iter().for_each(|&node| self.displace(model, node));
    }

    /// Facet `t` (m).
    pub fn facet(&mut self, model: &Model, t: u32) -> &Facet {
        let at = t as usize % KEPT;
        if self.formed[at].surface != self.surface || self.formed[at].triangle != t {
            self.displace_facet(model, t);
            let facet = model.surface.facet(&self.positions, t);
            self.formed[at] = Formed { surface: self.surface, triangle: t, facet };
        }
        &self.formed[at].facet
    }

    /// Calls `visit` with each facet of the surface whose flat triangle is nearer to `x` than the squared radius that
    /// `visit` returned last; `radius_squared` is the first (m^2). Some that are as near but for rounding may be among
    /// them.
    pub fn search(&mut self, model: &Model, x: DVec3, radius_squared: f64, mut visit: impl FnMut(u32, &Facet) -> f64) {
        let slack = model.surface.bounds.slack(x);
        let moved = self.bound.moved;
        // Of boxes at rest.
        let widened = |bound: f64| (bound.sqrt() + moved).powi(2) + slack;
        let mut bound = radius_squared + slack;
        let mut limit = widened(bound);
        model.surface.bounds.walk(x, limit, |leaf| {
            self.place(model, leaf);
            if self.places[leaf].volume.distance_squared(x) <= bound {
                let mut nearer = false;
                let squares = self.places[leaf].packet.distances_squared(x);
                for (&triangle, square) in model.surface.bounds.leaves[leaf].triangles.iter().zip(squares) {
                    if square <= bound {
                        bound = visit(triangle, self.facet(model, triangle)) + slack;
                        nearer = true;
                    }
                }
                if nearer {
                    limit = widened(bound);
                }
            }
            limit
        });
    }

    /// Places the triangles of leaf `leaf`.
    fn place(&mut self, model: &Model, leaf: usize) {
        if self.places[leaf].surface == self.surface {
            return;
        }
        let nodes = &model.surface.bounds.leaves[leaf].nodes;
        nodes.as_flattened().iter().for_each(|&node| self.displace(model, node));
        let place = &mut self.places[leaf];
        place.surface = self.surface;
        place.packet.set(&self.positions, nodes);
        place.volume = Volume::new(place.packet.bounds());
    }
}
