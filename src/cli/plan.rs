//! `haptize plan`: what each shard of a bake is going to take, and lines that start them all.

use super::{Failure, Report, interrupt, shell, watch};
use crate::{
    scene::Scene,
    sweep::{BackendChoice, Forecast, Plan},
};
use std::{
    fmt::{self, Write},
    path::PathBuf,
};

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
    let lines = Lines::new(arguments, &plan, cores);
    let mut json = serde_json::to_value(&plan)?;
    json["seconds"] = plan.seconds().into();
    json["lines"] = serde_json::to_value(&lines)?;
    let mut text = String::new();
    describe(&mut text, &plan, arguments, &lines)?;
    Ok(Report { text, json, whole: true })
}

/// Lines that start all shards and the merge.
#[derive(serde::Serialize)]
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

fn describe(text: &mut String, plan: &Plan, arguments: &Arguments, lines: &Lines) -> fmt::Result {
    let (count, points) = (plan.shards.len(), plan.points);
    let skipped = points - plan.solved;
    writeln!(text, "{}: {points} points in {count} shards, {skipped} of them proven free", arguments.scene.display())?;
    let Forecast { contact_fraction, sampled, .. } = plan.forecast;
    writeln!(text, "  contact      {:.0} % of {sampled} sampled points", 100.0 * contact_fraction)?;
    match (plan.seconds(), plan.longest()) {
        (Some(all), Some(longest)) => writeln!(
            text,
            "  time         {} for all on {} threads such as here, {} for the longest shard, {} of it to set up; \
             lower equilibria and the error come on top, in the merge",
            watch::duration(all),
            plan.threads,
            watch::duration(longest),
            watch::duration(plan.setup)
        )?,
        _ => writeln!(text, "  time         not predicted for a GPU; {} to set up each", watch::duration(plan.setup))?,
    }
    let solved = || plan.shards.iter().map(|shard| shard.solved);
    let (least, most) = (solved().min().unwrap_or(0), solved().max().unwrap_or(0));
    writeln!(text, "  balance      {least} to {most} points to be solved in a shard")?;
    let bytes = plan.shards.iter().map(|shard| shard.bytes).max().unwrap_or(0);
    writeln!(
        text,
        "  disk         {} a shard, {} the dataset, twice that for a moment in the merge",
        watch::megabytes(bytes),
        watch::megabytes(plan.dataset)
    )?;
    writeln!(text, "  memory       {} a process", watch::megabytes(plan.memory))?;
    for (name, lines) in [("Slurm", &lines.slurm), ("GNU parallel", &lines.parallel), ("HyperQueue", &lines.hyperqueue)]
    {
        writeln!(text, "\n{name}:")?;
        lines.iter().try_for_each(|line| writeln!(text, "  {line}"))?;
    }
    Ok(())
}
