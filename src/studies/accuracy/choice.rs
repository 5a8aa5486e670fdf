//! For a given error: which spacing and interpolation, and what it costs.

use super::{Accuracy, Row, Study};
use crate::{
    scene::Interpolation,
    sweep::{FARTHEST_EXTRAPOLATION, spacing::order},
};
use serde::Serialize;

/// Errors that are asked for, relative to the rms of the torque (1).
pub(super) const TARGETS: [f64; 7] = [0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01];

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
    pub points: f64,
    /// Bake time over that of the scene as it is.
    pub cost: f64,
    /// Error, relative (1).
    pub error: f64,
    /// Whether it was measured; else it follows from the measured order of convergence.
    pub measured: bool,
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

    /// Observed order p of a study of refinement: differences between one setting and the next fall as h^p.
    #[must_use]
    pub fn refinement_order(&self, study: Study) -> Option<f64> {
        order(self.of(study).map(|row| (row.value, row.rms)))
    }

    /// Measured order p of `series`, error ~ h^p. `None` for less than two spacings.
    #[must_use]
    pub fn order(&self, series: &str) -> Option<f64> {
        order(self.of(Study::Spacing).filter(|row| row.series == series).map(|row| (row.value, row.rms)))
    }
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

/// Errors of the scene's own grid, mesh and contact nodes, greatest first. That of the grid is measured with the
/// scene's interpolation; those of mesh and nodes follow from what halving them changes, `d / (1 - 2^-p)`, or are that
/// change where no order is observed.
#[must_use]
pub fn limits(accuracy: &Accuracy) -> Vec<Limit> {
    let own_grid = |row: &&Row| row.series == accuracy.interpolation && row.points == accuracy.points;
    let grid = accuracy.of(Study::Spacing).find(own_grid).map(|row| Limit {
        of: "grid".to_owned(),
        error: row.rms / row.size,
        order: accuracy.order(accuracy.interpolation).filter(|order| *order > 0.0),
    });
    let refined = [Study::Mesh, Study::Links].into_iter().filter_map(|study| {
        let row = accuracy.of(study).find(|row| row.value == 1.0)?;
        let order = accuracy.refinement_order(study).filter(|order| *order > 0.0);
        let share = order.map_or(1.0, |order| 1.0 - 0.5_f64.powf(order));
        Some(Limit { of: row.series.clone(), error: row.rms / row.size / share, order })
    });
    let mut limits: Vec<Limit> = grid.into_iter().chain(refined).collect();
    limits.sort_by(|a, b| b.error.total_cmp(&a.error));
    limits
}

/// The cheapest way to each target: measured where a measured grid reaches it, else from the finest grid by the
/// measured order. No offer where errors do not fall, or where the grid would be more than four times as fine as any
/// measured.
#[must_use]
pub fn offers(accuracy: &Accuracy) -> Vec<Offer> {
    let size = accuracy.torque.max(f64::MIN_POSITIVE);
    let measured = |target: f64| {
        let reaching = accuracy.of(Study::Spacing).filter(|row| row.rms <= target * size);
        reaching.min_by(|a, b| (a.solved, a.rms).partial_cmp(&(b.solved, b.rms)).unwrap_or(std::cmp::Ordering::Equal))
    };
    let predicted = |target: f64| {
        let from = |interpolation: Interpolation| {
            let series = interpolation.name();
            let rows = accuracy.of(Study::Spacing).filter(|row| row.series == series);
            let finest = rows.min_by(|a, b| a.value.total_cmp(&b.value))?;
            let order = accuracy.order(series).filter(|order| *order > 0.0)?;
            let finer = (finest.rms / (target * size)).powf(1.0 / order);
            if finer > FARTHEST_EXTRAPOLATION {
                return None;
            }
            let more = finer.powi(accuracy.joints as i32);
            Some(Offer {
                target,
                series: series.to_owned(),
                spacing: finest.value / finer,
                points: finest.points as f64 * more,
                cost: finest.cost.least * more,
                error: target,
                measured: false,
            })
        };
        Interpolation::ALL.into_iter().filter_map(from).min_by(|a, b| a.points.total_cmp(&b.points))
    };
    let offer = |target: f64| match measured(target) {
        Some(row) => Some(Offer {
            target,
            series: row.series.clone(),
            spacing: row.value,
            points: row.points as f64,
            cost: row.cost.least,
            error: row.rms / size,
            measured: true,
        }),
        None => predicted(target),
    };
    TARGETS.into_iter().filter_map(offer).collect()
}
