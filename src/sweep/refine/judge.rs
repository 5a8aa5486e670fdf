//! Random configurations that judge a store: what it gives there beside what is solved directly.
//!
//! They are solved from rest, and while a store is filled from nodes around them, too: from the corner of the finest
//! cell that predicts the lowest energy, where that is lower (`lowest.rs`). So a store of the lowest equilibria is
//! compared with the lowest. A cell of six joints has 64 corners: a search from each that predicts less would take
//! longer than the store.

use super::nodebook::HeldNodes;
use crate::{
    Error, JointVector,
    contact::{Model, Solvers, Status},
    dataset::{InterpolationError, MeasuredError},
    scene::{Interpolation, Scene},
    store::Store,
    sweep::{
        lowest::{self, Lattice},
        reference::Reference,
    },
};

/// Random configurations, solved directly, with which interpolations are compared.
pub struct Judge(pub(super) Reference);

impl Judge {
    /// Draws configurations in the grid of `scene` until `contacts` of them are in contact, the same ones every time
    /// for the same `seed`.
    ///
    /// # Errors
    /// When nothing touches.
    pub fn new(scene: &Scene, model: &Model<'_>, seed: u64, contacts: usize) -> Result<Self, Error> {
        Reference::in_contact(scene, model, seed, contacts).map(Self)
    }

    /// Number of configurations that were solved, free ones among them.
    #[must_use]
    pub fn solved(&self) -> usize {
        self.0.solved()
    }

    /// Mean number of the object's nodes with a contact force, of all configurations (1).
    #[must_use]
    pub fn mean_forces(&self) -> f64 {
        self.0.mean_forces()
    }

    /// Rms of the torque (the unit of its norm).
    #[must_use]
    pub fn torque(&self) -> f64 {
        self.0.torque
    }

    /// Rms error of the torque that `answer` gives, over the rms of the torque (1).
    pub fn relative_error(&self, answer: impl FnMut(&JointVector) -> JointVector) -> f64 {
        self.0.errors(answer).0 / self.0.torque
    }

    /// Returns the errors of the torque of `store`, and the excess of friction where `model` asks for slips.
    #[must_use]
    pub fn measure(&self, store: &Store, model: &Model<'_>) -> MeasuredError {
        let errors = self.0.distances(|q| store.sample(q).torque());
        let interpolation = Interpolation::Potential;
        let measured = self.0.measured(interpolation, vec![InterpolationError::of(interpolation.name(), errors)]);
        MeasuredError { friction: self.0.friction_excess(model), ..measured }
    }

    /// Replaces equilibria by lower ones that `solvers` reach from the `nodes` around them.
    pub(super) fn lower(&mut self, solvers: &Solvers<'_>, nodes: &HeldNodes) {
        let reference = &self.0;
        let places: Vec<usize> = (0..reference.places.len()).collect();
        let found = solvers.map(&places, |solver, &k| {
            let (q, here) = (&reference.places[k], reference.result(k));
            let (corners, spacing) = nodes.around(q).filter(|_| here.status == Status::Contact)?;
            let starts = corners.into_iter().filter(|&corner| nodes.status(corner) == Status::Contact);
            let promising = starts.map(|corner| {
                let there = (&nodes.configuration(corner), &nodes.result(corner));
                (lowest::excess((q, &here), there, spacing.iter().copied()), corner)
            });
            let (_, corner) = promising.filter(|(excess, _)| *excess > 0.0).max_by(|a, b| a.0.total_cmp(&b.0))?;
            lowest::lower(solver, q, Some(&here), std::iter::once(nodes.forces(corner)))
        });
        for (k, lowest) in found.into_iter().enumerate() {
            if let Some(lowest) = lowest {
                self.0.replace(k, &lowest);
            }
        }
    }
}
