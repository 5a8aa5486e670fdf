//! A motion that presses a contact node of an arm into an object, and a grid around it: what a scene begins with.
//!
//! The joints move along J^T n, by which the node moves along n. The length that everything is measured by is that of
//! what is pressed: the radius of a ball, or a part of a body's width.

use super::Chain;
use crate::{
    JointVector,
    scene::{JointKind, JointSpec},
    toml_text::{list, number},
};
use glam::DVec3;
use std::fmt::{self, Write};

/// Gap between node and object at the start, and how deep the motion presses, over the length of what is pressed (1).
pub const PRESS_GAP: f64 = 0.15;
const DEPTH: f64 = 0.35;

/// By how much the grid reaches beyond the motion at the node, over that length, and at most (1, rad).
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

/// A grid and a motion.
#[derive(Clone, Debug)]
pub struct Press {
    /// Least and greatest coordinate of the grid, and its lines, for each joint (rad or m).
    pub axes: Vec<([f64; 2], usize)>,
    /// Where the motion begins and where it presses most (rad or m).
    pub motion: [JointVector; 2],
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
        // By how much each joint moves where the node moves by a metre along the direction.
        let way = columns.iter().map(|column| if square > 0.0 { column.dot(direction) / square } else { 0.0 });
        let (mut start, mut end) = (q, q);
        let mut axes = Vec::new();
        for (j, (way, joint)) in way.zip(&chain.joints).enumerate() {
            let [lower, upper] = joint.limits;
            start[j] = rounded(q[j] - way * PRESS_GAP * length).clamp(lower, upper);
            end[j] = rounded(q[j] + way * (PRESS_GAP + DEPTH) * length).clamp(lower, upper);
            let most = if joint.kind == JointKind::Revolute { MOST_MARGIN } else { length };
            let margin = (MARGIN * length / columns[j].length()).min(most).max(LEAST_MARGIN);
            let range = [start[j].min(end[j]) - margin, start[j].max(end[j]) + margin];
            axes.push((range.map(|end| rounded(end).clamp(lower, upper)), LINES[q.len().clamp(1, LINES.len()) - 1]));
        }
        let longest = columns.iter().map(|column| column.length()).fold(0.0, f64::max);
        let levers = columns.iter().zip(&chain.joints).map(|(column, joint)| match joint.kind {
            JointKind::Revolute => column.length().max(SHORTEST_LEVER * longest).clamp(LEVERS[0], LEVERS[1]),
            JointKind::Prismatic => 1.0,
        });
        let levers = JointVector::from_slice(&levers.collect::<Vec<_>>());
        Self { axes, motion: [start, end], levers }
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
        writeln!(text, "]")
    }
}

/// Returns `coordinate` to a hundred thousandth of a radian or metre, as a scene shows it.
fn rounded(coordinate: f64) -> f64 {
    (coordinate * 1e5).round() / 1e5
}
