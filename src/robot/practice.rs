//! A soft ball within reach of an arm, a grid around it and a motion that presses it: what completes a scene.
//!
//! The ball lies before the arm's last link, tangent to the plane across the direction in which the link presses but
//! for a small gap.

use crate::proxy::{Chain, PRESS_GAP, Posture, Press};
use glam::DVec3;

/// Radius of the ball over the arm's reach, and its range (1, m).
const RADIUS_PER_REACH: f64 = 0.1;
const RADII: [f64; 2] = [0.01, 0.05];

/// A ball, a grid and a motion.
pub(super) struct Practice {
    /// (m)
    pub centre: DVec3,
    /// (m)
    pub radius: f64,
    /// Grid and motion.
    pub press: Press,
}

impl Practice {
    /// Places a ball before the last link of `chain` that has contact nodes; limits finite, at least one node.
    pub fn new(chain: &Chain) -> Option<Self> {
        let mut pose = chain.new_pose();
        let mut best: Option<(Posture, Ball)> = None;
        for posture in Posture::all(chain, None) {
            // Of the two sides of a posture the clearer one is taken.
            let is_clear = |ball: &Ball| ball.clearance > 0.5 * PRESS_GAP * ball.radius;
            if best.as_ref().is_some_and(|(other, ball)| is_clear(ball) && other.q != posture.q) {
                break;
            }
            chain.pose(&posture.q, &mut pose);
            let ball = Ball::before(&posture, pose.origins.first().copied().unwrap_or(DVec3::ZERO));
            if best.as_ref().is_none_or(|(_, best)| ball.clearance > best.clearance) {
                best = Some((posture, ball));
            }
        }
        best.map(|(Posture { q, node, direction, .. }, Ball { centre, radius, .. })| Self {
            centre,
            radius,
            press: Press::along(chain, q, node, direction, radius),
        })
    }
}

/// A ball before a posture.
struct Ball {
    centre: DVec3,
    radius: f64,
    /// Distance to the nearest contact node (m).
    clearance: f64,
}

impl Ball {
    /// The ball before `posture` of an arm whose first joint is at `base`.
    fn before(posture: &Posture, base: DVec3) -> Self {
        let tip = posture.nodes[posture.node];
        let radius = (RADIUS_PER_REACH * tip.distance(base)).clamp(RADII[0], RADII[1]);
        let radius = (radius * 1e3).round() / 1e3;
        let centre = tip + (1.0 + PRESS_GAP) * radius * posture.direction;
        let centre = (centre * 1e4).round() / 1e4;
        let clearance = posture.nodes.iter().map(|x| x.distance(centre) - radius).fold(f64::INFINITY, f64::min);
        Self { centre, radius, clearance }
    }
}
