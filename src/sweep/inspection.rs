//! One configuration in full: what equation (2) says of it, for the eye and for other programs.

use crate::Error;
use crate::contact::{Equilibrium, Model, Solver};
use glam::DVec3;
use serde::Serialize;

/// One configuration in full. Vectors are in the world's frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// Configuration (rad or m).
    pub q: Vec<f64>,
    /// Status, in lower case.
    pub status: String,
    /// Iterations of the contact solver.
    pub iterations: u32,
    /// Relative residual (1).
    pub residual: f64,
    /// Stored energy U (J).
    pub energy: f64,
    /// Smallest signed distance of the proxy to the surface at rest (m).
    pub gap: f64,
    /// tau (N m or N).
    pub torque: Vec<f64>,
    /// Way over which an arm that slides leaves its dent: see [`crate::scene::RelaxationSpec::dent`]. Mean over all
    /// directions; none without contact (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dent: Option<f64>,
    /// All contact nodes of the proxy.
    pub proxy_nodes: Vec<ProxyNode>,
    /// All nodes of the object's surface.
    pub object_nodes: Vec<ObjectNode>,
}

/// A contact node of the proxy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProxyNode {
    /// Name of the joint whose link carries it.
    pub link: String,
    /// x_i (m).
    pub position: DVec3,
    /// Columns of J_i, one per joint (m/rad, or 1).
    pub jacobian: Vec<DVec3>,
    /// The contact there, if it touches anything.
    pub contact: Option<Contact>,
}

/// A contact of a proxy node.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Contact {
    /// Force on the proxy node (N).
    pub force: DVec3,
    /// The object's nodes that carry its reaction.
    pub nodes: Vec<u32>,
    /// Share of each.
    pub weights: Vec<f64>,
}

/// A node of the object's surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ObjectNode {
    /// n0 (m).
    pub rest: DVec3,
    /// n (m).
    pub position: DVec3,
    /// Contact force f_j on it (N).
    pub force: DVec3,
}

impl Inspection {
    /// Solves the configuration `q` and returns every detail.
    ///
    /// # Errors
    /// When the compliance of `model` is not that of all nodes, and there is no memory to find how far they move.
    pub fn new(model: &Model<'_>, q: &[f64]) -> Result<Self, Error> {
        let mut solver = Solver::new(model);
        let equilibrium = solver.solve(q);
        let (object, chain) = (model.object, model.chain);
        let mut forces = vec![DVec3::ZERO; object.rest.len()];
        equilibrium.forces.iter().for_each(|contact| forces[contact.node as usize] = contact.force);
        let displacement = if equilibrium.forces.is_empty() || model.compliance.is_whole() {
            solver.displacement().chunks_exact(3).map(DVec3::from_slice).collect()
        } else {
            object.displacement_under(&forces)?
        };
        let nodes = object.rest.iter().zip(displacement).zip(forces).take(object.surface_nodes);
        let object_nodes: Vec<ObjectNode> =
            nodes.map(|((&rest, moved), force)| ObjectNode { rest, position: rest + moved, force }).collect();
        let pose = solver.pose();
        let proxy_nodes =
            chain.nodes.iter().zip(&pose.nodes).enumerate().map(|(node, (specified, &position))| ProxyNode {
                link: chain.links[specified.link].spec.name.clone(),
                position,
                jacobian: (0..chain.joints.len()).map(|joint| chain.jacobian_column(pose, node, joint)).collect(),
                contact: equilibrium.touches.iter().find(|touch| touch.proxy_node as usize == node).map(|touch| {
                    let (nodes, weights) = touch.carriers.iter().copied().unzip();
                    Contact { force: touch.force, nodes, weights }
                }),
            });
        let proxy_nodes = proxy_nodes.collect();
        let Equilibrium { status, iterations, residual, energy, gap, torque, .. } = equilibrium;
        Ok(Self {
            q: q.to_vec(),
            status: format!("{status:?}").to_lowercase(),
            iterations,
            residual,
            energy,
            gap,
            torque: torque.to_vec(),
            dent: dent(&object_nodes),
            proxy_nodes,
            object_nodes,
        })
    }
}

/// Radius of a disc as large as the surface over which the forces can be moved until their dent has 1/e of the energy in
/// common with the one that is there, `f . u`, each force moved to the nearest node. Where the object is smaller, the way
/// to its farthest node over the logarithm of what is in common there (m).
fn dent(nodes: &[ObjectNode]) -> Option<f64> {
    let loaded: Vec<&ObjectNode> = nodes.iter().filter(|node| node.force != DVec3::ZERO).collect();
    let heaviest = loaded.iter().max_by(|a, b| a.force.length().total_cmp(&b.force.length()))?;
    let nearest = |place: DVec3| {
        nodes.iter().min_by(|a, b| a.rest.distance_squared(place).total_cmp(&b.rest.distance_squared(place)))
    };
    let shared = |moved: DVec3| -> f64 {
        let of = |on: &&ObjectNode| nearest(on.rest + moved).map(|at| on.force.dot(at.position - at.rest));
        loaded.iter().filter_map(of).sum()
    };
    let whole = shared(DVec3::ZERO);
    let of = |node: &ObjectNode| {
        let way = node.rest - heaviest.rest;
        (way.length(), shared(way) / whole)
    };
    let mut ways: Vec<(f64, f64)> = nodes.iter().map(of).collect();
    ways.sort_by(|a, b| a.0.total_cmp(&b.0));
    let within = ways.iter().filter(|(_, share)| *share > 1.0 / std::f64::consts::E).count();
    match ways.get(within) {
        Some((way, _)) => Some(*way),
        None => ways.last().map(|(way, share)| way / -share.ln()),
    }
}
