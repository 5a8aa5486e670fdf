//! Directly solved configurations, each solved once, and the distance of other answers from them.

use super::{Backend, CpuBackend, tile::PointResult};
use crate::{
    Error, JointVector,
    contact::{Equilibrium, Model, NodeTree, Slip, Solvers, Status, exact_dissipation},
    dataset::{FrictionExcess, InterpolationError, MeasuredError},
    error,
    names::counted,
    random::Random,
    scene::{AxisSpec, ContactSpec, EffortNorm, Interpolation, LEVER_ARM, Scene},
};
use rayon::prelude::*;

/// Relative residual to which the reference of an accuracy study is solved (1): three decades below the scenes' own
/// 1e-8, and still above what rounding leaves of a residual (about 1e-13).
pub const REFERENCE_TOLERANCE: f64 = 1e-11;

/// Most configurations that are drawn to find some in contact: a region in contact at a few in a thousand is still
/// seen.
const MOST_DRAWN: usize = 1 << 16;

/// Random directions in which the arm moves at each configuration, to see what friction takes (1). More: the greatest
/// excess is found more nearly.
const DIRECTIONS: usize = 16;

/// Configurations and their torques, each solved once.
pub struct Reference {
    /// Configurations (rad or m).
    pub(crate) places: Vec<JointVector>,
    /// Torques there, converged.
    pub(crate) exact: Vec<JointVector>,
    /// Energies there (J).
    energies: Vec<f64>,
    pub(crate) in_contact: usize,
    pub(crate) left_out: usize,
    /// Forces on the object's nodes, of all configurations.
    forces: usize,
    /// Rms of the torque (the norm's unit).
    pub torque: f64,
    pub(crate) norm: EffortNorm,
}

impl Reference {
    /// What was `solved`; configurations that did not converge are left out.
    pub(crate) fn of(norm: EffortNorm, solved: impl IntoIterator<Item = (JointVector, Equilibrium)>) -> Self {
        let (places, exact, energies) = (Vec::new(), Vec::new(), Vec::new());
        let mut reference = Self { places, exact, energies, in_contact: 0, left_out: 0, forces: 0, torque: 0.0, norm };
        reference.extend(solved);
        reference
    }

    fn extend(&mut self, solved: impl IntoIterator<Item = (JointVector, Equilibrium)>) {
        for (q, equilibrium) in solved {
            self.forces += equilibrium.forces.len();
            if equilibrium.status.is_failed() {
                self.left_out += 1;
                continue;
            }
            self.in_contact += usize::from(equilibrium.status == Status::Contact);
            self.places.push(q);
            self.exact.push(equilibrium.torque);
            self.energies.push(equilibrium.energy);
        }
        self.settle();
    }

    /// Takes the rms of the torque anew.
    fn settle(&mut self) {
        let zero = JointVector::zeros(self.norm.joints());
        self.torque = self.errors(|_| zero).0;
    }

    /// Solves `count` random configurations within the grid of `scene`, the same ones every time for the same `seed`.
    pub(crate) fn solve(scene: &Scene, model: &Model<'_>, seed: u64, count: usize) -> Result<Self, Error> {
        Self::drawn(scene, model, seed, count, 0)
    }

    /// Solves random configurations within the grid of `scene`, the same ones every time for the same `seed`: twice as
    /// many again and again, until `contacts` of them are in contact or no more are drawn.
    ///
    /// # Errors
    /// When nothing touches.
    pub fn in_contact(scene: &Scene, model: &Model<'_>, seed: u64, contacts: usize) -> Result<Self, Error> {
        Self::drawn(scene, model, seed, 2 * contacts, contacts)
    }

    fn drawn(scene: &Scene, model: &Model<'_>, seed: u64, mut count: usize, contacts: usize) -> Result<Self, Error> {
        let mut random = Random::new(seed);
        let mut reference = Self::of(EffortNorm::of(scene), []);
        let mut along = |axis: &AxisSpec| axis.start + random.between(0.0, 1.0) * axis.step * (axis.count - 1) as f64;
        let mut place = |_| scene.grid.axes.iter().map(&mut along).collect();
        loop {
            let places: Vec<JointVector> = (reference.solved()..count).map(&mut place).collect();
            let solved = without_gaps(model, tight(scene.contact, REFERENCE_TOLERANCE), &places)?;
            reference.extend(places.into_iter().zip(solved));
            if reference.in_contact >= contacts || count >= MOST_DRAWN {
                break;
            }
            count *= 2;
        }
        if reference.in_contact == 0 {
            return Err(error!(
                "the proxy touches nothing, or contact converges nowhere, at {}: give the scene's grid a region \
                 where the proxy touches the object",
                counted(count, ["random configuration", "random configurations"])
            ));
        }
        Ok(reference)
    }

