//! Directly solved random configurations, and the distance of other answers from them.

use super::{Backend, BackendError, CpuBackend, table::PointResult};
use crate::{
    JointVector,
    contact::{Equilibrium, Model, Status},
    random::Random,
    scene::{Algorithm, ContactSpec, JointKind, LEVER_ARM, Scene, lever_arm},
};

/// Relative residual to which the reference of an accuracy study is solved (1): three decades below the scenes' own
/// 1e-8, and still above what rounding leaves of a residual (about 1e-13).
pub const REFERENCE_TOLERANCE: f64 = 1e-11;

/// Most configurations that are drawn to find some in contact: a region in contact at a few in a thousand is still
/// seen.
const MOST_DRAWN: usize = 1 << 16;

/// Random configurations and their torques.
pub(crate) struct Reference {
    /// Configurations (rad or m).
    pub places: Vec<JointVector>,
    /// Torques there, converged.
    pub exact: Vec<JointVector>,
    /// Energies there (J).
    energies: Vec<f64>,
    pub in_contact: usize,
    pub left_out: usize,
    /// Mean number of the object's nodes with a contact force (1).
    pub mean_forces: f64,
    /// rms of the torque (N m).
    pub torque: f64,
    /// rms of its own error (N m).
    pub error: f64,
    levers: JointVector,
    /// As in [`MeasuredError`](crate::dataset::MeasuredError::lever_arm) (m).
    pub lever_arm: Option<f64>,
}

/// There is nothing to compare with.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// No backend.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// Nothing touches, or nothing converges.
    #[error(
        "the proxy touches nothing, or contact converges nowhere, at {0} random configurations: give the scene's \
         grid a region where the proxy touches the object"
    )]
    NoContact(usize),
}

impl Reference {
    /// Solves `count` random configurations within the grid of `scene`, the same ones every time for the same `seed`.
    pub fn solve(scene: &Scene, model: &Model<'_>, seed: u64, count: usize) -> Result<Self, ReferenceError> {
        let mut random = Random::new(seed);
        let place = |_| {
            let mut q = JointVector::zeros(scene.grid.axes.len());
            for (q, axis) in q.iter_mut().zip(&scene.grid.axes) {
                *q = axis.start + random.between(0.0, 1.0) * axis.step * (axis.count - 1) as f64;
            }
            q
        };
        let drawn: Vec<JointVector> = (0..count).map(place).collect();
        let converged = equilibria(model, tight(scene.contact, REFERENCE_TOLERANCE), &drawn)?;
        let rougher = equilibria(model, tight(scene.contact, 100.0 * REFERENCE_TOLERANCE), &drawn)?;
        let mut levers = JointVector::zeros(model.chain.joints.len());
        levers.iter_mut().zip(&scene.proxy.joints).for_each(|(lever, joint)| {
            *lever = if joint.kind == JointKind::Prismatic { LEVER_ARM } else { 1.0 };
        });
        let forces: usize = converged.iter().map(|equilibrium| equilibrium.forces.len()).sum();
        let mut reference = Self {
            places: Vec::new(),
            exact: Vec::new(),
            energies: Vec::new(),
            in_contact: 0,
            left_out: 0,
            mean_forces: forces as f64 / count.max(1) as f64,
            torque: 0.0,
            error: 0.0,
            levers,
            lever_arm: lever_arm(scene.proxy.joints.iter().map(|joint| joint.kind.unit())),
        };
        let mut rough = Vec::new();
        for ((q, equilibrium), other) in drawn.into_iter().zip(converged).zip(rougher) {
            match equilibrium.status {
                Status::Free | Status::Contact => {
                    reference.in_contact += usize::from(equilibrium.status == Status::Contact);
                    reference.places.push(q);
                    reference.exact.push(equilibrium.torque);
                    reference.energies.push(equilibrium.energy);
                    rough.push(other.torque);
                }
                _ => reference.left_out += 1,
            }
        }
        if reference.in_contact == 0 {
            return Err(ReferenceError::NoContact(count));
        }
        let zero = JointVector::zeros(reference.levers.len());
        reference.torque = reference.errors(|_| zero).0;
        let mut rough = rough.into_iter();
        reference.error = reference.errors(|_| rough.next().unwrap_or(zero)).0;
        Ok(reference)
    }

