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

    /// The gap at the joint coordinates `q`, as [`super::Equilibrium::gap`] has it: the smallest signed distance of a proxy
    /// node to the surface at rest, less its radius [m].
    pub fn gap(&mut self, q: &[f64]) -> f64 {
        self.model.chain.pose(q, &mut self.pose);
        self.detection.take_up(self.model, &self.pose.nodes)
    }

    /// A lower bound of what each proxy node contributes to the last gap, its signed distance less its radius [m].
    pub fn clearances(&self) -> impl Iterator<Item = f64> {
        self.detection.distances().zip(&self.model.chain.nodes).map(|(distance, node)| distance - node.radius)
    }

    /// The proxy's pose at the last configuration measured.
    #[must_use]
    pub fn pose(&self) -> &Pose {
        &self.pose
    }
}
