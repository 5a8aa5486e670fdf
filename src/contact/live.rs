//! The law at rest along a way, solved again and again by a thread that has no time to lose: within limits, from the
//! rows that pushed before, and without allocating.

use super::detection::Detection;
use super::equilibrium::rest::{Guess, RestLimits, RestProgram};
use super::model::Model;
use super::{NodeForce, Slip, Status, reach};
use crate::JointVector;
use crate::proxy::Pose;
use glam::DVec3;

/// Largest contact that is solved. The scenes that ship have up to 40 rows on 200 nodes. A round with 512 rows takes some
/// milliseconds: a loop of 1 kHz slows down in so wide a contact, and is not stopped by its watchdog, which lets ticks
/// take ten. Along a way a program takes one round or two, or as many more as rows come and go at once.
const LIMITS: RestLimits = RestLimits { rows: 512, nodes: 1024, rounds: 8 };

/// Solves contact with the surface at rest along a way.
pub struct LiveSolver<'a> {
    model: &'a Model<'a>,
    pose: Pose,
    detection: Detection,
    rest: RestProgram,
    /// Forces on the proxy's nodes that are touched (N).
    on_proxy: Vec<NodeForce>,
}

/// Contact of one configuration on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LiveContact {
    /// How it ended: [`Status::Overflow`] where contact is larger than what is solved, or beyond the nodes whose
    /// compliance is known.
    pub status: Status,
    /// Smallest signed distance of the proxy's nodes to the surface at rest, less their radius; negative inside (m).
    pub gap: f64,
    /// Stored energy U (J).
    pub energy: f64,
    /// Contact torque tau = -dU/dq (N m or N).
    pub torque: JointVector,
    /// Nodes of the object that carry force.
    pub contact_nodes: u32,
}

impl<'a> LiveSolver<'a> {
    /// Room for all that is solved on the way. The law is that at rest, whatever algorithm `model` names.
    #[must_use]
    pub fn new(model: &'a Model<'a>) -> Self {
        let rest = RestProgram::within(model, LIMITS);
        let on_proxy = Vec::with_capacity(LIMITS.rows.min(model.chain.nodes.len()));
        Self { model, pose: model.chain.new_pose(), detection: Detection::along_a_way(model), rest, on_proxy }
    }

    /// Contact at the joint coordinates `q`, one per joint (rad or m); [`Status::Unconverged`] without torque where one
    /// is not finite. Where a way begins is of no matter but for rounding. Never allocates.
    pub fn solve(&mut self, q: &[f64]) -> LiveContact {
        let Self { model, pose, detection, rest, on_proxy } = self;
        let joints = model.chain.joints.len();
        let (energy, torque) = (0.0, JointVector::zeros(joints));
        let mut found = LiveContact { status: Status::Unconverged, gap: 0.0, energy, torque, contact_nodes: 0 };
        on_proxy.clear();
        if q.len() != joints || !q.iter().all(|x| x.is_finite()) {
            return found;
        }
        model.chain.pose(q, pose);
        found.gap = detection.set_configuration(model, &pose.nodes);
        if !found.gap.is_finite() {
            return found;
        }
        if found.gap >= rest.farthest() {
            found.status = Status::Free;
            return found;
        }
        let fits = match rest.solve(model, detection, Guess::Last) {
            Some(outcome) => outcome.converged,
            None => {
                found.status = Status::Overflow;
                return found;
            }
        };
        found.energy = rest.energy;
        for (i, row) in rest.rows.iter().enumerate().filter(|(_, row)| row.multiplier > 0.0) {
            let force = rest.force(i);
            model.chain.add_torque(pose, row.proxy_node as usize, force, &mut found.torque);
            on_proxy.push(NodeForce { node: row.proxy_node, force });
        }
        found.contact_nodes = rest.loaded().count() as u32;
        if fits && found.energy.is_finite() && found.torque.is_finite() {
            let moved = model.motion_bound(rest.elastic).moved;
            let touching = on_proxy.iter().map(|force| force.node as usize);
            let is_covered = reach::covers(model, detection, rest.loaded(), touching, moved);
            found.status = match is_covered {
                // Of a dent that is deeper than the proxy.
                true if found.contact_nodes == 0 && rest.farthest() > 0.0 => Status::Free,
                true => Status::Contact,
                false => Status::Overflow,
            };
        }
        found
    }

    /// Lets the surface stand displaced where nothing touches it, by `standing` at each of its nodes (m).
    pub fn stand(&mut self, standing: &[DVec3]) {
        self.rest.standing.clear();
        self.rest.standing.extend_from_slice(standing);
    }

    /// Forces of contact on the object's nodes at the configuration that was solved last (N).
    pub fn on_object(&self) -> impl Iterator<Item = NodeForce> {
        let forces = self.rest.support.nodes().iter().zip(self.rest.forces.as_chunks::<3>().0);
        forces.map(|(&node, force)| NodeForce { node, force: DVec3::from_array(*force) })
    }

    /// Returns the slip of the contacts at `q`, the configuration that was solved last. Never allocates.
    #[must_use]
    pub fn slip(&self, q: &[f64]) -> Slip {
        Slip::of(self.model.chain, q, self.on_proxy.iter().map(|on| (on.node, on.force)))
    }

    /// Forces on the proxy's nodes at the configuration that was solved last (N).
    #[must_use]
    pub fn on_proxy(&self) -> &[NodeForce] {
        &self.on_proxy
    }
}
