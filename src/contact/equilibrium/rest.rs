//! Contact with the surface at rest, in exact form: Signorini's problem.
//!
//! Depth D_i and row g_i of proxy node i, which says how the object's nodes carry and deepen it, belong to the place of
//! the node before the undeformed surface, and the depth is linear in the displacement: D_i + g_i . u. The stored
//! energy is then convex, and by duality
//!
//! `U(q) = max over lambda >= 0 of lambda . D - 1/2 lambda . (G C G^T + 1/kc) lambda`,
//!
//! with one solution, the forces of the contacts, and u = -C G^T lambda. By the envelope theorem `tau = -dU/dq = -sum_i
//! lambda_i J_i^T (grad D_i + grad g_i . u)`: the proxy is pushed along the normal, and sideways by how its row changes
//! along the surface. That part has no counterpart among the forces on the object's nodes, which are -lambda_i g_i. The
//! gradient of a row is the mixed second derivative of the depth, as [`super::super::law::depth`] has it; where that
//! limits a curvature (next to an edge, a vertex, or the points where the closest point leaps) the torque is off by
//! what the limit leaves out.
//!
//! Only nodes that touch somewhere have a row: first those below the surface at rest, and, after the program is solved,
//! those that the surface has bulged up to, until there are no more. Along a way the rows that pushed last are there
//! from the beginning ([`Guess::Last`]): the solution is the same, and is found sooner.
//!
//! The surface without contact may stand elsewhere than at rest, displaced by s of an object that remembers
//! ([`RestProgram::standing`]). Depths are then D_i + g_i . s, and u = s - C G^T lambda.

mod sensitivity;
mod tangent;

pub use sensitivity::Sensitivity;

use crate::contact::detection::Detection;
use crate::contact::equilibrium::energy::SolverStats;
use crate::contact::geometry::smooth::CARRIERS;
use crate::contact::law::depth::Contact;
use crate::contact::law::springs::{Slots, Springs};
use crate::contact::linear::nonnegative::NonnegativeProgram;
use crate::contact::linear::support::{Support, dot};
use crate::contact::model::Model;
use glam::DVec3;

/// Which rows push, before it is known. The solution is the same but for rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Guess {
    /// Those below the surface at rest: results do not depend on what was solved before, to the last bit.
    Depths,
    /// Those that pushed at the configuration that was solved last.
    Last,
}

/// Largest program that is solved, and for how long.
#[derive(Clone, Copy, Debug)]
pub struct RestLimits {
    /// Rows.
    pub rows: usize,
    /// Nodes of the object on the support.
    pub nodes: usize,
    /// Rounds of the program.
    pub rounds: u32,
}

/// Workspace of contact with the surface at rest, for one thread.
pub struct RestProgram {
    /// The object's nodes that carry force, or weigh in how a row changes.
    pub support: Support,
    /// Forces on the support (N).
    pub forces: Vec<f64>,
    /// The rows, in the order in which they were found; their depths are at rest, their multipliers the forces (m, N).
    pub rows: Vec<Contact>,
    /// Elastic energy (J).
    pub elastic: f64,
    /// U (J).
    pub energy: f64,
    /// Displacement s of each surface node without contact; empty at rest (m).
    pub standing: Vec<DVec3>,
    limits: RestLimits,
    slots: Vec<Slots>,
    /// Whether each proxy node that has a row pushes.
    pushes: Vec<Option<bool>>,
    /// Displacement of the support (m).
    displacement: Vec<f64>,
    /// C g of one row, as [`Support::respond_along`] has it (m/N).
    response: Vec<f64>,
    /// G C G^T + 1/kc (m/N).
    compliance: Vec<f64>,
    depths: Vec<f64>,
    program: NonnegativeProgram,
}

