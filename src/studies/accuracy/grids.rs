//! Grids of other spacings over the scene's region, looked up by each interpolation: error, bake time, size.

use super::{Accuracy, Row, Study, in_turns};
use crate::{
    Error, JointVector,
    dataset::Dataset,
    field::TorqueField,
    scene::{Interpolation, Scene},
    sweep::{
        baked,
        reference::Reference,
        spacing::{points, spaced, spacing_of},
    },
};
use std::hint::black_box;

/// Spacings, relative to the scene's own: half an octave apart, from four times as coarse to a quarter.
const COARSER: [f64; 9] = [4.0, 2.828, 2.0, 1.414, 1.0, std::f64::consts::FRAC_1_SQRT_2, 0.5, 0.354, 0.25];

/// Look-ups that are timed at once.
pub(super) const LOOK_UPS: usize = 20_000;

/// Grid points at which look-ups are timed: 256 of them stay in the cache, as where a hand moves they do.
const PLACES: usize = 256;

fn field(scene: &Scene, dataset: &Dataset, interpolation: Interpolation) -> Result<TorqueField, Error> {
    let spec = &scene.haptics;
    TorqueField::interpolated(dataset, interpolation, spec.threshold, &spec.boundary_slope)
}

/// The scene on grids of all spacings with at most `limit` points; the others are noted in `study`.
pub(super) fn spacings(scene: &Scene, limit: usize, study: &mut Accuracy) -> Vec<Scene> {
    let mut grids: Vec<Scene> = Vec::new();
    for coarser in COARSER {
        let spaced = spaced(scene, |steps| (steps / coarser).round());
        let count = points(&spaced);
        // Small grids cannot be cut much coarser.
        if grids.last().is_some_and(|last| points(last) == count) {
            continue;
        }
        if count > limit && coarser != 1.0 {
            study
                .notes
                .push(format!("the grid of {count} points is left out: more than {limit} (raise --points to have it)"));
            continue;
        }
        grids.push(spaced);
    }
    grids
}

/// Errors on `grids`; the dataset of the scene's own.
pub(super) fn spacing(grids: &[Scene], reference: &Reference, study: &mut Accuracy) -> Result<Dataset, Error> {
    let mut bakes = in_turns(study.rounds, grids.len(), |k| baked(&grids[k]))?;
    let own = grids.iter().position(|grid| points(grid) == study.points).unwrap_or(0);
    let own_time = bakes[own].0;
    for (spaced, (time, (dataset, report))) in grids.iter().zip(&bakes) {
        for interpolation in Interpolation::ALL {
            let field = field(spaced, dataset, interpolation)?;
            let (rms, worst) = reference.errors(|q| field.sample(q).torque);
            study.rows.push(Row {
                study: Study::Spacing,
                series: interpolation.name().to_owned(),
                setting: format!("{:.4} {}", spacing_of(spaced), study.unit),
                value: spacing_of(spaced),
                points: points(spaced),
                solved: report.contact_points,
                bytes: dataset.summary().bytes,
                cost: time / own_time,
                rms,
                worst,
            });
        }
    }
    Ok(bakes.swap_remove(own).1.0)
}

/// Time of a look-up, relative to that of `linear`.
pub(super) fn look_up(scene: &Scene, own: &Dataset, study: &mut Accuracy) -> Result<(), Error> {
    let points = own.grid.points();
    let places: Vec<JointVector> = (0..PLACES).map(|k| own.grid.configuration(k * points / PLACES)).collect();
    let fields = Interpolation::ALL.map(|interpolation| field(scene, own, interpolation));
    let fields = fields.into_iter().collect::<Result<Vec<_>, _>>()?;
    let timed = in_turns(study.rounds, fields.len(), |k| {
        for q in places.iter().cycle().take(LOOK_UPS) {
            black_box(fields[k].sample(black_box(q)));
        }
        Ok::<(), Error>(())
    })?;
    study.look_up = timed[0].0 / LOOK_UPS as f64;
    for (interpolation, (time, ())) in Interpolation::ALL.into_iter().zip(timed) {
        let series = interpolation.name();
        let error = study.rows.iter().find(|row| row.series == series && row.points == points);
        let (rms, worst) = error.map_or((0.0, 0.0), |row| (row.rms, row.worst));
        study.rows.push(Row {
            study: Study::Lookup,
            series: series.to_owned(),
            setting: series.to_owned(),
            value: 0.0,
            points,
            solved: 0,
            bytes: 0,
            cost: time / LOOK_UPS as f64 / study.look_up,
            rms,
            worst,
        });
    }
    Ok(())
}
