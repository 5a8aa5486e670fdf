//! An arm put before an object: where its tip is, how far the object is from it, and a press of one on the other.

use super::{BakeError, build_object, grid_sweep::check_axes};
use crate::{
    JointVector,
    contact::{Model, Proximity},
    object::Object,
    proxy::{Chain, PRESS_GAP, Press, inverse_kinematics::approach},
    random::Random,
    scene::{Scene, Shape},
};
use glam::DVec3;
use serde::Serialize;

/// Length by which a press is measured, over the body's least width (1): the tip then goes a tenth of that deep.
const PRESSED: f64 = 0.3;

/// Postures from which inverse kinematics sets out: the middle of the limits, then random ones.
const POSTURES: usize = 64;

/// Seed of the random postures.
const SEED: u64 = 7;

/// Distance from the point before the surface at which the tip counts as there, over the gap that it is to keep (1).
const REACHED: f64 = 0.01;

/// What an arm and an object are to each other.
#[derive(Clone, Debug, Serialize)]
pub struct Placing {
    /// Corners of the object's box at rest (m).
    pub body: [DVec3; 2],
    /// Centre of the object as the scene has it (m).
    pub centre: DVec3,
    /// The joint whose link carries the tip.
    pub link: String,
    /// Number of the contact node at the tip: of the last link with nodes, the one that is farthest from its joint.
    pub tip: usize,
    /// Where the tip is with every joint in the middle of its limits (m).
    pub at: DVec3,
    /// Point of the surface that is to be pressed, and the direction out of the object there (m, 1).
    pub point: DVec3,
    /// See `point`.
    pub normal: DVec3,
    /// Configuration at which the tip is before that point, or as near to that as the joints let it (rad or m).
    pub q: Vec<f64>,
    /// How far the tip then still is from there (m).
    pub short: DVec3,
    /// Distance of the whole arm to the object at `q`, negative where some of it is inside (m).
    pub gap: f64,
    /// How far the tip is to stay before the surface at first (m).
    pub standoff: f64,
    /// Grid and motion.
    #[serde(skip)]
    pub press: Press,
}

impl Placing {
    /// Puts the tip of the arm of `scene` before the point of the object's surface that is nearest to `wanted`, by
    /// default to the tip in the middle of the joints' limits.
    ///
    /// # Errors
    /// When the object is refused.
    pub fn new(scene: &Scene, wanted: Option<DVec3>) -> Result<Self, BakeError> {
        let (Shape::Sphere { centre, .. }
        | Shape::Icosphere { centre, .. }
        | Shape::Mesh { centre, .. }
        | Shape::Tetrahedra { centre, .. }) = scene.object.shape;
        check_axes(scene)?;
        let object = build_object(scene)?;
        let chain = Chain::new(&scene.proxy);
        // No compliance is needed where nothing is solved.
        let model = Model::reaching(&object, &chain, scene.contact, &[])?;
        let mut middle = JointVector::zeros(chain.joints.len());
        middle.iter_mut().zip(&chain.joints).for_each(|(q, joint)| *q = 0.5 * (joint.limits[0] + joint.limits[1]));
        let mut pose = chain.new_pose();
        chain.pose(&middle, &mut pose);
        let tip = tip(&chain);
        let (node, at) = (&chain.nodes[tip], pose.nodes[tip]);
        let body = body(&object);
        let length = PRESSED * (body[1] - body[0]).min_element();
        let surface = &model.surface;
        let closest = surface.closest(wanted.unwrap_or(at) - surface.centre, u32::MAX);
        let point = surface.centre + surface.facet_at_rest(closest.triangle).point(closest.point.weights);
        let normal = surface.pseudonormal_at_rest(closest.triangle, &closest.point).normalize_or(DVec3::Z);
        let standoff = PRESS_GAP * length;
        let before = point + (node.radius + standoff) * normal;
        let (mut random, mut proximity) = (Random::new(SEED), Proximity::new(&model));
        let mut best: Option<(JointVector, DVec3, f64)> = None;
        for number in 0..POSTURES {
            let mut start = middle;
            if number > 0 {
                let joints = start.iter_mut().zip(&chain.joints);
                joints.for_each(|(q, joint)| *q = random.between(joint.limits[0], joint.limits[1]));
            }
            let (q, _) = approach(&chain, tip, before, &start);
            chain.pose(&q, &mut pose);
            let (short, gap) = (before - pose.nodes[tip], proximity.gap(&q));
            let reaches = |short: &DVec3| short.length() < REACHED * standoff;
            let is_better = best.as_ref().is_none_or(|(_, other, room)| match (reaches(&short), reaches(other)) {
                (true, true) => gap > *room,
                (false, false) => short.length() < other.length(),
                (here, _) => here,
            });
            if is_better {
                best = Some((q, short, gap));
            }
            if reaches(&short) && gap > 0.5 * standoff {
                break;
            }
        }
        let (q, short, gap) = best.unwrap_or((middle, before - at, f64::INFINITY));
        Ok(Self {
            body,
            centre,
            link: chain.joints[node.link].name.clone(),
            tip,
            at,
            point,
            normal,
            press: Press::along(&chain, q, tip, -normal, length),
            q: q.to_vec(),
            short,
            gap,
            standoff,
        })
    }

    /// Whether the tip gets before the point.
    #[must_use]
    pub fn reaches(&self) -> bool {
        self.short.length() < REACHED * self.standoff
    }

    /// Whether the rest of the arm then stays out of the object.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        self.gap > 0.0
    }
}

/// The contact node at the end of the arm.
fn tip(chain: &Chain) -> usize {
    let last = chain.nodes.last().map_or(0, |node| node.link);
    let of_last = chain.nodes.iter().enumerate().filter(|(_, node)| node.link == last);
    let far = of_last.max_by(|(_, a), (_, b)| a.position.length().total_cmp(&b.position.length()));
    far.map_or(0, |(number, _)| number)
}

/// Corners of the box around the object's surface (m).
fn body(object: &Object) -> [DVec3; 2] {
    let nodes = &object.rest[..object.surface_nodes];
    [
        nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min),
        nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max),
    ]
}