impl RestProgram {
    /// Room for the object of `model`, which grows with the programs.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let limits = RestLimits { rows: usize::MAX, nodes: usize::MAX, rounds: model.contact.max_iterations };
        Self {
            support: Support::new(model.surface.positions.len()),
            forces: Vec::new(),
            rows: Vec::new(),
            elastic: 0.0,
            energy: 0.0,
            standing: Vec::new(),
            limits,
            slots: Vec::new(),
            pushes: vec![None; model.chain.nodes.len()],
            displacement: Vec::new(),
            response: Vec::new(),
            compliance: Vec::new(),
            depths: Vec::new(),
            program: NonnegativeProgram::default(),
        }
    }

    /// Room for programs within `limits`, which nothing allocates for from then on. Beyond them none is solved.
    #[must_use]
    pub fn within(model: &Model, limits: RestLimits) -> Self {
        let rows = limits.rows.min(model.chain.nodes.len());
        let nodes = limits.nodes.min(CARRIERS * rows).min(model.surface.positions.len());
        let limits = RestLimits { rows, nodes, ..limits };
        let mut program = Self { limits, ..Self::new(model) };
        program.support.reserve(nodes + CARRIERS, model.compliance.rows_per_node);
        for vector in [&mut program.forces, &mut program.displacement, &mut program.response] {
            vector.reserve(3 * nodes);
        }
        program.rows.reserve(rows);
        program.slots.reserve(rows);
        program.compliance.reserve(rows * rows);
        program.depths.reserve(rows);
        program.program.reserve(rows);
        program
    }

    /// Solves the configuration that `detection` has taken up; `None` where it is beyond the limits in size.
    pub fn solve(&mut self, model: &Model, detection: &mut Detection, guess: Guess) -> Option<SolverStats> {
        self.support.clear();
        self.rows.clear();
        self.slots.clear();
        self.depths.clear();
        let mut fits = true;
        for i in 0..model.chain.nodes.len() {
            let pushed = self.pushes[i].take().filter(|_| guess == Guess::Last);
            let reach = if pushed == Some(true) { f64::INFINITY } else { 0.0 };
            if fits && let Some(row) = detection.at_rest(model, i, reach) {
                let pushes = pushed.unwrap_or(row.depth > 0.0);
                fits = self.add(row, pushes);
            }
        }
        let (mut iterations, mut known) = (0, 0);
        while fits {
            self.assemble(model, known);
            let Self { program, compliance, depths, rows, pushes, .. } = self;
            let are_free = rows.iter().map(|row| pushes[row.proxy_node as usize] == Some(true));
            let left = self.limits.rounds.saturating_sub(iterations);
            let (ended, rounds) = program.solve(compliance, depths, are_free, left);
            iterations += rounds;
            self.take_solution(model);
            known = self.rows.len();
            fits = !ended || self.add_rows(model, detection);
            if !ended || fits && self.rows.len() == known {
                self.displace_support();
                return Some(SolverStats { converged: ended, iterations, residual: self.residual() });
            }
        }
        None
    }

    /// The object's nodes that carry force.
    pub fn loaded(&self) -> impl Iterator<Item = u32> {
        let loaded = self.support.nodes().iter().zip(self.forces.as_chunks::<3>().0);
        loaded.filter(|(_, force)| **force != [0.0; 3]).map(|(&node, _)| node)
    }

    /// Adds a row whose proxy node `pushes`, by a guess, and returns whether it is within the limits.
    fn add(&mut self, row: Contact, pushes: bool) -> bool {
        let depth = self.depth(&row);
        let Self { support, rows, slots, depths, limits, .. } = self;
        let mut own = [0; CARRIERS];
        for (j, (slot, &node)) in own.iter_mut().zip(row.carriers.nodes()).enumerate() {
            if row.carriers.carries(j) {
                *slot = support.add(node) as u32;
            }
        }
        if rows.len() == limits.rows || support.nodes().len() > limits.nodes {
            return false;
        }
        self.pushes[row.proxy_node as usize] = Some(pushes);
        slots.push(own);
        depths.push(depth);
        rows.push(row);
        true
    }

    /// Brings the support and the program up to date with the rows, of which the first `known` were there before.
    fn assemble(&mut self, model: &Model, known: usize) {
        let Self { support, rows, slots, response, compliance, .. } = self;
        support.gather(&model.compliance);
        response.resize(support.response_width() * support.nodes().len(), 0.0);
        let count = rows.len();
        widen(compliance, known, count);
        let springs = Springs { contacts: rows, slots, kc: model.kc };
        for i in known..count {
            springs.respond(support, (i, 0..=i), response, &mut compliance[i * count..][..=i]);
            (0..i).for_each(|j| compliance[j * count + i] = compliance[i * count + j]);
            compliance[i * count + i] += 1.0 / (model.kc * rows[i].share);
        }
    }

    /// Takes forces and energies from the program's solution.
    fn take_solution(&mut self, model: &Model) {
        let Self { support, forces, rows, elastic, energy, slots, pushes, depths, program, .. } = self;
        forces.clear();
        forces.resize(support.order(), 0.0);
        *energy = 0.5 * dot(&program.solution, depths);
        *elastic = *energy;
        for (row, &force) in rows.iter_mut().zip(&program.solution) {
            row.multiplier = force;
            pushes[row.proxy_node as usize] = Some(force > 0.0);
            *elastic -= 0.5 * force * force / (model.kc * row.share);
        }
        let springs = Springs { contacts: rows, slots, kc: model.kc };
        for (i, &force) in program.solution.iter().enumerate().filter(|(_, force)| **force > 0.0) {
            springs.add_reaction(i, &rows[i].spread(-force), forces);
        }
    }

    /// Sets the displacement of the support under the forces.
    fn displace_support(&mut self) {
        let Self { support, forces, displacement, .. } = self;
        displacement.resize(forces.len(), 0.0);
        support.multiply(forces, displacement);
    }

    /// Has `detection` take up the displaced surface, and returns a bound of how far that has moved (m).
    fn displace(&self, model: &Model, detection: &mut Detection) -> f64 {
        let bound = model.motion_bound(self.elastic);
        detection.displace(model, self.support.nodes(), &self.forces, bound);
        bound.moved + self.farthest()
    }

    /// Adds a row for each proxy node without one that the displaced surface has reached, and returns whether they are
    /// within the limits.
    fn add_rows(&mut self, model: &Model, detection: &mut Detection) -> bool {
        let moved = self.displace(model, detection);
        (0..model.chain.nodes.len()).all(|i| {
            if self.pushes[i].is_some() {
                return true;
            }
            match detection.at_rest(model, i, moved) {
                Some(row) if self.depth(&row) + linear_change(model, &row, detection) > 0.0 => self.add(row, true),
                _ => true,
            }
        })
    }

    /// Farthest that a node stands from where it rests (m).
    pub fn farthest(&self) -> f64 {
        self.standing.iter().map(|node| node.length_squared()).fold(0.0, f64::max).sqrt()
    }

    /// Depth of `row` before the surface as it stands without contact (m).
    fn depth(&self, row: &Contact) -> f64 {
        if self.standing.is_empty() {
            return row.depth;
        }
        let nodes = row.carriers.nodes();
        row.depth + row.normal.dot(row.moved(|j| self.standing[nodes[j] as usize]))
    }

    /// Force on the proxy node of row `i`: along the normal, and sideways by how the row changes (N).
    #[must_use]
    pub fn force(&self, i: usize) -> DVec3 {
        let Self { support, rows, slots, displacement, standing, .. } = self;
        let (row, nodes) = (&rows[i], displacement.as_chunks::<3>().0);
        let moved = |slot: usize| {
            let stands = standing.get(support.nodes()[slot] as usize).copied().unwrap_or_default();
            DVec3::from_array(nodes[slot]) + stands
        };
        row.pushed(|j| moved(slots[i][j] as usize)) * row.multiplier
    }

    /// The greatest depth that the forces do not account for, over the greatest at rest (1).
    fn residual(&self) -> f64 {
        let Self { depths, program, .. } = self;
        let deepest = depths.iter().fold(0.0_f64, |most, depth| most.max(*depth));
        let off = program
            .solution
            .iter()
            .zip(&program.slack)
            .map(|(force, slack)| if *force > 0.0 { slack.abs() } else { slack.max(0.0) });
        off.fold(0.0, f64::max) / deepest.max(f64::MIN_POSITIVE)
    }
}

/// Gives the rows of a square matrix of `from` rows the length of a matrix of `to` rows.
fn widen(matrix: &mut Vec<f64>, from: usize, to: usize) {
    matrix.resize(to * to, 0.0);
    (1..from).rev().for_each(|i| matrix.copy_within(i * from..(i + 1) * from, i * to));
}

/// Returns by how much the displacement that `detection` has taken up deepens `row` (m).
fn linear_change(model: &Model, row: &Contact, detection: &mut Detection) -> f64 {
    let mut sum = DVec3::ZERO;
    for (node, weight) in row.carriers.iter() {
        sum += detection.displacement(model, node) * weight;
    }
    row.normal.dot(sum)
}
