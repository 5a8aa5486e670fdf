//! `haptize bake`: a scene haptized into a dataset.

use super::{
    Failure,
    baked::Baked,
    max_error::{self, AccuracyGoal},
    output::{self, Content},
    reach,
    refine::{self, RefinementGoal},
    remarks,
    report::{Describe, Report, Text},
    shard::ShardChoice,
    watch::{configurations, watched},
};
use crate::{
    names::counted,
    scene::{ContactLaw, Scene},
    store::space::MAX_LEVELS,
    sweep::{Aim, BackendChoice, Bake, Shard, SweepReport},
};
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `haptize bake`.
#[derive(clap::Args)]
#[command(after_help = concat!(
    "\
Examples:
  haptize bake sphere.toml
  haptize bake sphere.toml --max-error 5%
  haptize bake sphere.toml --max-error 0.002Nm -o fine.haptize
  haptize bake organ.toml --max-error 10% --refine 3     finer where it errs, six joints included
  haptize bake sphere.toml --backend gpu --resume
  haptize bake sphere.toml --shard auto/64 -o shards     one task of a cluster's array; see haptize plan",
    adapter_help!()
))]
pub struct Arguments {
    /// The scene.
    scene: PathBuf,
    /// The dataset to write; by default the scene's name in the current folder, ending in .haptize. With --shard the
    /// folder to write to.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// The backend that solves contact.
    #[arg(long, default_value = "auto")]
    backend: BackendChoice,
    /// The law of contact, instead of the scene's: depth is measured from the undeformed surface (rest) or from the
    /// deformed one (following).
    #[arg(long)]
    law: Option<ContactLaw>,
    /// Continue a bake that was interrupted. What was solved is kept; the search for lower equilibria and the
    /// measurement of the error, which come last, start again.
    #[arg(long)]
    resume: bool,
    /// Number of random configurations at which the dataset's error is measured afterwards; 0 skips this. By default a
    /// tenth of the points in contact, at least 100 and at most 1000.
    #[arg(long, value_name = "COUNT", value_parser = configurations(), conflicts_with = "max_error")]
    measure_error: Option<usize>,
    /// Choose grid spacing, interpolation and solver tolerance for this rms error of the torque, and verify it: a
    /// fraction of the torque's own rms over the grid (0.01 or 1%), or a torque ("0.002 N m").
    #[arg(long, value_name = "ERROR", allow_negative_numbers = true)]
    max_error: Option<Aim>,
    /// Instead of choosing a uniform grid for --max-error, refine the scene's grid where it errs, with up to so many
    /// levels: the scene's grid is the first, and each further one halves the spacing.
    #[arg(long, value_name = "LEVELS", requires = "max_error",
        conflicts_with_all = ["resume", "law", "shard"],
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_LEVELS)))]
    refine: Option<u32>,
    /// Maximum number of grid points that --max-error may choose.
    #[arg(long, default_value_t = 2_000_000, value_name = "POINTS")]
    max_points: usize,
    /// Do not fail if the arm touches the object at no grid point.
    #[arg(long)]
    allow_free: bool,
    /// Solve one of N shards, counted from 0, into a file of its own: "3/64"; "auto/64" takes the number from the
    /// environment of the job scheduler. An unfinished shard is continued, a whole one left as it is. `haptize merge`
    /// puts them together.
    #[arg(long, value_name = "I/N", conflicts_with_all = ["max_error", "measure_error"])]
    shard: Option<ShardChoice>,
}

/// Haptizes the scene. Exit code 1 where nothing touches, unless that is allowed. Ctrl-C leaves a part that `--resume`
/// continues.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let mut scene = Scene::load(&arguments.scene)?;
    scene.contact = scene.contact.by(arguments.law.unwrap_or(scene.contact.law));
    if let Some(shard) = arguments.shard {
        return run_shard(arguments, &scene, shard.shard(|name| std::env::var(name).ok())?);
    }
    let output = match &arguments.output {
        Some(output) => output.clone(),
        None => PathBuf::from(arguments.scene.file_name().ok_or("the scene's path names no file")?)
            .with_extension("haptize"),
    };
    let earlier = output::check(&output, Content::Dataset, [arguments.scene.as_path()])?;
    let scene = reach::complete(scene, arguments.backend, arguments.max_error.is_some())?;
    if let (Some(aim), Some(levels)) = (arguments.max_error, arguments.refine) {
        let goal = RefinementGoal { aim, levels, most: arguments.max_points, output: &output };
        return refine::run(&scene, &goal, arguments.backend, earlier);
    }
    if let Some(aim) = arguments.max_error {
        let goal = AccuracyGoal { aim, points: arguments.max_points, output: &output, resume: arguments.resume };
        return max_error::run(&scene, &goal, arguments.backend, earlier);
    }
    let bake = |bake: Bake<'_>| bake.to_file(&output, arguments.resume);
    let sweep = watched(&scene, arguments.backend, |own| bake(Bake { measured: arguments.measure_error, ..own }))?;
    let mut baked = Baked::new(sweep, &output, None, earlier)?;
    let is_whole = baked.is_whole(arguments.allow_free);
    Report::of(&baked, is_whole)
}

/// A shard that was solved.
#[derive(Serialize)]
struct BakedShard {
    /// Absent where it was there already.
    #[serde(flatten)]
    sweep: Option<SweepReport>,
    file: String,
    shard: Shard,
}

impl Describe for BakedShard {
    fn describe(&self, text: &mut Text) {
        let Self { sweep, file, shard } = self;
        let Some(sweep) = sweep else { return text.line(format_args!("{file}: shard {shard}, there already")) };
        let SweepReport { points, contact_points, resumed_points, seconds, backend, adapter, .. } = sweep;
        text.line(format_args!(
            "{file}: shard {shard}, {}, {contact_points} in contact, {resumed_points} of an earlier run; \
             {seconds:.2} s on {backend} ({adapter})",
            counted(*points, ["point", "points"])
        ));
    }
}

/// Solves one shard.
fn run_shard(arguments: &Arguments, scene: &Scene, shard: Shard) -> Result<Report, Failure> {
    let folder = arguments.output.clone().unwrap_or_else(|| PathBuf::from("."));
    let (file, sweep) = watched(scene, arguments.backend, |bake| bake.to_shard(&folder, shard))?;
    let warnings = sweep.iter().flat_map(|sweep| &sweep.warnings);
    warnings.for_each(|warning| remarks::once(warning));
    Report::new(&BakedShard { sweep, file: file.display().to_string(), shard })
}
