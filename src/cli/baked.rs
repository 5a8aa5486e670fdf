//! The report of a bake: what was solved, and how far the dataset is to be trusted.

use super::{
    Failure,
    output::Replaced,
    remarks,
    report::{Describe, Text},
    tell,
    watch::{self, megabytes},
};
use crate::{
    contact::MeshRipple,
    dataset::{Dataset, MeasuredError},
    names::{counted, duration, escaped},
    sweep::{Clearance, Iterations, Lowered, SweepReport},
};
use serde::Serialize;
use std::path::Path;

/// A dataset that was baked.
#[derive(Serialize)]
pub struct Baked {
    /// The sweep in numbers.
    #[serde(flatten)]
    pub sweep: SweepReport,
    file: String,
    /// How near arm and object come where nothing touches.
    #[serde(skip_serializing_if = "Option::is_none")]
    clearance: Option<Clearance>,
    #[serde(flatten)]
    replaced: Option<Replaced>,
    /// Rms error over the rms torque that was asked for (1), if any.
    #[serde(skip)]
    aim: Option<f64>,
    /// Size of the file (bytes).
    #[serde(skip)]
    bytes: usize,
    /// Why this is no success.
    #[serde(skip_serializing_if = "Option::is_none")]
    defect: Option<&'static str>,
}

/// The defect of a dataset without a contact.
const FREE: &str = "the arm touches the object at no grid point: the dataset is whole, and its torque is zero everywhere; \
                    --allow-free takes that for success";

impl Baked {
    /// Returns the report of `sweep`, which was baked into `file`, for the error `aim` over the rms torque (1) if any.
    /// Its warnings are printed, but for those that were printed before the work.
    ///
    /// # Errors
    /// If nothing touches and the dataset cannot be read again.
    pub fn new(sweep: SweepReport, file: &Path, aim: Option<f64>, replaced: Option<Replaced>) -> Result<Self, Failure> {
        sweep.warnings.iter().for_each(|warning| remarks::once(warning));
        let is_free = sweep.contact_points == 0;
        let clearance = if is_free { watch::warn_of_free_space(&Dataset::load(file)?)? } else { None };
        let bytes = std::fs::metadata(file).map_or(0, |file| file.len() as usize);
        Ok(Self { sweep, file: file.display().to_string(), clearance, replaced, aim, bytes, defect: None })
    }

    /// Returns whether something touches, or need not. Every point was solved and has its status: that is the whole
    /// work otherwise.
    pub fn is_whole(&mut self, allow_free: bool) -> bool {
        if self.sweep.contact_points == 0 && !allow_free {
            tell(format_args!("haptize: {FREE}"));
            self.defect = Some(FREE);
        }
        self.defect.is_none()
    }
}

impl Describe for Baked {
    fn describe(&self, text: &mut Text) {
        let Self { sweep, file, replaced, aim, bytes, .. } = self;
        let SweepReport { points, contact_points, unconverged, overflowed, seconds, .. } = sweep;
        let SweepReport { configurations_per_second: rate, algorithm, backend, adapter, left_to_cpu, .. } = sweep;
        let [algorithm, backend, adapter] = [algorithm, backend, adapter].map(|text| escaped(text));
        let Iterations { mean, max } = sweep.iterations;
        let lost = unconverged + overflowed;
        text.line(format_args!(
            "{file}: {}, {contact_points} in contact, {lost} not converged",
            counted(*points, ["point", "points"])
        ));
        // What shards or an earlier run have solved leaves nothing to do.
        let (what, rate) = match *rate {
            rate if rate > 0.0 => ("solved", format!("{rate:.0} configurations a second, ")),
            _ => ("finished", String::new()),
        };
        text.row(what, format_args!("in {seconds:.2} s, {rate}{algorithm} on {backend} ({adapter})"));
        if let Some(forecast) = sweep.forecast {
            let time = forecast.seconds.map_or(String::new(), |seconds| {
                format!("{} from rest (predicted {}), ", duration(sweep.solving_seconds), duration(seconds))
            });
            let (size, predicted) = (megabytes(*bytes), megabytes(forecast.disk));
            text.row("forecast", format_args!("{time}{size} of disk (predicted {predicted})"));
        }
        describe_left_to_cpu(text, *left_to_cpu);
        text.row(
            "residual",
            format_args!(
                "at most {:.1e} where converged; iterations {mean:.1} on average, {max} at most",
                sweep.max_residual
            ),
        );
        if let Some(skin) = sweep.skin {
            text.row("skin", skin);
        }
        sweep.lattice.iter().for_each(|error| text.row("lattice", error));
        sweep.mesh_ripple.describe(text);
        sweep.lowered.describe(text);
        describe_error(text, sweep.error.as_ref(), *aim);
        replaced.describe(text);
    }
}

/// Describes how many configurations a GPU left to the CPU.
pub fn describe_left_to_cpu(text: &mut Text, count: usize) {
    if count > 0 {
        text.row("by the CPU", format_args!("{count} of them, which the GPU did not decide"));
    }
}

impl Describe for Lowered {
    fn describe(&self, text: &mut Text) {
        let Self { points, converged, greatest, rounds, searches, seconds } = *self;
        let which = match points {
            0 => "no point by neighbours' equilibria".to_owned(),
            _ => format!(
                "{} by neighbours' equilibria, {converged} unconverged from rest, energy by at most {:.1} %",
                counted(points, ["point", "points"]),
                100.0 * greatest
            ),
        };
        let (rounds, searches) = (counted(rounds, ["round", "rounds"]), counted(searches, ["search", "searches"]));
        text.row("lowered", format_args!("{which}; {rounds}, {searches}, {seconds:.2} s"));
    }
}

impl Describe for MeshRipple {
    fn describe(&self, text: &mut Text) {
        text.row("mesh ripple", self);
        self.remedy().iter().for_each(|remedy| text.row("", remedy));
    }
}

/// Describes the error that the bake measured, and whether it is within `aim`, the one over the rms torque that was
/// asked for (1).
pub fn describe_error(text: &mut Text, measured: Option<&MeasuredError>, aim: Option<f64>) {
    let Some(measured) = measured else { return text.row("error", "not measured") };
    text.rows("error", measured.lines());
    let MeasuredError { configurations, left_out, torque, unit, .. } = measured;
    if *configurations == 0 {
        return;
    }
    let without = if *left_out > 0 { format!("; {left_out} left out, which did not converge") } else { String::new() };
    text.row(
        "",
        format_args!(
            "of the rms torque, {torque:.4} {unit}, at {}{without}",
            counted(*configurations, ["random configuration", "random configurations"])
        ),
    );
    if let Some(aim) = aim {
        let verdict = if measured.keeps(aim) { "kept" } else { "missed" };
        text.row("", format_args!("asked for: {:.2} % rms, {verdict}", 100.0 * aim));
    }
}
