//! Inverse kinematics: the configuration that puts a contact node at a position.
//!
//! Damped Gauss-Newton steps `dq = J^T (J J^T + lambda^2 1)^-1 (x - x_i(q))` from the configuration before. A joint
//! that comes to a limit is held there, and the others go on. The damping (Nakamura and Hanafusa 1986) grows where a
//! step makes things worse. Nearby positions thus get nearby configurations, with redundant chains too.

use super::posture::outer;
use super::{Chain, Pose};
use crate::JointVector;
use glam::{DMat3, DVec3};

/// Distance at which a position counts as reached by inverse kinematics (m): a thousandth of an encoder step at 0.1 m.
const REACHED: f64 = 1e-7;

/// First damping of inverse kinematics (m): a tenth of a link's length, so that a first step stays in the linear range.
const REACH_DAMPING: f64 = 0.01;

/// Steps of inverse kinematics: converging ones take about ten, the rest allows for joint limits on the way.
const REACH_STEPS: usize = 200;

/// Configuration near `start` at which contact node `node` is at `target`, to `REACHED`; `None` where
/// the joints do not reach it.
#[must_use]
pub fn reach(chain: &Chain, node: usize, target: DVec3, start: &JointVector) -> Option<JointVector> {
    let (q, distance) = approach(chain, node, target, start);
    (distance < REACHED).then_some(q)
}

/// Configuration near `start` at which contact node `node` is as near to `target` as the joints let it, and how near
/// (m).
#[must_use]
pub fn approach(chain: &Chain, node: usize, target: DVec3, start: &JointVector) -> (JointVector, f64) {
    let mut q = *start;
    let mut pose = chain.new_pose();
    chain.pose(&q, &mut pose);
    let mut distance = target.distance(pose.nodes[node]);
    let mut damping = REACH_DAMPING;
    for _ in 0..REACH_STEPS {
        if distance < REACHED {
            break;
        }
        let next = step(chain, &pose, node, target, &q, damping);
        chain.pose(&next, &mut pose);
        let next_distance = target.distance(pose.nodes[node]);
        if next_distance < distance {
            (q, distance) = (next, next_distance);
            damping *= 0.3;
        } else {
            damping *= 4.0;
            chain.pose(&q, &mut pose);
        }
    }
    (q, distance)
}

fn step(chain: &Chain, pose: &Pose, node: usize, target: DVec3, q: &JointVector, damping: f64) -> JointVector {
    let columns: Vec<DVec3> = (0..q.len()).map(|joint| chain.jacobian_column(pose, node, joint)).collect();
    let mut free = vec![true; q.len()];
    let mut next = *q;
    // A joint that would pass its limit stops there, and the others do without it.
    loop {
        let (mut left, mut system) = (target - pose.nodes[node], DMat3::from_diagonal(DVec3::splat(damping * damping)));
        for (joint, column) in columns.iter().enumerate() {
            if free[joint] {
                system += outer(*column);
            } else {
                left -= (next[joint] - q[joint]) * *column;
            }
        }
        let pull = system.inverse() * left;
        let mut stopped = false;
        for joint in (0..q.len()).filter(|joint| free[*joint]).collect::<Vec<_>>() {
            let [least, greatest] = chain.joints[joint].limits;
            let wanted = q[joint] + columns[joint].dot(pull);
            next[joint] = wanted.clamp(least, greatest);
            if next[joint] != wanted {
                free[joint] = false;
                stopped = true;
            }
        }
        if !stopped {
            return next;
        }
    }
}
