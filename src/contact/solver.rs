//! Equilibrium of one configuration: dispatch to the scene's algorithm and the account of its result.

use super::detection::Detection;
use super::equilibrium::energy::{EnergySearch, SolverStats, StoppingCriteria};
use super::equilibrium::paper::PaperIteration;
use super::equilibrium::rest::{Guess, RestProgram};
use super::linear::support::dot;
use super::model::Model;
use super::reach;
use super::{Equilibrium, NodeForce, Slip, Status, Touch};
use crate::contact::MINIMUM_SQUARE;
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
    paper: PaperIteration,
    rest: RestProgram,
    /// Search that holds the displacement of the last configuration.
    held_by: HeldBy,
    /// That displacement, where it was asked for (m).
    displacement: Option<Vec<f64>>,
    /// Sum of the forces on each surface node (N), and whether it is among `touched`.
    node_forces: Vec<DVec3>,
    marked: Vec<bool>,
    touched: Vec<u32>,
}

/// Which forces hold a displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum HeldBy {
    Nothing,
    Energy,
    Paper,
    Rest,
}

impl<'a> Solver<'a> {
    /// A solver for `model`.
    #[must_use]
    pub fn new(model: &'a Model<'a>) -> Self {
        let surface_nodes = model.surface.positions.len();
        Self {
            model,
            pose: model.chain.new_pose(),
            detection: Detection::new(model),
            energy: EnergySearch::new(model),
            paper: PaperIteration::new(model),
            rest: RestProgram::new(model),
            held_by: HeldBy::Nothing,
            displacement: None,
            node_forces: vec![DVec3::ZERO; surface_nodes],
            marked: vec![false; surface_nodes],
            touched: Vec::new(),
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
            ContactLaw::Paper => solver.iterate(equilibrium),
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
            return unknown(joints);
        }
        model.chain.pose(q, &mut self.pose);
        let gap = self.set_configuration();
        if !gap.is_finite() {
            return unknown(joints);
        }
        let mut equilibrium = Equilibrium::free(gap, joints);
        if gap >= 0.0 {
            return equilibrium;
        }
        let outcome = search(self, &mut equilibrium);
        equilibrium.iterations = outcome.iterations;
        equilibrium.residual = outcome.residual;
        equilibrium.status = if outcome.converged { Status::Contact } else { Status::Unconverged };
        self.account(&mut equilibrium);
        equilibrium.slip = model.with_slip.then(|| Slip::of(model.chain, q, equilibrium.on_proxy()));
        if model.with_tangent && outcome.converged {
            equilibrium.tangent = match self.held_by {
                HeldBy::Energy => self.energy.tangent(model, &self.pose),
                HeldBy::Rest => Some(self.rest.tangent(model, &mut self.detection, &self.pose)),
                HeldBy::Nothing | HeldBy::Paper => None,
            };
        }
        if is_finite(&equilibrium) {
            if !self.is_covered(&equilibrium) {
                equilibrium.status = Status::Overflow;
            }
            return equilibrium;
        }
        self.held_by = HeldBy::Nothing;
        Equilibrium { gap, iterations: outcome.iterations, ..unknown(joints) }
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
            HeldBy::Nothing | HeldBy::Paper => None,
        };
        model.compliance.is_whole()
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
        let Self { model, energy, paper, rest, held_by, displacement, .. } = self;
        displacement.get_or_insert_with(|| {
            let mut displacement = vec![0.0; 3 * model.surface.positions.len()];
            match held_by {
                HeldBy::Nothing => {}
                HeldBy::Energy => {
                    energy.support.displace(&model.compliance, &energy.state.forces, &mut displacement);
                }
                HeldBy::Paper => displacement.copy_from_slice(&paper.displacement),
                HeldBy::Rest => rest.support.displace(&model.compliance, &rest.forces, &mut displacement),
            }
            displacement
        })
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
        for touch in &equilibrium.touches {
            let Self { node_forces, marked, touched, .. } = self;
            push_back(node_forces, marked, touched, &touch.carriers, touch.force);
        }
        outcome
    }

    /// Contact with the surface at rest: touches and U. The sideways part of the force on the proxy, which comes of how
    /// rows change along the surface, does not push back on the object.
    fn maximise(&mut self, equilibrium: &mut Equilibrium) -> SolverStats {
        let Self { model, detection, rest, node_forces, marked, touched, .. } = self;
        let outcome = rest.solve(model, detection, Guess::Depths).unwrap_or_default();
        self.held_by = HeldBy::Rest;
        equilibrium.energy = rest.energy;
        for (i, row) in rest.rows.iter().enumerate().filter(|(_, row)| row.multiplier > 0.0) {
            let carriers: Vec<(u32, f64)> = row.carriers.iter().collect();
            push_back(node_forces, marked, touched, &carriers, row.normal * row.multiplier);
            equilibrium.touches.push(Touch { proxy_node: row.proxy_node, carriers, force: rest.force(i) });
        }
        equilibrium.touches.sort_unstable_by_key(|touch| touch.proxy_node);
        outcome
    }

    /// The paper's iteration: touches, displacement and U.
    ///
    /// Its three forces on the nodes of a tie need not be parallel; the weights of a touch are their shares along the
    /// whole.
    fn iterate(&mut self, equilibrium: &mut Equilibrium) -> SolverStats {
        let outcome = self.paper.iterate(self.model, &mut self.detection);
        self.held_by = HeldBy::Paper;
        for (slot, &node) in self.paper.support.nodes().iter().enumerate() {
            let at = 3 * node as usize;
            let forces = &self.paper.forces[3 * slot..3 * slot + 3];
            equilibrium.energy += 0.5 * dot(forces, &self.paper.displacement[at..at + 3]);
        }
        for tie in &self.paper.ties {
            let force = -(tie.forces[0] + tie.forces[1] + tie.forces[2]);
            if force == DVec3::ZERO {
                continue;
            }
            let square = force.length_squared().max(MINIMUM_SQUARE);
            let weights = tie.forces.map(|part| -part.dot(force) / square);
            let carriers = tie.nodes.into_iter().zip(weights).collect();
            equilibrium.touches.push(Touch { proxy_node: tie.proxy_node, carriers, force });
            for (part, node) in tie.forces.into_iter().zip(tie.nodes) {
                // A spring Kc stretched to this force stores |f|^2 / (2 Kc).
                equilibrium.energy += part.length_squared() / (2.0 * self.model.contact.stiffness);
                if part != DVec3::ZERO {
                    push(&mut self.node_forces, &mut self.marked, &mut self.touched, node, part);
                }
            }
        }
        outcome
    }

    /// Torque from the touches, and the forces on the object's nodes, ascending.
    fn account(&mut self, equilibrium: &mut Equilibrium) {
        for touch in &equilibrium.touches {
            self.model.chain.add_torque(&self.pose, touch.proxy_node as usize, touch.force, &mut equilibrium.torque);
        }
        self.touched.sort_unstable();
        for &node in &self.touched {
            let force = std::mem::replace(&mut self.node_forces[node as usize], DVec3::ZERO);
            self.marked[node as usize] = false;
            equilibrium.forces.push(NodeForce { node, force });
        }
        self.touched.clear();
    }
}

