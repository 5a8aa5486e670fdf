//! Rows averaged in cells of C-space, direction by direction: memory bounded by the cells, not by the rows.
//!
//! A *visit* is an unbroken run of rows in one cell and one direction. The mean of each visit counts once, however long
//! it lasted, and the spread of the means over visits is the repeatability of the measurement: what a second pass
//! over the same place would give.

use super::Samples;
use crate::{Error, JointVector, MAX_AXES, dataset::JointLabel, error};
use std::collections::BTreeMap;

/// Cells of C-space at most: about 1 kB each.
const MOST_CELLS: usize = 1_000_000;

/// Cell number on each axis.
type Key = [i64; MAX_AXES];

/// LeadDirection of motion of the lead joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeadDirection {
    /// Up.
    Forward,
    /// Down.
    Backward,
}

/// What is made of the two directions in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branches {
    /// The mean of those that were visited.
    Any,
    /// The mean of both, in cells visited in both: dry friction cancels.
    Mean,
    /// Half of what the torque is greater by on the way down, in cells visited in both: dry friction.
    HalfDifference,
    /// One alone.
    One(LeadDirection),
}

/// Running weighted mean and sum of squared departures (West 1979).
#[derive(Clone, Copy)]
struct Mean {
    count: f64,
    weight: f64,
    mean: JointVector,
    squares: JointVector,
}

impl Mean {
    fn new(joints: usize) -> Self {
        Self { count: 0.0, weight: 0.0, mean: JointVector::zeros(joints), squares: JointVector::zeros(joints) }
    }

    fn add(&mut self, values: &JointVector, weight: f64) {
        self.count += 1.0;
        self.weight += weight;
        for (joint, value) in values.iter().enumerate() {
            let before = value - self.mean[joint];
            self.mean[joint] += weight / self.weight * before;
            self.squares[joint] += weight * before * (value - self.mean[joint]);
        }
    }

    /// Variance of the mean over visits; `None` for a single visit.
    fn variance_of_mean(&self, joint: usize) -> Option<f64> {
        (self.count > 1.5).then(|| self.squares[joint] / ((self.count - 1.0) * self.weight))
    }
}

/// One direction of one cell.
#[derive(Clone, Copy)]
struct Branch {
    q: Mean,
    torque: Mean,
    /// Variance within the visits, summed.
    within: JointVector,
}

/// The run of rows under way.
struct Visit {
    key: Key,
    direction: LeadDirection,
    q: Mean,
    torque: Mean,
}

impl Branch {
    fn new(joints: usize) -> Self {
        Self { q: Mean::new(joints), torque: Mean::new(joints), within: JointVector::zeros(joints) }
    }
}

/// Rows sorted into cells.
pub struct Cells {
    sides: Vec<f64>,
    joints: usize,
    cells: BTreeMap<Key, [Option<Branch>; 2]>,
    visit: Option<Visit>,
}

/// Facts from the cells beside the samples.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct CellReport {
    /// Cells that were visited.
    pub cells: usize,
    /// Cells visited in both directions.
    pub both_directions: usize,
    /// Mean of half the difference between the directions, a joint each: dry friction and backlash (N m).
    pub hysteresis: Vec<f64>,
    /// Root mean square over cells of the standard deviation between visits, a joint each: what measuring again at the
    /// same place in the same direction would give (N m).
    pub repeatability: Vec<f64>,
}

impl Cells {
    /// None yet, with these sides, one a joint (rad or m).
    #[must_use]
    pub fn new(sides: &[f64]) -> Self {
        Self { sides: sides.to_vec(), joints: sides.len(), cells: BTreeMap::new(), visit: None }
    }

    /// The cell of `q`.
    fn key(&self, q: &JointVector) -> Key {
        let mut key = [0; MAX_AXES];
        key.iter_mut().zip(q.iter().zip(&self.sides)).for_each(|(k, (x, side))| *k = (x / side).floor() as i64);
        key
    }

