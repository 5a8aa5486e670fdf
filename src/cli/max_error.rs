//! `haptize bake --max-error`: a grid chosen for an error, and baked.

use super::{
    Failure,
    baked::Baked,
    output::Replaced,
    report::{Describe, Report, Text},
    tell, watch,
};
use crate::{
    Error,
    scene::Scene,
    sweep::{Aim, BackendChoice, Bake, Choice, Direct, Pilot},
};
use serde::Serialize;
use std::path::Path;

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

/// A dataset whose grid was chosen for an error.
#[derive(Serialize)]
struct BakedForError {
    #[serde(flatten)]
    baked: Baked,
    pilot: Pilot,
    choice: Choice,
    /// Whether the error that was measured is at most the one that was asked for.
    kept: bool,
}

impl Describe for BakedForError {
    fn describe(&self, text: &mut Text) {
        self.baked.describe(text);
        if !self.kept {
            text.line("  the aim was missed: the dataset is whole, and errs by more; ask for a smaller error");
        }
    }
}

/// Chooses, states and bakes. Nothing is baked where no grid keeps the error; exit code 1 where the error that the bake
/// measures is larger.
pub fn run(
    scene: &Scene,
    goal: &AccuracyGoal<'_>,
    backend: BackendChoice,
    replaced: Option<Replaced>,
) -> Result<Report, Failure> {
    let (pilot, choice, sweep) = watch::watched(scene, backend, |bake| {
        tell(format_args!("haptize: pilot: coarse grids against random configurations ..."));
        let direct = Direct::at_rest(scene)?;
        let pilot = Pilot::run(scene, direct.model(), goal.aim, bake.backend, bake.stop)?;
        let choice = pilot.choose(scene, goal.points)?;
        state(&pilot, &choice);
        let aim = Some(pilot.relative);
        let bake = Bake { scene: &choice.scene, measured: Some(MEASURED), aim, progress: &mut *bake.progress, ..bake };
        let sweep = bake.to_file(goal.output, goal.resume)?;
        Ok::<_, Error>((pilot, choice, sweep))
    })?;
    let kept = sweep.error.as_ref().is_some_and(|error| error.keeps(pilot.relative));
    let baked = Baked::new(sweep, goal.output, Some(pilot.relative), replaced)?;
    Report::of(&BakedForError { baked, pilot, choice, kept }, kept)
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
    tell(format_args!(
        "haptize: predicted: about {:.0} s, {} on the disk",
        choice.seconds.ceil(),
        watch::megabytes(choice.bytes as usize),
    ));
}
