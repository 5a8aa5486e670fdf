//! The pointer's grip on the proxy: which node it holds, and where it takes it. The ray through the pointer meets the
//! plane through the node that faces the eye; inverse kinematics turns that place into joint coordinates.

use crate::{
    JointVector,
    draw::camera::Camera,
    proxy::inverse_kinematics::approach,
    proxy::{Chain, Pose},
};
use glam::{DVec2, DVec3};

/// A node of the proxy in the pointer's hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeDrag {
    /// Number of the proxy's node.
    pub node: usize,
    /// Where the node was when it was gripped (m): a point of the plane in which it is moved.
    anchor: DVec3,
    /// From the pointer's place in that plane to the node (m).
    offset: DVec3,
}

/// How near to a node the pointer must be, in heights of the picture.
const REACH: f64 = 0.05;

impl NodeDrag {
    /// Takes the node nearest to the picture point `at` (x right, y up, from -1 to 1), if one is near.
    #[must_use]
    pub fn take(camera: &Camera, aspect: f64, at: DVec2, pose: &Pose) -> Option<Self> {
        let distance = |node: &DVec3| {
            let way = camera.project(*node, aspect).map_or(DVec2::INFINITY, |seen| seen.at - at);
            0.5 * DVec2::new(way.x * aspect, way.y).length()
        };
        let nodes = pose.nodes.iter().copied().enumerate();
        let (node, anchor) = nodes.min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)))?;
        if distance(&anchor) > REACH {
            return None;
        }
        let met = camera.ray(at, aspect).meet_plane(anchor, camera.axes()[2])?;
        Some(Self { node, anchor, offset: anchor - met })
    }

    /// Configuration that brings the node to the picture point `at`, as far as the joints let it; `from` is where they
    /// are.
    #[must_use]
    pub fn lead(
        &self,
        camera: &Camera,
        aspect: f64,
        at: DVec2,
        chain: &Chain,
        from: &JointVector,
    ) -> Option<JointVector> {
        let met = camera.ray(at, aspect).meet_plane(self.anchor, camera.axes()[2])?;
        Some(approach(chain, self.node, met + self.offset, from).0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn a_gripped_node_follows_the_pointer() {
        let scene = Scene::parse(include_str!("../../tests/scenes/sphere.toml"), "sphere.toml").unwrap();
        let chain = Chain::new(&scene.proxy);
        let q = JointVector::from_slice(&[0.0, 1.4, -1.9]);
        let mut pose = chain.new_pose();
        chain.pose(&q, &mut pose);
        let camera = Camera::looking_at(DVec3::new(0.0, 0.0, 0.08), 0.2);
        let aspect = 1.3;
        let node = pose.nodes.len() - 1;
        let shown = camera.project(pose.nodes[node], aspect).unwrap().at;
        let grip = NodeDrag::take(&camera, aspect, shown, &pose).unwrap();
        assert_eq!(grip.node, node);
        let target = shown + DVec2::new(0.02, -0.05);
        let led = grip.lead(&camera, aspect, target, &chain, &q).unwrap();
        chain.pose(&led, &mut pose);
        let now = camera.project(pose.nodes[node], aspect).unwrap().at;
        assert!(now.distance(target) < 1e-4, "{now} is not {target}");
        assert!(NodeDrag::take(&camera, aspect, DVec2::new(0.9, -0.9), &pose).is_none());
    }
}
