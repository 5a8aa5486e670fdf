//! The way on which the hand is led to where a motion begins: through free space, where there is such a way.
//!
//! Dijkstra's algorithm over the grid's points finds the way; a point in contact costs as much as a detour of
//! [`CONTACT_COST`] points. Stretches are then replaced by straight lines where these touch no more.

use crate::{
    JointVector,
    contact::Status,
    dataset::{Dataset, Grid},
    device::Motion,
    scene::Waypoint,
};
use std::{cmp::Reverse, collections::BinaryHeap};

/// Time in which the hand is led along each straight line of the way (s).
pub const LEAD_IN: f64 = 0.8;

/// Cost of a step to a point that is not free, in steps through free space: any detour is shorter.
const CONTACT_COST: u64 = 1 << 20;

/// Points of the largest grid that is searched: a quarter of a second on one core.
const LARGEST_GRID: usize = 1 << 19;

/// Returns a smooth motion from `from` to `to` through the free space of `dataset`; straight without a dataset, or in
/// a grid too large to be searched. None if the two have not the same number of finite coordinates.
pub fn way(dataset: Option<&Dataset>, from: &JointVector, to: &JointVector) -> Option<Motion> {
    let searched = dataset.filter(|dataset| dataset.grid.points() <= LARGEST_GRID);
    let mut corners = vec![*from];
    corners.extend(searched.map(|dataset| between(dataset, from, to)).unwrap_or_default());
    corners.push(*to);
    let waypoints: Vec<Waypoint> =
        corners.iter().enumerate().map(|(k, &q)| Waypoint { time: k as f64 * LEAD_IN, q }).collect();
    Motion::through(&waypoints, from.len()).ok()
}

/// Returns the corners of the way between `from` and `to`.
fn between(dataset: &Dataset, from: &JointVector, to: &JointVector) -> Vec<JointVector> {
    let grid = &dataset.grid;
    let [Some(first), Some(last)] = [from, to].map(|q| grid.nearest(&grid.clamp(q))) else { return Vec::new() };
    let mut way = vec![*from];
    way.extend(cheapest(dataset, first, last).into_iter().map(|point| grid.configuration(point)));
    way.push(*to);
    let (mut corners, mut here) = (Vec::new(), 0);
    loop {
        let is_straight = |&there: &usize| match touched(dataset, way[here..=there].iter().copied()) {
            0 => is_line_free(dataset, &way[here], &way[there]),
            least => touched(dataset, line(grid, &way[here], &way[there])) <= least,
        };
        let farthest = (here + 2..way.len()).rev().find(is_straight);
        here = farthest.unwrap_or(here + 1);
        if here + 1 >= way.len() {
            return corners;
        }
        corners.push(way[here]);
    }
}

/// Returns the points of the cheapest way along grid lines, both ends included.
fn cheapest(dataset: &Dataset, first: usize, last: usize) -> Vec<usize> {
    let grid = &dataset.grid;
    let mut cost = vec![u64::MAX; grid.points()];
    let mut before = vec![first; grid.points()];
    let mut queue = BinaryHeap::from([(Reverse(0), first)]);
    cost[first] = 0;
    while let Some((Reverse(so_far), point)) = queue.pop() {
        if point == last {
            break;
        }
        if so_far > cost[point] {
            continue;
        }
        for next in grid.neighbours(point).flatten().flatten() {
            let step = if dataset.status(next) == Status::Free { 1 } else { CONTACT_COST };
            if so_far + step < cost[next] {
                (cost[next], before[next]) = (so_far + step, point);
                queue.push((Reverse(so_far + step), next));
            }
        }
    }
    let mut way = vec![last];
    while let Some(&point) = way.last().filter(|point| **point != first) {
        way.push(before[point]);
    }
    way.reverse();
    way
}

/// Returns configurations on the line from `from` to `to`, two or more a grid step.
fn line(grid: &Grid, from: &JointVector, to: &JointVector) -> impl Iterator<Item = JointVector> {
    let lines = grid.axes.iter().enumerate().map(|(joint, axis)| (to[joint] - from[joint]).abs() / axis.step);
    let samples = 2 * lines.fold(1.0, f64::max).ceil() as usize;
    let (from, to) = (*from, *to);
    (0..=samples).map(move |sample| {
        let mut q = from;
        for (x, end) in q.iter_mut().zip(to.iter()) {
            *x += sample as f64 / samples as f64 * (end - *x);
        }
        q
    })
}

/// Returns how many grid points in contact are the nearest one of some of `configurations`, which lie in a row.
fn touched(dataset: &Dataset, configurations: impl Iterator<Item = JointVector>) -> usize {
    let grid = &dataset.grid;
    let mut points: Vec<usize> = configurations.filter_map(|q| grid.nearest(&grid.clamp(&q))).collect();
    points.dedup();
    points.iter().filter(|point| dataset.status(**point) != Status::Free).count()
}

/// Whether all corners of all cells that the line from `from` to `to` leads through are free.
fn is_line_free(dataset: &Dataset, from: &JointVector, to: &JointVector) -> bool {
    let grid = &dataset.grid;
    line(grid, from, to).all(|q| {
        let cell = grid.locate(&q);
        cell.corners().all(|(point, weight)| weight == 0.0 || dataset.status(point) == Status::Free)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Axis;

    /// A plane of 21 x 21 points, a square in its middle in contact.
    fn plane() -> Dataset {
        let axis = |name: &str| Axis { name: name.into(), unit: "rad".into(), start: -1.0, step: 0.1, count: 21 };
        let grid = Grid { axes: vec![axis("a"), axis("b")] };
        let inside = |point| grid.configuration(point).iter().all(|x| x.abs() < 0.55);
        let status = (0..441).map(|point| if inside(point) { Status::Contact } else { Status::Free } as u8).collect();
        Dataset::bare(grid, vec![0.0; 882], status)
    }

    fn is_within(motion: &Motion, time: f64, half: f64) -> bool {
        motion.at(time).0.iter().all(|x| x.abs() < half)
    }

    #[test]
    fn the_way_from_side_to_side_of_a_square_in_contact_leads_around_it() {
        let [from, to] = [[-0.93, 0.04], [0.88, -0.07]].map(|q| JointVector::from_slice(&q));
        let touches = |motion: &Motion| (0..1000).any(|k| is_within(motion, motion.duration() * k as f64 / 1e3, 0.59));
        let plane = plane();
        let around = way(Some(&plane), &from, &to).unwrap();
        assert!(!touches(&around), "{around:?}");
        assert!(around.duration() <= 4.0 * LEAD_IN, "{around:?}");
        assert_eq!((around.at(0.0).0, around.at(around.duration()).0), (from, to));
        assert!(touches(&way(None, &from, &to).unwrap()), "a straight way would not have shown it");
    }

    #[test]
    fn the_way_out_of_contact_is_the_shortest_and_what_is_free_is_straight() {
        let plane = plane();
        let [inside, outside, corner] = [[0.4, 0.0], [0.9, 0.0], [0.9, 0.9]].map(|q| JointVector::from_slice(&q));
        let out = way(Some(&plane), &inside, &outside).unwrap();
        assert_eq!(out.duration(), LEAD_IN);
        assert!((0..1000).all(|k| out.at(out.duration() * k as f64 / 1e3).0[1].abs() < 1e-12), "{out:?}");
        assert_eq!(way(Some(&plane), &outside, &corner), way(None, &outside, &corner));
    }
}