    /// As [`Reference::solve`], with twice as many configurations again and again until `contacts` of them are in
    /// contact, or no more are drawn.
    pub fn in_contact(scene: &Scene, model: &Model<'_>, seed: u64, contacts: usize) -> Result<Self, ReferenceError> {
        let mut count = contacts;
        loop {
            count *= 2;
            match Self::solve(scene, model, seed, count) {
                Ok(reference) if reference.in_contact >= contacts || count >= MOST_DRAWN => return Ok(reference),
                Err(ReferenceError::NoContact(_)) | Ok(_) if count < MOST_DRAWN => (),
                otherwise => return otherwise,
            }
        }
    }

    /// The same configurations with other torques.
    pub fn with(&self, exact: Vec<JointVector>) -> Self {
        Self { places: self.places.clone(), exact, energies: self.energies.clone(), ..*self }
    }

    /// Returns the result at place number `k`; free, or in contact and converged.
    pub(super) fn result(&self, k: usize) -> PointResult {
        let energy = self.energies[k];
        let status = if energy > 0.0 { Status::Contact } else { Status::Free };
        let residual = REFERENCE_TOLERANCE as f32;
        PointResult { status, torque: self.exact[k], energy, gap: 0.0, residual, iterations: 0 }
    }

    /// Replaces the equilibrium at place number `k`.
    pub(super) fn replace(&mut self, k: usize, equilibrium: &Equilibrium) {
        (self.exact[k], self.energies[k]) = (equilibrium.torque, equilibrium.energy);
        let zero = JointVector::zeros(self.levers.len());
        self.torque = self.errors(|_| zero).0;
    }

    /// Mean of the squared distance of the torque that `answer` gives at each place from the exact one, and the
    /// standard deviation of that mean over random places (N^2 m^2).
    pub fn mean_square(&self, answer: impl FnMut(&JointVector) -> JointVector) -> (f64, f64) {
        let squares = self.squares(answer);
        let count = squares.len().max(1) as f64;
        let mean = squares.iter().sum::<f64>() / count;
        let variance = squares.iter().map(|square| (square - mean).powi(2)).sum::<f64>() / count;
        (mean, (variance / count).sqrt())
    }

    /// Root mean square and greatest distance of the torque that `answer` gives at each place from the exact one (N m).
    pub fn errors(&self, answer: impl FnMut(&JointVector) -> JointVector) -> (f64, f64) {
        let squares = self.squares(answer);
        let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        (mean.sqrt(), squares.into_iter().fold(0.0, f64::max).sqrt())
    }

    /// Distance of the torque that `answer` gives at each place from the exact one (N m).
    pub fn distances(&self, answer: impl FnMut(&JointVector) -> JointVector) -> Vec<f64> {
        self.squares(answer).into_iter().map(f64::sqrt).collect()
    }

    /// Squared distances of the torque that `answer` gives at each place from the exact one (N^2 m^2).
    fn squares(&self, mut answer: impl FnMut(&JointVector) -> JointVector) -> Vec<f64> {
        let square = |(q, exact): (&JointVector, &JointVector)| {
            let answered = answer(q);
            let parts = answered.iter().zip(exact.iter()).zip(self.levers.iter());
            parts.map(|((a, b), lever)| (lever * (a - b)).powi(2)).sum()
        };
        self.places.iter().zip(&self.exact).map(square).collect()
    }
}

/// `contact` with the geometry that it has, the energy form's where it is the paper's, solved to `tolerance`.
pub(super) fn tight(contact: ContactSpec, tolerance: f64) -> ContactSpec {
    let max_iterations = contact.max_iterations.saturating_mul(10);
    let algorithm = if contact.algorithm == Algorithm::Paper { Algorithm::Energy } else { contact.algorithm };
    ContactSpec { algorithm, tolerance, max_iterations, ..contact }
}

/// `places` solved as `contact` says, on all cores.
pub(crate) fn equilibria(
    model: &Model<'_>,
    contact: ContactSpec,
    places: &[JointVector],
) -> Result<Vec<Equilibrium>, BackendError> {
    let model = model.with_contact(contact);
    let mut backend = CpuBackend::new(&model, 0)?;
    Ok(backend.solve(places).unwrap_or_else(|never| match never {}))
}
