//! The energy form: the minimum of `E(u; q) = 1/2 u^T K u + 1/2 kc sum_i depth_i(u, q)^2` over the displacement u.
//!
//! State: the surface forces f on the support A, with u = C f, so that the elastic energy is 1/2 f . u_A. A damped
//! Newton step ([`super::newton`]) is tried, contact is detected anew at the trial, and the step is taken if E
//! decreases by a fair share of what the model promised: E never increases. Converged when the contact forces c(u)
//! balance f: sqrt(r . C r) <= tolerance sqrt(c . C c), r = c - f.
//!
//! Stiff contact is reached in stages of growing kc, each from the state before: E has then the shape of a steep and bent
//! valley, whose floor soft contact finds and stiffer contact only corrects. A stage's end never lies above the rest
//! state in E at the final kc: E_s(u_s) <= E_s(0) bounds both its elastic energy and its depths by those at rest.
//!
//! What does not converge from the rest state is approached from outside ([`outside`]).
//!
//! With the geometry frozen at rest (`linearised`) the same steps minimise the convex
//! `1/2 u^T K u + 1/2 kc sum_i max(0, depth_i(0) + sum_j w_j N . u_j)^2`; each of its updates freezes the geometry anew at the
//! displacement found and solves again.

mod outside;

use super::NodeForce;
use super::depth::Contact;
use super::detection::{Detection, Inner, Walls};
use super::model::Model;
use super::newton::{Care, Damping, Newton, Step};
use super::series::share_out;
use super::springs::{Bending, Springs, add_contact_forces};
use super::support::{Support, dot, root};
use super::tangent;
use crate::JointMatrix;
use crate::proxy::Pose;
use crate::tolerances::{
    ACCEPTED_SHARE, CONTINUATION_FACTOR, CONTINUATION_START, DEPTH_ROUNDING, ENERGY_ROUNDING, GIVE_UP_LENGTH,
    GOOD_SHARE, INNER_TOLERANCE, INNER_TOLERANCE_FLOOR, POOR_SHARE, RESIDUAL_FLOOR, STAGE_TOLERANCE, STALLED_LENGTH,
};
use glam::DVec3;

/// Where depth comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Geometry {
    /// The closest point of the deformed surface, found anew at every displacement.
    Deformed,
    /// The closest points at rest, or at the last update.
    Frozen,
}

/// One state of the search.
#[derive(Default)]
pub struct State {
    /// Forces on the support [N].
    pub forces: Vec<f64>,
    /// Displacement of all surface nodes [m].
    pub displacement: Vec<f64>,
    /// Surface nodes relative to the model's centre [m].
    pub positions: Vec<DVec3>,
    /// Contacts at this displacement.
    pub contacts: Vec<Contact>,
    /// E [J].
    pub energy: f64,
    /// Its elastic part [J].
    pub elastic: f64,
}

impl State {
    /// Positions from displacement.
    fn place(&mut self, model: &Model) {
        let displacement = self.displacement.as_chunks().0;
        for ((position, rest), u) in self.positions.iter_mut().zip(&model.rest).zip(displacement) {
            *position = *rest + DVec3::from_array(*u);
        }
    }
}

/// When a search ends.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Relative residual at which it has converged [1].
    pub tolerance: f64,
    /// Steps tried at most.
    pub iterations: u32,
}

/// What became of a search.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Whether the residual reached the tolerance.
    pub converged: bool,
    /// Steps tried.
    pub iterations: u32,
    /// Relative residual [1].
    pub residual: f64,
}

/// Workspace of the energy form.
pub struct EnergySearch {
    /// The current state; the result when the search has ended.
    pub state: State,
    trial: State,
    /// The state before a step on probation.
    before: State,
    /// The object nodes that carry force.
    pub support: Support,
    /// Contact stiffness of the current stage, and of the last [N/m].
    kc: f64,
    last_kc: f64,
    slots: Vec<[usize; 3]>,
    contact_forces: Vec<f64>,
    /// r = c - f [N], and C r [m].
    residual: Vec<f64>,
    product: Vec<f64>,
    newton: Newton,
    damping: Damping,
    care: Care,
    /// Rows of the frozen problem, with their depths at rest.
    frozen: Vec<Contact>,
    /// E at the start of the last stage and after each step taken since [J].
    pub history: Vec<f64>,
}

