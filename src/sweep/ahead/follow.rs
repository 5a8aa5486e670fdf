//! The equilibrium at the proxy itself, solved beside the loop, and its tangent, which the loop follows until the next
//! one.

use super::Whereabouts;
use crate::{
    JointMatrix, JointVector,
    contact::{Equilibrium, Model, NodeForce, Solver, Status},
    field::LEAST_ENERGY,
};
use std::{
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::Duration,
};

/// How long the thread sleeps when the proxy has not moved on: a share of a tick.
const IDLE: Duration = Duration::from_micros(50);

/// An equilibrium with its tangent.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// Number of the solution; 0 before the first.
    pub number: u64,
    /// Tick for which it was solved.
    pub tick: u64,
    /// Configuration (rad or m).
    pub place: JointVector,
    /// Status.
    pub status: Status,
    /// Contact torque (N m or N).
    pub torque: JointVector,
    /// Stored energy U (J).
    pub energy: f64,
    /// Tangent d tau/d q; zeros where there is none (N m/rad).
    pub tangent: JointMatrix,
    /// Nodes of the object in contact.
    pub contact_nodes: u32,
    /// Forces on the proxy's nodes that are touched (N); none unless they are asked for.
    pub on_proxy: Vec<NodeForce>,
}

impl Solution {
    /// None yet.
    #[must_use]
    pub fn none(joints: usize) -> Self {
        let zeros = JointVector::zeros(joints);
        let tangent = JointMatrix::default();
        let status = Status::Outside;
        let (energy, on_proxy) = (0.0, Vec::new());
        Self { number: 0, tick: 0, place: zeros, status, torque: zeros, energy, tangent, contact_nodes: 0, on_proxy }
    }

    fn new(number: u64, at: &Whereabouts, equilibrium: &Equilibrium, with_forces: bool) -> Self {
        Self {
            number,
            tick: at.tick,
            place: at.position,
            status: equilibrium.status,
            torque: equilibrium.torque,
            energy: equilibrium.energy,
            tangent: equilibrium.tangent.unwrap_or_default(),
            contact_nodes: equilibrium.forces.len() as u32,
            on_proxy: if with_forces { equilibrium.on_proxy() } else { Vec::new() },
        }
    }

    /// Torque (N m or N) and energy (J) at `q`, to second order of the energy: `tau + K dq` and `U - tau . dq - dq . K
    /// dq / 2`, and nothing where the root `sqrt(2 U)`, to first order, is negative: there contact has ended.
    #[must_use]
    pub fn at(&self, q: &JointVector) -> (JointVector, f64) {
        let nothing = (JointVector::zeros(q.len()), 0.0);
        if self.status != Status::Contact {
            return nothing;
        }
        let mut torque = self.torque;
        let (mut first, mut second) = (0.0, 0.0);
        for a in 0..q.len() {
            let rise: f64 = (0..q.len()).map(|b| self.tangent[a][b] * (q[b] - self.place[b])).sum();
            first -= self.torque[a] * (q[a] - self.place[a]);
            second -= 0.5 * rise * (q[a] - self.place[a]);
            torque[a] += rise;
        }
        // w = sqrt(2 U) and its change -tau . dq / w.
        let root = (2.0 * self.energy.max(LEAST_ENERGY)).sqrt();
        if root + first / root <= 0.0 { nothing } else { (torque, (self.energy + first + second).max(0.0)) }
    }
}

/// Solves equilibria one after another along a way: each starts from the forces of the one before; where that does not
/// settle, from rest.
pub struct Follower<'a> {
    solver: Solver<'a>,
    before: Option<Equilibrium>,
    number: u64,
    with_forces: bool,
}

impl<'a> Follower<'a> {
    /// For equilibria of `model`, which has tangents ([`Model::with_tangent`]) where torques are to be followed.
    #[must_use]
    pub fn new(model: &'a Model<'a>) -> Self {
        Self { solver: Solver::new(model), before: None, number: 0, with_forces: false }
    }

    /// The same with forces on the proxy's nodes, if they are wanted.
    #[must_use]
    pub fn with_forces(self, with_forces: bool) -> Self {
        Self { with_forces, ..self }
    }

    /// The equilibrium of a proxy `at` its whereabouts.
    pub fn solve(&mut self, at: &Whereabouts) -> Solution {
        let warm = self.before.take().filter(|before| before.status == Status::Contact);
        let warm = warm.map(|before| self.solver.solve_from(&at.position, &before.forces));
        let settled = warm.filter(|found| !found.status.is_failed());
        let found = settled.unwrap_or_else(|| self.solver.solve(&at.position));
        self.number += 1;
        let solution = Solution::new(self.number, at, &found, self.with_forces);
        self.before = Some(found);
        solution
    }
}

/// Has `follower` solve the equilibrium at the proxy's place in `whereabouts`, again and again, until `over` is raised.
pub fn follow(
    mut follower: Follower<'_>,
    mut whereabouts: triple_buffer::Output<Whereabouts>,
    mut solutions: triple_buffer::Input<Solution>,
    over: &AtomicBool,
) {
    while !over.load(Ordering::Acquire) {
        if whereabouts.update() {
            solutions.write(follower.solve(whereabouts.peek_output_buffer()));
        } else {
            thread::sleep(IDLE);
        }
    }
}
