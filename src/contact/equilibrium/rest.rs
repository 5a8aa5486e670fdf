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
//!
//! Before a rounded surface ([`super::super::law::rounded`]) rows are blends on the points of a lattice ([`blended`]), and
//! these stand for the nodes of the support; all else is the same.

mod blended;
mod sensitivity;
mod tangent;

pub use sensitivity::Sensitivity;

use crate::contact::detection::Detection;
use crate::contact::equilibrium::energy::SolverStats;
use crate::contact::geometry::smooth::CARRIERS;
use crate::contact::law::depth::{Contact, Variation};
use crate::contact::law::rounded::MOST_SIZE;
use crate::contact::law::springs::{Slots, Springs, stretched_and_bent};
use crate::contact::linear::nonnegative::NonnegativeProgram;
use crate::contact::linear::support::{Support, dot};
use crate::contact::model::Model;
use blended::{BlendedRows, TAPS};
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
    /// What the rows hang on before a rounded surface.
    blended: Option<BlendedRows>,
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
            blended: BlendedRows::new(model),
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
        let mut program = Self::new(model);
        let surface_nodes = model.surface.positions.len();
        let nodes = match &mut program.blended {
            None => {
                let nodes = limits.nodes.min(CARRIERS * rows).min(surface_nodes);
                program.support.reserve(nodes + CARRIERS, model.compliance.rows_per_node);
                program.displacement.reserve(3 * nodes);
                program.response.reserve(3 * nodes);
                program.forces.reserve(3 * nodes);
                nodes
            }
            Some(blended) => {
                let points = limits.nodes.min(TAPS * rows);
                blended.reserve(rows, points);
                program.support.reserve_nodes(surface_nodes);
                program.forces.reserve(3 * surface_nodes);
                points
            }
        };
        program.limits = RestLimits { rows, nodes, ..limits };
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
        self.blended.iter_mut().for_each(BlendedRows::clear);
        self.slots.clear();
        self.depths.clear();
        let mut fits = true;
        for i in 0..model.chain.nodes.len() {
            let pushed = self.pushes[i].take().filter(|_| guess == Guess::Last);
            let reach = if pushed == Some(true) { f64::INFINITY } else { 0.0 };
            if fits && let Some(row) = detection.at_rest(model, i, reach) {
                let pushes = pushed.unwrap_or(row.depth > 0.0);
                fits = self.add(row, detection.nodes()[i], pushes);
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

    /// Adds a row whose proxy node, at `x`, `pushes`, by a guess, and returns whether it is within the limits.
    fn add(&mut self, row: Contact, x: DVec3, pushes: bool) -> bool {
        let depth = self.depth(&row, x);
        let Self { support, rows, blended, slots, depths, limits, .. } = self;
        let mut own = [0; CARRIERS];
        for (j, (slot, &node)) in own.iter_mut().zip(row.carriers.nodes()).enumerate() {
            if row.carriers.carries(j) {
                *slot = support.add(node) as u32;
            }
        }
        let nodes = match blended {
            None => support.nodes().len(),
            Some(_) if rows.len() == limits.rows => return false,
            Some(blended) => {
                blended.add(x);
                blended.order()
            }
        };
        if rows.len() == limits.rows || nodes > limits.nodes {
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
        let Self { support, rows, blended, slots, response, compliance, .. } = self;
        match blended {
            None => {
                support.gather(&model.compliance);
                response.resize(support.response_width() * support.nodes().len(), 0.0);
            }
            Some(blended) => blended.gather(),
        }
        let count = rows.len();
        widen(compliance, known, count);
        let springs = Springs { contacts: rows, slots, kc: model.kc };
        for i in known..count {
            let gives = &mut compliance[i * count..][..=i];
            match blended {
                None => springs.respond(support, (i, 0..=i), response, gives),
                Some(blended) => blended.respond(i, gives),
            }
            (0..i).for_each(|j| compliance[j * count + i] = compliance[i * count + j]);
            compliance[i * count + i] += 1.0 / (model.kc * rows[i].share);
        }
    }

    /// Takes forces and energies from the program's solution.
    fn take_solution(&mut self, model: &Model) {
        let Self { rows, blended, elastic, energy, pushes, depths, program, .. } = self;
        // 2 l . D - l . S l: to first order, what rounding leaves in the forces is not in it.
        *energy = 0.5 * (dot(&program.solution, depths) + dot(&program.solution, &program.slack));
        *elastic = *energy;
        for (row, &force) in rows.iter_mut().zip(&program.solution) {
            row.multiplier = force;
            pushes[row.proxy_node as usize] = Some(force > 0.0);
            *elastic -= 0.5 * force * force / (model.kc * row.share);
        }
        if let Some(blended) = blended {
            return blended.take_forces(&program.solution);
        }
        let mut forces = std::mem::take(&mut self.forces);
        forces.clear();
        forces.resize(self.support.order(), 0.0);
        (0..self.rows.len()).for_each(|i| self.add_load(i, -self.rows[i].multiplier, &mut forces));
        self.forces = forces;
    }

    /// Numbers of a load: of the forces on the support, or along the rows of the points that stand for it.
    fn order(&self) -> usize {
        self.blended.as_ref().map_or(self.support.order(), BlendedRows::order)
    }

    /// Adds `force` times row `i` to `load`.
    fn add_load(&self, i: usize, force: f64, load: &mut [f64]) {
        let Self { rows, blended, slots, .. } = self;
        match blended {
            _ if force == 0.0 => {}
            None => Springs { contacts: rows, slots, kc: 1.0 }.add_reaction(i, &rows[i].spread(force), load),
            Some(blended) => blended.add_load(i, force, load),
        }
    }

    /// Adds the change of row `i` times its force, as its proxy node moves by `way` (m), to `load`.
    fn add_turn(&self, i: usize, way: DVec3, load: &mut [f64]) {
        let Self { rows, blended, slots, .. } = self;
        let row = &rows[i];
        match blended {
            None => {
                let turned = stretched_and_bent(row, 0.0, &Variation::translation(-way));
                Springs { contacts: rows, slots, kc: 1.0 }.add_reaction(i, &turned, load);
            }
            Some(blended) => blended.add_turn(i, way * row.multiplier, load),
        }
    }

    /// Sets `response` to how the support moves, or its points give, under `load` (m).
    fn respond(&self, load: &[f64], response: &mut [f64]) {
        match &self.blended {
            None => self.support.multiply(load, response),
            Some(blended) => blended.multiply(load, response),
        }
    }

    /// By how much such a `response` deepens row `i` (m).
    fn depth_change(&self, i: usize, response: &[f64]) -> f64 {
        let Self { rows, blended, slots, .. } = self;
        match blended {
            None => Springs { contacts: rows, slots, kc: 1.0 }.depth_change(i, response),
            Some(blended) => blended.depth_change(i, response),
        }
    }

    /// Sets the displacement of the support under the forces.
    fn displace_support(&mut self) {
        let Self { support, forces, displacement, blended, .. } = self;
        if let Some(blended) = blended {
            blended.give();
            blended.put_on(support);
            return blended.spread(&blended.load, support, forces);
        }
        displacement.resize(forces.len(), 0.0);
        support.multiply(forces, displacement);
    }

    /// The object's nodes that carry row `i` and their shares of its force, in sum one.
    pub fn carriers(&self, i: usize) -> Vec<(u32, f64)> {
        match &self.blended {
            None => self.rows[i].carriers.iter().collect(),
            Some(blended) => blended.carriers(i, &self.support),
        }
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
        let moved = match &mut self.blended {
            None => self.displace(model, detection),
            Some(blended) => {
                blended.give();
                blended.deepening_bound(self.elastic) + MOST_SIZE * self.farthest()
            }
        };
        (0..model.chain.nodes.len()).all(|i| {
            if self.pushes[i].is_some() {
                return true;
            }
            let Some(row) = detection.at_rest(model, i, moved) else { return true };
            let x = detection.nodes()[i];
            let change = match &self.blended {
                None => linear_change(model, &row, detection),
                Some(blended) => blended.deepening(x),
            };
            self.depth(&row, x) + change <= 0.0 || self.add(row, x, true)
        })
    }

    /// Farthest that a node stands from where it rests (m).
    pub fn farthest(&self) -> f64 {
        self.standing.iter().map(|node| node.length_squared()).fold(0.0, f64::max).sqrt()
    }

    /// Depth of `row`, of a proxy node at `x`, before the surface as it stands without contact (m).
    fn depth(&self, row: &Contact, x: DVec3) -> f64 {
        if self.standing.is_empty() {
            return row.depth;
        }
        let stands = |node: u32| self.standing[node as usize];
        match &self.blended {
            None => row.depth + row.normal.dot(row.moved(|j| stands(row.carriers.nodes()[j]))),
            Some(blended) => row.depth + blended.standing(x, stands),
        }
    }

    /// Force on the proxy node of row `i`: along the normal, and sideways by how the row changes (N).
    #[must_use]
    pub fn force(&self, i: usize) -> DVec3 {
        let Self { support, rows, blended, slots, displacement, .. } = self;
        let row = &rows[i];
        let stands = |node: u32| self.stands(node);
        let pushed = match blended {
            None => {
                let nodes = displacement.as_chunks::<3>().0;
                let moved = |slot: usize| DVec3::from_array(nodes[slot]) + stands(support.nodes()[slot]);
                row.pushed(|j| moved(slots[i][j] as usize))
            }
            Some(blended) => blended.pushed(i, stands),
        };
        pushed * row.multiplier
    }

    /// Where `node` stands without contact, from where it rests (m).
    fn stands(&self, node: u32) -> DVec3 {
        self.standing.get(node as usize).copied().unwrap_or_default()
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
