//! Friction between the node that scans and a real object, identified from recorded strokes to both sides.
//!
//! Along the same way to and fro the torques of the object are the same and those of friction opposite, as long as the
//! node slides. With n the way in C-space, half their difference along n is `mu N |B n|`, N and B of the contact
//! ([`Slip`]), and half their sum is the torque without friction, which one node's force explains: that is N and the
//! normal. So it is at each grid point, which stores N and B as those of a solved object do.

use super::ScanLog;
use crate::{
    JointVector,
    contact::{Slip, Status},
    dataset::{Dataset, IdentifiedFriction, SlipColumns},
    gridize::ForceHistory,
    joint_matrix::{entries, lower},
    proxy::{Chain, outer},
    scene::{PlanSpec, ScanSpec},
};
use glam::{DMat3, DVec3};

/// Part of a stroke to either side over which torques are compared (1): from the turn to there a node slides that moved
/// back under friction, unless the stroke is shorter than twice what the object gives way sideways.
const COMPARED: f64 = 0.5;

/// Least determinant of J J^T over that of a sphere of the same trace (1): below it the joints do not tell the force's
/// direction to a thousandth of what they tell of its size.
const LEAST_DETERMINANT: f64 = 1e-6;

/// One way over the middle of a stroke.
struct Pass {
    forward: bool,
    /// Means over the way (rad or m, N m or N).
    q: JointVector,
    torque: JointVector,
    /// From its begin to its end (rad or m).
    way: JointVector,
}

/// Identifies the coefficient of friction from the strokes in `log`, of a scan by `spec` with `chain`; absent where it
/// holds none, or the joints do not tell the direction of the node's force.
#[must_use]
pub fn identify_friction(log: &ScanLog, spec: &ScanSpec, chain: &Chain) -> Option<IdentifiedFriction> {
    let (PlanSpec::Workspace(plan), Some(history)) = (&spec.plan, &spec.history) else { return None };
    let node = spec.plan.node(chain.nodes.len());
    let (mut count, mut mean, mut squares) = (0.0, 0.0, 0.0);
    for press in log.histories() {
        for axis in &plan.across {
            let passes = passes(&press, chain, node, axis.direction, COMPARED * history.stroke);
            let [first, second] = &passes[..] else { continue };
            if first.forward == second.forward {
                continue;
            }
            let [forward, backward] = if first.forward { [first, second] } else { [second, first] };
            let (mut q, mut centre, mut half) = (forward.q, forward.torque, backward.torque);
            for joint in 0..q.len() {
                q[joint] = 0.5 * (forward.q[joint] + backward.q[joint]);
                centre[joint] = 0.5 * (forward.torque[joint] + backward.torque[joint]);
                half[joint] = 0.5 * (backward.torque[joint] - forward.torque[joint]);
            }
            let Some(slip) = slip(chain, node, &q, &centre) else { continue };
            let coefficient = half.dot(&forward.way) / slip.dissipation(&forward.way);
            if coefficient.is_finite() {
                count += 1.0;
                let before = coefficient - mean;
                mean += before / count;
                squares += before * (coefficient - mean);
            }
        }
    }
    let deviation = if count > 1.0 { (squares / (count - 1.0)).sqrt() } else { 0.0 };
    (mean > 0.0).then_some(IdentifiedFriction {
        coefficient: mean,
        strokes: count as usize,
        deviation,
        stiffness: None,
        predicted: Vec::new(),
    })
}

/// Gives `dataset` how the node `node` of `chain` slips, which alone touches.
pub fn add_slip(dataset: &mut Dataset, chain: &Chain, node: usize) {
    let (joints, points) = (dataset.grid.joints(), dataset.grid.points());
    let (mut forces, mut jacobians) = (vec![0.0; points], vec![0.0; points * entries(joints)]);
    for point in (0..points).filter(|&point| dataset.status(point) == Status::Contact) {
        let torque = JointVector::from_slice(dataset.torque(point));
        if let Some(slip) = slip(chain, node, &dataset.grid.configuration(point), &torque) {
            forces[point] = slip.normal_force as f32;
            let row = &mut jacobians[point * entries(joints)..];
            row.iter_mut().zip(lower(&slip.jacobian, joints)).for_each(|(entry, value)| *entry = value as f32);
        }
    }
    dataset.slip = Some(SlipColumns { normal_force: forces.into(), jacobian: jacobians.into() });
}

/// The slip of a node whose force makes `torque` most nearly; absent where the joints do not tell that force.
fn slip(chain: &Chain, node: usize, q: &[f64], torque: &JointVector) -> Option<Slip> {
    let links = chain.links(q);
    let columns = chain.node_jacobian(&links, node, chain.node_position(&links, node));
    let (mut square, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for (column, torque) in columns.iter().zip(torque.iter()) {
        square += outer(*column);
        right += *column * *torque;
    }
    let size = (square.x_axis.x + square.y_axis.y + square.z_axis.z) / 3.0;
    if square.determinant() < LEAST_DETERMINANT * size.powi(3) {
        return None;
    }
    Some(Slip::of(chain, q, [(node as u32, square.inverse() * right)]))
}

/// The ways from one side to the other along `axis` over the middle, to `reach` on both sides (m) of where the press was
/// held.
fn passes(press: &ForceHistory, chain: &Chain, node: usize, axis: DVec3, reach: f64) -> Vec<Pass> {
    let joints = chain.joints.len();
    let rows: Vec<[JointVector; 2]> = (0..press.times.len()).map(|row| press.row(row, joints)).collect();
    let Some(held) = press.counts.iter().rposition(|held| *held) else { return Vec::new() };
    let position = |row: usize| {
        let links = chain.links(&rows[row][0]);
        chain.node_position(&links, node)
    };
    let middle = position(held);
    let along: Vec<f64> = (held..rows.len()).map(|row| (position(row) - middle).dot(axis)).collect();
    let mut found = Vec::new();
    let mut begin = None;
    for k in 1..along.len() {
        let is_within = |k: usize| along[k].abs() < reach;
        if is_within(k) && !is_within(k - 1) {
            begin = Some(k);
        } else if !is_within(k) && is_within(k - 1) {
            let from_outside = begin.take().filter(|&begin| along[begin - 1] * along[k] < 0.0);
            found.extend(from_outside.map(|begin| mean(&rows[held + begin..held + k], along[k] > 0.0)));
        }
    }
    found
}

/// The means of `rows`.
fn mean(rows: &[[JointVector; 2]], forward: bool) -> Pass {
    let zero = JointVector::zeros(rows[0][0].len());
    let mut pass = Pass { forward, q: zero, torque: zero, way: rows[rows.len() - 1][0] };
    for joint in 0..zero.len() {
        pass.way[joint] -= rows[0][0][joint];
        for [q, torque] in rows {
            pass.q[joint] += q[joint] / rows.len() as f64;
            pass.torque[joint] += torque[joint] / rows.len() as f64;
        }
    }
    pass
}
