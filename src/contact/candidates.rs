//! Triangles of which one is closest to a proxy node, wherever the surface moves to: listed from the tree of boxes at rest, and
//! looked at again only when the surface has travelled far enough for them to have come to the node.

use super::detection::Closest;
use super::features::Features;
use super::model::Model;
use super::travel::Travel;
use crate::tolerances::TRAVEL_ROUNDING;
use glam::DVec3;

/// Triangles are listed that were farther at rest than they need be by this factor, so that they need not be listed again
/// whenever the surface moves on.
const LISTED_SHARE: f64 = 1.25;

/// A triangle that may be closest.
#[derive(Clone, Copy)]
struct Candidate {
    triangle: u32,
    /// How far the surface must have travelled before it can touch the node [m].
    due: f64,
}

impl Candidate {
    /// A lower bound of its distance, the surface having `travelled` so far [m].
    fn at_least(&self, travelled: f64) -> f64 {
        if self.due > travelled { self.due - travelled } else { 0.0 }
    }
}

/// Which candidates are those of one node.
#[derive(Clone, Copy, Default)]
pub struct Listed {
    /// All triangles that were nearer at rest are among them, except for the one that was closest then [m].
    within: f64,
    from: usize,
    to: usize,
}

impl Listed {
    /// None, as a node at the distance `distance` from the surface at rest needs none while nothing moves [m].
    #[must_use]
    pub fn none(distance: f64) -> Self {
        Self { within: distance, from: 0, to: 0 }
    }
}

/// The candidates of all nodes.
pub struct Candidates {
    /// How far the surface has come.
    pub travel: Travel,
    all: Vec<Candidate>,
}

impl Candidates {
    /// None, on the surface of `model` at rest.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self { travel: Travel::new(model), all: Vec::new() }
    }

    /// Forgets all, and starts anew from the surface at rest.
    pub fn restart(&mut self) {
        self.travel.restart();
        self.all.clear();
    }

    /// Sees to it that `listed` has all triangles that can be within `wanted` of the node at `x` now, except for the one that was
    /// closest at rest if nothing has moved [m].
    pub fn list(&mut self, model: &Model, x: DVec3, wanted: f64, listed: &mut Listed) {
        let Travel { moved, travelled, .. } = self.travel;
        let needed = wanted + moved;
        if listed.within >= needed {
            return;
        }
        let (within, from) = (LISTED_SHARE * needed, self.all.len());
        let reach = within * within;
        model.bounds.search(x, reach, |triangle, square| {
            self.all.push(Candidate { triangle, due: square.sqrt() + (travelled - moved) });
            reach
        });
        *listed = Listed { within, from, to: self.all.len() };
    }

    /// Takes for `closest`, which is on the triangle that was closest last, the closest feature among those listed; takes in what a
    /// node with a radius feels.
    pub fn find_closest(
        &mut self,
        model: &Model,
        x: DVec3,
        listed: Listed,
        positions: &[DVec3],
        mut felt: Option<(f64, &mut Features)>,
        closest: &mut Closest,
    ) {
        let travelled = self.travel.travelled;
        let slack = model.bounds.slack(x);
        let last = closest.triangle;
        let reach_squared = felt.as_ref().map_or(0.0, |(radius, _)| radius * radius);
        for candidate in &mut self.all[listed.from..listed.to] {
            let nearest = candidate.at_least(travelled);
            let nearest = nearest * nearest - slack;
            let felt = felt.as_mut().filter(|_| nearest < reach_squared);
            if felt.is_none() && (nearest > closest.distance_squared || candidate.triangle == last) {
                continue;
            }
            let (point, distance_squared) = closest.consider(x, positions, &model.object.triangles, candidate.triangle);
            candidate.due = (distance_squared.sqrt() + travelled) * (1.0 - TRAVEL_ROUNDING);
            if let Some((_, features)) = felt
                && distance_squared < reach_squared
            {
                features.push(candidate.triangle, point);
            }
        }
    }

    /// Those listed that may be within `reach` [m].
    pub fn within(&self, listed: Listed, reach: f64) -> impl Iterator<Item = u32> {
        let travelled = self.travel.travelled;
        let near = move |candidate: &&Candidate| candidate.at_least(travelled) <= reach;
        self.all[listed.from..listed.to].iter().filter(near).map(|candidate| candidate.triangle)
    }
}
