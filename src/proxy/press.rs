//! Motions that press a contact node of an arm into an object and draw it over that, and a grid around them: what a
//! scene begins with.
//!
//! To press, the joints move along J^T n, by which the node moves along n. To scrape, inverse kinematics takes the node
//! across n, along the direction in which the joints move it most. The length that everything is measured by is that of
//! what is pressed: the radius of a ball, or a part of a body's width.

use super::Chain;
use super::inverse_kinematics::approach;
use super::posture::{largest, outer};
use crate::{
    JointVector,
    scene::{JointKind, JointSpec},
    toml_text::{list, number},
};
use glam::{DMat3, DVec3};
use std::fmt::{self, Write};

/// Gap between node and object at the start, and how deep the motion presses, over the length of what is pressed (1).
pub const PRESS_GAP: f64 = 0.15;
const DEPTH: f64 = 0.35;

/// How deep the node scrapes, and how far to either side, over that length (1).
const SCRAPE_DEPTH: f64 = 0.2;
const SCRAPE_WAYS: [f64; 4] = [0.5, 0.35, 0.25, 0.15];

/// Greatest depth of the node at a corner of the grid, over that length (1): beyond about a third of a ball's radius contact
/// at rest errs, and beyond the centre nothing is right. The first way of scraping that keeps it is taken.
const DEEPEST: f64 = 0.5;

/// Ends of a stroke, over that way (1): to both sides of the point that is pressed, or where a limit is near, or an arm
/// is stretched, to one.
const STROKES: [[f64; 2]; 3] = [[-1.0, 1.0], [-2.0, 0.0], [0.0, 2.0]];

/// How far the node may be from the end of a stroke, over that length (1): a twentieth of its depth.
const SCRAPE_ERROR: f64 = 0.01;

/// By how much the grid reaches beyond the motion at the node with all joints together, over that length, and with each
/// at most (1, rad).
const MARGIN: f64 = 0.2;
const MOST_MARGIN: f64 = 0.15;

/// Lines of the grid along each axis, for 1 to 6 joints: some thousand configurations at most.
const LINES: [usize; 6] = [33, 17, 13, 7, 5, 4];

/// Least margin (rad or m): ten times the digits that are written.
const LEAST_MARGIN: f64 = 1e-4;

/// Shortest lever for which gains are given, over the longest (1): a joint that hardly moves the node needs some
/// stiffness, too.
const SHORTEST_LEVER: f64 = 0.2;

/// Range of the levers (m): from a fingertip to the longest arm.
const LEVERS: [f64; 2] = [0.01, 10.0];

/// A grid and two motions.
#[derive(Clone, Debug)]
pub struct Press {
    /// Least and greatest coordinate of the grid, and its lines, for each joint (rad or m).
    pub axes: Vec<([f64; 2], usize)>,
    /// Where the motion begins and where it presses most (rad or m).
    pub motion: [JointVector; 2],
    /// Ends of a stroke over the object, where the joints get there (rad or m).
    pub scrape: Option<[JointVector; 2]>,
    /// How far the node moves per joint coordinate, with which gains are scaled (m/rad, or 1).
    pub levers: JointVector,
}

impl Press {
    /// A press of contact node `node` of `chain` along the unit vector `direction`, into something of the length
    /// `length` (m); at `q` the node is [`PRESS_GAP`] of that length away from it.
    #[must_use]
    pub fn along(chain: &Chain, q: JointVector, node: usize, direction: DVec3, length: f64) -> Self {
        let mut pose = chain.new_pose();
        chain.pose(&q, &mut pose);
        let columns: Vec<DVec3> = (0..q.len()).map(|joint| chain.jacobian_column(&pose, node, joint)).collect();
        let square: f64 = columns.iter().map(|column| column.dot(direction).powi(2)).sum();
        // Where the node has moved by so much along the direction, to first order.
        let moved = |way: f64| {
            let mut q = q;
            for ((q, joint), column) in q.iter_mut().zip(&chain.joints).zip(&columns) {
                let share = if square > 0.0 { column.dot(direction) / square } else { 0.0 };
                *q = within(joint, *q + share * way);
            }
            q
        };
        let [start, end] = [-PRESS_GAP, PRESS_GAP + DEPTH].map(|way| moved(way * length));
        let scraping = moved((PRESS_GAP + SCRAPE_DEPTH) * length);
        let strokes = SCRAPE_WAYS.map(|way| stroke(chain, scraping, node, direction, [length, way * length]));
        let grids = strokes.into_iter().chain([None]).map(|scrape| {
            let corners = [start, end].into_iter().chain(scrape.into_iter().flatten());
            (scrape, Self::around(chain, &columns, length, corners))
        });
        let depth = |axes: &[([f64; 2], usize)]| {
            let deepest = (0..1_usize << axes.len()).map(|corner| {
                let q: Vec<f64> = axes.iter().enumerate().map(|(j, (range, _))| range[corner >> j & 1]).collect();
                let mut pose = chain.new_pose();
                chain.pose(&q, &mut pose);
                pose.nodes[node].dot(direction)
            });
            deepest.fold(f64::NEG_INFINITY, f64::max) - pose.nodes[node].dot(direction) - PRESS_GAP * length
        };
        let grids: Vec<_> = grids.collect();
        let (scrape, axes) = grids
            .iter()
            .find(|(_, axes)| depth(axes) <= DEEPEST * length)
            .or(grids.last())
            .cloned()
            .unwrap_or_default();
        let longest = columns.iter().map(|column| column.length()).fold(0.0, f64::max);
        let levers = columns.iter().zip(&chain.joints).map(|(column, joint)| match joint.kind {
            JointKind::Revolute => column.length().max(SHORTEST_LEVER * longest).clamp(LEVERS[0], LEVERS[1]),
            JointKind::Prismatic => 1.0,
        });
        let levers = JointVector::from_slice(&levers.collect::<Vec<_>>());
        Self { axes, motion: [start, end], scrape, levers }
    }