    /// Adds a row of a visit.
    ///
    /// # Errors
    /// When more cells were visited than are kept.
    pub fn add(&mut self, q: &JointVector, torque: &JointVector, direction: LeadDirection) -> Result<(), Error> {
        let key = self.key(q);
        if self.visit.as_ref().is_none_or(|visit| visit.key != key || visit.direction != direction) {
            self.end_visit();
            if self.cells.len() > MOST_CELLS {
                return Err(error!("more than {MOST_CELLS} cells of C-space were visited: enlarge torque.cell"));
            }
            let empty = Mean::new(self.joints);
            self.visit = Some(Visit { key, direction, q: empty, torque: empty });
        }
        if let Some(visit) = &mut self.visit {
            visit.q.add(q, 1.0);
            visit.torque.add(torque, 1.0);
        }
        Ok(())
    }

    /// One direction of a cell.
    fn branch(&mut self, key: Key, direction: LeadDirection) -> &mut Branch {
        let branches = self.cells.entry(key).or_default();
        branches[direction as usize].get_or_insert_with(|| Branch::new(self.joints))
    }

    /// Adds a row for itself, which counts by its `weight`.
    pub fn add_alone(&mut self, q: &JointVector, torque: &JointVector, weight: f64) {
        let branch = self.branch(self.key(q), LeadDirection::Forward);
        branch.q.add(q, weight);
        branch.torque.add(torque, weight);
    }

    /// The motion was interrupted: what follows is another visit.
    pub fn end_visit(&mut self) {
        let Some(visit) = self.visit.take() else { return };
        let branch = self.branch(visit.key, visit.direction);
        branch.q.add(&visit.q.mean, 1.0);
        branch.torque.add(&visit.torque.mean, 1.0);
        for (joint, sum) in branch.within.iter_mut().enumerate() {
            *sum += visit.torque.squares[joint] / visit.torque.count;
        }
    }

    /// One sample a cell that has what `branches` asks for.
    #[must_use]
    pub fn samples(&self, branches: Branches, joints: &[JointLabel]) -> Samples {
        let mut samples = Samples { joints: joints.to_vec(), ..Samples::default() };
        let mut deviations = Vec::new();
        for [forward, backward] in self.cells.values() {
            let is_both = forward.is_some() && backward.is_some();
            let used: Vec<&Branch> = match branches {
                Branches::Mean | Branches::HalfDifference if !is_both => continue,
                Branches::One(LeadDirection::Forward) => forward.iter().collect(),
                Branches::One(LeadDirection::Backward) => backward.iter().collect(),
                _ => forward.iter().chain(backward).collect(),
            };
            if used.is_empty() {
                continue;
            }
            let share = 1.0 / used.len() as f64;
            let first = if branches == Branches::HalfDifference { -share } else { share };
            for joint in 0..self.joints {
                let factors = || [first].into_iter().chain(std::iter::repeat(share)).zip(&used);
                samples.configurations.push(share * used.iter().map(|branch| branch.q.mean[joint]).sum::<f64>());
                samples.torques.push(factors().map(|(factor, branch)| factor * branch.torque.mean[joint]).sum::<f64>());
                let single = |branch: &Branch| branch.within[joint] / branch.torque.count;
                let variance =
                    |branch: &&Branch| branch.torque.variance_of_mean(joint).unwrap_or_else(|| single(branch));
                deviations.push(share * used.iter().map(variance).sum::<f64>().sqrt());
            }
        }
        samples.deviations = Some(deviations);
        samples
    }

    /// What the cells tell beside.
    #[must_use]
    pub fn report(&self) -> CellReport {
        let mut report = CellReport {
            cells: self.cells.len(),
            hysteresis: vec![0.0; self.joints],
            repeatability: vec![0.0; self.joints],
            ..CellReport::default()
        };
        let mut repeated = 0.0;
        for cell in self.cells.values() {
            if let [Some(forward), Some(backward)] = cell {
                report.both_directions += 1;
                for (joint, sum) in report.hysteresis.iter_mut().enumerate() {
                    *sum += 0.5 * (forward.torque.mean[joint] - backward.torque.mean[joint]).abs();
                }
            }
            for branch in cell.iter().flatten().filter(|branch| branch.torque.count > 1.5) {
                repeated += 1.0;
                for (joint, sum) in report.repeatability.iter_mut().enumerate() {
                    *sum += branch.torque.squares[joint] / (branch.torque.count - 1.0);
                }
            }
        }
        for sum in &mut report.hysteresis {
            *sum /= report.both_directions.max(1) as f64;
        }
        for sum in &mut report.repeatability {
            *sum = (*sum / f64::max(repeated, 1.0)).sqrt();
        }
        report
    }
}
