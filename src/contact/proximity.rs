//! How near the proxy comes to the surface at rest, without solving anything.

use super::detection::Detection;
use super::model::Model;
use crate::proxy::Pose;

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
    /// moves [m].
    pub fn gap(&mut self, q: &[f64]) -> f64 {
        self.model.chain.pose(q, &mut self.pose);
        self.detection.set_configuration(self.model, &self.pose.nodes)
    }

    /// A lower bound of what each proxy node contributes to the last gap [m].
    pub fn clearances(&self) -> impl Iterator<Item = f64> {
        let nodes = self.model.chain.nodes.iter();
        self.detection.distances().zip(nodes).map(|(distance, node)| distance - node.radius)
    }

    /// The proxy's pose at the last configuration measured.
    #[must_use]
    pub fn pose(&self) -> &Pose {
        &self.pose
    }
}
