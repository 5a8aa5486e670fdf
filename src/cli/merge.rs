//! `haptize merge`: the shards of a bake put together into its dataset.

use super::{
    Failure, Report,
    bar::Bar,
    info, interrupt,
    output::{self, Content},
    tell, watch,
};
use crate::names::escaped;
use crate::sweep::{Merge, MergeError, Merged, Progress, Sweep, ranges};
use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

/// Arguments of `haptize merge`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize merge arm-shards -o arm.haptize
  haptize merge node1/shards node2/shards -o arm.haptize
  haptize merge arm-shards -o arm.haptize --json      names the missing shards as 3,7-9")]
pub struct Arguments {
    /// Shards that `haptize bake --shard` has written, or folders of them.
    #[arg(required = true)]
    parts: Vec<PathBuf>,
    /// The dataset to write.
    #[arg(short, long)]
    output: PathBuf,
    /// Number of random configurations at which the dataset's error is measured; 0 skips this. By default a tenth of
    /// the points in contact, at least 100 and at most 1000.
    #[arg(long, value_name = "COUNT", value_parser = watch::configurations())]
    measure_error: Option<usize>,
    /// Take it for success that the arm touches the object at no grid point.
    #[arg(long)]
    allow_free: bool,
}

/// Merges, where no shard is missing; exit code 1 and the numbers of the missing ones otherwise. Exit code 1, too,
/// where nothing touches, unless that is allowed.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let output = &arguments.output;
    let inputs = arguments.parts.iter().map(PathBuf::as_path);
    let earlier = output::check(output, Content::Dataset, inputs)?;
    output::check(&Sweep::growing_of(output), Content::Dataset, [])?;
    let merge = Merge::gather(&arguments.parts)?;
    merge.notes.iter().for_each(|note| tell(format_args!("haptize: {note}")));
    let missing = merge.missing();
    if !missing.is_empty() {
        return Ok(lacking(&merge, &missing));
    }
    let stop = interrupt::stop_flag();
    let bar = Bar::new("points", "{wide_bar} {pos}/{len} points");
    let mut progress = |progress: Progress| bar.set(progress.done as u64, progress.points as u64, String::new());
    let merged = merge.to_file(output, arguments.measure_error, stop, &mut progress);
    bar.finish();
    interrupt::over();
    let merged = merged?;
    watch::warn(&merged.report);
    let mut json = serde_json::to_value(&merged.report)?;
    json["file"] = output.display().to_string().into();
    json["shards"] = merged.shards.into();
    json["missing"] = "".into();
    let mut text = describe(output, &merged)?;
    earlier.tell(&mut text, &mut json);
    let whole = watch::touches(&merged.report, output, arguments.allow_free, &mut json)?;
    Ok(Report { text, json, whole })
}

/// Returns the message about missing shards.
fn lacking(merge: &Merge, missing: &[usize]) -> Report {
    let (numbers, count) = (ranges(missing), merge.count());
    let error = MergeError::Missing { missing: numbers.clone(), count };
    tell(format_args!("haptize: {error}"));
    tell(format_args!("haptize: with Slurm: sbatch --array={numbers} ... --shard auto/{count}"));
    let json = serde_json::json!({ "missing": numbers, "shards": count, "error": error.to_string() });
    Report { text: format!("{numbers}\n"), json, whole: false }
}

/// Describes the dataset `file`, for people.
fn describe(file: &Path, merged: &Merged) -> Result<String, Failure> {
    let report = &merged.report;
    let mut text = String::new();
    let lost = report.unconverged + report.overflowed;
    writeln!(
        text,
        "{}: {} points of {} shards, {} in contact, {lost} not converged",
        file.display(),
        report.points,
        merged.shards,
        report.contact_points
    )?;
    writeln!(
        text,
        "  merged       in {:.2} s, {} on {} ({})",
        report.seconds,
        escaped(&report.algorithm),
        escaped(&report.backend),
        escaped(&report.adapter)
    )?;
    watch::lowered(&mut text, report.lowered)?;
    info::error(&mut text, report.error.as_ref(), None)?;
    Ok(text)
}