impl EnergySearch {
    /// Room for the object of `model`.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let state = || State {
            displacement: vec![0.0; 3 * model.rest.len()],
            positions: model.rest.clone(),
            ..State::default()
        };
        Self {
            state: state(),
            trial: state(),
            before: state(),
            support: Support::new(model.rest.len()),
            slots: Vec::new(),
            kc: 0.0,
            last_kc: 0.0,
            contact_forces: Vec::new(),
            residual: Vec::new(),
            product: Vec::new(),
            newton: Newton::default(),
            damping: Damping::default(),
            care: Care::Quick,
            frozen: Vec::new(),
            history: Vec::new(),
        }
    }

    /// The equilibrium of the configuration that `detection` has taken up, with proxy nodes at `nodes` [m] in the world.
    pub fn search(&mut self, model: &Model, detection: &mut Detection, geometry: Geometry, nodes: &[DVec3]) -> Outcome {
        (detection.inner, detection.left_out) = (Inner::Alone, false);
        let mut outcome = self.search_from_rest(model, detection, geometry);
        detection.inner = Inner::Among;
        if geometry == Geometry::Frozen {
            return outcome;
        }
        if detection.left_out && (!outcome.converged || self.is_inside(model)) {
            outcome = self.go_on(model, detection, outcome);
        }
        if !outcome.converged {
            self.search_from_outside(model, detection, nodes, &mut outcome);
        }
        outcome
    }

    /// Whether a ball's centre is inside the object.
    fn is_inside(&self, model: &Model) -> bool {
        let radius = |row: &Contact| model.chain.nodes[row.proxy_node as usize].radius;
        self.state.contacts.iter().any(|row| row.wall.is_some() && row.depth > radius(row))
    }

    /// Goes on where balls have felt the nearest wall alone inside: from the equilibrium found, or if there is none or no way on, from the
    /// rest state.
    fn go_on(&mut self, model: &Model, detection: &mut Detection, mut outcome: Outcome) -> Outcome {
        if outcome.converged {
            self.descend_anew(model, detection, &mut outcome);
        }
        if !outcome.converged {
            let before = outcome.iterations;
            outcome = self.search_from_rest(model, detection, Geometry::Deformed);
            outcome.iterations += before;
        }
        outcome
    }

    /// Descends from the current state by an E that detection measures otherwise than before.
    fn descend_anew(&mut self, model: &Model, detection: &mut Detection, outcome: &mut Outcome) {
        self.trial.forces.clone_from(&self.state.forces);
        self.take_trial(model, detection, Geometry::Deformed);
        let iterations = outcome.iterations + model.contact.max_iterations;
        let limits = Limits { tolerance: model.contact.tolerance, iterations };
        self.descend(model, detection, Geometry::Deformed, limits, outcome);
    }

    /// Searches from the rest state.
    fn search_from_rest(&mut self, model: &Model, detection: &mut Detection, geometry: Geometry) -> Outcome {
        self.kc = match geometry {
            // A spring pressed in beyond a node's radius would pull the node's centre through the surface.
            Geometry::Deformed => {
                model.kc.min(CONTINUATION_START / model.softest * detection.depth_in_radii(model).max(1.0))
            }
            Geometry::Frozen => model.kc,
        };
        self.last_kc = model.kc;
        self.start(model, detection, geometry);
        let mut outcome = Outcome { converged: false, iterations: 0, residual: f64::MAX };
        let limits = Limits { tolerance: model.contact.tolerance, iterations: model.contact.max_iterations };
        self.descend(model, detection, geometry, limits, &mut outcome);
        let updates = if geometry == Geometry::Frozen { model.contact.updates } else { 0 };
        for _ in 0..updates {
            if !outcome.converged {
                break;
            }
            self.freeze_here(model, detection);
            self.descend(model, detection, geometry, limits, &mut outcome);
        }
        outcome
    }

    /// Searches from where `forces` on the object's nodes hold it, which should be near the minimum with contact stiffness `kc` [N/m], for
    /// the configuration that `detection` has taken up.
    pub fn settle(
        &mut self,
        model: &Model,
        detection: &mut Detection,
        geometry: Geometry,
        (forces, kc): (&[NodeForce], f64),
        limits: Limits,
    ) -> Outcome {
        (self.kc, self.last_kc) = (kc, model.kc);
        self.support.clear();
        if geometry == Geometry::Frozen {
            self.start(model, detection, geometry);
        }
        self.trial.forces.clear();
        for &NodeForce { node, force } in forces {
            let at = 3 * self.support.add(node);
            self.trial.forces.resize(self.support.order(), 0.0);
            self.trial.forces[at..at + 3].iter_mut().zip(force.to_array()).for_each(|(sum, part)| *sum += part);
        }
        self.take_trial(model, detection, geometry);
        self.kc = model.kc;
        let mut outcome = Outcome { converged: false, iterations: 0, residual: f64::MAX };
        self.descend(model, detection, geometry, limits, &mut outcome);
        outcome
    }

    /// Takes what the trial's forces lead to for the state.
    fn take_trial(&mut self, model: &Model, detection: &mut Detection, geometry: Geometry) {
        self.evaluate(model, detection, geometry);
        std::mem::swap(&mut self.state, &mut self.trial);
        for contact in &mut self.state.contacts {
            contact.multiplier = self.kc * contact.bears();
        }
    }

    /// Descends from the current state until it is balanced or there is no going on.
    fn descend(
        &mut self,
        model: &Model,
        detection: &mut Detection,
        geometry: Geometry,
        limits: Limits,
        outcome: &mut Outcome,
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
            outcome.converged = self.kc == self.last_kc && outcome.residual <= limits.tolerance;
            if outcome.converged || outcome.iterations >= limits.iterations || stuck {
                break;
            }
            outcome.iterations += 1;
            let step = self.step(outcome.residual);
            self.try_step(model, detection, geometry);
            // Near the solution both decreases drown in rounding, which must not refuse a good step.
            let rounding = self.energy_rounding(detection.nodes());
            let promised = step.predicted + rounding;
            let energy = self.state.energy;
            // Contacts that come and go may leave a step that promises nothing.
            let share =
                |trial: &State| if promised > 0.0 { (energy - trial.energy + rounding) / promised } else { 0.0 };
            let mut ratio = share(&self.trial);
            let on_probation = self.care.is_thorough() && ratio < ACCEPTED_SHARE && promised > 0.0;
            if on_probation {
                outcome.iterations += 1;
                self.correct(model, detection, geometry);
                ratio = share(&self.trial);
            }
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
            }
            if ratio >= ACCEPTED_SHARE || on_probation {
                outcome.residual = self.balance(model);
            }
        }
    }

    /// The step from the current state, whose relative residual is `residual`.
    fn step(&mut self, residual: f64) -> Step {
        let step = self.newton.step(
            &self.support,
            Springs { contacts: &self.state.contacts, slots: &self.slots, kc: self.kc, bending: Bending::Exact },
            (&self.residual, &self.product),
            self.damping.multiple,
            residual.clamp(INNER_TOLERANCE_FLOOR, INNER_TOLERANCE),
            self.care,
        );
        self.damping.multiple = step.damping;
        step
    }

    /// Puts in the trial's place what another step leads to from there. The state stays as it is, its balance does not.
    fn correct(&mut self, model: &Model, detection: &mut Detection, geometry: Geometry) {
        std::mem::swap(&mut self.before, &mut self.state);
        std::mem::swap(&mut self.state, &mut self.trial);
        let residual = self.balance(model);
        self.step(residual);
        self.try_step(model, detection, geometry);
        std::mem::swap(&mut self.state, &mut self.before);
    }

    /// Freezes the geometry anew, as it is at the current displacement: an update of linearised contact.
    fn freeze_here(&mut self, model: &Model, detection: &mut Detection) {
        let Self { state, frozen, .. } = self;
        state.place(model);
        detection.deformed(model, &state.displacement, &state.positions, Walls::All, frozen);
        frozen.iter_mut().for_each(Contact::freeze);
        // Depths at rest, by the slopes here.
        for row in frozen.iter_mut() {
            row.depth -= linear_change(row, &state.displacement);
        }
        frozen_contacts(frozen, &state.displacement, &mut state.contacts);
    }

    /// The tangent d tau/d q at the current state, an equilibrium of the proxy in `pose`; see [`tangent`].
    pub fn tangent(&mut self, model: &Model, pose: &Pose) -> Option<JointMatrix> {
        let Self { state, slots, support, newton, kc, .. } = self;
        for contact in &mut state.contacts {
            contact.multiplier = *kc * contact.bears();
        }
        let springs = Springs { contacts: &state.contacts, slots, kc: *kc, bending: Bending::Exact };
        tangent::tangent(model, pose, springs, support, newton)
    }

    /// Takes up a new contact stiffness at the current state; returns how far from rest any iterate can be in the energy norm:
    /// 1/2 |u|^2 never exceeds E.
    fn begin_stage(&mut self, model: &Model, outcome: &mut Outcome) -> f64 {
        self.state.energy = self.state.elastic + contact_energy(&self.state.contacts, self.kc);
        self.history.clear();
        self.history.push(self.state.energy);
        self.damping = Damping::default();
        outcome.residual = self.balance(model);
        (2.0 * self.state.energy).sqrt()
    }

    /// The rest state.
    fn start(&mut self, model: &Model, detection: &mut Detection, geometry: Geometry) {
        self.support.clear();
        self.state.forces.clear();
        self.state.elastic = 0.0;
        self.state.displacement.fill(0.0);
        self.state.positions.copy_from_slice(&model.rest);
        detection.deformed(
            model,
            &self.state.displacement,
            &self.state.positions,
            if geometry == Geometry::Frozen { Walls::Closest } else { Walls::All },
            &mut self.state.contacts,
        );
        if geometry == Geometry::Frozen {
            // 1/2 |u|^2 <= E <= E(0) in the energy norm and |u_j|^2 <= trace(C_jj) |u|^2, all along the search: nodes
            // farther from the surface than this can never touch.
            let energy = contact_energy(&self.state.contacts, self.kc);
            let reach = (2.0 * energy * model.softest).sqrt();
            detection.frozen(model, reach, &mut self.frozen);
            frozen_contacts(&self.frozen, &self.state.displacement, &mut self.state.contacts);
        }
    }

    /// Brings the support, the contact forces and the residual force r = c - f up to date with the current state; returns
    /// the relative residual sqrt(r . C r) / sqrt(c . C c).
    fn balance(&mut self, model: &Model) -> f64 {
        let Self { state, support, slots, contact_forces, residual, product, kc, .. } = self;
        slots.clear();
        for contact in &state.contacts {
            let mut contact_slots = [0; 3];
            for (slot, (&node, &weight)) in contact_slots.iter_mut().zip(contact.nodes.iter().zip(&contact.weights)) {
                // Nodes without weight take no force; their entries are multiplied by zero in any slot.
                if weight != 0.0 {
                    *slot = support.add(node);
                }
            }
            slots.push(contact_slots);
        }
        support.gather(&model.compliance);
        let order = support.order();
        state.forces.resize(order, 0.0);
        contact_forces.clear();
        contact_forces.resize(order, 0.0);
        add_contact_forces(
            Springs { contacts: &state.contacts, slots, kc: *kc, bending: Bending::Exact },
            contact_forces,
        );
        residual.clear();
        residual.extend(contact_forces.iter().zip(&state.forces).map(|(c, f)| c - f));
        product.resize(order, 0.0);
        support.multiply(contact_forces, product);
        let scale = dot(contact_forces, product);
        support.multiply(residual, product);
        let out_of_balance = dot(residual, product);
        // Forces of depths too small to be known to the tolerance are measured against the smallest that is.
        let resolved_depth = DEPTH_ROUNDING * model.extent / model.contact.tolerance;
        let floor = *kc * resolved_depth * model.softest.sqrt();
        root(out_of_balance) / root(scale).max(floor).max(RESIDUAL_FLOOR)
    }

    /// The state that the last Newton step leads to.
    fn try_step(&mut self, model: &Model, detection: &mut Detection, geometry: Geometry) {
        let Self { state, trial, newton, .. } = self;
        trial.forces.clear();
        trial.forces.extend(state.forces.iter().zip(&newton.force).map(|(f, df)| f + df));
        self.evaluate(model, detection, geometry);
        let Self { state, trial, newton, .. } = self;
        let bears = &newton.bears;
        foresee(&mut trial.contacts, &state.contacts, |_, k| self.kc * bears[k]);
    }

    /// Displacement, contacts and energy that the trial's forces lead to.
    fn evaluate(&mut self, model: &Model, detection: &mut Detection, geometry: Geometry) {
        let Self { trial, support, .. } = self;
        support.displace(&model.compliance, &trial.forces, &mut trial.displacement);
        match geometry {
            Geometry::Deformed => {
                trial.place(model);
                detection.deformed(model, &trial.displacement, &trial.positions, Walls::All, &mut trial.contacts);
            }
            Geometry::Frozen => frozen_contacts(&self.frozen, &trial.displacement, &mut trial.contacts),
        }
        let mut work = 0.0;
        for (slot, &node) in support.nodes().iter().enumerate() {
            let at = 3 * node as usize;
            work += dot(&trial.forces[3 * slot..3 * slot + 3], &trial.displacement[at..at + 3]);
        }
        trial.elastic = 0.5 * work;
        trial.energy = trial.elastic + contact_energy(&trial.contacts, self.kc);
    }

    /// What E is rounded by: each depth is rounded by a few eps of the coordinates, E's part by lambda times that [J].
    fn energy_rounding(&self, nodes: &[DVec3]) -> f64 {
        let mut size = self.state.energy;
        for contact in &self.state.contacts {
            size += self.kc * contact.bears() * nodes[contact.proxy_node as usize].length();
        }
        ENERGY_ROUNDING * size
    }
}

