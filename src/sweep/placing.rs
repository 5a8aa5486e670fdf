//! An arm put before an object: where its tip is, how far the object is from it, and a press of one on the other.

use super::{grid_sweep::check_axes, region::drawn, shaped_object};
use crate::{
    Error, JointVector,
    contact::{Model, Proximity},
    object::{Object, corners},
    proxy::{Chain, PRESS_GAP, Posture, Press, inverse_kinematics::approach, tip},
    random::Random,
    scene::{JointSpec, Scene},
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

/// Room about the whole arm with which a posture is taken, over the gap that the tip is to keep (1).
const CLEAR: f64 = 0.5;

/// To what the motion of an object is rounded (m): a scene shows it so.
const ROUNDED_TO: f64 = 1e-4;

/// What an arm and an object are to each other.
#[derive(Clone, Debug, Serialize)]
pub struct Placing {
    /// Corners of the object's box at rest (m).
    pub body: [DVec3; 2],
    /// Centre of the object as the scene has it (m).
    pub centre: DVec3,
    /// The joint whose link carries the tip.
    pub link: String,
    /// Number of the contact node at the tip, which is the first of its link to meet the object.
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
    /// default to the tip in the middle of the joints' limits. `None` where the arm has no contact node.
    ///
    /// # Errors
    /// When the object is refused.
    pub fn new(scene: &Scene, wanted: Option<DVec3>) -> Result<Option<Self>, Error> {
        if scene.proxy.contact_nodes() == 0 {
            return Ok(None);
        }
        check_axes(scene)?;
        Self::from(scene, &shaped_object(scene)?, wanted, None).map(Some)
    }

    /// Puts the tip before the point of the surface that is nearest to it at `q`, and begins from there. `None` where the
    /// arm has no contact node.
    ///
    /// # Errors
    /// When the object is refused.
    pub fn here(scene: &Scene, q: &JointVector) -> Result<Option<Self>, Error> {
        let chain = Chain::new(&scene.proxy);
        let Some(tip) = tip(&chain) else { return Ok(None) };
        let mut pose = chain.new_pose();
        chain.pose(q, &mut pose);
        check_axes(scene)?;
        Self::from(scene, &shaped_object(scene)?, Some(pose.nodes[tip]), Some((tip, *q))).map(Some)
    }

    /// Moves the object of `scene` before the tip of its arm, to be pressed from above where the arm does that easily.
    /// Returns its motion (m), and what arm and object are to each other there; `None` where the arm has no contact
    /// node.
    ///
    /// # Errors
    /// When the object is refused.
    pub fn brought(scene: &Scene) -> Result<Option<(DVec3, Self)>, Error> {
        check_axes(scene)?;
        let (mut object, chain) = (shaped_object(scene)?, Chain::new(&scene.proxy));
        let body = corners(&object.rest[..object.surface_nodes]);
        let standoff = PRESS_GAP * length(body);
        let mut best: Option<(Posture, DVec3, DVec3, f64)> = None;
        for posture in Posture::all(&chain, Some(DVec3::NEG_Z)) {
            let surface = object.rest[..object.surface_nodes].iter();
            let along = |node: &&DVec3| node.dot(posture.direction);
            let Some(&foremost) = surface.min_by(|a, b| along(a).total_cmp(&along(b))) else { break };
            let node = &chain.nodes[posture.node];
            let pressed = posture.nodes[posture.node] + (node.radius + standoff) * posture.direction;
            let motion = pressed - foremost;
            let motion = (motion / ROUNDED_TO).round() * ROUNDED_TO;
            let room = |x: DVec3| (x - x.clamp(body[0] + motion, body[1] + motion)).length();
            let clear = posture.nodes.iter().zip(&chain.nodes).map(|(x, node)| room(*x) - node.radius);
            let clear = clear.fold(f64::INFINITY, f64::min);
            if best.as_ref().is_none_or(|(.., other)| clear > *other) {
                best = Some((posture, motion, foremost + motion, clear));
            }
            if clear > CLEAR * standoff {
                break;
            }
        }
        let Some((posture, motion, pressed, _)) = best else { return Ok(None) };
        object.rest.iter_mut().for_each(|node| *node += motion);
        let placing = Self::from(scene, &object, Some(pressed), Some((posture.node, posture.q)))?;
        Ok(Some((motion, Self { centre: scene.object.shape.centre() + motion, ..placing })))
    }

    /// The same for `object`, which was built of the scene and perhaps moved; begins with the tip and the configuration
    /// of `posture`, where there are some.
    fn from(
        scene: &Scene,
        object: &Object,
        wanted: Option<DVec3>,
        posture: Option<(usize, JointVector)>,
    ) -> Result<Self, Error> {
        let chain = Chain::new(&scene.proxy);
        // No compliance is needed where nothing is solved.
        let model = Model::reaching(object, &chain, scene.contact, &[])?;
        let middle: JointVector = chain.joints.iter().map(|joint| 0.5 * (joint.limits[0] + joint.limits[1])).collect();
        let mut pose = chain.new_pose();
        chain.pose(&middle, &mut pose);
        let tip = posture.map(|(node, _)| node).or_else(|| tip(&chain)).unwrap_or(0);
        let at = pose.nodes[tip];
        let body = corners(&object.rest[..object.surface_nodes]);
        let length = length(body);
        let surface = &model.surface;
        let closest = surface.closest(wanted.unwrap_or(at) - surface.centre, u32::MAX);
        let point = surface.centre + surface.facet_at_rest(closest.triangle).point(closest.point.weights);
        let normal = surface.pseudonormal_at_rest(closest.triangle, &closest.point).normalize_or(DVec3::Z);
        let standoff = PRESS_GAP * length;
        let stand = Stand { point, normal, standoff };
        let (mut random, mut proximity) = (Random::new(SEED), Proximity::new(&model));
        let mut best: Option<Attempt> = None;
        for number in 0..POSTURES {
            let first = posture.map_or(middle, |(_, q)| q);
            let start =
                if number == 0 { first } else { drawn(&mut random, chain.joints.iter().map(|joint| joint.limits)) };
            let attempt = stand.attempt(&mut proximity, tip, start);
            if best.as_ref().is_none_or(|best| attempt.is_better(best, standoff)) {
                best = Some(attempt);
            }
            if best.as_ref().is_some_and(|best| best.reaches(standoff) && best.gap > CLEAR * standoff) {
                break;
            }
        }
        let Attempt { q, tip, short, gap } =
            best.unwrap_or(Attempt { q: middle, tip, short: point - at, gap: f64::INFINITY });
        chain.pose(&middle, &mut pose);
        Ok(Self {
            body,
            centre: scene.object.shape.centre(),
            link: chain.links[chain.nodes[tip].link].spec.name.clone(),
            tip,
            at: pose.nodes[tip],
            point,
            normal,
            press: Press::along(&chain, q, tip, -normal, length),
            q: q.to_vec(),
            short,
            gap,
            standoff,
        })
    }

    /// The tables of grid and motions, as a scene whose arm has `joints` has them.
    ///
    /// # Errors
    /// None in a `String`.
    pub fn tables(&self, joints: &[JointSpec]) -> Result<String, Error> {
        let mut tables = String::new();
        let written = self.press.write_grid(&mut tables, joints).and_then(|()| {
            tables.push('\n');
            self.press.write_motion(&mut tables)
        });
        written.map(|()| tables).map_err(|error| Error::from(error.to_string()))
    }

    /// Why the tip does not get before the point, if it does not, or what is in its way.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        let tip = "the tip does not get before the surface";
        if !self.reaches() {
            let short = 1e3 * self.short.length();
            return Some(format!(
                "{tip}: {short:.1} mm are missing; move the object nearer, or widen the joints' limits"
            ));
        }
        let inside = -1e3 * self.gap;
        (!self.is_clear()).then(|| format!("{tip}: the arm is {inside:.1} mm inside the object elsewhere; move either"))
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

/// Where a contact node is to stand before a surface.
struct Stand {
    point: DVec3,
    normal: DVec3,
    standoff: f64,
}

/// A configuration that inverse kinematics came to.
struct Attempt {
    q: JointVector,
    /// The contact node that stands before the point.
    tip: usize,
    /// See [`Placing::short`].
    short: DVec3,
    /// See [`Placing::gap`].
    gap: f64,
}

impl Stand {
    /// Takes contact node `tip` there, beginning at `start`. Where another node of its link is then nearer to the
    /// object, that one is the tip.
    fn attempt(&self, proximity: &mut Proximity<'_>, mut tip: usize, start: JointVector) -> Attempt {
        let chain = proximity.model().chain;
        let (mut tried, mut q) = (vec![tip], start);
        loop {
            let before = self.point + (chain.nodes[tip].radius + self.standoff) * self.normal;
            (q, _) = approach(chain, tip, before, &q);
            let nearest = proximity.nearest(&q);
            let attempt = Attempt { q, tip, short: before - proximity.pose().nodes[tip], gap: nearest.gap };
            let is_of_link = chain.nodes[nearest.node].link == chain.nodes[tip].link;
            if attempt.gap > CLEAR * self.standoff || !is_of_link || tried.contains(&nearest.node) {
                return attempt;
            }
            tip = nearest.node;
            tried.push(tip);
        }
    }
}

impl Attempt {
    fn reaches(&self, standoff: f64) -> bool {
        self.short.length() < REACHED * standoff
    }

    /// Whether it is nearer to the point, or there with more room about the arm.
    fn is_better(&self, other: &Self, standoff: f64) -> bool {
        match (self.reaches(standoff), other.reaches(standoff)) {
            (true, true) => self.gap > other.gap,
            (false, false) => self.short.length() < other.short.length(),
            (here, _) => here,
        }
    }
}

/// Length by which a press on a body of these corners is measured (m).
fn length(body: [DVec3; 2]) -> f64 {
    PRESSED * (body[1] - body[0]).min_element()
}
