//! `haptize bake`: a scene haptized into a dataset.

use super::{
    Failure, Report,
    bar::bar,
    info,
    interrupt::stop_flag,
    max_error,
    output::{self, Kind},
    tell,
};
use crate::{
    haptize::{Aim, BackendChoice, Bake, Bounds, Footprint, Iterations, Lowered, Progress, SweepReport},
    scene::{Algorithm, Scene},
};
use indicatif::ProgressBar;
use std::{
    fmt::{self, Write},
    path::{Path, PathBuf},
    sync::atomic::Ordering,
    time::SystemTime,
};

/// What to haptize, and how.
#[derive(clap::Args)]
#[command(after_help = super::ADAPTER_HELP)]
pub struct Arguments {
    /// The scene's file.
    scene: PathBuf,
    /// The dataset to write; by default the scene's name in the current folder, ending in .haptize.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// What solves.
    #[arg(long, default_value = "auto")]
    backend: BackendChoice,
    /// How contact is solved, instead of what the scene says.
    #[arg(long)]
    algorithm: Option<Algorithm>,
    /// Continue a bake that was interrupted.
    #[arg(long)]
    resume: bool,
    /// Random configurations at which the dataset's error is measured afterwards; 0 leaves it out. By default a tenth of the points in
    /// contact, at least 100 and at most 1000.
    #[arg(long, value_name = "COUNT", conflicts_with = "max_error")]
    measure_error: Option<usize>,
    /// Choose grid spacing, interpolation and the solver's tolerance for this rms error of the torque, and verify it: a share of
    /// the torque's own rms over the grid's region (0.01), or a torque ("0.002 N m").
    #[arg(long, value_name = "ERROR", allow_negative_numbers = true)]
    max_error: Option<Aim>,
    /// Most grid points that --max-error may choose.
    #[arg(long, default_value_t = 2_000_000, value_name = "POINTS")]
    max_points: usize,
}

/// Haptizes the scene. Ctrl-C leaves a part that `--resume` continues.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let mut scene = Scene::load(&arguments.scene)?;
    if let Some(algorithm) = arguments.algorithm {
        scene.contact.algorithm = algorithm;
    }
    let output = match &arguments.output {
        Some(output) => output.clone(),
        None => PathBuf::from(arguments.scene.file_name().ok_or("the scene's path names no file")?)
            .with_extension("haptize"),
    };
    output::check(&output, Kind::Dataset, [arguments.scene.as_path()])?;
    if let Some(aim) = arguments.max_error {
        let wanted = max_error::Wanted { aim, points: arguments.max_points, output: &output, resume: arguments.resume };
        return max_error::run(&scene, &wanted, arguments.backend);
    }
    let bake = |bake: Bake<'_>| bake.to_file(&output, arguments.resume);
    let report = watched(&scene, arguments.backend, |own| bake(Bake { measured: arguments.measure_error, ..own }))?;
    warn(&report);
    let mut json = serde_json::to_value(&report)?;
    json["file"] = output.display().to_string().into();
    let mut text = String::new();
    describe(&mut text, &output, &report, None)?;
    // Every point was solved and says what became of it: that is the whole work.
    Ok(Report { text, json, whole: true })
}

/// Runs `bake`, dated now, with a progress bar. Ctrl-C stops it after the configurations at hand; afterwards, or again,
/// Ctrl-C ends the program at once.
pub fn watched<T, E: Into<Failure>>(
    scene: &Scene,
    backend: BackendChoice,
    bake: impl FnOnce(Bake<'_>) -> Result<T, E>,
) -> Result<T, Failure> {
    let stop = stop_flag()?;
    let bar = bar(0, "{wide_bar} {pos}/{len} points, {msg}, {eta} left");
    let mut announced = false;
    let mut progress = |progress: Progress| {
        if !std::mem::replace(&mut announced, true) {
            bar.suspend(|| announce(&progress));
        }
        show(&bar, progress);
    };
    let date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let result = bake(Bake { scene, backend, measured: None, aim: None, date: &date, stop, progress: &mut progress });
    bar.finish_and_clear();
    stop.store(true, Ordering::Relaxed);
    result.map_err(Into::into)
}

/// Tells on standard error what was noticed on the way.
pub fn warn(report: &SweepReport) {
    report.warnings.iter().for_each(|warning| tell(format_args!("haptize: {warning}")));
}

/// What was baked into `file`, for an rms error of `aim` over the rms torque if there was one, for people.
pub fn describe(text: &mut String, file: &Path, report: &SweepReport, aim: Option<f64>) -> fmt::Result {
    let SweepReport { points, contact_points, unconverged, overflowed, .. } = report;
    let SweepReport { seconds, configurations_per_second, algorithm, backend, adapter, left_to_cpu, .. } = report;
    let Iterations { mean, max } = report.iterations;
    let lost = unconverged + overflowed;
    writeln!(text, "{}: {points} points, {contact_points} in contact, {lost} not converged", file.display())?;
    writeln!(
        text,
        "  solved       in {seconds:.2} s, {configurations_per_second:.0} configurations a second, {algorithm} on \
         {backend} ({adapter})"
    )?;
    if *left_to_cpu > 0 {
        writeln!(text, "  by the CPU   {left_to_cpu} of them, which the GPU did not decide")?;
    }
    writeln!(
        text,
        "  residual     at most {:.1e} where converged; iterations {mean:.1} on average, {max} at most",
        report.max_residual
    )?;
    if let Some(skin) = report.skin {
        writeln!(text, "  skin         {skin}")?;
    }
    info::mesh_ripple(text, report.mesh_ripple)?;
    if let Some(Lowered { points, converged, greatest, rounds, searches, seconds }) = report.lowered {
        writeln!(
            text,
            "  lowered      {points} points by neighbours' equilibria, {converged} of them unconverged from rest, energy by at most {:.1} %; \
             {rounds} rounds, {searches} searches, {seconds:.2} s",
            100.0 * greatest
        )?;
    }
    info::error(text, report.error.as_ref(), aim)
}

/// What the sweep is going to take, before it begins.
fn announce(progress: &Progress) {
    if let Some(remedy) = progress.mesh_ripple.and_then(|ripple| ripple.remedy()) {
        tell(format_args!("haptize: {remedy}"));
    }
    let range = |Bounds { least, most }| format!("{} to {}", megabytes(least), megabytes(most));
    let Progress { points, done, footprint: Footprint { memory, disk }, .. } = progress;
    let disk = match disk.most {
        0 => String::new(),
        _ => format!(" and {} of disk (twice that for a moment at the end)", range(*disk)),
    };
    tell(format_args!(
        "haptize: {points} points, {done} of them done; results take {} of memory{disk}, depending on how much touches",
        range(*memory)
    ));
}

/// Rounded up, with unit.
pub fn megabytes(bytes: usize) -> String {
    format!("{} MB", (bytes as f64 / 1e6).ceil())
}

fn show(bar: &ProgressBar, progress: Progress) {
    bar.set_length(progress.points as u64);
    bar.set_position(progress.done as u64);
    bar.set_message(format!("{} in contact, {:.0}/s", progress.contact_points, progress.rate));
}
