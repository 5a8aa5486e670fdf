//! The configurations that a scan visits, in order.
//!
//! A workspace plan goes line by line: along a line into the object, back out to the clearance, across to the next
//! line, every other row of lines backwards so that neighbours in time are neighbours in space. A plan over joints goes
//! through its grid row by row, every other row backwards.

use crate::proxy::inverse_kinematics::reach;
use crate::{
    Error, JointVector, error,
    proxy::Chain,
    scene::{PlanSpec, WorkspacePlan},
};
use glam::DVec3;

/// Most points of a scan: at a second a point, eleven days.
const SCAN_POINTS: usize = 1_000_000;

/// What is wrong with a plan of which nothing can be reached.
const NOTHING_REACHABLE: &str =
    "the joints reach no point of the plan: check its start, directions and the joints' limits";

/// One stop of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Commanded configuration (rad or m).
    pub q: JointVector,
    /// Number of the plan's point, in the order of the specification; `None` for a way point at which nothing is
    /// measured.
    pub point: Option<usize>,
}

/// The stops of a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// In the order of the visit.
    pub stops: Vec<Stop>,
    /// Number of points to be measured.
    pub points: usize,
    /// Points that the joints do not reach; they are not visited.
    pub unreachable: Vec<usize>,
}

impl Plan {
    /// The plan of `spec` for `chain`.
    ///
    /// # Errors
    /// When it has too many points, or the joints reach none of them.
    pub fn new(spec: &PlanSpec, chain: &Chain) -> Result<Self, Error> {
        let plan = match spec {
            PlanSpec::Workspace(plan) => workspace(plan, chain, spec.node(chain.nodes.len()))?,
            PlanSpec::Joints(grid) => {
                let counts: Vec<usize> = grid.axes.iter().map(|axis| axis.count).collect();
                let points = checked_points(&counts)?;
                let configuration = |place: &[usize]| {
                    let values: Vec<f64> =
                        grid.axes.iter().zip(place).map(|(axis, k)| axis.start + *k as f64 * axis.step).collect();
                    JointVector::from_slice(&values)
                };
                let stop = |(point, place): (usize, Vec<usize>)| Stop { q: configuration(&place), point: Some(point) };
                Self { stops: serpentine(&counts).map(stop).collect(), points, unreachable: Vec::new() }
            }
        };
        if plan.stops.is_empty() {
            return Err(NOTHING_REACHABLE.into());
        }
        Ok(plan)
    }
}

impl Plan {
    /// `count` points of the plan, spread over it evenly however many follow (the golden ratio's multiples), from
    /// number `first` of that order on: for each the way point that leads there, or itself, and its configuration.
    #[must_use]
    pub fn spread(&self, first: usize, count: usize) -> Vec<[JointVector; 2]> {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let measured: Vec<usize> = (0..self.stops.len()).filter(|&stop| self.stops[stop].point.is_some()).collect();
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

fn workspace(plan: &WorkspacePlan, chain: &Chain, node: usize) -> Result<Plan, Error> {
    let counts = [plan.across[0].count, plan.across[1].count];
    let depth = plan.depth;
    let points = checked_points(&[counts[0], counts[1], depth.count])?;
    let mut result = Plan { stops: Vec::new(), points, unreachable: Vec::new() };
    let mut near = JointVector::zeros(chain.degrees_of_freedom());
    for (q, joint) in near.iter_mut().zip(&chain.joints) {
        *q = joint.limits[0].midpoint(joint.limits[1]);
    }
    for (line, place) in serpentine(&counts) {
        let offset = |axis: usize| plan.across[axis].direction * (place[axis] as f64 * plan.across[axis].spacing);
        let top = plan.start + offset(0) + offset(1);
        let mut visit = |position: DVec3, point: Option<usize>, stops: &mut Vec<Stop>| {
            let found = reach(chain, node, position, &near);
            if let Some(q) = found {
                near = q;
                stops.push(Stop { q, point });
            }
            found.is_some()
        };
        let back = top - depth.direction * plan.clearance;
        visit(back, None, &mut result.stops);
        for level in 0..depth.count {
            let point = line * depth.count + level;
            let position = top + depth.direction * (level as f64 * depth.spacing);
            if !visit(position, Some(point), &mut result.stops) {
                result.unreachable.push(point);
            }
        }
        visit(back, None, &mut result.stops);
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
