//! Every second, or every fourth, line of a grid: its points, its cells, and what lies halfway between.
//!
//! Points bear the numbers of the whole grid. A cell is named by its lowest corner; its 2^d corners belong to the level, and
//! the other 3^d - 2^d points of three lines along each axis are halfway: the next finer level has them, too.

use crate::{
    JointVector, MAX_JOINTS,
    dataset::{Axis, Grid},
};

/// Lines of a grid whose numbers are multiples of a stride, an even one that divides the number of steps of each axis.
pub(super) struct Level<'a> {
    grid: &'a Grid,
    stride: usize,
    /// How far apart neighbours along each axis are in the grid's numbering.
    pitches: [usize; MAX_JOINTS],
}

impl<'a> Level<'a> {
    pub fn new(grid: &'a Grid, stride: usize) -> Self {
        let mut pitches = [1; MAX_JOINTS];
        for a in (1..grid.joints()).rev() {
            pitches[a - 1] = pitches[a] * grid.axes[a].count;
        }
        Self { grid, stride, pitches }
    }

    /// The level as a grid of its own.
    pub fn coarse(&self) -> Grid {
        let axis = |axis: &Axis| Axis {
            step: axis.step * self.stride as f64,
            count: (axis.count - 1) / self.stride + 1,
            ..axis.clone()
        };
        Grid { axes: self.grid.axes.iter().map(axis).collect() }
    }

    /// Its points, in the order of [`Level::coarse`].
    pub fn points(&self) -> impl Iterator<Item = usize> + '_ {
        self.multiples(1)
    }

    /// Its cells, by their lowest corners, ascending.
    pub fn cells(&self) -> impl Iterator<Item = usize> + '_ {
        self.multiples(0)
    }

    /// Points whose lines are multiples of the stride, without the last `1 - ends` of each axis.
    fn multiples(&self, ends: usize) -> impl Iterator<Item = usize> + '_ {
        let counts = self.grid.axes.iter().map(move |axis| (axis.count - 1) / self.stride + ends);
        let counts: Vec<usize> = counts.collect();
        (0..counts.iter().product()).map(move |mut number| {
            let mut point = 0;
            for (count, pitch) in counts.iter().zip(self.pitches).rev() {
                point += number % count * self.stride * pitch;
                number /= count;
            }
            point
        })
    }

    /// Corners of a cell.
    pub fn corners(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        self.lines(cell, 2, self.stride).map(|(point, _)| point)
    }

    /// The centre of a cell.
    pub fn centre(&self, cell: usize) -> usize {
        cell + self.stride / 2 * self.pitches[..self.grid.joints()].iter().sum::<usize>()
    }

    /// The points halfway between the corners of a cell, ascending.
    pub fn halfway(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        self.lines(cell, 3, self.stride / 2).filter(|(_, halfway)| *halfway).map(|(point, _)| point)
    }

    /// Points on `count` lines along each axis from `cell` on, `apart` steps apart; and whether a middle line is among theirs.
    fn lines(&self, cell: usize, count: usize, apart: usize) -> impl Iterator<Item = (usize, bool)> + '_ {
        let joints = self.grid.joints();
        (0..count.pow(joints as u32)).map(move |mut number| {
            let (mut point, mut halfway) = (cell, false);
            for pitch in self.pitches[..joints].iter().rev() {
                point += number % count * apart * pitch;
                halfway |= count == 3 && number % count == 1;
                number /= count;
            }
            (point, halfway)
        })
    }

    /// The level's points around a point halfway: the two, four, .. that it lies in the middle of.
    pub fn around(&self, point: usize) -> impl Iterator<Item = usize> + '_ {
        let line = |a: usize| point / self.pitches[a] % self.grid.axes[a].count;
        let between: Vec<usize> = (0..self.grid.joints()).filter(|&a| !line(a).is_multiple_of(self.stride)).collect();
        (0..1_usize << between.len()).map(move |sides| {
            between.iter().enumerate().fold(point, |around, (k, &a)| {
                let half = self.stride / 2 * self.pitches[a];
                if sides >> k & 1 == 1 { around + half } else { around - half }
            })
        })
    }

    /// The cells that a point lies in, or between.
    pub fn cells_at(&self, point: usize) -> impl Iterator<Item = usize> + '_ {
        let lows = |a: usize| {
            let (count, pitch) = (self.grid.axes[a].count, self.pitches[a]);
            let line = point / pitch % count;
            let low = line / self.stride * self.stride;
            let below = low.checked_sub(self.stride).filter(|_| low == line);
            let here = Some(low).filter(|&low| low + 1 < count);
            [below, here].into_iter().flatten().map(move |low| low * pitch)
        };
        let cells = (0..self.grid.joints()).fold(vec![0], |cells: Vec<usize>, a| {
            cells.iter().flat_map(|cell| lows(a).map(move |low| cell + low)).collect()
        });
        cells.into_iter()
    }

    /// Configuration of a point.
    pub fn configuration(&self, point: usize) -> JointVector {
        self.grid.configuration(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::synthetic::grid;

    #[test]
    fn every_point_of_a_grid_belongs_to_a_level_or_lies_halfway_in_one() {
        let grid = grid(&[(0.0, 0.1, 9), (1.0, 0.2, 5), (-1.0, 0.5, 5)]);
        let mut seen = vec![0; grid.points()];
        Level::new(&grid, 4).points().for_each(|point| seen[point] += 1);
        for stride in [4, 2] {
            let level = Level::new(&grid, stride);
            let mut halfway: Vec<usize> = level.cells().flat_map(|cell| level.halfway(cell)).collect();
            halfway.sort_unstable();
            halfway.dedup();
            halfway.iter().for_each(|&point| seen[point] += 1);
            // In the middle of what is around them.
            for &point in &halfway {
                let around: Vec<JointVector> = level.around(point).map(|p| level.configuration(p)).collect();
                assert!(around.len() > 1);
                for (a, x) in level.configuration(point).iter().enumerate() {
                    let mean = around.iter().map(|q| q[a]).sum::<f64>() / around.len() as f64;
                    assert!((mean - x).abs() < 1e-12, "joint {a}: {mean} for {x}");
                }
            }
            for cell in level.cells() {
                assert!(level.halfway(cell).any(|point| point == level.centre(cell)));
                assert!(level.halfway(cell).chain(level.corners(cell)).all(|p| level.cells_at(p).any(|c| c == cell)));
                assert_eq!(level.around(level.centre(cell)).count(), level.corners(cell).count());
            }
            let shared = |point: usize| level.cells_at(point).count();
            assert_eq!((shared(0), shared(level.centre(0))), (1, 1));
            assert_eq!(shared(level.corners(0).last().unwrap()), if stride == 4 { 2 } else { 8 });
            let coarse = level.coarse();
            assert!(level.points().enumerate().all(|(k, p)| coarse.configuration(k) == level.configuration(p)));
            assert_eq!(coarse.points(), level.points().count());
        }
        assert!(seen.iter().all(|count| *count == 1));
    }
}