    /// The axes of a grid around `corners`, beyond which it reaches at the node, whose motion with each joint `columns`
    /// has (m/rad, or 1).
    fn around(
        chain: &Chain,
        columns: &[DVec3],
        length: f64,
        corners: impl Iterator<Item = JointVector> + Clone,
    ) -> Vec<([f64; 2], usize)> {
        let count = columns.len();
        let axis = |(j, joint): (usize, &JointSpec)| {
            let most = if joint.kind == JointKind::Revolute { MOST_MARGIN } else { length };
            let margin = MARGIN * length / (count as f64 * columns[j].length());
            let margin = margin.min(most).max(LEAST_MARGIN);
            let ends = corners.clone().map(|q| q[j]);
            let (least, greatest) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
            let range = [least - margin, greatest + margin];
            (range.map(|end| within(joint, end)), LINES[count.clamp(1, LINES.len()) - 1])
        };
        chain.joints.iter().enumerate().map(axis).collect()
    }

    /// Number of the grid's points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.axes.iter().map(|(_, lines)| lines).product()
    }

    /// Writes the table `[grid]` of a scene whose arm has `joints`.
    ///
    /// # Errors
    /// None in a `String`.
    pub fn write_grid(&self, text: &mut String, joints: &[JointSpec]) -> fmt::Result {
        writeln!(text, "[grid]\naxes = [")?;
        for (([start, stop], count), spec) in self.axes.iter().zip(joints) {
            let unit = spec.kind.unit();
            writeln!(
                text,
                "    {{ start = {}, stop = {}, count = {count} }}, # {unit}: {}",
                number(*start, 9),
                number(*stop, 9),
                spec.name
            )?;
        }
        writeln!(text, "]")
    }

    /// Writes the table `[motion]` of a scene.
    ///
    /// # Errors
    /// None in a `String`.
    pub fn write_motion(&self, text: &mut String) -> fmt::Result {
        writeln!(text, "[motion]\n# Into the object, hold, and off again.\npress = [")?;
        let [start, end] = self.motion.map(|q| list(&q, |x| number(*x, 9)));
        for (time, q) in [(0.0, &start), (0.5, &start), (2.0, &end), (2.6, &end), (4.1, &start), (4.5, &start)] {
            writeln!(text, "    {{ time = {time:?}, q = {q} }},")?;
        }
        writeln!(text, "]")?;
        let Some(ends) = self.scrape else { return Ok(()) };
        writeln!(text, "# Down, to and fro over the object, and off again.\nscrape = [")?;
        let [from, to] = ends.map(|q| list(&q, |x| number(*x, 9)));
        for (time, q) in [(0.0, &start), (0.5, &start), (1.5, &from), (3.0, &to), (4.5, &from), (5.5, &start)] {
            writeln!(text, "    {{ time = {time:?}, q = {q} }},")?;
        }
        writeln!(text, "]")
    }
}

/// Ends of a stroke of `node` across `direction` about where it is at `q`, `way` to either side over something of the
/// length `length` (m); `None` where the joints do not get there.
fn stroke(
    chain: &Chain,
    q: JointVector,
    node: usize,
    direction: DVec3,
    [length, way]: [f64; 2],
) -> Option<[JointVector; 2]> {
    let mut pose = chain.new_pose();
    chain.pose(&q, &mut pose);
    let across = |x: DVec3| x - x.dot(direction) * direction;
    let columns = (0..q.len()).map(|joint| across(chain.jacobian_column(&pose, node, joint)));
    let square = columns.fold(DMat3::ZERO, |sum, column| sum + outer(column));
    let along = largest(square, direction.any_orthonormal_vector());
    let end = |to: DVec3| {
        let (mut end, error) = approach(chain, node, pose.nodes[node] + way * to, &q);
        end.iter_mut().zip(&chain.joints).for_each(|(q, joint)| *q = within(joint, *q));
        (error <= SCRAPE_ERROR * length).then_some(end)
    };
    let strokes =
        [along, direction.cross(along)].into_iter().flat_map(|way| STROKES.map(|ends| ends.map(|end| end * way)));
    strokes.into_iter().find_map(|[from, to]| Some([end(from)?, end(to)?]))
}

/// Returns `coordinate` within the limits of `joint`, to a hundred thousandth of a radian or metre, as a scene shows
/// it.
fn within(joint: &JointSpec, coordinate: f64) -> f64 {
    let [lower, upper] = joint.limits;
    ((coordinate * 1e5).round() / 1e5).clamp(lower, upper)
}
