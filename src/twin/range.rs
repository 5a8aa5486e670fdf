//! The configurations in which a twin answers like what was scanned.
//!
//! Contact is with the closest surface. Beyond the middle of a body that is another than the one which was touched, and
//! where the ground holds it the force has no bound. Rows as deep do not count for the modulus, and a grid leaves them
//! out. A scan's lines are straight in space and bent in joint space: the box around its rows has corners that are deeper
//! than all of them.

use super::{Approaches, ScannedShape};
use crate::{JointVector, proxy::Chain};

/// Points of the grid, about: solved in some seconds.
const POINTS: f64 = 4000.0;

/// Configurations from a lowest to a highest value of each joint.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct KnownRange {
    /// Lowest and highest value of each joint (rad or m).
    pub joints: Vec<[f64; 2]>,
}

impl KnownRange {
    /// Returns the box around all rows of `approaches`.
    #[must_use]
    pub fn around(approaches: &Approaches) -> Self {
        let rows = || approaches.free.iter().chain(approaches.contact.iter().map(|row| &row.q));
        let joints = rows().next().map_or(0, |q| q.len());
        let bound = |joint: usize, least: f64, of: fn(f64, f64) -> f64| rows().map(|q| q[joint]).fold(least, of);
        let joints = (0..joints).map(|k| [bound(k, f64::INFINITY, f64::min), bound(k, f64::NEG_INFINITY, f64::max)]);
        Self { joints: joints.collect() }
    }

    /// Returns the number of grid lines of each joint.
    #[must_use]
    pub fn lines(&self) -> usize {
        (POINTS.powf(1.0 / self.joints.len().max(1) as f64) as usize).max(3)
    }

    /// Returns the points of its grid, the last joint the fastest.
    #[must_use]
    pub fn grid(&self) -> Vec<JointVector> {
        let lines = self.lines();
        let point = |index: usize| {
            let mut q = JointVector::zeros(self.joints.len());
            for (joint, [low, high]) in self.joints.iter().enumerate() {
                q[joint] = low + (high - low) * self.line(index, joint) as f64 / (lines - 1) as f64;
            }
            q
        };
        (0..lines.pow(self.joints.len() as u32)).map(point).collect()
    }

    /// Returns the grid line of `joint` on which the point of a number lies.
    fn line(&self, point: usize, joint: usize) -> usize {
        let lines = self.lines();
        point / lines.pow((self.joints.len() - 1 - joint) as u32) % lines
    }

    /// Returns a part of this box in which no point of the grid is `deepest` below the surface of `shape` (m). The outermost
    /// points of the joint where most of them are deeper are left out, again and again.
    #[must_use]
    pub fn no_deeper(&self, deepest: f64, shape: &ScannedShape, chain: &Chain) -> Self {
        let mut pose = chain.new_pose();
        let known: Vec<bool> = self.grid().iter().map(|q| shape.depth(q, chain, &mut pose) <= deepest).collect();
        let lines = self.lines();
        let mut kept = vec![[0, lines - 1]; self.joints.len()];
        loop {
            let is_in = |point: &usize| {
                kept.iter().enumerate().all(|(joint, [low, high])| (*low..=*high).contains(&self.line(*point, joint)))
            };
            let inside: Vec<usize> = (0..known.len()).filter(is_in).collect();
            let unknown = |joint: usize, end: usize| {
                let on = inside.iter().filter(|point| self.line(**point, joint) == kept[joint][end]);
                let (all, not) =
                    on.fold((0_usize, 0_usize), |(all, not), point| (all + 1, not + usize::from(!known[*point])));
                not as f64 / all.max(1) as f64
            };
            // A grid has two lines at each joint.
            let wide = (0..kept.len()).filter(|joint| kept[*joint][0] + 1 < kept[*joint][1]);
            let ends = wide.flat_map(|joint| [0, 1].map(|end| (unknown(joint, end), joint, end)));
            let worst = ends.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|_| inside.iter().any(|point| !known[*point]));
            let Some((_, joint, end)) = worst else { break };
            if end == 0 {
                kept[joint][0] += 1;
            } else {
                kept[joint][1] -= 1;
            }
        }
        let ends = self
            .joints
            .iter()
            .zip(kept)
            .map(|([low, high], ends)| ends.map(|line| low + (high - low) * line as f64 / (lines - 1) as f64));
        Self { joints: ends.collect() }
    }
}
