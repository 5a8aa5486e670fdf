//! The energy form: the minimum of `E(u; q) = 1/2 u^T K u + 1/2 kc sum_i depth_i(u, q)^2` over the displacement u.
//!
//! State: the surface forces f on the support A, with u = C f, so that the elastic energy is 1/2 f . u_A. A damped
//! Newton step ([`super::newton`]) is tried, contact is detected again at the trial, and the step is taken if E
//! decreases by a fair share of what the model promised: E never increases. Converged when the contact forces c(u)
//! balance f: sqrt(r . C r) <= tolerance sqrt(c . C c), r = c - f.
//!
//! Stiff contact is reached in stages of growing kc, each from the state before: E has then the shape of a steep and
//! bent valley, whose floor soft contact finds and stiffer contact only corrects. A stage's end never lies above the
//! rest state in E at the final kc: E_s(u_s) <= E_s(0) bounds both its elastic energy and its depths by those at rest.

use super::newton::{Damping, Newton, Step};
use super::tangent;
use crate::JointMatrix;
use crate::contact::NodeForce;
use crate::contact::detection::Detection;
use crate::contact::geometry::{DEPTH_ROUNDING, smooth::CARRIERS};
use crate::contact::law::depth::Contact;
use crate::contact::law::springs::{Slots, Springs, add_contact_forces};
use crate::contact::linear::support::{Support, dot, root};
use crate::contact::model::{Model, MotionBound};
use crate::proxy::Pose;
use crate::random::scattered;
use glam::DVec3;

/// Least contact force in the energy norm, sqrt(c^T C c), that a residual is measured against [sqrt(J)]: its square
/// 1e-24 J is a nanonewton over a femtometre.
pub const RESIDUAL_FLOOR: f64 = 1e-12;