/// Adds the reaction to `force` on a proxy node to the forces on the nodes that carry it.
fn push_back(sums: &mut [DVec3], marked: &mut [bool], touched: &mut Vec<u32>, carriers: &[(u32, f64)], force: DVec3) {
    for &(node, weight) in carriers.iter().filter(|(_, weight)| *weight != 0.0) {
        push(sums, marked, touched, node, -force * weight);
    }
}

/// Adds `force` on `node`.
fn push(sums: &mut [DVec3], marked: &mut [bool], touched: &mut Vec<u32>, node: u32, force: DVec3) {
    if !std::mem::replace(&mut marked[node as usize], true) {
        touched.push(node);
    }
    sums[node as usize] += force;
}

/// No result: nothing is known to be balanced.
fn unknown(joints: usize) -> Equilibrium {
    Equilibrium { status: Status::Unconverged, residual: 1.0, ..Equilibrium::free(0.0, joints) }
}

/// True when every number is finite.
fn is_finite(equilibrium: &Equilibrium) -> bool {
    equilibrium.energy.is_finite()
        && equilibrium.residual.is_finite()
        && equilibrium.torque.is_finite()
        && equilibrium.forces.iter().all(|force| force.force.is_finite())
        && equilibrium
            .touches
            .iter()
            .all(|touch| touch.force.is_finite() && touch.carriers.iter().all(|(_, weight)| weight.is_finite()))
}
