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
//! those that the surface has bulged up to, until there are no more.

mod tangent;

use crate::contact::detection::Detection;
use crate::contact::equilibrium::energy::SolverStats;
use crate::contact::geometry::smooth::CARRIERS;
use crate::contact::law::depth::Contact;
use crate::contact::law::springs::{Slots, Springs};
use crate::contact::linear::nonnegative::NonnegativeProgram;
use crate::contact::linear::support::{Support, dot};
use crate::contact::model::Model;
use glam::DVec3;

/// Workspace of contact with the surface at rest, for one thread.
pub struct RestProgram {
    /// The object's nodes that carry force, or weigh in how a row changes.
    pub support: Support,
    /// Forces on the support (N).
    pub forces: Vec<f64>,
    /// The rows, ascending by proxy node; their depths are at rest, their multipliers the forces (m, N).
    pub rows: Vec<Contact>,
    /// Elastic energy (J).
    pub elastic: f64,
    /// U (J).
    pub energy: f64,
    slots: Vec<Slots>,
    /// Displacement of the support (m).
    displacement: Vec<f64>,
    /// C g_i of each row on the support, one row after the other, and along its normal alone (m/N).
    columns: Vec<f64>,
    scalars: Vec<f64>,
    /// G C G^T + 1/kc (m/N).
    compliance: Vec<f64>,
    depths: Vec<f64>,
    program: NonnegativeProgram,
}

impl RestProgram {
    /// Room for the object of `model`.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            support: Support::new(model.surface.positions.len()),
            forces: Vec::new(),
            rows: Vec::new(),
            elastic: 0.0,
            energy: 0.0,
            slots: Vec::new(),
            displacement: Vec::new(),
            columns: Vec::new(),
            scalars: Vec::new(),
            compliance: Vec::new(),
            depths: Vec::new(),
            program: NonnegativeProgram::default(),
        }
    }

    /// Solves the configuration that `detection` has taken up.
    pub fn solve(&mut self, model: &Model, detection: &mut Detection) -> SolverStats {
        self.support.clear();
        self.rows.clear();
        self.rows.extend((0..model.chain.nodes.len()).filter_map(|i| detection.at_rest(model, i, 0.0)));
        let mut iterations = 0;
        loop {
            self.assemble(model);
            let left = model.contact.max_iterations.saturating_sub(iterations);
            let (ended, rounds) = self.program.solve(&self.compliance, &self.depths, left);
            iterations += rounds;
            self.take_solution(model);
            let converged = ended && !self.add_rows(model, detection);
            if converged || !ended {
                return SolverStats { converged, iterations, residual: self.residual() };
            }
        }
    }

    /// Brings the support and the program up to date with the rows.
    fn assemble(&mut self, model: &Model) {
        let Self { support, rows, slots, columns, scalars, compliance, depths, .. } = self;
        slots.clear();
        for Contact { carriers, .. } in &*rows {
            let mut own = [0; CARRIERS];
            for (j, (slot, &node)) in own.iter_mut().zip(carriers.nodes()).enumerate() {
                if carriers.carries(j) {
                    *slot = support.add(node) as u32;
                }
            }
            slots.push(own);
        }
        support.gather(&model.compliance);
        let (count, order) = (rows.len(), support.order());
        let springs = Springs { contacts: rows, slots, kc: model.kc };
        columns.resize(count * order, 0.0);
        compliance.resize(count * count, 0.0);
        for i in 0..count {
            let column = &mut columns[i * order..(i + 1) * order];
            springs.respond(support, (i, 0..=i), (scalars, column), &mut compliance[i * count..][..=i]);
            (0..i).for_each(|j| compliance[j * count + i] = compliance[i * count + j]);
            compliance[i * count + i] += 1.0 / (model.kc * rows[i].share);
        }
        depths.clear();
        depths.extend(rows.iter().map(|row| row.depth));
    }

    /// Takes forces, displacement and energies from the program's solution.
    fn take_solution(&mut self, model: &Model) {
        let Self { support, forces, rows, elastic, energy, slots, displacement, columns, depths, program, .. } = self;
        let order = support.order();
        for vector in [&mut *forces, displacement] {
            vector.clear();
            vector.resize(order, 0.0);
        }
        *energy = 0.5 * dot(&program.solution, depths);
        *elastic = *energy;
        for (row, &force) in rows.iter_mut().zip(&program.solution) {
            row.multiplier = force;
            *elastic -= 0.5 * force * force / (model.kc * row.share);
        }
        let springs = Springs { contacts: rows, slots, kc: model.kc };
        for (i, &force) in program.solution.iter().enumerate().filter(|(_, force)| **force > 0.0) {
            springs.add_reaction(i, &rows[i].spread(-force), forces);
            let column = &columns[i * order..(i + 1) * order];
            displacement.iter_mut().zip(column).for_each(|(sum, entry)| *sum -= force * entry);
        }
    }

    /// Has `detection` take up the displaced surface, and returns a bound of how far that has moved (m).
    fn displace(&self, model: &Model, detection: &mut Detection) -> f64 {
        let bound = model.motion_bound(self.elastic);
        detection.displace(model, self.support.nodes(), &self.forces, bound);
        bound.moved
    }

    /// Adds a row for each proxy node without one that the displaced surface has reached, and returns whether there are
    /// any.
    fn add_rows(&mut self, model: &Model, detection: &mut Detection) -> bool {
        let moved = self.displace(model, detection);
        let Self { rows, .. } = self;
        let known = rows.len();
        for i in 0..model.chain.nodes.len() {
            if rows[..known].binary_search_by_key(&(i as u32), |row| row.proxy_node).is_ok() {
                continue;
            }
            if let Some(row) = detection.at_rest(model, i, moved)
                && row.depth + linear_change(model, &row, detection) > 0.0
            {
                rows.push(row);
            }
        }
        let added = rows.len() > known;
        rows.sort_unstable_by_key(|row| row.proxy_node);
        added
    }

    /// Force on the proxy node of row `i`: along the normal, and sideways by how the row changes (N).
    #[must_use]
    pub fn force(&self, i: usize) -> DVec3 {
        let Self { rows, slots, displacement, .. } = self;
        let (row, nodes) = (&rows[i], displacement.as_chunks::<3>().0);
        row.pushed(|j| DVec3::from_array(nodes[slots[i][j] as usize])) * row.multiplier
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

/// Returns by how much the displacement that `detection` has taken up deepens `row` (m).
fn linear_change(model: &Model, row: &Contact, detection: &mut Detection) -> f64 {
    let mut sum = DVec3::ZERO;
    for (node, weight) in row.carriers.iter() {
        sum += detection.displacement(model, node) * weight;
    }
    row.normal.dot(sum)
}