    /// Number of configurations that were solved, free ones among them.
    #[must_use]
    pub fn solved(&self) -> usize {
        self.places.len() + self.left_out
    }

    /// Mean number of the object's nodes with a contact force, of all configurations (1).
    #[must_use]
    pub fn mean_forces(&self) -> f64 {
        self.forces as f64 / self.solved().max(1) as f64
    }

    /// Its own error, rms: distance of the same configurations solved a hundred times as roughly (N m).
    pub(crate) fn own_error(&self, scene: &Scene, model: &Model<'_>) -> Result<f64, Error> {
        self.error_of(model, tight(scene.contact, 100.0 * REFERENCE_TOLERANCE))
    }

    /// Rms distance of the same configurations solved as `contact` says (N m).
    pub(crate) fn error_of(&self, model: &Model<'_>, contact: ContactSpec) -> Result<f64, Error> {
        let solved = without_gaps(model, contact, &self.places)?;
        let mut torques = solved.iter().map(|equilibrium| equilibrium.torque);
        Ok(self.errors(|q| torques.next().unwrap_or(*q)).0)
    }

    /// The same configurations with other torques.
    pub(crate) fn with(&self, exact: Vec<JointVector>) -> Self {
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
        self.settle();
    }

    /// What is told of a dataset whose own `interpolation` and others have `errors` here.
    pub(crate) fn measured(&self, interpolation: Interpolation, errors: Vec<InterpolationError>) -> MeasuredError {
        MeasuredError {
            configurations: self.places.len(),
            left_out: self.left_out,
            torque: self.torque,
            unit: self.norm.unit,
            interpolation: interpolation.name().to_owned(),
            errors,
            ..MeasuredError::default()
        }
    }

    /// Returns how far friction by the slip of all contacts of `model` together lies above that of each; `None` where it
    /// is not asked for, or no two touch at once.
    pub(crate) fn friction_excess(&self, model: &Model<'_>) -> Option<FrictionExcess> {
        let solvers = Solvers::new(model, rayon::current_num_threads());
        let places: Vec<_> = self.places.iter().enumerate().filter(|_| model.with_slip).collect();
        let excesses = solvers.map(&places, |solver, (number, q)| {
            let here = solver.solve(q);
            let slip = here.slip.filter(|_| here.status == Status::Contact && here.touches.len() > 1);
            slip.map_or(Vec::new(), |slip| {
                let mut random = Random::new(*number as u64);
                (0..DIRECTIONS).filter_map(|_| excess(model, q, (&here, &slip), &mut random)).collect()
            })
        });
        let configurations = excesses.iter().filter(|excesses| !excesses.is_empty()).count();
        let all = excesses.concat();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let greatest = all.into_iter().fold(0.0, f64::max);
        (configurations > 0).then_some(FrictionExcess { configurations, mean, greatest })
    }

    /// Mean of the squared distance of the torque that `answer` gives at each place from the exact one, and the
    /// standard deviation of that mean over random places (N^2 m^2).
    pub(crate) fn mean_square(&self, answer: impl FnMut(&JointVector) -> JointVector) -> (f64, f64) {
        let squares = self.squares(answer);
        let count = squares.len().max(1) as f64;
        let mean = squares.iter().sum::<f64>() / count;
        let variance = squares.iter().map(|square| (square - mean).powi(2)).sum::<f64>() / count;
        (mean, (variance / count).sqrt())
    }

    /// Root mean square and greatest distance of the torque that `answer` gives at each place from the exact one (N m).
    pub(crate) fn errors(&self, answer: impl FnMut(&JointVector) -> JointVector) -> (f64, f64) {
        let squares = self.squares(answer);
        let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        (mean.sqrt(), squares.into_iter().fold(0.0, f64::max).sqrt())
    }

    /// Rms error of the torque that `answer` gives, over the rms of the torque (1).
    pub fn relative_error(&self, answer: impl FnMut(&JointVector) -> JointVector) -> f64 {
        self.errors(answer).0 / self.torque
    }

