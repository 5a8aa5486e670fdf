//! Equilibrium of one configuration: dispatch to the scene's algorithm and the account of its result.

use super::detection::Detection;
use super::equilibrium::energy::{EnergySearch, SolverStats, StoppingCriteria};
use super::equilibrium::rest::{Guess, RestProgram, Sensitivity};
use super::model::Model;
use super::reach;
use super::reactions::Reactions;
use super::{Equilibrium, NodeForce, Slip, Status, Touch};
use crate::proxy::Pose;
use crate::scene::ContactLaw;
use glam::DVec3;

/// Solves configurations one after another with memory of its own; one per thread.
///
/// The start is always the rest state, so a result depends on its configuration only, never on what was solved before.
pub struct Solver<'a> {
    model: &'a Model<'a>,
    pose: Pose,
    detection: Detection,
    energy: EnergySearch,
    rest: RestProgram,
    /// Search that holds the displacement of the last configuration.
    held_by: HeldBy,
    /// That displacement, where it was asked for (m).
    displacement: Option<Vec<f64>>,
    reactions: Reactions,
}

/// Which forces hold a displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum HeldBy {
    Nothing,
    Energy,
    Rest,
}

impl<'a> Solver<'a> {
    /// A solver for `model`.
    #[must_use]
    pub fn new(model: &'a Model<'a>) -> Self {
        Self {
            model,
            pose: model.chain.new_pose(),
            detection: Detection::new(model),
            energy: EnergySearch::new(model),
            rest: RestProgram::new(model),
            held_by: HeldBy::Nothing,
            displacement: None,
            reactions: Reactions::new(model),
        }
    }

    /// Equilibrium at the joint coordinates `q`, one per joint (rad or m).
    ///
    /// Numbers that are not finite, or fewer than there are joints, give [`Status::Unconverged`] with zeros and a
    /// residual of one: nothing is balanced.
    #[must_use]
    pub fn solve(&mut self, q: &[f64]) -> Equilibrium {
        self.find(q, |solver, equilibrium| match solver.model.contact.law {
            ContactLaw::Following => solver.minimise(None, equilibrium),
            ContactLaw::Rest => solver.maximise(equilibrium),
        })
    }

    /// The same by the energy form, from near the solution on: where `forces` on the object's nodes hold it with
    /// contact stiffness `kc` (N/m).
    #[must_use]
    pub(crate) fn solve_with_guess(
        &mut self,
        q: &[f64],
        forces: &[NodeForce],
        kc: f64,
        limits: StoppingCriteria,
    ) -> Equilibrium {
        self.find(q, |solver, equilibrium| solver.minimise(Some(((forces, kc), limits)), equilibrium))
    }

    /// The same by the energy form, from where `forces` on the object's nodes hold it, with the scene's tolerance and
    /// iterations. With the surface at rest there is one equilibrium, and no search that could start there.
    #[must_use]
    pub fn solve_from(&mut self, q: &[f64], forces: &[NodeForce]) -> Equilibrium {
        if self.model.contact.law == ContactLaw::Rest {
            return self.solve(q);
        }
        let limits =
            StoppingCriteria { tolerance: self.model.contact.tolerance, iterations: self.model.contact.max_iterations };
        self.solve_with_guess(q, forces, self.model.kc, limits)
    }

    /// Returns the equilibrium that `search` finds at `q`, if there is contact.
    fn find(&mut self, q: &[f64], search: impl FnOnce(&mut Self, &mut Equilibrium) -> SolverStats) -> Equilibrium {
        let model = self.model;
        (self.held_by, self.displacement) = (HeldBy::Nothing, None);
        let joints = model.chain.joints.len();
        if q.len() != joints || !q.iter().all(|x| x.is_finite()) {
            return Equilibrium::unknown(joints);
        }
        model.chain.pose(q, &mut self.pose);
        let gap = self.set_configuration();
        if !gap.is_finite() {
            return Equilibrium::unknown(joints);
        }
        let mut equilibrium = Equilibrium::free(gap, joints);
        if gap >= 0.0 {
            return equilibrium;
        }
        let outcome = search(self, &mut equilibrium);
        equilibrium.iterations = outcome.iterations;
        equilibrium.residual = outcome.residual;
        equilibrium.status = if outcome.converged { Status::Contact } else { Status::Unconverged };
        self.reactions.account(model, &self.pose, &mut equilibrium);
        equilibrium.slip = model.with_slip.then(|| Slip::of(model.chain, q, equilibrium.on_proxy()));
        if model.with_tangent && outcome.converged {
            equilibrium.tangent = match self.held_by {
                HeldBy::Energy => self.energy.tangent(model, &self.pose),
                HeldBy::Rest => Some(self.rest.tangent(model, &mut self.detection, &self.pose)),
                HeldBy::Nothing => None,
            };
        }
        if equilibrium.is_finite() {
            if !self.is_covered(&equilibrium) {
                equilibrium.status = Status::Overflow;
            }
            return equilibrium;
        }
        self.held_by = HeldBy::Nothing;
        Equilibrium { gap, iterations: outcome.iterations, ..Equilibrium::unknown(joints) }
    }

