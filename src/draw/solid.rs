//! Solid bodies as a list of rounded cones: balls, rods, arrows, an arm. The rasteriser draws it into figures, the GPU in
//! the window.

use super::colour::Colour;
use crate::proxy::{Chain, Pose};
use glam::DVec3;

/// A rounded cone between two ends: a rod where its radii are equal, a ball where its ends are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Its ends (m).
    pub ends: [DVec3; 2],
    /// Its radius at each (m).
    pub radii: [f64; 2],
    /// Its colour.
    pub colour: Colour,
}

/// Radii of the balls at joints and at contact nodes, over that of the rods (1).
const JOINT: f64 = 2.0;
const NODE: f64 = 1.25;

/// Length of an arrow's head over the radius of its shaft (1), its greatest share of the whole (1), and its radius over
/// its length (1).
const HEAD: f64 = 5.0;
const HEAD_SHARE: f64 = 0.4;
const HEAD_RADIUS: f64 = 0.5;

impl Cone {
    /// A ball.
    #[must_use]
    pub fn ball(centre: DVec3, radius: f64, colour: Colour) -> Self {
        Self::rod([centre; 2], radius, colour)
    }

    /// A rod with round ends.
    #[must_use]
    pub fn rod(ends: [DVec3; 2], radius: f64, colour: Colour) -> Self {
        Self { ends, radii: [radius; 2], colour }
    }

    /// An arrow from `tail` along `span`, with a shaft of `radius`. A short one has a thinner shaft, so that its head is
    /// never wider than long; one without length has no parts.
    #[must_use]
    pub fn arrow(tail: DVec3, span: DVec3, radius: f64, colour: Colour) -> Vec<Self> {
        let length = span.length();
        if !(length > 0.0 && length.is_finite()) {
            return Vec::new();
        }
        let head = (HEAD * radius).min(HEAD_SHARE * length);
        let (neck, shaft) = (tail + span * (1.0 - head / length), radius.min(head / HEAD));
        // Its round end touches the tail.
        let begin = tail + span * (shaft / length);
        vec![
            Self::rod([begin, neck], shaft, colour),
            Self { ends: [neck, tail + span], radii: [HEAD_RADIUS * head, 0.0], colour },
        ]
    }
}

/// Links of an arm from joint to joint, the last one to its farthest contact node, with a ball at each joint; those that
/// `is_shown`.
#[must_use]
pub fn links(
    chain: &Chain,
    pose: &Pose,
    is_shown: impl Fn(usize) -> bool,
    thickness: f64,
    colour: Colour,
) -> Vec<Cone> {
    let mut cones = Vec::new();
    for (link, &from) in pose.origins.iter().enumerate().filter(|(link, _)| is_shown(*link)) {
        let own = || chain.nodes.iter().zip(&pose.nodes).filter(|(node, _)| node.link == link).map(|(_, &x)| x);
        let farthest = || own().max_by(|a, b| a.distance(from).total_cmp(&b.distance(from)));
        let to = pose.origins.get(link + 1).copied().or_else(farthest).unwrap_or(from);
        cones.extend([Cone::rod([from, to], thickness, colour), Cone::ball(from, JOINT * thickness, colour)]);
    }
    cones
}

/// Contact nodes of an arm on those links that `is_shown`; points get a radius by `thickness`, that of
/// the links.
#[must_use]
pub fn nodes(
    chain: &Chain,
    pose: &Pose,
    is_shown: impl Fn(usize) -> bool,
    thickness: f64,
    colour: Colour,
) -> Vec<Cone> {
    let shown = chain.nodes.iter().zip(&pose.nodes).filter(|(node, _)| is_shown(node.link));
    shown.map(|(node, &place)| Cone::ball(place, node.radius.max(NODE * thickness), colour)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{draw::colour::INK, proxy::Node};

    #[test]
    fn an_arrow_ends_where_its_span_ends_and_vanishes_with_it() {
        for length in [1.0, 0.01] {
            let arrow = Cone::arrow(DVec3::ONE, length * DVec3::X, 0.01, INK);
            assert_eq!((arrow[1].ends[1], arrow[1].radii[1]), (DVec3::ONE + length * DVec3::X, 0.0));
            assert!(arrow[0].radii[0] < arrow[1].radii[0] && arrow[1].radii[0] < 0.3 * length, "{arrow:?}");
        }
        assert!(Cone::arrow(DVec3::ONE, DVec3::ZERO, 0.01, INK).is_empty());
        assert!(Cone::arrow(DVec3::ONE, DVec3::NAN, 0.01, INK).is_empty());
    }

    #[test]
    fn an_arm_has_a_rod_and_a_ball_a_link_and_a_ball_a_node() {
        let node = |link| Node { link, position: DVec3::ZERO, radius: 0.0, length: 0.0 };
        let chain = Chain { nodes: [0, 1, 1].map(node).to_vec(), ..Chain::default() };
        let nodes_at = vec![DVec3::Y, 2.0 * DVec3::X, 3.0 * DVec3::X];
        let pose = Pose { origins: vec![DVec3::ZERO, DVec3::X], nodes: nodes_at, ..Pose::default() };
        let count = |is_shown: fn(usize) -> bool| {
            (links(&chain, &pose, is_shown, 0.1, INK).len(), nodes(&chain, &pose, is_shown, 0.1, INK).len())
        };
        assert_eq!((count(|_| true), count(|link| link != 1)), ((4, 3), (2, 1)));
        let last = links(&chain, &pose, |link| link == 1, 0.1, INK)[0];
        assert_eq!(last.ends, [DVec3::X, 3.0 * DVec3::X], "the last link ends at its farthest node");
    }
}
