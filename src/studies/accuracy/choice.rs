//! For a given error: which spacing and interpolation, and what it costs; and what limits the accuracy of a scene.

use super::{Accuracy, Row, Study};
use crate::sweep::spacing::order;
use serde::Serialize;
use std::cmp::Ordering;

/// Errors that are asked for, relative to the rms of the torque (1).
const TARGETS: [f64; 7] = [0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01];

/// The grid to take for one error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Offer {
    /// Relative to the rms of the torque (1).
    pub target: f64,
    /// Interpolation.
    pub series: String,
    /// Spacing (rad or m).
    pub spacing: f64,
    /// Grid points.
    pub points: usize,
    /// Bake time over that of the scene as it is.
    pub cost: f64,
    /// Error, relative (1).
    pub error: f64,
}

/// A limit of a scene's accuracy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Limit {
    /// `grid`, `mesh` or `link nodes`.
    pub of: String,
    /// Estimated rms error at the scene's own setting, relative to the rms torque (1).
    pub error: f64,
    /// Observed order p, error ~ h^p; absent where errors do not fall.
    pub order: Option<f64>,
}

impl Accuracy {
    /// Rows of one study.
    pub fn of(&self, study: Study) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(move |row| row.study == study)
    }

    /// Rows of the spacing study that no other beats in both points solved and error, coarsest first.
    #[must_use]
    pub fn front(&self) -> Vec<&Row> {
        let beaten = |row: &&Row| {
            self.of(Study::Spacing).any(|other| {
                other.solved <= row.solved && other.rms <= row.rms && (other.solved < row.solved || other.rms < row.rms)
            })
        };
        let mut front: Vec<&Row> = self.of(Study::Spacing).filter(|row| !beaten(row)).collect();
        front.sort_by_key(|row| row.solved);
        front
    }

    /// Observed order p of a series of `study`, error ~ h^p. `None` for less than two settings, and where errors do not
    /// fall.
    #[must_use]
    pub fn order(&self, study: Study, series: &str) -> Option<f64> {
        let rows = self.of(study).filter(|row| row.series == series);
        order(rows.map(|row| (row.value, row.rms))).filter(|order| *order > 0.0)
    }

    /// Error of `row` relative to the rms torque (1).
    #[must_use]
    pub fn relative(&self, row: &Row) -> f64 {
        row.rms / self.torque.max(f64::MIN_POSITIVE)
    }
}

/// Errors of the scene's own grid, mesh and contact nodes, greatest first. That of the grid is measured with the
/// scene's interpolation; those of mesh and nodes follow from what halving them changes, `d / (1 - 2^-p)`, or are that
/// change where no order is observed.
#[must_use]
pub fn limits(accuracy: &Accuracy) -> Vec<Limit> {
    let own_grid = |row: &&Row| row.series == accuracy.interpolation && row.points == accuracy.points;
    let grid = accuracy.of(Study::Spacing).find(own_grid).map(|row| Limit {
        of: "grid".to_owned(),
        error: accuracy.relative(row),
        order: accuracy.order(Study::Spacing, accuracy.interpolation),
    });
    let refined = [Study::Mesh, Study::Links].into_iter().filter_map(|study| {
        let row = accuracy.of(study).find(|row| row.value == 1.0)?;
        let order = accuracy.order(study, &row.series);
        let share = order.map_or(1.0, |order| 1.0 - 0.5_f64.powf(order));
        Some(Limit { of: row.series.clone(), error: accuracy.relative(row) / share, order })
    });
    let mut limits: Vec<Limit> = grid.into_iter().chain(refined).collect();
    limits.sort_by(|a, b| b.error.total_cmp(&a.error));
    limits
}

/// The cheapest measured grid for each target that one reaches.
#[must_use]
pub fn offers(accuracy: &Accuracy) -> Vec<Offer> {
    let cheaper = |a: &&Row, b: &&Row| (a.solved, a.rms).partial_cmp(&(b.solved, b.rms)).unwrap_or(Ordering::Equal);
    let offer = |target: f64| {
        let reaching = accuracy.of(Study::Spacing).filter(|row| accuracy.relative(row) <= target);
        let row = reaching.min_by(cheaper)?;
        let (series, error) = (row.series.clone(), accuracy.relative(row));
        Some(Offer { target, series, spacing: row.value, points: row.points, cost: row.cost, error })
    };
    TARGETS.into_iter().filter_map(offer).collect()
}