    /// Whether the compliance covers all that `equilibrium` depends on, where the surface has moved by at most `moved`
    /// (m).
    fn covers_within(&self, equilibrium: &Equilibrium, moved: f64) -> bool {
        let loaded = equilibrium.forces.iter().map(|force| force.node);
        let touching = equilibrium.touches.iter().map(|touch| touch.proxy_node as usize);
        reach::covers(self.model, &self.detection, loaded, touching, moved)
    }

    /// Whether the compliance covers all that `equilibrium` depends on.
    fn is_covered(&mut self, equilibrium: &Equilibrium) -> bool {
        let model = self.model;
        let elastic = match self.held_by {
            HeldBy::Energy => Some(self.energy.state.elastic),
            HeldBy::Rest => Some(self.rest.elastic),
            HeldBy::Nothing => None,
        };
        (model.compliance.is_whole() && model.rounded.is_none())
            || elastic.is_some_and(|elastic| self.covers_within(equilibrium, model.motion_bound(elastic).moved))
            || {
                let moved = self.displacement().chunks_exact(3).map(|u| DVec3::from_slice(u).length());
                let moved = moved.fold(0.0, f64::max);
                self.covers_within(equilibrium, moved)
            }
    }

    /// Smallest signed distance of the proxy's nodes to the surface at rest, less their radius, at the joint
    /// coordinates `q`, without solving; NaN where those are not finite or not one per joint (m).
    #[must_use]
    pub fn gap(&mut self, q: &[f64]) -> f64 {
        if q.len() != self.model.chain.joints.len() || !q.iter().all(|x| x.is_finite()) {
            return f64::NAN;
        }
        self.model.chain.pose(q, &mut self.pose);
        self.set_configuration()
    }

    /// The gap of the configuration posed last, which detection takes up (m).
    fn set_configuration(&mut self) -> f64 {
        self.detection.set_configuration(self.model, &self.pose.nodes)
    }

    /// Displacement u of the surface nodes at the last configuration solved, three numbers a node (m).
    #[must_use]
    pub fn displacement(&mut self) -> &[f64] {
        let Self { model, energy, rest, held_by, displacement, .. } = self;
        displacement.get_or_insert_with(|| {
            let mut displacement = vec![0.0; 3 * model.surface.positions.len()];
            match held_by {
                HeldBy::Nothing => {}
                HeldBy::Energy => {
                    energy.support.displace(&model.compliance, &energy.state.forces, &mut displacement);
                }
                HeldBy::Rest => rest.support.displace(&model.compliance, &rest.forces, &mut displacement),
            }
            displacement
        })
    }

    /// How the torque of the last configuration solved depends on the object, where it touches and its surface is at rest.
    #[must_use]
    pub fn sensitivity(&mut self) -> Option<Sensitivity> {
        let Self { model, pose, rest, held_by, .. } = self;
        (*held_by == HeldBy::Rest).then(|| rest.sensitivity(model, pose))
    }

    /// The proxy's pose at the last configuration solved.
    #[must_use]
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Energy at the start of the last stage of the energy form's last search, where contact has taken its full
    /// stiffness, and after each step taken since: it never rises (J).
    #[must_use]
    pub fn energy_history(&self) -> &[f64] {
        &self.energy.history
    }

    /// The energy form: touches, displacement and U, from the rest state or from forces near the solution.
    fn minimise(
        &mut self,
        near: Option<((&[NodeForce], f64), StoppingCriteria)>,
        equilibrium: &mut Equilibrium,
    ) -> SolverStats {
        let Self { model, detection, energy, .. } = self;
        let outcome = match near {
            None => energy.search(model, detection),
            Some((forces, limits)) => energy.solve_with_guess(model, detection, forces, limits),
        };
        let state = &self.energy.state;
        self.held_by = HeldBy::Energy;
        equilibrium.energy = state.energy;
        equilibrium.touches.extend(state.contacts.iter().filter(|c| c.is_active()).map(|contact| Touch {
            proxy_node: contact.proxy_node,
            carriers: contact.carriers.iter().collect(),
            force: contact.normal * (self.model.kc * contact.force_over_kc()),
        }));
        equilibrium.touches.iter().for_each(|touch| self.reactions.push_back(&touch.carriers, touch.force));
        outcome
    }

    /// Contact with the surface at rest: touches and U. The sideways part of the force on the proxy, which comes of how
    /// rows change along the surface, does not push back on the object.
    fn maximise(&mut self, equilibrium: &mut Equilibrium) -> SolverStats {
        let Self { model, detection, rest, reactions, .. } = self;
        let outcome = rest.solve(model, detection, Guess::Depths).unwrap_or_default();
        self.held_by = HeldBy::Rest;
        equilibrium.energy = rest.energy;
        for (&node, &force) in rest.support.nodes().iter().zip(rest.forces.as_chunks().0) {
            if force != [0.0; 3] {
                reactions.push(node, DVec3::from_array(force));
            }
        }
        for (i, row) in rest.rows.iter().enumerate().filter(|(_, row)| row.multiplier > 0.0) {
            let (carriers, force) = (rest.carriers(i), rest.force(i));
            equilibrium.touches.push(Touch { proxy_node: row.proxy_node, carriers, force });
        }
        equilibrium.touches.sort_unstable_by_key(|touch| touch.proxy_node);
        outcome
    }
}
