//! Where contact is in C-space, before anything is baked, and the grid that follows.
//!
//! Random configurations within the joint limits are measured against the surface at rest, and nothing is solved. A
//! configuration whose deepest proxy node is d below the surface counts as contact of depth d. *Shallow* contact is at
//! most as deep as asked for; the grid's ranges are the least box that holds all of it that was met. Its lines are so
//! far apart that a step along any axis moves the proxy by about as much as along any other.

use super::{grid_sweep::check_axes, region::drawn, spacing};
use crate::{
    Error, ErrorKind, JointVector,
    contact::{Model, NodeTree},
    error,
    object::{Object, corners},
    proxy::Chain,
    random::Random,
    scene::{AxisSpec, Scene},
};
use rayon::prelude::*;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

/// Configurations of one round; the first one is enough where contact is no rarity.
const ROUND: usize = 1 << 15;

/// Most rounds (1): shallow contact of a few in ten thousand is still seen.
const ROUNDS: usize = 16;

/// Shallow contacts that are asked for: those at the edges of a range lie within a hundredth of it.
const CONTACTS: usize = 4000;

/// Seed of the random configurations.
const SEED: u64 = 0xd1b5_4a32_d192_ed03;

/// Depth up to which contact counts as shallow, over the body's size (1): from about a fifth on a soft body has several
/// equilibria, between which torque jumps on any grid.
const SHALLOW: f64 = 0.2;

/// By how much a range is widened on either side, over its width (1): what lies between the outermost contacts that
/// were met and the outermost ones there are.
const MARGIN: f64 = 0.02;

/// Parts of a joint's limits for which contact is listed separately (1).
const PARTS: usize = 10;

/// Points of the grid over the ranges from which a pilot begins (1): more than the pilot's own.
const POINTS: f64 = 200_000.0;

/// Lines of that grid along an axis, at most as a geometric mean (1): with few joints there need not be so many points.
const LINES: f64 = 64.0;

/// Fewest steps along an axis (1): interpolation takes differences over two.
const FEWEST_STEPS: f64 = 2.0;

/// How far the proxy moves along an axis at least, over the farthest (1): a joint that hardly moves it still has its
/// lines.
const LEAST_WAY: f64 = 1e-3;

/// To what ends of ranges are rounded, outwards (rad or m).
const ROUNDED_TO: f64 = 1e-4;

/// Depths for which the share of contact is listed, over the body's size (1).
const DEPTHS: [f64; 6] = [0.02, 0.05, 0.1, 0.2, 0.3, 0.5];

/// Contact along one joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointReach {
    /// The joint's name.
    pub name: String,
    /// `rad` or `m`.
    pub unit: &'static str,
    /// The joint's limits (rad or m).
    pub limits: [f64; 2],
    /// Where shallow contact is (rad or m).
    pub range: [f64; 2],
    /// Shares of the configurations that are in contact, in each tenth of the limits (1).
    pub contact: [f64; PARTS],
}

/// Contact up to a depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DepthShare {
    /// (m)
    pub depth: f64,
    /// Share of all contact within the joint limits that is at most this deep (1).
    pub share: f64,
}

/// Where contact is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reach {
    /// Joint by joint.
    pub joints: Vec<JointReach>,
    /// Configurations measured.
    pub configurations: usize,
    /// Share of them in contact (1).
    pub contact: f64,
    /// Share of those within the ranges that are in contact (1).
    pub contact_in_ranges: f64,
    /// Volume of the ranges over that of the limits (1).
    pub volume: f64,
    /// Least width of the body at rest (m).
    pub body: f64,
    /// Depth up to which contact counts as shallow (m).
    pub shallow: f64,
    /// Greatest depth met within the ranges (m).
    pub deepest: f64,
    /// How deep contact is.
    pub depths: Vec<DepthShare>,
}

/// Depth and status at a configuration.
#[derive(Clone, Copy)]
struct Met {
    q: JointVector,
    /// Signed distance between proxy and surface where they touch, else zero (m).
    gap: f64,
}

