//! The results of all grid points, read point by point in any order: in memory, or in the part on the disk.

use super::tile::{PointResult, Shape, Tile};
use crate::contact::{NodeForce, Status};
use std::{collections::BTreeMap, ops::Range};

/// Results of all points of a grid, with the new ones of single points over them.
pub(super) struct Table<'a> {
    shape: Shape,
    /// In the order of the points.
    tiles: Vec<Tile<'a>>,
    pub replaced: Replaced,
}

/// New results of single points, by number of the grid point: a tile each.
pub(super) type Replaced = BTreeMap<usize, Tile<'static>>;

impl<'a> Table<'a> {
    /// The points of `tiles`, which follow one another from point 0 on.
    pub fn new(shape: Shape, tiles: Vec<Tile<'a>>) -> Self {
        Self { shape, tiles, replaced: Replaced::new() }
    }

    /// Status of a point.
    pub fn status(&self, point: usize) -> Status {
        let (tile, row) = self.at(point);
        tile.status(row)
    }

    /// Result of a point.
    pub fn result(&self, point: usize) -> PointResult {
        let (tile, row) = self.at(point);
        tile.result(row, self.shape.joints)
    }

    /// Forces on the object's nodes at a point, ascending by node (N).
    pub fn forces(&self, point: usize) -> Vec<NodeForce> {
        let (tile, row) = self.at(point);
        tile.forces(row)
    }

    /// Result of a point as it was before it was replaced.
    pub fn before(&self, point: usize) -> PointResult {
        let tile = self.tile(point);
        tile.result(point - tile.first, self.shape.joints)
    }

    /// The tiles that hold `points`, in their order, and which of a tile's points those are.
    pub fn runs(&self, points: Range<usize>) -> impl Iterator<Item = (&Tile<'_>, Range<usize>)> {
        let Range { start: mut point, end } = points;
        std::iter::from_fn(move || {
            let new = self.replaced.range(point..end).next();
            let (tile, rows) = match new {
                _ if point >= end => return None,
                Some((&first, row)) if first == point => (row, 0..1),
                _ => {
                    let (tile, end) = (self.tile(point), new.map_or(end, |(&first, _)| first));
                    (tile, point - tile.first..tile.points().min(end - tile.first))
                }
            };
            point += rows.len();
            Some((tile, rows))
        })
    }

    fn tile(&self, point: usize) -> &Tile<'a> {
        &self.tiles[self.tiles.partition_point(|tile| tile.first <= point) - 1]
    }

    /// The tile with the result of a point, and which of its points that is.
    fn at(&self, point: usize) -> (&Tile<'_>, usize) {
        if let Some(new) = self.replaced.get(&point) {
            return (new, 0);
        }
        let tile = self.tile(point);
        (tile, point - tile.first)
    }
}
