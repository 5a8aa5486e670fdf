//! The meaning of an export's arrays: the unit of each, and its axes.

use super::super::{Axis, Grid, Stored, stored::units};

/// Unit and axes of an array.
pub(super) struct Meaning {
    /// As SI writes it; `1` for numbers without a unit. Where joints are of both kinds, one unit for each kind:
    /// `N m, N`.
    pub(super) unit: String,
    /// The axes, slowest first. Those of the grid come first and are called as its joints.
    pub(super) axes: Vec<String>,
    /// How many of them are the grid's.
    pub(super) of_grid: usize,
}

impl Meaning {
    /// That of an array of a dataset over `grid`.
    pub(super) fn of(array: Stored, grid: &Grid) -> Self {
        let (axes, of_grid) = array.axes(grid);
        Self { unit: array.unit(grid), axes, of_grid }
    }

    /// That of the configurations `q`.
    pub(super) fn of_configurations(grid: &Grid) -> Self {
        Self { unit: units(grid, |axis| axis.unit.clone()), ..Self::of(Stored::Torque, grid) }
    }
}

/// Name of the array with the grid lines of axis `k`.
pub(super) fn lines_name(k: usize) -> String {
    format!("q{}", k + 1)
}

/// Returns the coordinates of the grid lines of `axis`.
pub(super) fn lines(axis: &Axis) -> impl ExactSizeIterator<Item = f64> + '_ {
    (0..axis.count).map(|line| axis.coordinate(line))
}
