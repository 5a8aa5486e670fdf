//! Why a dataset cannot be rendered, and what to do.

use crate::{JointVector, memory::Shortage};

/// A dataset cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FieldError {
    /// Its grid is none.
    #[error("{0}")]
    Grid(String),
    /// A column's length does not fit the grid.
    #[error("the dataset's {column} has {found} entries where its grid asks for {expected}: bake it again")]
    Length {
        /// Name of the column.
        column: &'static str,
        /// Entries that the grid asks for.
        expected: usize,
        /// Entries found.
        found: usize,
    },
    /// A torque, an energy or a gap is not a number, or beyond anything physical.
    #[error("the dataset's {column} at grid point {point} is {value}: bake it again")]
    Value {
        /// Name of the column.
        column: &'static str,
        /// Number of the grid point.
        point: usize,
        /// The value found.
        value: f64,
    },
    /// Not a single grid point was computed.
    #[error("no grid point of the dataset was computed: finish the bake first")]
    Empty,
    /// The interpolation needs a column that scanned datasets do not have.
    #[error(
        "the dataset holds no {column}, as datasets of real objects do not, and the scene asks for interpolation = \
         \"{interpolation}\", which needs it: set interpolation = \"linear\" in [haptics], or bake a virtual object"
    )]
    Missing {
        /// Name of the column.
        column: &'static str,
        /// The interpolation, as the scene names it.
        interpolation: &'static str,
    },
    /// The interpolation needs more memory than is left.
    #[error(
        "the interpolation: {0}; or set interpolation = \"linear\" in [haptics], which takes less, \
         or take a coarser grid"
    )]
    Memory(#[from] Shortage),
    /// The threshold is not in 0 <= Ith < 1.
    #[error("the contact index threshold is {0}; it must be at least 0 and below 1 (the paper uses 0.5)")]
    Threshold(f64),
    /// The slope is not one positive number per joint.
    #[error("the boundary slope is {0:?}; it must be one positive number of N m/rad per joint of the dataset")]
    Slope(JointVector),
}
