//! A shard: every n-th stretch of a grid's points, solved by a process of its own, on whatever machine.
//!
//! The grid's points are cut into stretches of equal length, and n consecutive stretches make a round. A shard has one
//! stretch of each round. Its place within the round is drawn again from round to round: contact is clustered in
//! C-space, and a fixed place could fall on the same lines of the grid every time. The cut depends on the grid and on n
//! alone.
//!
//! A shard's file is a part (`part.rs`) of its points. It is called `.part` until it is whole, so that whoever finds
//! the name without it finds all of its points.

use crate::random::Random;
use serde::{Deserialize, Serialize};
use std::{fmt, ops::Range, str::FromStr};

/// Stretches of a shard where the grid has points enough (1): the points in contact then differ from shard to shard by
/// about a tenth.
const STRETCHES: usize = 64;

/// Fewest points of a stretch (1): enough for the threads of a machine to share them.
const SHORTEST: usize = 64;

/// Most shards of a sweep (1): more than any cluster has tasks.
const MOST: usize = 1_000_000;

/// Extension of a whole shard's file.
pub const EXTENSION: &str = "shard";

/// One of several equal shares of a grid's points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// From 0 to `count` - 1.
    pub index: usize,
    /// Number of shards, at least 1.
    pub count: usize,
}

impl Shard {
    /// All points.
    pub const WHOLE: Self = Self { index: 0, count: 1 };

    /// Checks that there is such a shard.
    ///
    /// # Errors
    /// Problem, in words.
    pub fn check(self) -> Result<(), String> {
        let Self { index, count } = self;
        if index < count && count <= MOST {
            Ok(())
        } else {
            Err(format!("there is no shard {index} of {count}: shards count from 0, and there are at most {MOST}"))
        }
    }

    /// Number of its points, of a grid of `points` points.
    #[must_use]
    pub fn points(self, points: usize) -> usize {
        let length = self.stretch(points);
        let rounds = points.div_ceil(length).div_ceil(self.count);
        let last = rounds.saturating_sub(1);
        last * length + self.of_round(points, last).len()
    }

    /// Returns the rest of the current stretch once the first `done` points of the shard are done; empty at the end.
    pub(super) fn rest(self, points: usize, done: usize) -> Range<usize> {
        let length = self.stretch(points);
        let stretch = self.of_round(points, done / length);
        (stretch.start + done % length).min(stretch.end)..stretch.end
    }

    /// Points of a stretch, at least 1.
    fn stretch(self, points: usize) -> usize {
        if self.count == 1 { points.max(1) } else { (points / self.count / STRETCHES).max(SHORTEST) }
    }

    /// The shard, of as many as this one is of, that has the point `point`.
    pub(super) fn having(self, point: usize, points: usize) -> usize {
        let stretch = point / self.stretch(points);
        (stretch % self.count + self.count - self.turn(stretch / self.count)) % self.count
    }

    /// Returns by how many places shard 0 is behind the first stretch of a round, less than the number of shards.
    fn turn(self, round: usize) -> usize {
        Random::new(round as u64 + 1).between(0.0, self.count as f64) as usize % self.count
    }

    /// The shard's stretch of a round.
    fn of_round(self, points: usize, round: usize) -> Range<usize> {
        let stretch = round * self.count + (self.index + self.turn(round)) % self.count;
        let length = self.stretch(points);
        (stretch * length).min(points)..((stretch + 1) * length).min(points)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').map(|(index, count)| (index.parse::<usize>(), count.parse::<usize>()));
        match numbers {
            Some((Ok(index), Ok(count))) => Self { index, count }.check().map(|()| Self { index, count }),
            _ => Err("give a shard and the number of shards, such as 3/64; shards count from 0".into()),
        }
    }
}

/// Numbers in ascending order as job schedulers take them: `3,7-9`.
#[must_use]
pub fn ranges(numbers: &[usize]) -> String {
    let runs = numbers.chunk_by(|a, b| a + 1 == *b).map(|run| match run {
        [one] => one.to_string(),
        [first, .., last] => format!("{first}-{last}"),
        [] => String::new(),
    });
    runs.collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn all_of(shard: Shard, points: usize) -> Vec<usize> {
        let (mut done, mut found) = (0, Vec::new());
        loop {
            let rest = shard.rest(points, done);
            if rest.is_empty() {
                return found;
            }
            // Not whole stretches, as chunks cut them.
            let taken = rest.len().min(37);
            found.extend(rest.take(taken));
            done += taken;
        }
    }

    #[test]
    fn shards_have_each_point_once() {
        for (points, count) in [(1, 1), (1, 3), (63, 1), (63, 2), (5000, 7), (100_000, 12), (4096 * 64, 64)] {
            let mut all = BTreeSet::new();
            let mut sizes = Vec::new();
            for index in 0..count {
                let shard = Shard { index, count };
                let own = all_of(shard, points);
                assert!(own.is_sorted() && own.len() == shard.points(points), "{shard} of {points}");
                assert!(own.iter().all(|&point| shard.having(point, points) == index), "{shard} of {points}");
                sizes.push(own.len());
                all.extend(own);
            }
            assert_eq!(sizes.iter().sum::<usize>(), points, "no point twice");
            assert!(all.into_iter().eq(0..points), "{points} points, {count} shards");
        }
    }

    /// Contact in a slab of C-space, on a grid whose lines are as many as the shards.
    #[test]
    fn contact_is_spread_evenly_over_shards() {
        let (points, count) = (64 * 64 * 64, 64);
        let touching = |point: &usize| point / 64 % 64 < 16;
        let shares: Vec<usize> = (0..count)
            .map(|index| all_of(Shard { index, count }, points).iter().filter(|p| touching(p)).count())
            .collect();
        let mean = points / 4 / count;
        assert!(shares.iter().all(|share| (mean / 2..2 * mean).contains(share)), "{shares:?}, {mean} on average");
        // The comparison sees what a fixed place would give: all or nothing.
        let fixed = |index: usize| (0..points).filter(|p| p / 64 % count == index).filter(touching).count();
        assert_eq!([fixed(0), fixed(20)], [4 * mean, 0]);
    }

    #[test]
    fn numbers_are_written_as_schedulers_take_them() {
        assert_eq!(ranges(&[3, 7, 8, 9]), "3,7-9");
        assert_eq!(ranges(&[0, 1, 3, 4, 9]), "0-1,3-4,9");
        assert_eq!(ranges(&[]), "");
        assert_eq!("3/64".parse(), Ok(Shard { index: 3, count: 64 }));
        for wrong in ["64/64", "3", "a/4", "1/0", "-1/4", ""] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