    /// Distance of the torque that `answer` gives at each place from the exact one (N m).
    pub(crate) fn distances(&self, answer: impl FnMut(&JointVector) -> JointVector) -> Vec<f64> {
        self.squares(answer).into_iter().map(f64::sqrt).collect()
    }

    /// Squared distances of the torque that `answer` gives at each place from the exact one (N^2 m^2).
    fn squares(&self, mut answer: impl FnMut(&JointVector) -> JointVector) -> Vec<f64> {
        let square = |(q, exact): (&JointVector, &JointVector)| self.norm.square(&answer(q), exact);
        self.places.iter().zip(&self.exact).map(square).collect()
    }
}

/// What friction takes by the `slip` of all contacts of `here` together over what it takes by each, less one, as the arm
/// moves from `q` in a random direction; `None` where nothing slips.
fn excess(model: &Model<'_>, q: &JointVector, (here, slip): (&Equilibrium, &Slip), random: &mut Random) -> Option<f64> {
    let mut rates = *q;
    for (rate, joint) in rates.iter_mut().zip(&model.chain.joints) {
        let scale = if joint.kind.unit() == "m" { LEVER_ARM } else { 1.0 };
        *rate = scale * random.normal();
    }
    let exact = exact_dissipation(model.chain, q, here.on_proxy(), &rates);
    (exact > 0.0).then(|| slip.dissipation(&rates) / exact - 1.0)
}

/// `contact` solved to `tolerance`.
pub(super) fn tight(contact: ContactSpec, tolerance: f64) -> ContactSpec {
    let max_iterations = contact.max_iterations.saturating_mul(10);
    ContactSpec { tolerance, max_iterations, ..contact }
}

/// `places` solved as `contact` says, on all cores.
pub(crate) fn equilibria(
    model: &Model<'_>,
    contact: ContactSpec,
    places: &[JointVector],
) -> Result<Vec<Equilibrium>, Error> {
    let model = model.with_contact(contact);
    let mut backend = CpuBackend::new(&model, 0)?;
    Ok(backend.solve(places).unwrap_or_else(|never| match never {}))
}

/// The same, but free ones have no gap: the arm is seen to be apart there by a few of its nodes.
fn without_gaps(model: &Model<'_>, contact: ContactSpec, places: &[JointVector]) -> Result<Vec<Equilibrium>, Error> {
    let tree = NodeTree::new(model.chain);
    let are_apart: Vec<bool> = places.par_iter().map(|q| tree.is_apart(model, q)).collect();
    let near = places.iter().zip(&are_apart).filter(|(_, is_apart)| !**is_apart).map(|(q, _)| *q);
    let mut solved = equilibria(model, contact, &near.collect::<Vec<_>>())?.into_iter();
    let free = || Equilibrium::free(0.0, model.chain.joints.len());
    Ok(are_apart.into_iter().filter_map(|is_apart| if is_apart { Some(free()) } else { solved.next() }).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        proxy::Chain,
        sweep::{build_object, model_within},
    };

    #[test]
    fn configurations_drawn_until_enough_touch_are_those_drawn_at_once() {
        // At rest equilibria are exact, whatever the tolerance.
        let text = include_str!("../../tests/scenes/small.toml").replace("[contact]", "[contact]\nlaw = \"following\"");
        let scene = Scene::parse(&text, "small.toml").unwrap();
        let (object, chain) = (build_object(&scene).unwrap(), Chain::new(&scene.proxy));
        let model = model_within(&scene, &object, &chain).unwrap();
        let grown = Reference::in_contact(&scene, &model, 5, 24).unwrap();
        // More than the first draw, and no more than is needed.
        assert!(grown.solved() > 48 && grown.in_contact >= 24, "{} of {}", grown.in_contact, grown.solved());
        let at_once = Reference::solve(&scene, &model, 5, grown.solved()).unwrap();
        assert_eq!((&grown.places, &grown.exact), (&at_once.places, &at_once.exact));
        assert_eq!((grown.in_contact, grown.torque), (at_once.in_contact, at_once.torque));
        assert_eq!(grown.mean_forces(), at_once.mean_forces());
        assert!(Reference::solve(&scene, &model, 5, grown.solved() / 2).unwrap().in_contact < 24);
        let own = grown.own_error(&scene, &model).unwrap();
        assert!(own > 0.0 && own < 1e-6 * grown.torque, "{own} of {}", grown.torque);
    }
}
