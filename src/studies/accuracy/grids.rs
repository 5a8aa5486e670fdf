//! Grids of other spacings over the scene's region, looked up by each interpolation: error, bake time, size, loops.

use super::{Accuracy, AccuracyError, Loops, Row, Study, timed};
use crate::{
    JointVector,
    dataset::Dataset,
    field::{FieldError, TorqueField},
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

/// Sides of loops, in grid steps.
const SIDES: [f64; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];

/// Loops of each size.
const LOOPS: usize = 24;

pub(super) fn field(scene: &Scene, dataset: &Dataset, interpolation: Interpolation) -> Result<TorqueField, FieldError> {
    let spec = &scene.haptics;
    TorqueField::interpolated(dataset, interpolation, spec.threshold, &spec.boundary_slope)
}

/// Errors at all spacings with at most `limit` grid points; the dataset of the scene's own.
pub(super) fn spacing(
    scene: &Scene,
    reference: &Reference,
    limit: usize,
    study: &mut Accuracy,
) -> Result<Dataset, AccuracyError> {
    let (own_cost, (own, _)) = timed(study.rounds, || baked(scene))?;
    let mut before = 0;
    for coarser in COARSER {
        let spaced = spaced(scene, |steps| (steps / coarser).round());
        let count = points(&spaced);
        // Small grids cannot be cut much coarser.
        if count == before {
            continue;
        }
        before = count;
        if count > limit && coarser != 1.0 {
            study
                .notes
                .push(format!("the grid of {count} points is left out: more than {limit} (raise --points to have it)"));
            continue;
        }
        let (cost, (dataset, report)) = timed(study.rounds, || baked(&spaced))?;
        for interpolation in Interpolation::ALL {
            let field = field(&spaced, &dataset, interpolation)?;
            let (rms, worst) = reference.errors(|q| field.sample(q).torque);
            study.rows.push(Row {
                study: Study::Spacing,
                series: interpolation.name().to_owned(),
                setting: format!("{:.4} {}", spacing_of(&spaced), study.unit),
                value: spacing_of(&spaced),
                points: count,
                solved: report.contact_points,
                bytes: dataset.summary().bytes,
                cost: cost.over(own_cost.least),
                unit: "N m",
                rms,
                worst,
                size: reference.torque,
            });
        }
    }
    Ok(own)
}

/// Time of a look-up, relative to that of `linear`.
pub(super) fn look_up(scene: &Scene, own: &Dataset, study: &mut Accuracy) -> Result<(), AccuracyError> {
    let errors = |series: &str, study: &Accuracy| {
        let own = study.rows.iter().find(|row| row.series == series && row.points == own.grid.points());
        own.map_or((0.0, 0.0), |row| (row.rms, row.worst))
    };
    for interpolation in Interpolation::ALL {
        let field = field(scene, own, interpolation)?;
        let places: Vec<JointVector> = (0..256).map(|k| own.grid.configuration(k * own.grid.points() / 256)).collect();
        let (cost, ()) = timed(study.rounds, || {
            for k in 0..LOOK_UPS {
                black_box(field.sample(black_box(&places[k % places.len()])));
            }
            Ok::<(), AccuracyError>(())
        })?;
        if study.look_up == 0.0 {
            study.look_up = cost.least / LOOK_UPS as f64;
        }
        let (rms, worst) = errors(interpolation.name(), study);
        study.rows.push(Row {
            study: Study::Lookup,
            series: interpolation.name().to_owned(),
            setting: interpolation.name().to_owned(),
            value: f64::from(u8::from(interpolation == Interpolation::Potential)) * 2.0 + 1.0,
            points: own.grid.points(),
            solved: 0,
            bytes: 0,
            cost: cost.over(LOOK_UPS as f64 * study.look_up),
            unit: "N m",
            rms,
            worst,
            size: study.torque,
        });
    }
    Ok(())
}

/// Work around squares in the plane of the last two joints, about configurations in contact.
pub(super) fn loops(
    scene: &Scene,
    own: &Dataset,
    reference: &Reference,
    study: &mut Accuracy,
) -> Result<(), AccuracyError> {
    let joints = own.grid.joints();
    if joints < 2 {
        study.notes.push("work around loops is not shown: one joint has no loops".to_owned());
        return Ok(());
    }
    let pressed = reference.places.iter().zip(&reference.exact).filter(|(_, tau)| tau.norm() > 0.0);
    let centres: Vec<&JointVector> = pressed.map(|(q, _)| q).take(LOOPS).collect();
    for interpolation in Interpolation::ALL {
        let field = field(scene, own, interpolation)?;
        for side in SIDES {
            let around = |centre: &JointVector| {
                let corner = |a: f64, b: f64| {
                    let mut q = *centre;
                    for (axis, sign) in [(joints - 2, a), (joints - 1, b)] {
                        let line = &own.grid.axes[axis];
                        let half = 0.5 * side * line.step;
                        // The whole square moves into the grid, where the field is not faded.
                        let (first, last) = (line.coordinate(0) + half, line.last() - half);
                        q[axis] = q[axis].min(last).max(first) + sign * half;
                    }
                    q
                };
                field.work_around(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)])
            };
            let square: f64 = centres.iter().map(|centre| around(centre).powi(2)).sum();
            study.loops.push(Loops {
                series: interpolation.name().to_owned(),
                side: side * own.grid.axes[joints - 1].step,
                work: (square / centres.len().max(1) as f64).sqrt(),
            });
        }
    }
    Ok(())
}
