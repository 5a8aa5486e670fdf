//! A soft ball within reach of an arm, a grid around it and a motion that presses it: what completes a scene.
//!
//! The arm starts in the middle of its limits. There, the contact node of its last link that the joints move most goes
//! fastest along n, the eigenvector of J J^T of the largest eigenvalue. The ball lies on that side of the link, tangent
//! to the plane across n through the link's foremost node but for a small gap. The joints move along J^T n, by which
//! the node moves along n, into the ball.

use crate::JointVector;
use crate::proxy::{Chain, PRESS_GAP, Pose, Press};
use crate::random::Random;
use glam::{DMat3, DVec3};

/// Radius of the ball over the arm's reach, and its range (1, m).
const RADIUS_PER_REACH: f64 = 0.1;
const RADII: [f64; 2] = [0.01, 0.05];

/// Postures that are tried: the middle of the limits, then random ones in the middle half.
const POSTURES: usize = 64;

/// Steps of the power iteration for n: enough for eigenvalues that differ by a tenth.
const ITERATIONS: usize = 100;

/// A ball, a grid and a motion.
pub(super) struct Practice {
    /// (m)
    pub centre: DVec3,
    /// (m)
    pub radius: f64,
    /// Grid and motion.
    pub press: Press,
}

/// A posture with a ball before its last link.
struct Posture {
    q: JointVector,
    node: usize,
    direction: DVec3,
    centre: DVec3,
    radius: f64,
    /// Distance from the ball to the nearest contact node (m).
    clearance: f64,
}

impl Practice {
    /// Places a ball before the last link of `chain` that has contact nodes; limits finite, at least one node.
    pub fn new(chain: &Chain) -> Self {
        let mut random = Random::new(1);
        let mut pose = chain.new_pose();
        let mut best: Option<Posture> = None;
        for number in 0..POSTURES {
            let share = |random: &mut Random| if number == 0 { 0.5 } else { random.between(0.25, 0.75) };
            let mut q = JointVector::zeros(chain.joints.len());
            for (entry, joint) in q.iter_mut().zip(&chain.joints) {
                let [lower, upper] = joint.limits;
                *entry = lower + share(&mut random) * (upper - lower);
            }
            chain.pose(&q, &mut pose);
            for side in [-1.0, 1.0] {
                let posture = Posture::new(chain, &pose, q, side);
                if best.as_ref().is_none_or(|best| posture.clearance > best.clearance) {
                    best = Some(posture);
                }
            }
            if best.as_ref().is_some_and(|best| best.clearance > 0.5 * PRESS_GAP * best.radius) {
                break;
            }
        }
        let posture = best.unwrap_or_else(|| Posture::new(chain, &pose, JointVector::zeros(chain.joints.len()), 1.0));
        let Posture { q, node, direction, centre, radius, .. } = posture;
        Self { centre, radius, press: Press::along(chain, q, node, direction, radius) }
    }
}

impl Posture {
    /// Places a ball before the last link at `pose`, on one of the two sides.
    fn new(chain: &Chain, pose: &Pose, q: JointVector, side: f64) -> Self {
        let last = chain.nodes.last().map_or(0, |node| node.link);
        let of_last = || (0..chain.nodes.len()).filter(|&node| chain.nodes[node].link == last);
        let columns = |node: usize| (0..q.len()).map(move |joint| chain.jacobian_column(pose, node, joint));
        let mobility = |node: usize| columns(node).map(|column| column.length_squared()).sum::<f64>();
        let moved = of_last().max_by(|&a, &b| mobility(a).total_cmp(&mobility(b))).unwrap_or(0);
        let square = columns(moved).fold(DMat3::ZERO, |sum, c| sum + DMat3::from_cols(c * c.x, c * c.y, c * c.z));
        let longest = columns(moved).max_by(|a, b| a.length().total_cmp(&b.length())).unwrap_or(DVec3::Z);
        let mut direction = longest.normalize_or(DVec3::Z);
        for _ in 0..ITERATIONS {
            direction = (square * direction).normalize_or(direction);
        }
        direction *= side;
        let along = |node: usize| pose.nodes[node].dot(direction);
        let node = of_last().max_by(|&a, &b| along(a).total_cmp(&along(b))).unwrap_or(0);
        let base = pose.origins.first().copied().unwrap_or(DVec3::ZERO);
        let radius = (RADIUS_PER_REACH * pose.nodes[node].distance(base)).clamp(RADII[0], RADII[1]);
        let radius = (radius * 1e3).round() / 1e3;
        let centre = pose.nodes[node] + (1.0 + PRESS_GAP) * radius * direction;
        let centre = (centre * 1e4).round() / 1e4;
        let clearance = pose.nodes.iter().map(|x| x.distance(centre) - radius).fold(f64::INFINITY, f64::min);
        Self { q, node, direction, centre, radius, clearance }
    }
}
