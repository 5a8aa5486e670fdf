//! The paper's iteration for equation (2), section 2.1, step by step:
//!
//! 1. Cvp: the proxy nodes inside the deformed surface; for each, its three closest object nodes, S_i.
//! 2. Solve (2) for n. With forces on the tied nodes A only, u = C f, this is the small system
//!    `(C_AA + D^-1) f_A = (xbar - n0)_A`: D = Kc times the number of proxy nodes tied to a node, xbar their mean.
//! 3. f_j^i = -Kc (n_j - x_i); tensional ones (not pushing into the object) are dropped, the others projected on the
//!    surface normal, which here is the outward area-weighted vertex normal of the surface as deformed by step 2.
//! 4. Solve K (n - n0) = sum f_j^i. Repeat from 1 until n, f, S stop changing.
//!
//! Then tau = sum_i J_i^T (-sum_j f_j^i).
//!
//! The iteration is faithful, and so is its failure: at stiff contact step 4 pushes the surface past the proxy node,
//! and the next pass finds nothing inside. A configuration that started in contact and lost it is not converged, never
//! free. One that cycles would run into the cap: a pass depends on nothing but the pass before, so it is given up as
//! soon as a pass repeats an earlier one to the last bit (Brent 1980: compared with the pass of the last power of two).
//! A node with a radius, which the paper does not have, acts through its deepest point x_i - r_i N_i.

use crate::contact::RESIDUAL_FLOOR;
use crate::contact::detection::Detection;
use crate::contact::equilibrium::energy::SolverStats;
use crate::contact::geometry::LENGTH_ROUNDING;
use crate::contact::geometry::normals;
use crate::contact::law::depth::Contact;
use crate::contact::linear::cholesky;
use crate::contact::linear::support::{Support, dot, root};
use crate::contact::{Model, MotionBound};
use glam::DVec3;

/// A proxy node tied to its three closest object nodes.
#[derive(Clone, Copy, Debug)]
pub struct Tie {
    /// Number of the proxy node.
    pub proxy_node: u32,
    /// Its position x_i, or its deepest point if it has a radius, relative to the model's centre (m).
    pub target: DVec3,
    /// Object nodes, ascending.
    pub nodes: [u32; 3],
    /// Their slots on the support.
    pub slots: [usize; 3],
    /// f_j^i after step 3, zero where dropped (N).
    pub forces: [DVec3; 3],
}

/// Workspace of the paper's iteration.
pub struct PaperIteration {
    /// Ties of the last pass: S, and the forces f_j^i.
    pub ties: Vec<Tie>,
    previous_ties: Vec<Tie>,
    /// Tied object nodes A.
    pub support: Support,
    /// Forces on A after step 4 (N).
    pub forces: Vec<f64>,
    previous_forces: Vec<f64>,
    /// The pass that later ones are compared with: a repetition is a cycle.
    marked_ties: Vec<Tie>,
    marked_forces: Vec<f64>,
    /// Displacement of all surface nodes after step 4 (m).
    pub displacement: Vec<f64>,
    positions: Vec<DVec3>,
    contacts: Vec<Contact>,
    /// Step 2: number of ties of each node of A, matrix (m/N), right-hand side (m), which becomes the forces (N).
    tie_counts: Vec<f64>,
    matrix: Vec<f64>,
    tied_forces: Vec<f64>,
    /// Outward normals of A.
    normals: Vec<DVec3>,
    change: Vec<f64>,
    image: Vec<f64>,
}

