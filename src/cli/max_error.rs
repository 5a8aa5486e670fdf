//! `haptize bake --max-error`: a grid chosen for an error, and baked.

use super::{Failure, Report, tell, watch};
use crate::{
    scene::Scene,
    sweep::{Aim, BackendChoice, Bake, Choice, Pilot, PilotError},
};
use std::{fmt::Write, path::Path};

/// Configurations at which the error is measured (1): the rms is to decide whether the aim was kept, and single large
/// errors where the torque has kinks and jumps make it vary by a third with a hundred.
const MEASURED: usize = 400;

/// The accuracy that is asked for.
pub struct AccuracyGoal<'a> {
    /// The error to stay below.
    pub aim: Aim,
    /// Most grid points.
    pub points: usize,
    /// The dataset to write.
    pub output: &'a Path,
    /// Whether to continue a bake that was interrupted: its pilot finds the same again.
    pub resume: bool,
}

/// Chooses, states and bakes. Nothing is baked where no grid keeps the error; exit code 1 where the error that the bake
/// measures is larger.
pub fn run(scene: &Scene, wanted: &AccuracyGoal<'_>, backend: BackendChoice) -> Result<Report, Failure> {
    let (pilot, choice, report) = watch::watched(scene, backend, |bake| {
        tell(format_args!("haptize: pilot: coarse grids against random configurations ..."));
        let pilot = Pilot::run(scene, wanted.aim, bake.backend, bake.stop)?;
        let choice = pilot.choose(scene, wanted.points, bake.backend)?;
        state(&pilot, &choice);
        let aim = Some(pilot.relative);
        let bake = Bake { scene: &choice.scene, measured: Some(MEASURED), aim, progress: &mut *bake.progress, ..bake };
        let report = bake.to_file(wanted.output, wanted.resume)?;
        Ok::<_, PilotError>((pilot, choice, report))
    })?;
    watch::warn(&report);
    let is_kept = report.error.as_ref().is_some_and(|error| error.keeps(pilot.relative));
    let mut json = serde_json::to_value(&report)?;
    json["file"] = wanted.output.display().to_string().into();
    json["pilot"] = serde_json::to_value(&pilot)?;
    json["choice"] = serde_json::to_value(&choice)?;
    json["kept"] = is_kept.into();
    let mut text = String::new();
    watch::describe(&mut text, wanted.output, &report, Some(pilot.relative))?;
    if !is_kept {
        writeln!(text, "  the aim was missed: the dataset is whole, and errs by more; ask for a smaller error")?;
    }
    Ok(Report { text, json, whole: is_kept })
}

/// Prints the choice and its predicted cost, before the bake begins.
fn state(pilot: &Pilot, choice: &Choice) {
    let best = pilot.prospects.first().map_or(0.0, |best| best.order);
    tell(format_args!(
        "haptize: for an rms error of {:.2e} {} ({:.2} % of {:.4} {}): {} grid points, {:.4} apart, `{}`, \
         solved to {:.0e}; the pilot's errors fell with the spacing to the power {best:.2}",
        pilot.aim,
        pilot.unit.name(),
        100.0 * pilot.relative,
        pilot.torque,
        pilot.unit,
        choice.points,
        choice.spacing,
        choice.interpolation,
        choice.tolerance,
    ));
    let disk = choice.footprint.disk;
    tell(format_args!(
        "haptize: predicted: about {:.0} s, {} to {} on the disk",
        choice.seconds.ceil(),
        watch::megabytes(disk.least),
        watch::megabytes(disk.most),
    ));
}
