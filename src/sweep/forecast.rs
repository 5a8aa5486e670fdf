//! The time that a sweep is going to take, from a sample of its points.
//!
//! Points of the grid are drawn at random. Those that are not free with their neighbours are solved by the sweep's own
//! backend. The fraction in contact, the number of contact forces and the time per point follow.

use super::{Backend, Sweep, tile::Shape};
use crate::random::Random;
use serde::Serialize;
use std::time::Instant;

/// Number of points that are solved at once.
const PORTION: usize = 64;

/// Maximum number of portions: where most points are to be solved, the fraction in contact is then known to some
/// hundredths.
const PORTIONS: usize = 8;

/// Maximum number of points that are drawn: where little is in contact, its fraction is known better, too.
const DRAWN: usize = 16 * PORTION * PORTIONS;

/// Time after which no further portion is solved (s): expensive contact is sampled less.
const LONGEST: f64 = 0.5;

/// Grids with fewer points are not sampled: they are done as soon.
const FEWEST_POINTS: usize = 2 * PORTION * PORTIONS;

/// Seed of the sample.
const SEED: u64 = 0x2545_f491_4f6c_dd1d;

/// Expected cost of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// Fraction of the points in contact (1).
    pub contact_fraction: f64,
    /// Solving all points from rest, without the search for lower equilibria and the measurement of the error; absent
    /// for a GPU, whose time for few points says nothing of many (s).
    pub seconds: Option<f64>,
    /// The search for lower equilibria and the measurement of the error that follow, at most; likewise (s).
    pub after: Option<f64>,
    /// The dataset on disk (bytes).
    pub disk: usize,
    /// The results on disk while they are collected, with the forces from which lower equilibria are searched for
    /// (bytes).
    pub part: usize,
    /// Random points that were sampled; some may have been drawn twice.
    pub sampled: usize,
}

impl Sweep<'_> {
    /// Samples the sweep's points with `backend`, and keeps the forecast that follows. Returns the time in which the
    /// backend solves the whole grid, zero where that is small or not known (s). `is_timed`: whether a sample's time counts.
    ///
    /// # Errors
    /// Those of the backend.
    pub fn predict<B: Backend>(&mut self, backend: &mut B, is_timed: bool) -> Result<f64, B::Error> {
        if self.binding.grid.points() >= FEWEST_POINTS {
            self.forecast = Some(self.sampled(backend, is_timed)?);
        }
        Ok(self.forecast.and_then(|forecast| forecast.seconds).unwrap_or(0.0))
    }

    /// What follows from a sample of the points, however few there are.
    pub(super) fn sampled<B: Backend>(&self, backend: &mut B, is_timed: bool) -> Result<Forecast, B::Error> {
        let points = self.binding.grid.points();
        let mut random = Random::new(SEED);
        let most = DRAWN.min(points);
        let free_space = self.free_space();
        let mut free_space = free_space.as_ref().map(|free_space| (free_space, free_space.proximity()));
        let (mut sampled, mut touching, mut contacts) = (0, 0, 0);
        let (mut solving, start) = (0.0, Instant::now());
        for _ in 0..PORTIONS {
            let mut portion = Vec::new();
            while portion.len() < PORTION && sampled < most && start.elapsed().as_secs_f64() < LONGEST {
                let point = (random.between(0.0, points as f64) as usize).min(points - 1);
                let is_free =
                    free_space.as_mut().is_some_and(|(space, proximity)| space.is_surrounded(proximity, point));
                if !is_free {
                    portion.push(self.binding.grid.configuration(point));
                }
                sampled += 1;
            }
            if portion.is_empty() {
                break;
            }
            let begin = Instant::now();
            for equilibrium in backend.solve(&portion)? {
                touching += usize::from(equilibrium.status.is_in_contact());
                contacts += equilibrium.forces.len();
            }
            solving += begin.elapsed().as_secs_f64();
        }
        let per_sample = points as f64 / sampled.max(1) as f64;
        let seconds = per_sample * solving;
        // Few searches for a lower equilibrium take longer than a solution from rest.
        let searched = if self.lowest.is_some() { touching } else { 0 };
        let measured = self.error.map_or(0, |error| error.solutions((per_sample * touching as f64) as usize));
        let after = seconds * (searched as f64 + measured as f64 / per_sample) / touching.max(1) as f64;
        let bytes = |shape: Shape| {
            let contacts = if shape.extras.forces { (per_sample * contacts as f64).round() as usize } else { 0 };
            shape.size(points, contacts)
        };
        Ok(Forecast {
            contact_fraction: touching as f64 / sampled.max(1) as f64,
            seconds: is_timed.then_some(seconds),
            after: is_timed.then_some(after),
            disk: bytes(self.stored()),
            part: bytes(self.binding.shape),
            sampled,
        })
    }
}