impl PaperIteration {
    /// Room for the object of `model`.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self {
            ties: Vec::new(),
            previous_ties: Vec::new(),
            support: Support::new(model.surface.positions.len()),
            forces: Vec::new(),
            previous_forces: Vec::new(),
            marked_ties: Vec::new(),
            marked_forces: Vec::new(),
            displacement: vec![0.0; 3 * model.surface.positions.len()],
            positions: model.surface.positions.clone(),
            contacts: Vec::new(),
            tie_counts: Vec::new(),
            matrix: Vec::new(),
            tied_forces: Vec::new(),
            normals: Vec::new(),
            change: Vec::new(),
            image: Vec::new(),
        }
    }

    /// Iterates from the rest state, for the configuration that `detection` has taken up.
    pub fn iterate(&mut self, model: &Model, detection: &mut Detection) -> SolverStats {
        let mut outcome = SolverStats { converged: false, iterations: 0, residual: f64::MAX };
        self.displacement.fill(0.0);
        self.ties.clear();
        self.forces.clear();
        while !outcome.converged && outcome.iterations < model.contact.max_iterations {
            outcome.iterations += 1;
            std::mem::swap(&mut self.forces, &mut self.previous_forces);
            std::mem::swap(&mut self.ties, &mut self.previous_ties);
            self.tie(model, detection);
            self.solve_tied(model);
            self.project(model);
            self.apply(model);
            outcome.residual = self.relative_change();
            if !outcome.residual.is_finite() || self.forces.iter().all(|&f| f == 0.0) {
                // Contact was lost: nothing inside, or no force left that compresses.
                outcome.residual = 1.0;
                return outcome;
            }
            outcome.converged = outcome.residual <= model.contact.tolerance;
            if !outcome.converged && self.repeats(outcome.iterations) {
                break;
            }
        }
        outcome
    }

    /// Step 1: proxy nodes inside, each tied to the three closest object nodes.
    fn tie(&mut self, model: &Model, detection: &mut Detection) {
        self.place(model);
        let moved = self.displacement.as_chunks().0.iter().map(|u| DVec3::from_array(*u).length()).fold(0.0, f64::max);
        let bound = MotionBound { moved: moved * (1.0 + LENGTH_ROUNDING), bulge: 0.0 };
        detection.displace(model, self.support.nodes(), &self.previous_forces, bound);
        detection.deformed(model, &mut self.contacts);
        self.support.clear();
        self.ties.clear();
        for contact in self.contacts.iter().filter(|contact| contact.depth > 0.0) {
            let radius = model.chain.nodes[contact.proxy_node as usize].radius;
            let x = detection.nodes()[contact.proxy_node as usize];
            let target = x - contact.normal * radius;
            let mut nodes = three_closest(target, &self.positions);
            nodes.sort_unstable();
            let slots = nodes.map(|node| self.support.add(node));
            let forces = [DVec3::ZERO; 3];
            self.ties.push(Tie { proxy_node: contact.proxy_node, target, nodes, slots, forces });
        }
        self.support.gather(&model.compliance);
    }

    /// Step 2: n from equation (2), all ties being springs Kc.
    fn solve_tied(&mut self, model: &Model) {
        let Self { ties, support, tie_counts, matrix, tied_forces, .. } = self;
        tie_counts.clear();
        tie_counts.resize(support.nodes().len(), 0.0);
        tied_forces.clear();
        tied_forces.resize(support.order(), 0.0);
        let targets = tied_forces.as_chunks_mut::<3>().0;
        for tie in ties.iter() {
            for slot in tie.slots {
                tie_counts[slot] += 1.0;
                targets[slot] = (DVec3::from_array(targets[slot]) + tie.target).to_array();
            }
        }
        for ((target, count), &node) in targets.iter_mut().zip(tie_counts.iter()).zip(support.nodes()) {
            *target = (DVec3::from_array(*target) / *count - model.surface.positions[node as usize]).to_array();
        }
        let (compliance, rows_per_node) = support.compliance();
        matrix.clear();
        matrix.extend_from_slice(compliance);
        let order = rows_per_node * tie_counts.len();
        for row in 0..order {
            matrix[row * order + row] += 1.0 / (model.contact.stiffness * tie_counts[row / rows_per_node]);
        }
        cholesky::factorize(matrix, order);
        if rows_per_node == 1 {
            cholesky::solve(matrix, targets);
        } else {
            cholesky::solve(matrix, tied_forces.as_chunks_mut::<1>().0);
        }
        self.support.displace(&model.compliance, &self.tied_forces, &mut self.displacement);
        self.place(model);
    }

    /// Step 3: compressive tie forces, projected on the surface normal.
    fn project(&mut self, model: &Model) {
        let Self { ties, support, positions, normals, .. } = self;
        let (triangles, topology) = (&model.object.triangles, &model.object.topology);
        normals.clear();
        let normal = |&node: &u32| normals::vertex_normal(positions, triangles, topology, node);
        normals.extend(support.nodes().iter().map(normal));
        for tie in ties {
            for ((force, &node), slot) in tie.forces.iter_mut().zip(&tie.nodes).zip(tie.slots) {
                let pull = (tie.target - positions[node as usize]) * model.contact.stiffness;
                *force = normals[slot] * pull.dot(normals[slot]).min(0.0);
            }
        }
    }

    /// Step 4: n under the projected forces.
    fn apply(&mut self, model: &Model) {
        self.forces.clear();
        self.forces.resize(self.support.order(), 0.0);
        for tie in &self.ties {
            for (force, slot) in tie.forces.into_iter().zip(tie.slots) {
                for (a, component) in force.to_array().into_iter().enumerate() {
                    self.forces[3 * slot + a] += component;
                }
            }
        }
        self.support.displace(&model.compliance, &self.forces, &mut self.displacement);
    }

    /// Relative change of the forces (and so of n = n0 + C f) since the last pass, in the energy norm; one when S
    /// changed (1).
    fn relative_change(&mut self) -> f64 {
        if !same_selection(&self.ties, &self.previous_ties) {
            return 1.0;
        }
        let order = self.support.order();
        self.change.clear();
        self.change.extend(self.forces.iter().zip(&self.previous_forces).map(|(f, previous)| f - previous));
        self.image.resize(order, 0.0);
        self.support.multiply(&self.change, &mut self.image);
        let change = dot(&self.change, &self.image);
        self.support.multiply(&self.forces, &mut self.image);
        let scale = dot(&self.forces, &self.image);
        root(change) / root(scale).max(RESIDUAL_FLOOR)
    }

    /// True when this pass repeats the marked one; marks it instead if its number is a power of two.
    fn repeats(&mut self, pass: u32) -> bool {
        if pass > 1 && same_selection(&self.ties, &self.marked_ties) && self.forces == self.marked_forces {
            return true;
        }
        if pass.is_power_of_two() {
            self.marked_ties.clone_from(&self.ties);
            self.marked_forces.clone_from(&self.forces);
        }
        false
    }

    /// Positions from displacement.
    fn place(&mut self, model: &Model) {
        let displacement = self.displacement.as_chunks().0;
        for ((position, rest), u) in self.positions.iter_mut().zip(&model.surface.positions).zip(displacement) {
            *position = *rest + DVec3::from_array(*u);
        }
    }
}

