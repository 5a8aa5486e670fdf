//! `haptize merge`: the shards of a bake put together into its dataset.

use super::{
    Failure,
    baked::Baked,
    bar::Bar,
    interrupt,
    output::{self, Content},
    report::{Describe, Report, Text},
    tell, watch,
};
use crate::names::counted;
use crate::sweep::{Merge, Progress, ranges};
use serde::Serialize;
use std::path::PathBuf;

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
    /// Do not fail if the arm touches the object at no grid point.
    #[arg(long)]
    allow_free: bool,
}

/// Merges, where no shard is missing; exit code 1 and the numbers of the missing ones otherwise. Exit code 1, too,
/// where nothing touches, unless that is allowed.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let output = &arguments.output;
    let inputs = arguments.parts.iter().map(PathBuf::as_path);
    let earlier = output::check(output, Content::Dataset, inputs)?;
    let merge = Merge::gather(&arguments.parts)?;
    merge.notes.iter().for_each(|note| tell(format_args!("haptize: {note}")));
    let missing = merge.missing();
    if !missing.is_empty() {
        return lacking(&merge, &missing);
    }
    let stop = interrupt::stop_flag();
    let bar = Bar::new("points", "{wide_bar} {pos}/{len} points, {msg}");
    let mut progress = |progress: Progress| bar.set(progress.done as u64, progress.points as u64, String::new(), None);
    let report = merge.to_file(output, arguments.measure_error, stop, &mut progress);
    bar.finish();
    interrupt::over();
    let mut baked = Baked::new(report?, output, None, earlier)?;
    let is_whole = baked.is_whole(arguments.allow_free);
    Report::of(&MergedShards { baked, shards: merge.count(), missing: "" }, is_whole)
}

/// A dataset put together.
#[derive(Serialize)]
struct MergedShards {
    #[serde(flatten)]
    baked: Baked,
    shards: usize,
    /// Numbers of missing shards: none.
    missing: &'static str,
}

impl Describe for MergedShards {
    fn describe(&self, text: &mut Text) {
        let Self { baked, shards, .. } = self;
        text.line(format_args!("{} put together", counted(*shards, ["shard", "shards"])));
        baked.describe(text);
    }
}

/// Shards that are missing.
#[derive(Serialize)]
struct MissingShards {
    /// Their numbers, as job schedulers take them.
    missing: String,
    shards: usize,
    error: String,
}

impl Describe for MissingShards {
    fn describe(&self, text: &mut Text) {
        text.line(&self.missing);
    }
}

/// Returns the report of missing shards.
fn lacking(merge: &Merge, missing: &[usize]) -> Result<Report, Failure> {
    let error = merge.lacks(missing).to_string();
    let (missing, shards) = (ranges(missing), merge.count());
    tell(format_args!("haptize: {error}"));
    tell(format_args!("haptize: with Slurm: sbatch --array={missing} ... --shard auto/{shards}"));
    Report::of(&MissingShards { missing, shards, error }, false)
}