/// Rounding of the stored energy, in units of eps (E + sum lambda_i L): sums of about a hundred products each rounded
/// by eps / 2, and depths rounded by a few eps L, are within 16 of these units; steps whose predicted decrease lies
/// below are judged by the model alone.
pub const ENERGY_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Share of the predicted decrease that a step must achieve to be taken (1) (Conn, Gould & Toint 2000,
/// section 6.1: any value in (0, 1/4); small, because the energy itself is cheap and only decrease matters).
pub const ACCEPTED_SHARE: f64 = 1e-4;

/// Below this share of the predicted decrease damping grows (1) (Conn, Gould & Toint, section 17.1).
pub const POOR_SHARE: f64 = 0.25;

/// Above this share damping fades (1) (same source).
pub const GOOD_SHARE: f64 = 0.75;

/// Largest relative residual at which the inner conjugate gradients stop (1); nearer the solution they stop at the
/// outer residual itself, which keeps Newton's convergence quadratic (Dembo, Eisenstat & Steihaug 1982).
pub const INNER_TOLERANCE: f64 = 1e-2;

/// Least relative residual the inner conjugate gradients are asked for (1): eps times the about 1e3 by which rounding
/// grows over some tens of iterations.
pub const INNER_TOLERANCE_FLOOR: f64 = 1e-13;

/// First contact stiffness of the energy form, in units of the stiffness of the object's softest node (one over the
/// trace of its compliance) (1): soft contact, as stiff as the object itself, converges within a few steps from
/// anywhere.
pub const CONTINUATION_START: f64 = 4.0;

/// Growth of the contact stiffness from stage to stage (1): measured on the 102-node sphere at Kc = 1e4 to 1e6 N/m, 3
/// converges as fast as 4 and 10 where contact is shallow and more often where it is deep.
pub const CONTINUATION_FACTOR: f64 = 3.0;

/// Relative residual at which a stage but the last is left (1). The next stage's own first residual is
/// 1 - 1 / [`CONTINUATION_FACTOR`]; but a stage left at 0.1 had not always found its facets, and of deep contact at
/// Kc = 1e6 N/m 91 % converged, after 0.01 98 % in the same time.
pub const STAGE_TOLERANCE: f64 = 0.01;

/// Length of a refused step, relative to the greatest there can be, at which a stage but the last is left (1): where a
/// stage stalls, at a kink, the next has a different energy and mostly gets past it.
pub const STALLED_LENGTH: f64 = 1e-5;

/// Length of a refused step, relative to the greatest there can be, at which a configuration is given up (1): the
/// energy of a step scales with its length, so below 1e-12 nothing measurable can be gained any more.
pub const GIVE_UP_LENGTH: f64 = 1e-12;

/// Relative residual of the linear solve that looks for negative curvature at an equilibrium (1). Its random load has a
/// share of one over the root of the number of unknowns, a tenth or so, in a direction of negative curvature, which
/// conjugate gradients meet before the residual is as small as this.
pub const PROBE_TOLERANCE: f64 = 1e-2;

/// First length of the step away from a saddle, over the length of the displacement there, in the energy norm (1); it
/// is halved until the energy falls by more than its rounding, at most [`NUDGE_HALVINGS`] times.
pub const NUDGE_LENGTH: f64 = 0.1;

/// See [`NUDGE_LENGTH`]: after these, the fall of the energy, of second order, would be below rounding.
pub const NUDGE_HALVINGS: u32 = 20;

/// One state of the search.
#[derive(Default)]
pub struct State {
    /// Forces on the support (N).
    pub forces: Vec<f64>,
    /// Contacts at this displacement.
    pub contacts: Vec<Contact>,
    /// E (J).
    pub energy: f64,
    /// Its elastic part (J).
    pub elastic: f64,
}

/// When a search ends.
#[derive(Clone, Copy, Debug)]
pub struct StoppingCriteria {
    /// Relative residual at which it has converged (1).
    pub tolerance: f64,
    /// Steps tried at most.
    pub iterations: u32,
}

/// Convergence, iterations and residual of a search.
#[derive(Clone, Copy, Debug, Default)]
pub struct SolverStats {
    /// Whether forces are balanced to the tolerance, or to what depths are rounded by.
    pub converged: bool,
    /// Steps tried.
    pub iterations: u32,
    /// Relative residual (1).
    pub residual: f64,
}

/// Workspace of the energy form.
pub struct EnergySearch {
    /// The current state; the result when the search has ended.
    pub state: State,
    trial: State,
    /// The object nodes that carry force.
    pub support: Support,
    /// Contact stiffness of the current stage, and of the last (N/m).
    kc: f64,
    last_kc: f64,
    slots: Vec<Slots>,
    contact_forces: Vec<f64>,
    /// r = c - f (N), and C r (m).
    residual: Vec<f64>,
    product: Vec<f64>,
    /// |r| over |c| in the energy norm (1).
    imbalance: f64,
    /// Displacement of the support in the trial (m).
    displacement: Vec<f64>,
    newton: Newton,
    damping: Damping,
    /// E at the start of the last stage and after each step taken since (J).
    pub history: Vec<f64>,
}

impl EnergySearch {
    /// Room for the object of `model`.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            state: State::default(),
            trial: State::default(),
            support: Support::new(model.surface.positions.len()),
            slots: Vec::new(),
            kc: 0.0,
            last_kc: 0.0,
            contact_forces: Vec::new(),
            residual: Vec::new(),
            product: Vec::new(),
            imbalance: 0.0,
            displacement: Vec::new(),
            newton: Newton::default(),
            damping: Damping::default(),
            history: Vec::new(),
        }
    }

    /// The equilibrium of the configuration that `detection` has taken up, searched from the rest state.
    pub fn search(&mut self, model: &Model, detection: &mut Detection) -> SolverStats {
        self.kc = model.kc.min(CONTINUATION_START / model.max_nodal_compliance);
        self.last_kc = model.kc;
        self.start(model, detection);
        let mut outcome = SolverStats { converged: false, iterations: 0, residual: f64::MAX };
        let limits = StoppingCriteria { tolerance: model.contact.tolerance, iterations: model.contact.max_iterations };
        self.descend(model, detection, limits, &mut outcome);
        SolverStats { residual: self.imbalance, ..outcome }
    }

    /// Searches from where `forces` on the object's nodes hold it, which should be near the minimum with contact
    /// stiffness `kc` (N/m), for the configuration that `detection` has taken up.
    pub fn solve_with_guess(
        &mut self,
        model: &Model,
        detection: &mut Detection,
        (forces, kc): (&[NodeForce], f64),
        limits: StoppingCriteria,
    ) -> SolverStats {
        (self.kc, self.last_kc) = (kc, model.kc);
        self.support.clear();
        self.trial.forces.clear();
        for &NodeForce { node, force } in forces {
            let at = 3 * self.support.add(node);
            self.trial.forces.resize(self.support.order(), 0.0);
            self.trial.forces[at..at + 3].iter_mut().zip(force.to_array()).for_each(|(sum, part)| *sum += part);
        }
        self.take_trial(model, detection);
        self.kc = model.kc;
        let mut outcome = SolverStats { converged: false, iterations: 0, residual: f64::MAX };
        self.descend(model, detection, limits, &mut outcome);
        SolverStats { residual: self.imbalance, ..outcome }
    }

    /// Takes what the trial's forces lead to for the state.
    fn take_trial(&mut self, model: &Model, detection: &mut Detection) {
        self.evaluate(model, detection);
        std::mem::swap(&mut self.state, &mut self.trial);
        self.weigh_curvature();
    }

    /// Descends from the current state until it is balanced or there is no going on.
    fn descend(
        &mut self,
        model: &Model,
        detection: &mut Detection,
        limits: StoppingCriteria,
        outcome: &mut SolverStats,
    ) {
        let mut greatest = self.begin_stage(model, outcome);
        // Length of the last step, if it was poor.
        let mut length = greatest;
        while outcome.residual.is_finite() {
            let stuck = length.is_nan() || length < GIVE_UP_LENGTH * greatest;
            let stalled = length < STALLED_LENGTH * greatest;
            if self.kc < self.last_kc && (outcome.residual <= STAGE_TOLERANCE || stalled) {
                self.kc = self.last_kc.min(CONTINUATION_FACTOR * self.kc);
                greatest = self.begin_stage(model, outcome);
                length = greatest;
                continue;
            }
            let balanced = self.kc == self.last_kc && outcome.residual <= limits.tolerance;
            if balanced && outcome.iterations < limits.iterations && self.leave_saddle(model, detection) {
                outcome.iterations += 1;
                outcome.residual = self.update_residual(model);
                continue;
            }
            outcome.converged = balanced;
            if outcome.converged || outcome.iterations >= limits.iterations || stuck {
                break;
            }
            outcome.iterations += 1;
            let step = self.step(outcome.residual);
            self.try_step(model, detection);
            // Near the solution both decreases drown in rounding, which must not refuse a good step.
            let rounding = self.energy_rounding(detection.nodes());
            let promised = step.predicted + rounding;
            let energy = self.state.energy;
            // Contacts that come and go may leave a step that promises nothing.
            let share =
                |trial: &State| if promised > 0.0 { (energy - trial.energy + rounding) / promised } else { 0.0 };
            let ratio = share(&self.trial);
            if ratio >= POOR_SHARE {
                self.damping.decrease(ratio > GOOD_SHARE);
                length = greatest;
            } else {
                self.damping.increase();
                length = step.length;
            }
            if ratio >= ACCEPTED_SHARE {
                std::mem::swap(&mut self.state, &mut self.trial);
                self.history.push(self.state.energy);
                outcome.residual = self.update_residual(model);
            }
        }
    }

    /// The step from the current state, whose relative residual is `residual`.
    fn step(&mut self, residual: f64) -> Step {
        let step = self.newton.step(
            &self.support,
            Springs { contacts: &self.state.contacts, slots: &self.slots, kc: self.kc },
            (&self.residual, &self.product),
            self.damping.multiple,
            residual.clamp(INNER_TOLERANCE_FLOOR, INNER_TOLERANCE),
        );
        self.damping.multiple = step.damping;
        step
    }

    /// Displaces the surface by `forces` on the support, which store the energy `elastic` (J).
    fn displace(&self, model: &Model, detection: &mut Detection, forces: &[f64], elastic: f64) {
        detection.displace(model, self.support.nodes(), forces, model.motion_bound(elastic));
    }

    /// Takes a step from a balanced state that is no minimum but a saddle of E, along a direction of negative
    /// curvature, to a state of less energy; false where there is none.
    fn leave_saddle(&mut self, model: &Model, detection: &mut Detection) -> bool {
        self.weigh_curvature();
        let Self { state, slots, support, newton, kc, product, .. } = self;
        let springs = Springs { contacts: &state.contacts, slots, kc: *kc };
        for (number, load) in (0..).zip(product.iter_mut()) {
            *load = scattered(number);
        }
        newton.factorise(support, springs);
        if newton.respond(support, springs, product, PROBE_TOLERANCE).is_some() {
            return false;
        }
        let (descent, length) = newton.descent();
        let descent = descent.to_vec();
        let mut step = NUDGE_LENGTH * root(2.0 * self.state.energy) / length;
        let fallen = self.state.energy - self.energy_rounding(detection.nodes());
        for _ in 0..NUDGE_HALVINGS {
            for side in [step, -step] {
                self.trial.forces.clear();
                self.trial.forces.extend(self.state.forces.iter().zip(&descent).map(|(f, along)| f + side * along));
                self.evaluate(model, detection);
                if self.trial.energy < fallen {
                    std::mem::swap(&mut self.state, &mut self.trial);
                    self.weigh_curvature();
                    self.history.push(self.state.energy);
                    return true;
                }
            }
            step *= 0.5;
        }
        false
    }

    /// Sets the multipliers to the rows' forces: the curvature then is that of E.
    fn weigh_curvature(&mut self) {
        for contact in &mut self.state.contacts {
            contact.multiplier = self.kc * contact.force_over_kc();
        }
    }

    /// The tangent d tau/d q at the current state, an equilibrium of the proxy in `pose`; see [`tangent`].
    pub fn tangent(&mut self, model: &Model, pose: &Pose) -> Option<JointMatrix> {
        self.weigh_curvature();
        let Self { state, slots, support, newton, kc, .. } = self;
        let springs = Springs { contacts: &state.contacts, slots, kc: *kc };
        tangent::tangent(model, pose, springs, support, newton)
    }

    /// Takes up a new contact stiffness at the current state; returns how far from rest any iterate can be in the
    /// energy norm: 1/2 |u|^2 never exceeds E.
    fn begin_stage(&mut self, model: &Model, outcome: &mut SolverStats) -> f64 {
        self.state.energy = self.state.elastic + contact_energy(&self.state.contacts, self.kc);
        self.history.clear();
        self.history.push(self.state.energy);
        self.damping = Damping::default();
        outcome.residual = self.update_residual(model);
        (2.0 * self.state.energy).sqrt()
    }

    /// The rest state.
    fn start(&mut self, model: &Model, detection: &mut Detection) {
        self.support.clear();
        self.state.forces.clear();
        self.state.elastic = 0.0;
        detection.displace(model, &[], &[], MotionBound { moved: 0.0, bulge: model.surface.bulge });
        detection.deformed(model, &mut self.state.contacts);
    }

    /// Brings the support, the contact forces and the residual force r = c - f up to date with the current state;
    /// returns the relative residual sqrt(r . C r) / sqrt(c . C c), where forces of depths that are known to less than
    /// the tolerance count as those of the least depth that is.
    fn update_residual(&mut self, model: &Model) -> f64 {
        let Self { state, support, slots, contact_forces, residual, product, kc, .. } = self;
        slots.clear();
        for Contact { carriers, .. } in &state.contacts {
            let mut own = [0; CARRIERS];
            for (j, (slot, &node)) in own.iter_mut().zip(carriers.nodes()).enumerate() {
                // Nodes that carry nothing take no force; their entries are multiplied by zero in any slot.
                if carriers.carries(j) {
                    *slot = support.add(node) as u32;
                }
            }
            slots.push(own);
        }
        support.gather(&model.compliance);
        let order = support.order();
        state.forces.resize(order, 0.0);
        contact_forces.clear();
        contact_forces.resize(order, 0.0);
        add_contact_forces(Springs { contacts: &state.contacts, slots, kc: *kc }, contact_forces);
        residual.clear();
        residual.extend(contact_forces.iter().zip(&state.forces).map(|(c, f)| c - f));
        product.resize(order, 0.0);
        support.multiply(contact_forces, product);
        let scale = dot(contact_forces, product);
        support.multiply(residual, product);
        let out_of_balance = dot(residual, product);
        let resolved_depth = DEPTH_ROUNDING * model.surface.extent / model.contact.tolerance;
        let floor = *kc * resolved_depth * model.max_nodal_compliance.sqrt();
        self.imbalance = root(out_of_balance) / root(scale).max(RESIDUAL_FLOOR);
        root(out_of_balance) / root(scale).max(floor).max(RESIDUAL_FLOOR)
    }

    /// The state that the last Newton step leads to.
    fn try_step(&mut self, model: &Model, detection: &mut Detection) {
        let Self { state, trial, newton, .. } = self;
        trial.forces.clear();
        trial.forces.extend(state.forces.iter().zip(&newton.force).map(|(f, df)| f + df));
        self.evaluate(model, detection);
        let Self { state, trial, newton, .. } = self;
        predict_multipliers(&mut trial.contacts, &state.contacts, |k| self.kc * newton.forces_over_kc[k]);
    }

    /// Displacement, contacts and energy that the trial's forces lead to.
    fn evaluate(&mut self, model: &Model, detection: &mut Detection) {
        let Self { trial, support, displacement, .. } = self;
        support.gather(&model.compliance);
        displacement.resize(support.order(), 0.0);
        support.multiply(&trial.forces, displacement);
        trial.elastic = 0.5 * dot(&trial.forces, displacement);
        self.displace(model, detection, &self.trial.forces, self.trial.elastic);
        let contacts = &mut self.trial.contacts;
        detection.deformed(model, contacts);
        self.trial.energy = self.trial.elastic + contact_energy(contacts, self.kc);
    }

    /// Returns the rounding error of E (J): each depth is rounded by a few eps of the coordinates, E's part by lambda
    /// times that.
    fn energy_rounding(&self, nodes: &[DVec3]) -> f64 {
        let mut size = self.state.energy;
        for contact in &self.state.contacts {
            size += self.kc * contact.force_over_kc() * nodes[contact.proxy_node as usize].length();
        }
        ENERGY_ROUNDING * size
    }
}

/// Sets the multipliers of `contacts` to the forces that `force` predicts for the rows `before`, by their place; zero
/// for a proxy node that had no row. Both lists ascend by proxy node (N).
fn predict_multipliers(contacts: &mut [Contact], before: &[Contact], force: impl Fn(usize) -> f64) {
    let mut k = 0;
    for contact in contacts {
        while k < before.len() && before[k].proxy_node < contact.proxy_node {
            k += 1;
        }
        let had = before.get(k).is_some_and(|row| row.proxy_node == contact.proxy_node);
        contact.multiplier = if had { force(k).max(0.0) } else { 0.0 };
    }
}

/// Returns 1/2 kc sum_i share_i max(0, depth_i)^2 (J).
#[must_use]
pub fn contact_energy(contacts: &[Contact], kc: f64) -> f64 {
    let mut sum = 0.0;
    for contact in contacts {
        sum += contact.force_over_kc() * contact.depth;
    }
    0.5 * kc * sum
}