/// Multipliers as `force` foretells them from the contacts before, by contact and place in the list: of the same wall, or
/// the one that faces the same way; zero for a node that was not known. Both lists ascend by proxy node [N].
fn foresee(contacts: &mut [Contact], before: &[Contact], force: impl Fn(&Contact, usize) -> f64) {
    let mut first = 0;
    for contact in contacts {
        while first < before.len() && before[first].proxy_node < contact.proxy_node {
            first += 1;
        }
        let mut likest = -2.0;
        contact.multiplier = 0.0;
        for (k, before) in before.iter().enumerate().skip(first) {
            if before.proxy_node != contact.proxy_node {
                break;
            }
            let same = contact.wall.is_some() && before.nodes == contact.nodes;
            let alike = if same { 2.0 } else { before.normal.dot(contact.normal) };
            if alike > likest {
                likest = alike;
                contact.multiplier = force(before, k).max(0.0);
            }
        }
    }
}

/// 1/2 kc sum_i share_i depth_i^2, or of a ball that touches walls what [`super::series`] says [J].
#[must_use]
pub fn contact_energy(contacts: &[Contact], kc: f64) -> f64 {
    let mut sum = 0.0;
    for contact in contacts {
        sum += contact.bears() * contact.depth;
    }
    0.5 * kc * sum
}

/// Rows of the frozen problem with their depths at `displacement`.
fn frozen_contacts(rows: &[Contact], displacement: &[f64], contacts: &mut Vec<Contact>) {
    contacts.clear();
    contacts.extend(rows.iter().map(|row| Contact { depth: row.depth + linear_change(row, displacement), ..*row }));
    share_out(contacts, &mut Vec::new());
}

/// By how much `displacement` deepens a frozen row [m].
fn linear_change(row: &Contact, displacement: &[f64]) -> f64 {
    row.deepening(row.nodes.map(|node| DVec3::from_slice(&displacement[3 * node as usize..])))
}
