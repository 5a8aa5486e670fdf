//! `haptize gridize`: scattered measurements made a dataset over a uniform grid.

use super::{Failure, Report};
use haptize::{
    dataset::Dataset,
    haptize::{
        gridize::{GridizeOptions, GridizeReport, Interpolation, Samples, gridize},
        import::{ImportProgress, ImportReport, Mapping, import, total_size},
        scan::{RowStatus, ScanLog},
    },
    scene::Rendering,
};
use indicatif::{ProgressBar, ProgressStyle};
use std::{
    fmt::{self, Write},
    io::{IsTerminal, stderr},
    path::PathBuf,
    time::{Instant, SystemTime},
};

/// What to gridize, and how finely.
#[derive(clap::Args)]
pub struct Arguments {
    /// A log written by `haptize scan`, or with --columns any tables of joint positions and torques.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Grid step [rad or m]: one number, or one a joint, separated by commas.
    #[arg(long, required = true, value_delimiter = ',', num_args = 1, value_name = "H")]
    step: Vec<f64>,
    /// The dataset to write; by default the first log's name in the current folder, ending in .haptize.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// A TOML file that says which column is what (datasets/instrument.toml is an example).
    #[arg(long, value_name = "TOML")]
    columns: Option<PathBuf>,
    /// A scene whose proxy and gains the dataset is to be felt with; scan logs bring theirs.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Torque above which a configuration counts as contact [N m]; by default three standard deviations of the samples, or
    /// a hundredth of the greatest torque.
    #[arg(long)]
    epsilon: Option<f64>,
    /// How torques are interpolated.
    #[arg(long, default_value = "linear")]
    interpolation: Interpolation,
    /// Smooth torques within their measured standard deviation first.
    #[arg(long)]
    smooth: bool,
}

/// What was read.
struct Source {
    samples: Samples,
    scene: String,
    /// For the dataset's provenance: `scan`, `simulated scan` or `import`, and of what.
    kind: &'static str,
    of: String,
    import: Option<ImportReport>,
    left_out: usize,
}

/// Reads the logs and writes the dataset.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let started = Instant::now();
    let mut source = match &arguments.columns {
        Some(columns) => imported(arguments, &Mapping::load(columns)?)?,
        None => scanned(arguments)?,
    };
    if let Some(path) = &arguments.scene {
        source.scene = scene(path, source.samples.joints.len())?;
    }
    let read = started.elapsed().as_secs_f64();
    let options = GridizeOptions {
        steps: arguments.step.clone(),
        epsilon: arguments.epsilon,
        interpolation: arguments.interpolation,
        smooth: arguments.smooth,
    };
    let (mut dataset, report) = gridize(&source.samples, &options)?;
    dataset.scene = source.scene.clone();
    dataset.provenance.backend = source.kind.to_owned();
    dataset.provenance.adapter.clone_from(&source.of);
    dataset.provenance.date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let output = output(arguments)?;
    dataset.save(&output)?;
    let seconds = started.elapsed().as_secs_f64();
    let mut json = serde_json::to_value(&report)?;
    json["file"] = output.display().to_string().into();
    json["source"] = source.kind.into();
    json["seconds"] = seconds.into();
    json["import"] = serde_json::to_value(&source.import)?;
    json["left_out"] = source.left_out.into();
    let mut text = String::new();
    writeln!(
        text,
        "{}: {} grid points of {} inside the measured region",
        output.display(),
        report.inside,
        report.points
    )?;
    describe(&mut text, &source, &dataset, &report)?;
    writeln!(text, "  {seconds:.2} s, of these {read:.2} s for reading")?;
    Ok(Report { text, json, whole: true })
}

fn output(arguments: &Arguments) -> Result<PathBuf, Failure> {
    if let Some(output) = &arguments.output {
        return Ok(output.clone());
    }
    let name = arguments.logs.first().and_then(|log| log.file_name()).ok_or("the log's path names no file; give -o")?;
    Ok(PathBuf::from(name).with_extension("haptize"))
}

fn scanned(arguments: &Arguments) -> Result<Source, Failure> {
    let [path] = arguments.logs.as_slice() else {
        return Err("several logs can be gridized together only with --columns".into());
    };
    let log = ScanLog::read(path)?;
    let left_out = log.rows.iter().filter(|row| row.status != RowStatus::Steady).count();
    let kind = if log.header.simulated { "simulated scan" } else { "scan" };
    Ok(Source { samples: log.samples(), scene: log.header.scene, kind, of: log.header.rig, import: None, left_out })
}

fn imported(arguments: &Arguments, mapping: &Mapping) -> Result<Source, Failure> {
    let total = total_size(&arguments.logs);
    let bar = if stderr().is_terminal() { ProgressBar::new(total) } else { ProgressBar::hidden() };
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {bytes}/{total_bytes}, {msg}, {eta} left") {
        bar.set_style(style);
    }
    let mut progress = |progress: ImportProgress| {
        bar.set_position(progress.bytes);
        bar.set_message(format!("{} rows", progress.rows));
    };
    let imported = import(mapping, &arguments.logs, &mut progress);
    bar.finish_and_clear();
    let (samples, report) = imported?;
    let left_out = report.dropped.iter().map(|dropped| dropped.rows as usize).sum();
    let names: Vec<String> = arguments.logs.iter().map(|log| log.display().to_string()).collect();
    Ok(Source { samples, scene: String::new(), kind: "import", of: names.join(", "), import: Some(report), left_out })
}

/// The text of a valid scene with as many joints as the samples.
fn scene(path: &PathBuf, joints: usize) -> Result<String, Failure> {
    let scene = Rendering::load(path)?;
    let count = scene.proxy.joints.len();
    if count != joints {
        return Err(format!("{}: its proxy has {count} joints, the samples {joints}", path.display()).into());
    }
    Ok(scene.text)
}

fn describe(text: &mut String, source: &Source, dataset: &Dataset, report: &GridizeReport) -> fmt::Result {
    writeln!(text, "  made from    {} samples ({}: {})", report.samples, source.kind, source.of)?;
    if report.merged > 0 {
        writeln!(text, "  merged       {} samples at the same configuration as another", report.merged)?;
    }
    writeln!(text, "  in contact   {} points, torque above {:.4}", report.contact_points, report.epsilon)?;
    if source.left_out > 0 {
        writeln!(text, "  left out     {} rows", source.left_out)?;
    }
    for dropped in source.import.iter().flat_map(|import| &import.dropped) {
        writeln!(text, "               {} {:?}, first at {}", dropped.rows, dropped.reason, dropped.first)?;
    }
    let Some(import) = &source.import else { return Ok(()) };
    writeln!(text, "  rows         {} read, {} gaps in time", import.rows, import.gaps)?;
    let Some(cells) = &import.cells else { return Ok(()) };
    writeln!(text, "  cells        {} visited, {} of them in both directions", cells.cells, cells.both_directions)?;
    for (axis, (hysteresis, repeatability)) in
        dataset.grid.axes.iter().zip(cells.hysteresis.iter().zip(&cells.repeatability))
    {
        let unit = axis.effort_unit();
        writeln!(
            text,
            "  {:<12} hysteresis +-{hysteresis:.4} {unit}, repeatability {repeatability:.4} {unit}",
            axis.name
        )?;
    }
    Ok(())
}
