//! The account of a configuration: forces on the object's nodes, and the torque of the proxy's.

use super::model::Model;
use super::{Equilibrium, NodeForce};
use crate::proxy::Pose;
use glam::DVec3;

/// Sums of the contact forces on the object's nodes.
pub(crate) struct Reactions {
    /// Sum of each surface node (N), and whether it is among `touched`.
    sums: Vec<DVec3>,
    marked: Vec<bool>,
    touched: Vec<u32>,
}

impl Reactions {
    /// None yet on the object of `model`.
    pub fn new(model: &Model<'_>) -> Self {
        let nodes = model.surface.positions.len();
        Self { sums: vec![DVec3::ZERO; nodes], marked: vec![false; nodes], touched: Vec::new() }
    }

    /// Adds the reaction to `force` on a proxy node to the nodes that carry it.
    pub fn push_back(&mut self, carriers: &[(u32, f64)], force: DVec3) {
        carriers
            .iter()
            .filter(|(_, weight)| *weight != 0.0)
            .for_each(|&(node, weight)| self.push(node, -force * weight));
    }

    /// Adds `force` on `node`.
    pub fn push(&mut self, node: u32, force: DVec3) {
        if !std::mem::replace(&mut self.marked[node as usize], true) {
            self.touched.push(node);
        }
        self.sums[node as usize] += force;
    }

    /// Gives `equilibrium` the torque of its touches, and the forces on the object's nodes, ascending; none are left.
    pub fn account(&mut self, model: &Model<'_>, pose: &Pose, equilibrium: &mut Equilibrium) {
        for touch in &equilibrium.touches {
            model.chain.add_torque(pose, touch.proxy_node as usize, touch.force, &mut equilibrium.torque);
        }
        self.touched.sort_unstable();
        for node in self.touched.drain(..) {
            let force = std::mem::replace(&mut self.sums[node as usize], DVec3::ZERO);
            self.marked[node as usize] = false;
            equilibrium.forces.push(NodeForce { node, force });
        }
    }
}
