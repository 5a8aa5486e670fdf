//! Grids that are filled where coarser ones foretell them, beside those that are solved throughout: what they save.

use super::{Accuracy, AccuracyError, Row, Study, grids, timed};
use crate::{
    haptize::{
        reference::Reference,
        spacing::{points, spaced, spacing_of},
    },
    scene::{Interpolation, Scene},
};

/// Series of such grids. Their interpolation is the potential, which is what they are filled from.
pub(super) const SERIES: &str = "filled";

/// Spacings, relative to the scene's own.
const COARSER: [f64; 3] = [1.0, 0.5, 0.25];

/// Tolerances of filling, relative to the rms torque.
const TOLERANCES: [f64; 3] = [0.4, 0.3, 0.2];

/// Filled grids have at most as many times the points of those that are solved throughout: they solve a fraction.
const LARGER: usize = 8;

/// A filled grid beside the solved one of the fewest points that errs as little at worst.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Saving {
    /// Filled.
    pub filled: Row,
    /// Solved throughout, with the potential.
    pub uniform: Row,
    /// How many times as many points are solved [1].
    pub times: f64,
}

/// Errors of filled grids, where the solved ones have at most `limit` points.
pub(super) fn rows(
    scene: &Scene,
    reference: &Reference,
    limit: usize,
    own_cost: f64,
    study: &mut Accuracy,
) -> Result<(), AccuracyError> {
    for coarser in COARSER {
        // Lines must be halved twice.
        let mut spaced = spaced(scene, |steps| 4.0 * (steps / (4.0 * coarser)).round().max(1.0));
        if points(&spaced) > limit.saturating_mul(LARGER) {
            continue;
        }
        for share in TOLERANCES {
            let tolerance = share * reference.torque;
            spaced.grid.fill = Some(tolerance);
            let (cost, (dataset, report)) = timed(1, || grids::baked(&spaced))?;
            let field = grids::field(&spaced, &dataset, Interpolation::Potential)?;
            let (rms, worst) = reference.errors(|q| field.sample(q).torque);
            let setting = format!("{:.4} {}, filled to {tolerance:.1e} N m", spacing_of(&spaced), study.unit);
            study.rows.push(Row {
                study: Study::Spacing,
                series: SERIES.to_owned(),
                setting,
                value: spacing_of(&spaced),
                points: points(&spaced),
                solved: report.contact_points - report.filled_points,
                bytes: dataset.summary().bytes,
                cost: cost.over(own_cost),
                unit: "N m",
                rms,
                worst,
                size: reference.torque,
            });
        }
    }
    Ok(())
}

impl Accuracy {
    /// What filling saves at most at equal worst error, where a grid that is solved throughout errs as little; `None` where it
    /// saves nothing.
    #[must_use]
    pub fn saving(&self) -> Option<Saving> {
        let potential = Interpolation::Potential.name();
        let filled = self.of(Study::Spacing).filter(|row| row.series == SERIES);
        let savings = filled.filter_map(|filled| {
            let uniform = self.of(Study::Spacing).filter(|row| row.series == potential && row.worst <= filled.worst);
            let uniform = uniform.min_by_key(|row| row.solved)?;
            let times = uniform.solved as f64 / filled.solved.max(1) as f64;
            Some(Saving { filled: filled.clone(), uniform: uniform.clone(), times })
        });
        savings.filter(|saving| saving.times > 1.0).max_by(|a, b| a.times.total_cmp(&b.times))
    }
}
