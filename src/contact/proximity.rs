//! How near the proxy comes to the surface at rest, without solving anything.

use super::detection::Detection;
use super::model::Model;
use crate::proxy::Pose;
use glam::DVec3;
use serde::Serialize;

/// The contact node that is nearest to the surface at rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NearestNode {
    /// Number of the node.
    pub node: usize,
    /// Distance between node and surface, negative inside (m).
    pub gap: f64,
    /// Middle of the node in the world (m).
    pub position: DVec3,
    /// Nearest point of the surface at rest (m).
    pub surface: DVec3,
}

/// Measures configurations one after another with memory of its own; one per thread.
pub struct Proximity<'a> {
    model: &'a Model<'a>,
    pose: Pose,
    detection: Detection,
}

impl<'a> Proximity<'a> {
    /// A measure of `model`.
    #[must_use]
    pub fn new(model: &'a Model<'a>) -> Self {
        Self { model, pose: model.chain.new_pose(), detection: Detection::new(model) }
    }

    /// Places the proxy at the joint coordinates `q` without a search: [`Proximity::clearances`] are then bounds that
    /// may be negative though nothing touches. Returns the node whose bound is least.
    pub fn place(&mut self, q: &[f64]) -> usize {
        self.model.chain.pose(q, &mut self.pose);
        self.detection.place(self.model, &self.pose.nodes)
    }

    /// The gap at the joint coordinates `q`, [`super::Equilibrium::gap`], which no proxy node changes by more than it
    /// moves (m).
    pub fn gap(&mut self, q: &[f64]) -> f64 {
        self.model.chain.pose(q, &mut self.pose);
        self.detection.set_configuration(self.model, &self.pose.nodes)
    }

    /// The node that makes the gap at `q`.
    pub fn nearest(&mut self, q: &[f64]) -> NearestNode {
        let gap = self.gap(q);
        // The least bound is exact: it belongs to the node that made the gap.
        let node = self.clearances().enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(node, _)| node);
        let (surface, position) = (&self.model.surface, self.pose.nodes[node]);
        let closest = surface.closest(position - surface.centre, u32::MAX);
        let facet = surface.facet_at_rest(closest.triangle);
        NearestNode { node, gap, position, surface: surface.centre + facet.point(closest.point.weights) }
    }

    /// A lower bound of what each proxy node contributes to the last gap (m).
    pub fn clearances(&self) -> impl Iterator<Item = f64> {
        let nodes = self.model.chain.nodes.iter();
        self.detection.distances().zip(nodes).map(|(distance, node)| distance - node.radius)
    }

    /// The model whose configurations are measured.
    #[must_use]
    pub fn model(&self) -> &'a Model<'a> {
        self.model
    }

    /// The proxy's pose at the last configuration measured.
    #[must_use]
    pub fn pose(&self) -> &Pose {
        &self.pose
    }
}
