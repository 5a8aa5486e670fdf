//! Random configurations that judge a store: what it gives there beside what is solved directly.

use crate::{
    JointVector,
    contact::Model,
    scene::Scene,
    sweep::reference::{Reference, ReferenceError},
};

/// Random configurations, solved directly, with which interpolations are compared.
pub struct Judge(pub(super) Reference);

impl Judge {
    /// Draws configurations in the grid of `scene` until `contacts` of them are in contact, the same ones every time
    /// for the same `seed`.
    ///
    /// # Errors
    /// When nothing touches.
    pub fn new(scene: &Scene, model: &Model<'_>, seed: u64, contacts: usize) -> Result<Self, ReferenceError> {
        Reference::in_contact(scene, model, seed, contacts).map(Self)
    }

    /// Number of configurations that were solved, free ones among them.
    #[must_use]
    pub fn solved(&self) -> usize {
        // Each is solved twice: see [`Reference::solve`].
        2 * (self.0.places.len() + self.0.left_out)
    }

    /// Rms of the torque [N m].
    #[must_use]
    pub fn torque(&self) -> f64 {
        self.0.torque
    }

    /// Rms error of the torque that `answer` gives, over the rms of the torque [1].
    pub fn relative_error(&self, answer: impl FnMut(&JointVector) -> JointVector) -> f64 {
        self.0.errors(answer).0 / self.0.torque
    }
}
