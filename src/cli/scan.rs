//! `haptize scan`: a real object haptized by touching it. The rig that ships is simulated, and says so.

use super::{
    Failure, Report,
    bar::bar,
    interrupt::stop_flag,
    output::{self, Kind},
    tell,
};
use crate::{
    JointVector,
    haptize::scan::{
        LogHeader, LogWriter, Plan, Rig, ScanProgress, ScanReport, ScanRow, Session, labels,
        simulated::{Hand, SimulatedRig},
    },
    proxy::Chain,
    scene::ScanScene,
};
use std::{
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

/// What to scan.
#[derive(clap::Args)]
pub struct Arguments {
    /// The scene's file; its [scan] says where the device goes.
    scene: PathBuf,
    /// The log to write; by default the scene's name in the current folder, ending in .csv.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Continue a log that was interrupted.
    #[arg(long)]
    resume: bool,
    /// Instead of going through the plan, log for so many seconds wherever a hand leads the device to and lets go of it. The
    /// simulated rig is led by a simulated hand, to places of the plan.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    guided: Option<f64>,
}

/// Longest guided scan [s].
const LONGEST: f64 = 36_000.0;

/// Seed of the simulated rig's noise.
const SEED: u64 = 1;

/// Scans. Ctrl-C stops after the point at hand and leaves a log that `--resume` continues.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let scene = ScanScene::load(&arguments.scene)?;
    if let Some(seconds) = arguments.guided.filter(|seconds| !(*seconds > 0.0 && *seconds <= LONGEST)) {
        return Err(format!("cannot log for {seconds} s: give --guided between 0 and {LONGEST}").into());
    }
    let output = match &arguments.output {
        Some(output) => output.clone(),
        None => PathBuf::from(arguments.scene.file_name().ok_or("the scene's path names no file; give -o")?)
            .with_extension("csv"),
    };
    output::check(&output, Kind::Table, [arguments.scene.as_path()])?;
    let stop = stop_flag()?;
    let bar = bar(0, "{wide_bar} {pos}/{len} points, {msg}, {eta} left");
    let mut progress = |progress: ScanProgress| {
        bar.set_length(progress.points as u64);
        bar.set_position(progress.done as u64);
        bar.set_message(format!("{:.0} s on the rig", progress.time));
    };
    let course = Course { resume: arguments.resume, guided: arguments.guided };
    let result = measure(&scene, &output, course, stop, &mut progress);
    bar.finish_and_clear();
    stop.store(true, Ordering::Relaxed);
    let report = result?;
    let mut json = serde_json::to_value(&report)?;
    json["file"] = output.display().to_string().into();
    let mut text = describe(&output, &report);
    if !report.whole {
        text += &format!(
            "  interrupted; continue: haptize scan {} -o {} --resume\n",
            arguments.scene.display(),
            output.display()
        );
    }
    Ok(Report { text, json, whole: report.whole })
}

/// How a scan goes: by default through the whole plan, into a new log.
#[derive(Clone, Copy, Default)]
pub struct Course {
    /// Whether a log that is there is continued.
    pub resume: bool,
    /// Time for which a hand leads, instead of the plan [s].
    pub guided: Option<f64>,
}

/// Scans `scene` on the simulated rig into the log `output`, until it is done or `stop` is raised.
pub fn measure(
    scene: &ScanScene,
    output: &Path,
    course: Course,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(ScanProgress),
) -> Result<ScanReport, Failure> {
    let chain = Chain::new(&scene.proxy);
    let plan = Plan::new(&scene.scan.plan, &chain)?;
    let first = plan.stops.first().map_or_else(|| JointVector::zeros(chain.joints.len()), |stop| stop.q);
    let mut rig = SimulatedRig::new(&scene.proxy, &scene.scan.simulated, first, SEED);
    let header = LogHeader {
        rig: rig.description(),
        simulated: rig.is_simulated(),
        guided: course.guided.is_some(),
        joints: labels(&chain),
        scene: scene.text.clone(),
    };
    let (mut log, logged): (LogWriter, Vec<ScanRow>) = if course.resume {
        LogWriter::resume(output, &header)?
    } else {
        (LogWriter::create(output, &header)?, Vec::new())
    };
    if let Some(seconds) = course.guided {
        rig = rig.led_by(Hand::new(plan.spread(logged.len(), Hand::visits_within(seconds))));
    }
    tell(format_args!("haptize: {}", rig.description()));
    let mut session = Session { spec: &scene.scan, chain: &chain, rig: &mut rig, log: &mut log, stop, progress };
    Ok(match course.guided {
        Some(seconds) => session.guided(seconds, &logged),
        None => session.scan(&plan, &logged),
    }?)
}

fn describe(output: &Path, report: &ScanReport) -> String {
    let mut text = format!(
        "{}: {} of {} points measured in {:.0} s on the rig's clock\n  rig          {}\n",
        output.display(),
        report.steady,
        report.points,
        report.seconds,
        report.rig
    );
    for (count, what) in [
        (report.unsteady, "not steady in time, left out by gridize"),
        (report.limited, "stopped by a limit, left out by gridize"),
        (report.unreachable, "not reached by the joints"),
    ] {
        if count > 0 {
            text += &format!("  note         {count} points {what}\n");
        }
    }
    text
}
