//! `haptize bake`: a scene haptized into a dataset.

use super::{Failure, Report};
use haptize::{
    haptize::{BackendChoice, Bake, Progress},
    scene::{Algorithm, Scene},
};
use indicatif::{ProgressBar, ProgressStyle};
use std::{
    io::{IsTerminal, stderr},
    path::PathBuf,
    sync::{Arc, atomic::AtomicBool, atomic::Ordering},
    time::SystemTime,
};

/// What to haptize, and how.
#[derive(clap::Args)]
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
}

/// Haptizes the scene. Ctrl-C stops after the configurations at hand and leaves a part that `--resume` continues.
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
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed))?;
    let bar = progress_bar();
    let mut progress = |progress: Progress| show(&bar, progress);
    let date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let bake = Bake { scene: &scene, backend: arguments.backend, date: &date, stop: &stop, progress: &mut progress };
    let result = bake.to_file(&output, arguments.resume);
    bar.finish_and_clear();
    let (_, report) = result?;
    report.warnings.iter().for_each(|warning| eprintln!("haptize: {warning}"));
    let mut json = serde_json::to_value(&report)?;
    json["file"] = output.display().to_string().into();
    let lost = report.unconverged + report.overflowed;
    let text = format!(
        "{}: {} points, {} in contact, of these {lost} not converged ({} on {}, {})\n\
         residual at most {:.1e}, iterations {:.1} on average and at most {}\n\
         {:.2} s, {:.0} configurations a second\n",
        output.display(),
        report.points,
        report.contact_points,
        report.algorithm,
        report.backend,
        report.adapter,
        report.max_residual,
        report.iterations.mean,
        report.iterations.max,
        report.seconds,
        report.configurations_per_second,
    );
    // Every point was solved and says what became of it: that is the whole work.
    Ok(Report { text, json, whole: true })
}

/// A bar on standard error, hidden where that is no terminal.
fn progress_bar() -> ProgressBar {
    if !stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{wide_bar} {pos}/{len} points, {msg}, {eta} left");
    ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

fn show(bar: &ProgressBar, progress: Progress) {
    bar.set_length(progress.points as u64);
    bar.set_position(progress.done as u64);
    bar.set_message(format!("{} in contact, {:.0}/s", progress.contact_points, progress.rate));
}
