//! Random configurations that judge a store: what it gives there beside what is solved directly.
//!
//! They are solved from rest, and while a store is filled from nodes around them, too: from the corner of the finest
//! cell that predicts the lowest energy, where that is lower (`lowest.rs`). So a store of the lowest equilibria is
//! compared with the lowest. A cell of six joints has 64 corners: a search from each that predicts less would take
//! longer than the store.

use super::nodebook::HeldNodes;
use crate::{
    contact::{Model, Solvers, Status},
    dataset::{InterpolationError, MeasuredError},
    scene::Interpolation,
    store::Store,
    sweep::{
        lowest::{self, Lattice},
        reference::Reference,
    },
};

impl Reference {
    /// Returns the errors of the torque of `store`, and the excess of friction where `model` asks for slips.
    #[must_use]
    pub fn measure(&self, store: &Store, model: &Model<'_>) -> MeasuredError {
        let errors = self.distances(|q| store.sample(q).torque());
        let interpolation = Interpolation::Potential;
        let measured = self.measured(interpolation, vec![InterpolationError::of(interpolation.name(), errors)]);
        MeasuredError { friction: self.friction_excess(model), ..measured }
    }

    /// Replaces equilibria by lower ones that `solvers` reach from the `nodes` around them.
    pub(super) fn lower(&mut self, solvers: &Solvers<'_>, nodes: &HeldNodes) {
        let reference = &*self;
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
                self.replace(k, &lowest);
            }
        }
    }
}
