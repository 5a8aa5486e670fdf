//! The configurations that a scan visits, in order.
//!
//! A workspace plan goes line by line: along a line into the object, back out to the clearance, across to the next
//! line, every other row of lines backwards so that neighbours in time are neighbours in space. A plan over joints goes
//! through its grid row by row, every other row backwards.
//!
//! After some of the lines come presses that are recorded ([`crate::scene::HistorySpec`]): in to the line's last level
//! but one, held, aside and back along both axes across, and out again.

use crate::proxy::inverse_kinematics::reach;
use crate::{
    Error, JointVector, error,
    proxy::Chain,
    scene::{PlanSpec, ScanSpec, WorkspacePlan},
};
use glam::DVec3;

/// Where a press goes along an axis across, in strokes: to both sides and back, each way once after a turn.
const STROKES: [f64; 4] = [1.0, -1.0, 1.0, 0.0];

/// Most points of a scan: at a second a point, eleven days.
const SCAN_POINTS: usize = 1_000_000;

/// The golden ratio less one, whose multiples spread evenly however many follow.
const GOLDEN: f64 = std::f64::consts::GOLDEN_RATIO - 1.0;

/// What is wrong with a plan of which nothing can be reached.
const NOTHING_REACHABLE: &str =
    "the joints reach no point of the plan: check its start, directions and the joints' limits";

/// One stop of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Commanded configuration (rad or m).
    pub q: JointVector,
    /// Number of the plan's point, in the order of the specification, those of histories after them; `None` for a way
    /// point at which nothing is measured.
    pub point: Option<usize>,
    /// How it is recorded on the way and there; absent where it is measured at rest, or not at all.
    pub recorded: Option<PressRecord>,
}

/// How a stop is approached that is recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressRecord {
    /// Greatest speed of the commanded position (rad/s or m/s).
    pub speed: f64,
    /// Time for which it is held there (s).
    pub hold: f64,
}

/// The stops of a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// In the order of the visit.
    pub stops: Vec<Stop>,
    /// Number of points to be measured at rest.
    pub points: usize,
    /// Number of presses to be recorded.
    pub histories: usize,
    /// Points that the joints do not reach; they are not visited.
    pub unreachable: Vec<usize>,
}

impl Plan {
    /// The plan of `spec` for `chain`.
    ///
    /// # Errors
    /// When it has too many points, or the joints reach none of them.
    pub fn new(spec: &ScanSpec, chain: &Chain) -> Result<Self, Error> {
        let plan = match &spec.plan {
            PlanSpec::Workspace(plan) => workspace(plan, spec, chain)?,
            PlanSpec::Joints(grid) => {
                let counts: Vec<usize> = grid.axes.iter().map(|axis| axis.count).collect();
                let points = checked_points(&counts)?;
                let stop = |(point, place): (usize, Vec<usize>)| Stop {
                    q: grid.axes.iter().zip(place).map(|(axis, k)| axis.start + k as f64 * axis.step).collect(),
                    point: Some(point),
                    recorded: None,
                };
                Self { stops: serpentine(&counts).map(stop).collect(), points, histories: 0, unreachable: Vec::new() }
            }
        };
        if plan.stops.is_empty() {
            return Err(NOTHING_REACHABLE.into());
        }
        Ok(plan)
    }

    /// `count` points of the plan, spread over it evenly however many follow (the golden ratio's multiples), from
    /// number `first` of that order on: for each the way point that leads there, or itself, and its configuration.
    #[must_use]
    pub fn spread(&self, first: usize, count: usize) -> Vec<[JointVector; 2]> {
        let is_measured = |stop: &Stop| stop.point.is_some() && stop.recorded.is_none();
        let measured: Vec<usize> = (0..self.stops.len()).filter(|&stop| is_measured(&self.stops[stop])).collect();
        let approach = |stop: usize| self.stops[..stop].iter().rev().find(|before| before.point.is_none());
        let visit = |number: usize| {
            let place = ((number as f64 * GOLDEN).fract() * measured.len() as f64) as usize;
            let stop = measured[place.min(measured.len() - 1)];
            let q = self.stops[stop].q;
            [approach(stop).map_or(q, |way_point| way_point.q), q]
        };
        if measured.is_empty() { Vec::new() } else { (first..first + count).map(visit).collect() }
    }
}

fn checked_points(counts: &[usize]) -> Result<usize, Error> {
    let points = counts.iter().try_fold(1_usize, |product, &count| product.checked_mul(count));
    points
        .filter(|&points| points <= SCAN_POINTS)
        .ok_or_else(|| error!("the plan has more than {SCAN_POINTS} points: widen its spacing"))
}

