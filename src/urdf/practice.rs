//! A soft ball within reach of an arm, a grid around it and a motion that presses it: what completes a scene.
//!
//! The arm starts in the middle of its limits. There, the contact node of its last link that the joints move most goes
//! fastest along n, the eigenvector of J J^T of the largest eigenvalue. The ball lies on that side of the link, tangent
//! to the plane across n through the link's foremost node but for a small gap. The joints move along J^T n, by which
//! the node moves along n, into the ball.

use crate::JointVector;
use crate::proxy::{Chain, Pose};
use crate::random::Random;
use crate::scene::JointKind;
use glam::{DMat3, DVec3};

/// Radius of the ball over the arm's reach, and its range (1, m).
const RADIUS_PER_REACH: f64 = 0.1;
const RADII: [f64; 2] = [0.01, 0.05];

/// Gap between link and ball at the start, and how deep the motion presses, over the ball's radius (1).
const GAP: f64 = 0.15;
const DEPTH: f64 = 0.35;

/// By how much the grid reaches beyond the motion at the link's end, over the ball's radius, and at most (1, rad).
const MARGIN: f64 = 0.2;
const MOST_MARGIN: f64 = 0.15;

/// Lines of the grid along each axis, for 1 to 6 joints: some thousand configurations at most.
const LINES: [usize; 6] = [33, 17, 13, 7, 5, 4];

/// Postures that are tried: the middle of the limits, then random ones in the middle half.
const POSTURES: usize = 64;

/// Steps of the power iteration for n: enough for eigenvalues that differ by a tenth.
const ITERATIONS: usize = 100;

/// Least margin (rad or m): ten times the digits that are written.
const LEAST_MARGIN: f64 = 1e-4;

/// Shortest lever for which gains are given, over the longest (1): a joint that hardly moves the node needs some
/// stiffness, too.
const SHORTEST_LEVER: f64 = 0.2;

/// Range of the levers (m): from a fingertip to the longest arm.
const LEVERS: [f64; 2] = [0.01, 10.0];

/// A ball, a grid and a motion.
pub(super) struct Practice {
    /// (m)
    pub centre: DVec3,
    /// (m)
    pub radius: f64,
    /// Least and greatest coordinate of the grid, and its lines, for each joint.
    pub axes: Vec<([f64; 2], usize)>,
    /// Where the motion begins and where it presses most.
    pub motion: [JointVector; 2],
    /// How far the node moves per joint coordinate, with which gains are scaled (m/rad, or 1).
    pub levers: JointVector,
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
            if best.as_ref().is_some_and(|best| best.clearance > 0.5 * GAP * best.radius) {
                break;
            }
        }
        let posture = best.unwrap_or_else(|| Posture::new(chain, &pose, JointVector::zeros(chain.joints.len()), 1.0));
        Self::around(chain, &posture)
    }

    fn around(chain: &Chain, posture: &Posture) -> Self {
        let Posture { q, node, direction, centre, radius, .. } = *posture;
        let mut pose = chain.new_pose();
        chain.pose(&q, &mut pose);
        let columns: Vec<DVec3> = (0..q.len()).map(|joint| chain.jacobian_column(&pose, node, joint)).collect();
        let square: f64 = columns.iter().map(|column| column.dot(direction).powi(2)).sum();
        // By how much each joint moves where the node moves by a metre along the direction.
        let way = columns.iter().map(|column| if square > 0.0 { column.dot(direction) / square } else { 0.0 });
        let (mut start, mut end) = (q, q);
        let mut axes = Vec::new();
        for (j, (way, joint)) in way.zip(&chain.joints).enumerate() {
            let [lower, upper] = joint.limits;
            start[j] = rounded(q[j] - way * GAP * radius).clamp(lower, upper);
            end[j] = rounded(q[j] + way * (GAP + DEPTH) * radius).clamp(lower, upper);
            let most = if joint.kind == JointKind::Revolute { MOST_MARGIN } else { radius };
            let margin = (MARGIN * radius / columns[j].length()).min(most).max(LEAST_MARGIN);
            let range = [start[j].min(end[j]) - margin, start[j].max(end[j]) + margin];
            axes.push((range.map(|end| rounded(end).clamp(lower, upper)), LINES[q.len().clamp(1, LINES.len()) - 1]));
        }
        let longest = columns.iter().map(|column| column.length()).fold(0.0, f64::max);
        let levers = columns.iter().zip(&chain.joints).map(|(column, joint)| match joint.kind {
            JointKind::Revolute => column.length().max(SHORTEST_LEVER * longest).clamp(LEVERS[0], LEVERS[1]),
            JointKind::Prismatic => 1.0,
        });
        let levers = JointVector::from_slice(&levers.collect::<Vec<_>>());
        Self { centre, radius, axes, motion: [start, end], levers }
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
        let centre = pose.nodes[node] + (1.0 + GAP) * radius * direction;
        let centre = (centre * 1e4).round() / 1e4;
        let clearance = pose.nodes.iter().map(|x| x.distance(centre) - radius).fold(f64::INFINITY, f64::min);
        Self { q, node, direction, centre, radius, clearance }
    }
}

/// Returns `coordinate` to a hundred thousandth of a radian or metre, as a scene shows it.
fn rounded(coordinate: f64) -> f64 {
    (coordinate * 1e5).round() / 1e5
}
