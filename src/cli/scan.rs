//! `haptize scan`: a real object haptized by touching it. The rig that ships is simulated, and says so.

use super::{
    Failure,
    bar::Bar,
    interrupt,
    keyboard::Keyboard,
    output::{self, Content, Replaced},
    report::{Describe, Report, Text},
    shell, tell,
};
use crate::{
    JointVector,
    control::check_rate,
    dataset::replace_file,
    device::{Address, Guard, Key, Kind as DeviceKind, attach_joints, open},
    logs::suggested_steps,
    names::counted,
    proxy::Chain,
    scan::{
        LogHeader, LogWriter, Plan, RATE, ScanLog, ScanProgress, ScanReport, ScanRow, Session, Trajectory, labels,
        simulated::{Hand, SimulatedRig},
    },
    scene::ScanScene,
    toml_text::coarse,
};
use serde::Serialize;
use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

/// Arguments of `haptize scan`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize scan sponge.toml
  haptize scan sponge.toml --resume
  haptize scan sponge.toml --guided 60")]
pub struct Arguments {
    /// A scene with a table `[scan]`, which says where the device goes.
    scene: PathBuf,
    /// The log to write; by default the scene's name in the current folder, ending in .csv.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Continue a log that was interrupted.
    #[arg(long)]
    resume: bool,
    /// Scan with a real device instead of the simulated rig: KIND or KIND:PLACE, as `haptize device list` shows it. It
    /// must measure and drive its joints. With --guided, hold the space bar while you move it.
    #[arg(long, value_name = "NAME", conflicts_with = "plan_out")]
    device: Option<Address>,
    /// Only write the plan as a trajectory, as CSV or, where the name ends in .mcap, as joint states in MCAP: for a
    /// robot that its own controller moves. Its log comes back by `haptize gridize`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["output", "resume", "guided"])]
    plan_out: Option<PathBuf>,
    /// How long the trajectory of --plan-out rests at each point (s); by default `window` and `average` of the
    /// scan's control together.
    #[arg(long, requires = "plan_out", allow_negative_numbers = true)]
    dwell: Option<f64>,
    /// Instead of going through the plan, log for so many seconds wherever a hand leads the device to and lets go of
    /// it. The simulated rig is led by a simulated hand, to places of the plan.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    guided: Option<f64>,
}

/// Longest guided scan (s).
const LONGEST: f64 = 36_000.0;

/// Seed of the simulated rig's noise.
const SEED: u64 = 1;

/// Scans. Ctrl-C stops after the current point and leaves a log that `--resume` continues.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let scene = ScanScene::load(&arguments.scene)?;
    if let Some(seconds) = arguments.guided.filter(|seconds| !(*seconds > 0.0 && *seconds <= LONGEST)) {
        return Err(format!("cannot log for {seconds} s: give --guided between 0 and {LONGEST}").into());
    }
    if let Some(file) = &arguments.plan_out {
        return write_plan(&scene, arguments, file);
    }
    let output = match &arguments.output {
        Some(output) => output.clone(),
        None => PathBuf::from(arguments.scene.file_name().ok_or("the scene's path names no file; give -o")?)
            .with_extension("csv"),
    };
    output::check(&output, Content::Scan, [arguments.scene.as_path()])?;
    let stop = if arguments.device.is_some() { interrupt::stop_flag_of_device() } else { interrupt::stop_flag() };
    let bar = Bar::new("points", "{wide_bar} {pos}/{len} points, {msg}");
    let mut progress = |progress: ScanProgress| {
        interrupt::kept();
        bar.set(progress.done as u64, progress.points as u64, format!("{:.0} s on the rig", progress.time), None);
    };
    let course = Course { resume: arguments.resume, guided: arguments.guided };
    let result = match &arguments.device {
        Some(address) => drive(&scene, &output, course, address, stop, &mut progress),
        None => measure(&scene, &output, course, stop, &mut progress),
    };
    bar.finish();
    interrupt::over();
    let (report, file) = (result?, output.display().to_string());
    let [scene, log] = [&arguments.scene, &output].map(|file| shell::file(file));
    let next = if report.whole {
        format!("haptize gridize {log} --step {}", steps(&ScanLog::read(&output)?))
    } else {
        format!("haptize scan {scene} -o {log} --resume")
    };
    let scanned = Scanned { report, file, next };
    Report::of(&scanned, scanned.report.whole)
}