impl Reach {
    /// Measures `scene`, whose grid does not matter, `model` being its object and its arm, of which no compliance is
    /// needed. `depth` is that of the contact that the ranges are to hold, by default a fifth of the body's size (m).
    ///
    /// # Errors
    /// When the arm has too many joints, nothing touches, or `stop` is raised.
    pub fn new(scene: &Scene, model: &Model<'_>, depth: Option<f64>, stop: &AtomicBool) -> Result<Self, Error> {
        check_axes(scene)?;
        let (tree, body) = (NodeTree::new(model.chain), size(model.object));
        let shallow = depth.unwrap_or_else(|| self::shallow(model.object));
        let is_shallow = |met: &Met| met.gap < 0.0 && -met.gap <= shallow;
        let mut random = Random::new(SEED);
        let mut met: Vec<Met> = Vec::new();
        for _ in 0..ROUNDS {
            if stop.load(Ordering::Relaxed) {
                return Err(error!("stopped; nothing was written").of(ErrorKind::Stopped));
            }
            met.extend(measured(model, &tree, scene, &mut random));
            if met.iter().filter(|met| is_shallow(met)).count() >= CONTACTS {
                break;
            }
        }
        let touching: Vec<Met> = met.iter().filter(|met| met.gap < 0.0).copied().collect();
        let wanted: Vec<Met> = touching.iter().filter(|met| is_shallow(met)).copied().collect();
        if wanted.is_empty() {
            let depth =
                if touching.is_empty() { String::new() } else { format!(" by at most {:.1} mm", shallow * 1e3) };
            let configurations = met.len();
            return Err(Error::at(
                &scene.path,
                format_args!(
                    "the proxy touches the object at none of {configurations} random configurations within the joint \
                     limits{depth}: move the object or the arm, widen the limits (limits of [[proxy.joint]]), or allow \
                     for deeper contact (--depth)"
                ),
            ));
        }
        let joints: Vec<JointReach> =
            (0..scene.proxy.joints.len()).map(|joint| along(scene, joint, &met, &wanted)).collect();
        let is_within = |met: &&Met| {
            joints.iter().zip(met.q.iter()).all(|(joint, q)| (joint.range[0]..=joint.range[1]).contains(q))
        };
        let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
        let contact = share(touching.len(), met.len());
        let (within, touching_within) =
            (met.iter().filter(is_within).count(), touching.iter().filter(is_within).count());
        let within_depth = |depth: f64| {
            let count = touching.iter().filter(|met| -met.gap <= depth).count();
            DepthShare { depth, share: share(count, touching.len()) }
        };
        let width = |range: [f64; 2]| range[1] - range[0];
        Ok(Self {
            configurations: met.len(),
            contact,
            contact_in_ranges: share(touching_within, within),
            volume: joints.iter().map(|joint| width(joint.range) / width(joint.limits)).product(),
            body,
            shallow,
            deepest: touching.iter().filter(is_within).map(|met| -met.gap).fold(0.0, f64::max),
            depths: DEPTHS.map(|part| within_depth(part * body)).to_vec(),
            joints,
        })
    }

    /// The table `[grid]` of a scene with lines over the ranges, as many as `scene` has there.
    #[must_use]
    pub fn table(&self, scene: &Scene) -> String {
        let axes = self.joints.iter().zip(&scene.grid.axes).map(|(joint, axis)| {
            let [start, stop] = joint.range.map(|end| (end / ROUNDED_TO).round() * ROUNDED_TO);
            let [start, stop] = [start, stop].map(|end| format!("{end:.4}"));
            format!("    {{ start = {start}, stop = {stop}, count = {} }}, # {}\n", axis.count, joint.name)
        });
        format!(
            "[grid] # `haptize reach`: contact up to {:.1} mm deep\naxes = [\n{}]\n",
            self.shallow * 1e3,
            axes.collect::<String>()
        )
    }