/// Places of a grid with the last axis fastest, every other row backwards, each with its number in plain order.
fn serpentine(counts: &[usize]) -> impl Iterator<Item = (usize, Vec<usize>)> {
    let counts = counts.to_vec();
    let total: usize = counts.iter().product();
    (0..total).map(move |index| {
        let mut place = vec![0; counts.len()];
        let mut rest = index;
        for (axis, count) in counts.iter().enumerate().rev() {
            place[axis] = rest % count;
            rest /= count;
            // `rest` numbers the row: odd rows run backwards.
            if rest % 2 == 1 {
                place[axis] = count - 1 - place[axis];
            }
        }
        let number = place.iter().zip(&counts).fold(0, |number, (k, count)| number * count + k);
        (number, place)
    })
}

fn workspace(plan: &WorkspacePlan, spec: &ScanSpec, chain: &Chain) -> Result<Plan, Error> {
    let node = spec.plan.node(chain.nodes.len());
    let counts = [plan.across[0].count, plan.across[1].count];
    let depth = plan.depth;
    let points = checked_points(&[counts[0], counts[1], depth.count])?;
    let mut result = Plan { stops: Vec::new(), points, histories: 0, unreachable: Vec::new() };
    let lines = counts[0] * counts[1];
    let recorded = spec.history.as_ref().map_or(0, |history| ((history.share * lines as f64) as usize).max(1));
    // The lines in the middle of so many equal parts.
    let is_recorded = |line: usize| (line + 1) * recorded / lines > line * recorded / lines;
    let middles = chain.joints.iter().map(|joint| joint.limits[0].midpoint(joint.limits[1]));
    let mut near: JointVector = middles.collect();
    for (line, place) in serpentine(&counts) {
        let (mut bottom, mut last) = (None, None);
        let offset = |axis: usize| plan.across[axis].direction * (place[axis] as f64 * plan.across[axis].spacing);
        let top = plan.start + offset(0) + offset(1);
        let mut go = |position: DVec3, point: Option<usize>, recorded: Option<PressRecord>, stops: &mut Vec<Stop>| {
            let found = reach(chain, node, position, &near);
            if let Some(q) = found {
                near = q;
                stops.push(Stop { q, point, recorded });
            }
            found.is_some()
        };
        let back = top - depth.direction * plan.clearance;
        go(back, None, None, &mut result.stops);
        for level in 0..depth.count {
            let point = line * depth.count + level;
            let position = top + depth.direction * (level as f64 * depth.spacing);
            if go(position, Some(point), None, &mut result.stops) {
                // Not the last level: a grid ends before the last measurement.
                bottom = Some(last.replace(position).unwrap_or(position));
            } else {
                result.unreachable.push(point);
            }
        }
        go(back, None, None, &mut result.stops);
        let (Some(history), Some(bottom)) = (spec.history.as_ref().filter(|_| is_recorded(line)), bottom) else {
            continue;
        };
        // The device's own viscous friction is least in slow strokes.
        let slowest = history.speeds.iter().copied().fold(f64::INFINITY, f64::min);
        for (press, &speed) in history.speeds.iter().enumerate() {
            let point = Some(points + result.histories);
            result.histories += 1;
            let mut record = |position: DVec3, speed: f64, hold: f64| {
                go(position, point, Some(PressRecord { speed, hold }), &mut result.stops);
            };
            record(bottom, speed, history.hold);
            if press == 0 && history.stroke > 0.0 {
                for side in plan.across.iter().flat_map(|axis| STROKES.map(|share| axis.direction * share)) {
                    record(bottom + side * history.stroke, slowest, 0.0);
                }
            }
            record(back, speed, 0.0);
        }
    }
    if result.unreachable.len() == points {
        return Err(NOTHING_REACHABLE.into());
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_serpentine_visits_every_place_once_and_steps_to_neighbours() {
        let places: Vec<(usize, Vec<usize>)> = serpentine(&[3, 4, 5]).collect();
        let mut numbers: Vec<usize> = places.iter().map(|(number, _)| *number).collect();
        for pair in places.windows(2) {
            let steps: usize = pair[0].1.iter().zip(&pair[1].1).map(|(a, b)| a.abs_diff(*b)).sum();
            assert_eq!(steps, 1, "{pair:?}");
        }
        numbers.sort_unstable();
        assert!(numbers.into_iter().eq(0..60));
    }
}