/// The spacing of a grid to begin with, as an argument.
fn steps(log: &ScanLog) -> String {
    let joints = log.header.joints.len();
    let range = |joint: usize| {
        let values = || log.rows.iter().map(|row| row.q[joint]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    suggested_steps(&(0..joints).map(range).collect::<Vec<_>>()).into_iter().map(coarse).collect::<Vec<_>>().join(",")
}

/// An object that was scanned.
#[derive(Serialize)]
struct Scanned {
    #[serde(flatten)]
    report: ScanReport,
    file: String,
    /// The command that continues a scan that was interrupted, or makes a dataset of a whole one.
    #[serde(skip)]
    next: String,
}

impl Describe for Scanned {
    fn describe(&self, text: &mut Text) {
        let Self { report, file, next } = self;
        let ScanReport { steady, points, seconds, rig, .. } = report;
        text.line(format_args!(
            "{file}: {steady} of {} measured in {seconds:.0} s on the rig's clock",
            counted(*points, ["point", "points"])
        ));
        text.row("rig", rig);
        for (count, what) in [
            (report.unsteady, "not steady in time, left out by gridize"),
            (report.limited, "stopped by a limit, left out by gridize"),
            (report.unreachable, "not reached by the joints"),
        ] {
            if count > 0 {
                text.row("note", format_args!("{} {what}", counted(count, ["point", "points"])));
            }
        }
        if let Some(histories) = report.histories {
            text.row(
                "recorded",
                format_args!(
                    "{}, of which gridize learns memory and friction",
                    counted(histories, ["press", "presses"])
                ),
            );
        }
        if report.whole {
            text.row("next", next);
        } else {
            text.row("interrupted", format_args!("continue: {next}"));
        }
    }
}

/// Writes the plan of `scene` to `file`.
fn write_plan(scene: &ScanScene, arguments: &Arguments, file: &Path) -> Result<Report, Failure> {
    let replaced = output::check(file, Content::Product, [arguments.scene.as_path()])?;
    let control = &scene.scan.control;
    let dwell = arguments.dwell.unwrap_or(control.window + control.average);
    if !(dwell > 0.0 && dwell <= LONGEST) {
        return Err(format!("cannot rest for {dwell} s at each point: give --dwell between 0 and {LONGEST}").into());
    }
    let chain = Chain::new(&scene.proxy);
    let plan = Plan::new(&scene.scan, &chain)?;
    let trajectory = Trajectory::new(&plan, control.speed, dwell);
    let joints = labels(&chain);
    let written = replace_file(file, |out| match output::is_mcap(file) {
        true => trajectory.write_mcap(&joints, out),
        false => trajectory.write_csv(&joints, out),
    });
    written
        .map_err(|error| format!("cannot write {}: {error}; free some space or give another place", file.display()))?;
    Report::new(&WrittenPlan {
        file: file.display().to_string(),
        rows: trajectory.rows.len(),
        points: plan.points,
        unreachable: plan.unreachable.len(),
        seconds: trajectory.duration(),
        dwell,
        replaced,
    })
}

/// A plan written as a trajectory.
#[derive(Serialize)]
struct WrittenPlan {
    file: String,
    rows: usize,
    points: usize,
    /// Points that the joints do not reach.
    unreachable: usize,
    /// Duration, and how long it rests at each point (s).
    seconds: f64,
    dwell: f64,
    #[serde(flatten)]
    replaced: Option<Replaced>,
}

impl Describe for WrittenPlan {
    fn describe(&self, text: &mut Text) {
        let Self { file, rows, points, unreachable, seconds, dwell, replaced } = self;
        let reached = points - unreachable;
        text.line(format_args!(
            "{file}: {} through {} in {seconds:.0} s, {dwell} s at each; {} not reached by the joints",
            counted(*rows, ["row", "rows"]),
            counted(reached, ["point", "points"]),
            counted(*unreachable, ["point is", "points are"])
        ));
        text.row("note", "limits of torque and speed are the robot's own: nothing of haptize watches it");
        replaced.describe(text);
    }
}

/// How a scan goes: by default through the whole plan, into a new log.
#[derive(Clone, Copy, Default)]
pub struct Course {
    /// Whether a log that is there is continued.
    pub resume: bool,
    /// Time for which a hand leads, instead of the plan (s).
    pub guided: Option<f64>,
}

/// Scans `scene` on the simulated rig into the log `output`, until it is done or `stop` is raised.
pub fn measure(
    scene: &ScanScene,
    output: &Path,
    course: Course,
    stop: &AtomicBool,
    progress: &mut (dyn FnMut(ScanProgress) + Send),
) -> Result<ScanReport, Failure> {
    let (chain, plan) = planned(scene)?;
    let first = plan.stops.first().map_or_else(|| JointVector::zeros(chain.joints.len()), |stop| stop.q);
    let mut rig = SimulatedRig::new(&scene.proxy, &scene.scan.simulated, first, SEED);
    let header = header(scene, &chain, course, (rig.description(), true));
    let (mut log, logged) = open_log(&header, output, course)?;
    if let Some(seconds) = course.guided {
        rig = rig.led_by(Hand::new(plan.spread(logged.len(), Hand::visits_within(seconds))));
    }
    let (spec, chain, header, log) = (&scene.scan, &chain, &header, &mut log);
    let device = &mut rig;
    go(Session { spec, chain, device, against_time: false, header, log, stop, progress }, course, &plan, &logged)
}

/// Scans `scene` with the device at `address` into the log `output`, until it is done or `stop` is raised.
fn drive(
    scene: &ScanScene,
    output: &Path,
    course: Course,
    address: &Address,
    stop: &AtomicBool,
    progress: &mut (dyn FnMut(ScanProgress) + Send),
) -> Result<ScanReport, Failure> {
    let (chain, plan) = planned(scene)?;
    let (key, input) = Key::new();
    let _keyboard = if course.guided.is_some() { Some(Keyboard::start(input)?) } else { None };
    let guard = Guard::new(open(address, None)?, None).map_err(|halt| format!("{address}: {halt}"))?;
    if let Some(scheduler) = guard.scheduler() {
        check_rate(scheduler.as_ref(), 1.0 / scene.scan.control.rate, RATE)
            .map_err(|error| format!("{address}: {error}"))?;
    }
    let header = header(scene, &chain, course, (guard.description(), address.kind == DeviceKind::Simulated));
    let (mut log, logged) = open_log(&header, output, course)?;
    // Last of all: the motors go on.
    let device = attach_joints(guard, address, chain.degrees_of_freedom(), &scene.device)?;
    let device = &mut device.led_by(course.guided.map(|_| key));
    let (spec, chain, header, log) = (&scene.scan, &chain, &header, &mut log);
    go(Session { spec, chain, device, against_time: true, header, log, stop, progress }, course, &plan, &logged)
}

/// The arm of `scene`, and where it goes.
fn planned(scene: &ScanScene) -> Result<(Chain, Plan), Failure> {
    let chain = Chain::new(&scene.proxy);
    let plan = Plan::new(&scene.scan, &chain)?;
    Ok((chain, plan))
}

/// What the log of a scan says of it and of the rig, whose description this is; whether that is simulated.
fn header(scene: &ScanScene, chain: &Chain, course: Course, (rig, simulated): (String, bool)) -> LogHeader {
    LogHeader { rig, simulated, guided: course.guided.is_some(), joints: labels(chain), scene: scene.text.clone() }
}

/// Begins or continues a log, and tells of its rig; the rows that it holds.
fn open_log(header: &LogHeader, output: &Path, course: Course) -> Result<(LogWriter, Vec<ScanRow>), Failure> {
    let opened = if course.resume {
        LogWriter::resume(output, header)?
    } else {
        (LogWriter::create(output, header)?, Vec::new())
    };
    tell(format_args!("haptize: {}", header.rig));
    Ok(opened)
}

fn go(mut session: Session<'_>, course: Course, plan: &Plan, logged: &[ScanRow]) -> Result<ScanReport, Failure> {
    Ok(match course.guided {
        Some(seconds) => session.guided(seconds, logged),
        None => session.scan(plan, logged),
    }?)
}
