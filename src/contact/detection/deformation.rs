//! The deformed surface, for searches near a point. Nodes are displaced, and packets of triangles placed, when a search first comes
//! to them, so that what a search costs does not grow with the size of the mesh.

use crate::contact::geometry::bounding_volumes::{Leaf, Volume};
use crate::contact::geometry::closest_point::Feature;
use crate::contact::geometry::normals;
use crate::contact::geometry::packet::Packet;
use crate::contact::model::Model;
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
    /// An upper bound of how far any point of the surface is from where it rests [m].
    pub moved: f64,
    /// Forces that displace it: where the rows of C begin at the nodes that carry them, and the forces [N].
    loads: Vec<(usize, [f64; 3])>,
    /// The surface's number when each node was displaced.
    displaced: Vec<u64>,
    /// Displacement of the nodes that are displaced [m].
    displacement: Vec<DVec3>,
    /// Their positions [m].
    pub positions: Vec<DVec3>,
    places: Vec<Place>,
}

impl Deformation {
    /// For the surface of `model`.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let place = |leaf: &Leaf| Place { surface: 0, packet: Packet::default(), volume: leaf.volume };
        Self {
            surface: 0,
            moved: 0.0,
            loads: Vec::new(),
            displaced: vec![0; model.surface.positions.len()],
            displacement: vec![DVec3::ZERO; model.surface.positions.len()],
            positions: model.surface.positions.clone(),
            places: model.surface.bounds.leaves.iter().map(place).collect(),
        }
    }

    /// Another surface, displaced by `forces` on `nodes`, three numbers a node [N], nowhere by more than `moved` [m].
    pub fn take(&mut self, model: &Model, nodes: &[u32], forces: &[f64], moved: f64) {
        self.surface += 1;
        self.moved = moved;
        let Compliance { rows_per_node, .. } = *model.compliance;
        let block = rows_per_node * model.compliance.order();
        self.loads.clear();
        self.loads.extend(nodes.iter().zip(forces.as_chunks().0).filter_map(|(&node, &force)| {
            let place = (force != [0.0; 3]).then(|| model.compliance.place(node)).flatten()?;
            Some((place * block, force))
        }));
    }

    /// Displacement of a node; zero where the compliance does not cover it [m].
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

    /// Pseudonormal of a feature of triangle `t`, outward, not of length one.
    pub fn pseudonormal(&mut self, model: &Model, t: usize, feature: Feature) -> DVec3 {
        let (triangles, topology) = (&model.object.triangles, &model.object.topology);
        match feature {
            Feature::Face => {}
            Feature::Edge(k) => {
                triangles[topology.across[t][k] as usize].into_iter().for_each(|node| self.displace(model, node));
            }
            Feature::Vertex(k) => {
                for &around in topology.triangles_around(triangles[t][k] as usize) {
                    triangles[around as usize].into_iter().for_each(|node| self.displace(model, node));
                }
            }
        }
        normals::pseudonormal(&self.positions, triangles, topology, t, feature)
    }

    /// Corners of triangle `t` [m].
    pub fn corners(&mut self, model: &Model, t: u32) -> [DVec3; 3] {
        let nodes = model.object.triangles[t as usize];
        nodes.into_iter().for_each(|node| self.displace(model, node));
        normals::corners(&self.positions, nodes)
    }

    /// Calls `visit` with each triangle of the surface that is nearer to `x` than the squared radius that `visit` returned last, and
    /// with its corners; `radius_squared` is the first [m^2]. Some that are as near but for rounding may be among them.
    pub fn search(
        &mut self,
        model: &Model,
        x: DVec3,
        radius_squared: f64,
        mut visit: impl FnMut(u32, [DVec3; 3]) -> f64,
    ) {
        let slack = model.surface.bounds.slack(x);
        let moved = self.moved;
        // Of boxes at rest.
        let widened = |bound: f64| (bound.sqrt() + moved).powi(2) + slack;
        let mut bound = radius_squared + slack;
        let mut limit = widened(bound);
        model.surface.bounds.walk(x, limit, |leaf| {
            self.place(model, leaf);
            let Self { places, positions, .. } = self;
            let place = &places[leaf];
            if place.volume.distance_squared(x) <= bound {
                let mut nearer = false;
                for (&triangle, square) in
                    model.surface.bounds.leaves[leaf].triangles.iter().zip(place.packet.distances_squared(x))
                {
                    if square <= bound {
                        let corners = normals::corners(positions, model.object.triangles[triangle as usize]);
                        bound = visit(triangle, corners) + slack;
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