    /// `scene` with a grid over the ranges, its text too. It is as fine as a pilot wants it to begin with, not as fine
    /// as any error wants it.
    ///
    /// # Errors
    /// When the scene cannot take the grid.
    pub fn scene(&self, scene: &Scene) -> Result<Scene, Error> {
        let ranges: Vec<[f64; 2]> = self.joints.iter().map(|joint| joint.range).collect();
        let mut motion = vec![0.0_f64; ranges.len()];
        for bound in Chain::new(&scene.proxy).jacobian_bounds(&ranges) {
            motion.iter_mut().zip(bound.iter()).for_each(|(motion, r)| *motion = motion.max(*r));
        }
        // How far the proxy moves along each axis, and the step at which the grid has about the wanted number of
        // points.
        let ways: Vec<f64> = ranges.iter().zip(motion).map(|(range, r)| (range[1] - range[0]) * r).collect();
        let longest = ways.iter().copied().fold(0.0, f64::max);
        let ways: Vec<f64> = ways.into_iter().map(|way| way.max(LEAST_WAY * longest)).collect();
        let volume: f64 = ways.iter().product();
        let points = POINTS.min(LINES.powi(ways.len() as i32));
        let step = (volume / points).powf(1.0 / ways.len() as f64);
        let mut scene = scene.clone();
        let axis = |(range, way): (&[f64; 2], f64)| {
            let steps = (way / step).round().max(FEWEST_STEPS);
            AxisSpec { start: range[0], step: (range[1] - range[0]) / steps, count: steps as usize + 1 }
        };
        scene.grid.axes = ranges.iter().zip(ways).map(axis).collect();
        while spacing::points(&scene) as f64 > 2.0 * points {
            scene = spacing::spaced(&scene, |steps| (steps / std::f64::consts::SQRT_2).round().max(FEWEST_STEPS));
        }
        scene.with_own_text()
    }
}

/// Least extent of the object's surface along an axis of space (m).
fn size(object: &Object) -> f64 {
    let [low, high] = corners(&object.rest[..object.surface_nodes]);
    (high - low).min_element()
}

/// Depth up to which contact with `object` counts as shallow (m).
pub(crate) fn shallow(object: &Object) -> f64 {
    SHALLOW * size(object)
}

/// A round of random configurations within the joint limits.
fn measured(model: &Model<'_>, tree: &NodeTree, scene: &Scene, random: &mut Random) -> Vec<Met> {
    let drawn: Vec<JointVector> =
        (0..ROUND).map(|_| drawn(random, scene.proxy.joints.iter().map(|joint| joint.limits))).collect();
    drawn.into_par_iter().map(|q| Met { gap: tree.touching_gap(model, &q), q }).collect()
}

/// Contact along one joint; the `wanted` ones set its range.
fn along(scene: &Scene, joint: usize, met: &[Met], wanted: &[Met]) -> JointReach {
    let spec = &scene.proxy.joints[joint];
    let [least, greatest] = spec.limits;
    let mut counts = [[0_usize; 2]; PARTS];
    for met in met {
        let part = ((met.q[joint] - least) / (greatest - least) * PARTS as f64) as usize;
        let count = &mut counts[part.min(PARTS - 1)];
        count[0] += 1;
        count[1] += usize::from(met.gap < 0.0);
    }
    let ends = wanted.iter().map(|met| met.q[joint]);
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| (low.min(q), high.max(q)));
    let margin = MARGIN * (high - low).max(MARGIN * (greatest - least));
    JointReach {
        name: spec.name.clone(),
        unit: spec.kind.unit(),
        limits: spec.limits,
        range: [
            (((low - margin) / ROUNDED_TO).floor() * ROUNDED_TO).max(least),
            (((high + margin) / ROUNDED_TO).ceil() * ROUNDED_TO).min(greatest),
        ],
        contact: counts.map(|[all, touching]| touching as f64 / all.max(1) as f64),
    }
}
