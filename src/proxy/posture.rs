//! Postures from which an arm can press: where its last link goes most easily, and with which contact node first.
//!
//! The contact node of the last link that the joints move most goes fastest along n, the eigenvector of J J^T of the
//! largest eigenvalue (Yoshikawa 1985). An object on that side of the link, beyond the plane across n through the
//! link's foremost node, is met by that node first.

use super::{Chain, Pose};
use crate::JointVector;
use crate::random::Random;
use glam::{DMat3, DVec3};

/// Postures that are tried: the middle of the limits, then random ones in the middle half.
const POSTURES: usize = 64;

/// Steps of the power iteration for n: enough for eigenvalues that differ by a tenth.
const ITERATIONS: usize = 100;

/// Least speed along a wanted direction over that along n with which it counts as easy (1).
const EASY: f64 = 0.25;

/// A posture of an arm, and a direction in which it presses.
#[derive(Clone, Debug)]
pub struct Posture {
    /// Configuration (rad or m).
    pub q: JointVector,
    /// The contact node of the last link that is foremost along the direction.
    pub node: usize,
    /// Unit vector.
    pub direction: DVec3,
    /// All contact nodes (m).
    pub nodes: Vec<DVec3>,
}

impl Posture {
    /// Postures of `chain`, the middle of the limits first; none without contact nodes. Each comes with the direction
    /// `wanted`, where the link goes there easily, and with both directions along n.
    pub fn all(chain: &Chain, wanted: Option<DVec3>) -> impl Iterator<Item = Self> {
        let (mut random, mut pose) = (Random::new(1), chain.new_pose());
        let postures = if chain.nodes.is_empty() { 0 } else { POSTURES };
        (0..postures).flat_map(move |number| {
            let mut q = JointVector::zeros(chain.joints.len());
            for (entry, joint) in q.iter_mut().zip(&chain.joints) {
                let share = if number == 0 { 0.5 } else { random.between(0.25, 0.75) };
                *entry = joint.limits[0] + share * (joint.limits[1] - joint.limits[0]);
            }
            chain.pose(&q, &mut pose);
            let (easiest, square) = easiest(chain, &pose);
            let speed = |direction: DVec3| direction.dot(square * direction).sqrt();
            let is_easy = |direction: &DVec3| speed(*direction) >= EASY * speed(easiest);
            let directions = wanted.filter(is_easy).into_iter().chain([-easiest, easiest]);
            directions.map(|direction| Self::along(chain, &pose, q, direction)).collect::<Vec<_>>()
        })
    }

    fn along(chain: &Chain, pose: &Pose, q: JointVector, direction: DVec3) -> Self {
        let along = |node: &usize| pose.nodes[*node].dot(direction);
        let node = of_last_link(chain).max_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or(0);
        Self { q, node, direction, nodes: pose.nodes.clone() }
    }
}

/// Contact nodes of the last link that has some.
pub fn of_last_link(chain: &Chain) -> impl Iterator<Item = usize> {
    let last = chain.nodes.last().map_or(0, |node| node.link);
    (0..chain.nodes.len()).filter(move |&node| chain.nodes[node].link == last)
}

/// The tip of the arm: of the contact nodes of its last link, the one that is farthest from its joint. None where the arm
/// has no contact node.
#[must_use]
pub fn tip(chain: &Chain) -> Option<usize> {
    let far = |node: &usize| chain.nodes[*node].position.length();
    of_last_link(chain).max_by(|a, b| far(a).total_cmp(&far(b)))
}

/// The unit vector n, and J J^T of the node that moves most.
fn easiest(chain: &Chain, pose: &Pose) -> (DVec3, DMat3) {
    let columns = |node: usize| (0..chain.joints.len()).map(move |joint| chain.jacobian_column(pose, node, joint));
    let mobility = |node: &usize| columns(*node).map(|column| column.length_squared()).sum::<f64>();
    let moved = of_last_link(chain).max_by(|a, b| mobility(a).total_cmp(&mobility(b))).unwrap_or(0);
    let square = columns(moved).fold(DMat3::ZERO, |sum, column| sum + outer(column));
    let longest = columns(moved).max_by(|a, b| a.length().total_cmp(&b.length())).unwrap_or(DVec3::Z);
    (largest(square, longest.normalize_or(DVec3::Z)), square)
}

/// The eigenvector of the largest eigenvalue of `square`, sought from the unit vector `from`.
pub(super) fn largest(square: DMat3, from: DVec3) -> DVec3 {
    (0..ITERATIONS).fold(from, |direction, _| (square * direction).normalize_or(direction))
}

/// a a^T.
pub fn outer(a: DVec3) -> DMat3 {
    DMat3::from_cols(a * a.x, a * a.y, a * a.z)
}