/// Whether two passes tie the same nodes, i.e. have the same S.
fn same_selection(a: &[Tie], b: &[Tie]) -> bool {
    let same = |(a, b): (&Tie, &Tie)| a.proxy_node == b.proxy_node && a.nodes == b.nodes;
    a.len() == b.len() && a.iter().zip(b).all(same)
}

/// The three nodes closest to `x`, nearest first; ties go to the lower number.
#[must_use]
pub fn three_closest(x: DVec3, positions: &[DVec3]) -> [u32; 3] {
    let mut nodes = [0; 3];
    let mut squares = [f64::MAX; 3];
    let (fours, rest) = positions.as_chunks::<4>();
    let mut consider = |mut entry: (f64, u32)| {
        if entry.0 < squares[2] {
            for (square, node) in squares.iter_mut().zip(&mut nodes) {
                if entry.0 < *square {
                    std::mem::swap(square, &mut entry.0);
                    std::mem::swap(node, &mut entry.1);
                }
            }
        }
        squares[2]
    };
    let mut third = f64::MAX;
    for (k, four) in fours.iter().enumerate() {
        let four = four.map(|position| position.distance_squared(x));
        // Most are not among the three.
        if four.iter().any(|&square| square < third) {
            for (lane, square) in four.into_iter().enumerate() {
                third = consider((square, (4 * k + lane) as u32));
            }
        }
    }
    for (lane, position) in rest.iter().enumerate() {
        consider((position.distance_squared(x), (4 * fours.len() + lane) as u32));
    }
    nodes
}
