//! `haptize plan`: what each shard of a bake is going to take, and lines that start them all.

use super::{
    Failure, interrupt,
    report::{Describe, Report, Text},
    shell, watch,
};
use crate::{
    names::{counted, duration},
    scene::Scene,
    sweep::{BackendChoice, Forecast, Plan},
};
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `haptize plan`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize plan arm.toml --shards 64
  haptize plan arm.toml --shards 64 --cores 16 --json")]
pub struct Arguments {
    /// The scene.
    scene: PathBuf,
    /// Number of shards: several for each machine, so that none waits for the last.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    shards: u32,
    /// Cores of each task; by default as many as this machine has.
    #[arg(long, value_name = "CORES", value_parser = clap::value_parser!(u32).range(1..=4096))]
    cores: Option<u32>,
    /// The backend that is going to solve.
    #[arg(long, default_value = "cpu")]
    backend: BackendChoice,
}

/// Memory asked of a scheduler, at least and in steps of (MB): a job that exceeds it is ended.
const MEMORY_STEP: usize = 256;

/// Time asked of a scheduler over the predicted one (1): other machines are slower, and some run other work beside.
const TIME_MARGIN: f64 = 2.0;

/// Samples the scene and states what its shards take. Nothing is written.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let scene = Scene::load(&arguments.scene)?;
    let stop = interrupt::stop_flag();
    let plan = Plan::new(&scene, arguments.backend, arguments.shards as usize, stop);
    interrupt::over();
    let plan = plan?;
    let cores = arguments.cores.map_or(plan.threads, |cores| cores as usize);
    let (lines, seconds) = (Lines::new(arguments, &plan, cores), plan.seconds());
    Report::new(&Planned { scene: arguments.scene.display().to_string(), plan, seconds, lines })
}

/// What the shards of a bake take, and how they are started.
#[derive(Serialize)]
struct Planned {
    #[serde(flatten)]
    plan: Plan,
    /// Time of all shards, one after the other (s).
    seconds: Option<f64>,
    lines: Lines,
    #[serde(skip)]
    scene: String,
}

/// Lines that start all shards and the merge.
#[derive(Serialize)]
struct Lines {
    slurm: Vec<String>,
    parallel: Vec<String>,
    hyperqueue: Vec<String>,
}

impl Lines {
    fn new(arguments: &Arguments, plan: &Plan, cores: usize) -> Self {
        let count = arguments.shards;
        let last = count - 1;
        let stem = arguments.scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let [scene, folder, dataset] =
            [arguments.scene.clone(), format!("{stem}-shards").into(), format!("{stem}.haptize").into()]
                .map(|path: PathBuf| shell::file(&path));
        let backend = if plan.backend == "gpu" { " --backend gpu" } else { " --backend cpu" };
        let bake = |shard: &str| format!("haptize bake {scene} --shard {shard}/{count}{backend} -o {folder}");
        let merge = format!("haptize merge {folder} -o {dataset}");
        let memory = plan.memory.div_ceil(MEMORY_STEP * 1_000_000) * MEMORY_STEP;
        let time = plan.longest().map(|seconds| {
            let seconds = seconds * plan.threads as f64 / cores as f64;
            format!(" --time={}", (TIME_MARGIN * seconds / 60.0).ceil().max(1.0) as usize)
        });
        let time = time.unwrap_or_default();
        let gpu = if plan.backend == "gpu" { " --gpus=1" } else { "" };
        // A shell takes a word in single quotes as it is; what is quoted within needs other quotes.
        let wrap = |line: &str| shell::word(line);
        Self {
            slurm: vec![
                format!(
                    "id=$(sbatch --parsable --array=0-{last} --cpus-per-task={cores} --mem={memory}M{time}{gpu} \
                     --requeue --wrap {})",
                    wrap(&bake("auto"))
                ),
                format!(
                    "sbatch --dependency=afterok:$id --cpus-per-task={cores} --mem={memory}M --wrap {}",
                    wrap(&merge)
                ),
            ],
            parallel: vec![
                format!("seq 0 {last} | RAYON_NUM_THREADS=1 parallel --retries 3 {}", shell::word(&bake("{}"))),
                merge.clone(),
            ],
            hyperqueue: vec![
                format!("hq submit --array 0-{last} --cpus {cores} --pin taskset --wait {}", bake("auto")),
                merge,
            ],
        }
    }
}

impl Describe for Planned {
    fn describe(&self, text: &mut Text) {
        let Self { scene, plan, seconds, lines } = self;
        let (count, points, setup) = (plan.shards.len(), plan.points, duration(plan.setup));
        let skipped = points - plan.solved;
        text.line(format_args!(
            "{scene}: {} in {}, {skipped} of them proven free",
            counted(points, ["point", "points"]),
            counted(count, ["shard", "shards"])
        ));
        let Forecast { contact_fraction, sampled, .. } = plan.forecast;
        text.row(
            "contact",
            format_args!(
                "{:.0} % of {}",
                100.0 * contact_fraction,
                counted(sampled, ["sampled point", "sampled points"])
            ),
        );
        match (seconds, plan.longest()) {
            (Some(all), Some(longest)) => text.row(
                "time",
                format_args!(
                    "{} for all on {} such as here, {} for the longest shard, {setup} of it to set up; lower \
                     equilibria and the error come on top, in the merge",
                    duration(*all),
                    counted(plan.threads, ["thread", "threads"]),
                    duration(longest)
                ),
            ),
            _ => text.row("time", format_args!("not predicted for a GPU; {setup} to set up each")),
        }
        let solved = || plan.shards.iter().map(|shard| shard.solved);
        let (least, most) = (solved().min().unwrap_or(0), solved().max().unwrap_or(0));
        text.row("balance", format_args!("{least} to {} to be solved in a shard", counted(most, ["point", "points"])));
        let shard = plan.shards.iter().map(|shard| shard.bytes).max().unwrap_or(0);
        let [shard, dataset, memory] = [shard, plan.dataset, plan.memory].map(watch::megabytes);
        text.row("disk", format_args!("{shard} a shard, {dataset} the dataset, twice that for a moment in the merge"));
        text.row("memory", format_args!("{memory} a process"));
        for (name, lines) in
            [("Slurm", &lines.slurm), ("GNU parallel", &lines.parallel), ("HyperQueue", &lines.hyperqueue)]
        {
            text.line(format_args!("\n{name}:"));
            lines.iter().for_each(|line| text.line(format_args!("  {line}")));
        }
    }
}
