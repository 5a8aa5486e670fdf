//! `haptize play`: a dataset felt by a simulated hand, and the object seen to deform; traces and figures of it.

use super::{
    Failure, Report,
    felt::Felt,
    output::{self, Kind},
    tell,
};
use crate::{
    dataset::{Dataset, replace_file},
    device::{Device, Motion, Recorded},
    render::{
        realtime,
        recording::Recording,
        session::{self, SessionError},
        setup::{Setup, labels},
        steal::Steal,
        timing::{Percentiles, Timing},
        trace::{Summary, Trace},
    },
    report,
};
use serde_json::{Value, json};
use std::{
    fmt::{self, Write},
    path::{Path, PathBuf},
};

/// What to play, and how.
#[derive(clap::Args)]
pub struct Arguments {
    /// The dataset's file.
    dataset: PathBuf,
    /// What the hand does: `press` or `scrape` as in the scene, or a CSV file of times [s] and joint coordinates.
    #[arg(long, default_value = "press")]
    motion: String,
    /// How long; by default as long as the motion [s].
    #[arg(long, allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// The device moves exactly as the motion says, whatever the torque, instead of being held by a simulated hand.
    #[arg(long)]
    exact: bool,
    /// Against the clock, in a real-time thread where permitted, instead of as fast as it goes.
    #[arg(long)]
    realtime: bool,
    /// Records the session into this file: all that the loop was told, and what it answered.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Has the session in this file again and compares it bit for bit; differences are an error.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["motion", "seconds", "exact", "realtime", "record"])]
    replay: Option<PathBuf>,
    /// The folder to write traces and figures to; by default one in `out/` that is named after dataset and motion.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Another dataset, felt by the same motion: the forces at the end of both proxies are drawn in one figure.
    #[arg(long, value_name = "DATASET", conflicts_with = "replay")]
    beside: Option<PathBuf>,
}

/// Shapes of the object that are kept.
const SNAPSHOTS: usize = 60;

/// Longest session [s]: all its ticks are kept in memory, half a gigabyte for each ten minutes at 1 kHz.
const LONGEST: f64 = 3600.0;

/// Plays the dataset.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let inputs =
        || [&arguments.dataset].into_iter().chain(&arguments.beside).chain(&arguments.replay).map(PathBuf::as_path);
    let moved = || std::iter::once(Path::new(&arguments.motion));
    let folder = folder(arguments);
    if let Some(file) = &arguments.record {
        output::check(file, Kind::Table, inputs().chain(moved()))?;
    }
    for trace in ["trace.csv", "frames.csv"] {
        output::check(&folder.join(trace), Kind::Table, inputs().chain(moved()))?;
    }
    let dataset = Dataset::load(&arguments.dataset)?;
    let setup = Setup::new(&dataset).map_err(|error| format!("{}: {error}", arguments.dataset.display()))?;
    for exceeded in &setup.exceeded {
        tell(format_args!("haptize: note: {exceeded}"));
    }
    let (played, told) = match &arguments.replay {
        Some(file) => replay(&setup, &dataset, file)?,
        None => (perform(&setup, &dataset, arguments)?, None),
    };
    if let Some(timing) = &played.timing {
        timing.refused.iter().for_each(|refused| tell(format_args!("haptize: note: {refused}")));
    }
    let mut files = Vec::new();
    if let Some(file) = &arguments.record {
        record(&played, file)?;
        files.push(file.clone());
    }
    files.extend(write(&setup, &dataset, &played, &folder)?);
    let mut felt = Felt::new(&arguments.dataset, &dataset, &setup, &played.trace);
    if let Some(path) = &arguments.beside {
        felt.beside(path, motion(&setup, &arguments.motion)?, played.trace.summary().seconds)?;
        felt.draw(&folder, &played.trace)?;
    }
    let summary = played.trace.summary();
    let fault = played.trace.ticks.iter().find_map(|tick| Some((tick.time, tick.fault?.to_string())));
    let mut json = serde_json::to_value(summary)?;
    felt.tell(&mut json);
    json["notes"] = setup.exceeded.iter().map(ToString::to_string).collect();
    json["bounds"] = serde_json::to_value(&setup.bounds)?;
    json["timing"] = serde_json::to_value(&played.timing)?;
    json["fault"] = fault.as_ref().map(|(time, reason)| json!({ "time": time, "reason": reason })).into();
    json["replayed"] = told.is_some().into();
    json["files"] = files.iter().map(|file| Value::from(file.display().to_string())).collect();
    let mut text = told.unwrap_or_default();
    describe(&mut text, &summary)?;
    felt.describe(&mut text)?;
    if let Some((time, reason)) = &fault {
        writeln!(text, "  fault        at {time:.4} s the torque went to zero: {reason}; play again to clear it")?;
    }
    if let Some(timing) = &played.timing {
        describe_timing(&mut text, timing)?;
    }
    if let Some(file) = &arguments.record {
        writeln!(text, "recorded in {}", file.display())?;
    }
    writeln!(text, "traces and figures in {}", folder.display())?;
    Ok(Report { text, json, whole: fault.is_none() })
}

/// The session that `arguments` ask for.
fn perform(setup: &Setup, dataset: &Dataset, arguments: &Arguments) -> Result<Played, Failure> {
    let motion = motion(setup, &arguments.motion)?;
    let seconds = arguments.seconds.unwrap_or_else(|| motion.duration());
    if !(seconds > 0.0 && seconds <= LONGEST) {
        return Err(format!("cannot play {seconds} s: give --seconds between 0 and {LONGEST}").into());
    }
    let mut device: Box<dyn Device> =
        if arguments.exact { Box::new(Recorded::new(motion)) } else { Box::new(setup.hand(motion)?) };
    play(setup, dataset, device.as_mut(), seconds, arguments.realtime)
}

/// Has the session in `file` again. Its figures, and a line that says that it was the same.
fn replay(setup: &Setup, dataset: &Dataset, file: &Path) -> Result<(Played, Option<String>), Failure> {
    let recording = Recording::read(file, setup.chain.joints.len())?;
    let mut graphics = setup.graphics(dataset)?;
    let trace = recording.replay(&setup.haptics, graphics.as_mut(), labels(&dataset.grid))?;
    if let Some(tick) = recording.first_difference(&trace) {
        let time = trace.ticks.get(tick).map_or(0.0, |tick| tick.time);
        let why = "the dataset, its scene or the version of haptize is another one than when it was recorded";
        return Err(
            format!("{}: the session differs from tick {tick}, at {time:.4} s, on: {why}", file.display()).into()
        );
    }
    let told = format!("{} ticks replayed, torque and proxy equal to the last bit\n", recording.ticks());
    Ok((Played { trace, timing: None }, Some(told)))
}

/// Writes what `played` recorded to `file`.
/// Where traces and figures go.
fn folder(arguments: &Arguments) -> PathBuf {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let felt = arguments.replay.as_deref().unwrap_or(Path::new(&arguments.motion));
    let named = || Path::new("out").join(format!("{}-{}", stem(&arguments.dataset), stem(felt)));
    arguments.output.clone().unwrap_or_else(named)
}

fn record(played: &Played, file: &Path) -> Result<(), Failure> {
    let lost = played.timing.as_ref().map_or(0, |timing| timing.unrecorded);
    if lost > 0 {
        return Err(
            format!("{lost} ticks were not recorded, the machine is too busy: nothing is written; try again").into()
        );
    }
    let recording = Recording::of(&played.trace);
    replace_file(file, |out| recording.write(&played.trace.joints, out)).map_err(|error| unwritten(file, error))?;
    Ok(())
}

fn unwritten(path: &Path, error: impl fmt::Display) -> String {
    format!("cannot write {}: {error}; free some space or give another place", path.display())
}

/// A session that was played.
pub struct Played {
    /// Its recording.
    pub trace: Trace,
    /// How punctual it was, if it ran against the clock.
    pub timing: Option<Timing>,
}

/// Plays for `seconds` what `device` does.
pub fn play(
    setup: &Setup,
    dataset: &Dataset,
    device: &mut dyn Device,
    seconds: f64,
    against_the_clock: bool,
) -> Result<Played, Failure> {
    let mut graphics = setup.graphics(dataset)?;
    let plan = setup.plan(dataset, seconds, SNAPSHOTS);
    if against_the_clock {
        let (trace, timing) = realtime::run(&setup.haptics, device, graphics.as_mut(), &plan)?;
        return Ok(Played { trace, timing: Some(timing) });
    }
    let played: Result<Trace, SessionError> = session::run(&setup.haptics, device, graphics.as_mut(), &plan);
    Ok(Played { trace: played?, timing: None })
}

/// Writes traces and figures of `played` into `folder`, and returns their paths.
pub fn write(setup: &Setup, dataset: &Dataset, played: &Played, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("cannot make the folder {}: {error}; give another by -o", folder.display()))?;
    let ticks = folder.join("trace.csv");
    replace_file(&ticks, |out| played.trace.write_ticks(out)).map_err(|error| unwritten(&ticks, error))?;
    let mut files = vec![ticks];
    if !played.trace.frames.is_empty() {
        let frames = folder.join("frames.csv");
        replace_file(&frames, |out| played.trace.write_frames(out)).map_err(|error| unwritten(&frames, error))?;
        files.push(frames);
    }
    files.extend(report::write_figures(folder, dataset, Some((&setup.chain, &played.trace)))?);
    if let Some(timing) = &played.timing {
        let jitter = report::jitter::jitter(timing);
        files.extend(report::write_both(folder, "jitter", &jitter)?);
    }
    Ok(files)
}

/// The motion called `name` in the scene, or in the file of that name.
pub fn motion(setup: &Setup, name: &str) -> Result<Motion, Failure> {
    let joints = setup.chain.joints.len();
    let waypoints = match name {
        "press" => &setup.scene.motion.press,
        "scrape" => &setup.scene.motion.scrape,
        file => return Ok(Motion::from_csv(Path::new(file), joints)?),
    };
    if waypoints.is_empty() {
        let known = "give [motion] in the scene such waypoints and bake it again, or a CSV file by --motion";
        return Err(format!("the dataset's scene has no motion \"{name}\": {known}").into());
    }
    Ok(Motion::through(waypoints, joints)?)
}

/// What was felt, for people.
pub fn describe(text: &mut String, s: &Summary) -> fmt::Result {
    writeln!(text, "{:.2} s, {} ticks, {:.0} % in contact", s.seconds, s.ticks, 100.0 * s.contact_share)?;
    writeln!(
        text,
        "  contact      torque at most {:.4} N m, {} object nodes",
        s.max_contact_torque, s.max_contact_nodes
    )?;
    writeln!(
        text,
        "  continuous   at most {:.4} N m/ms on the proxy, {:.4} on the device",
        s.max_contact_torque_step, s.max_device_torque_step
    )?;
    writeln!(
        text,
        "  energy       accounts close to {:.1e} of their turnover; leak {:.2e} J, held torque gave {:.2e} J",
        s.max_relative_account_residual, s.leak, s.hold_gain
    )?;
    for (count, what) in [
        (s.outside, "in free space outside the haptized range"),
        (s.held, "held at the border of the haptized range: for more room, bake a wider grid"),
        (s.absent, "beside absent grid points"),
        (s.unconverged, "beside unconverged grid points"),
        (s.limited, "with the device's torque limited"),
        (s.faults, "without torque, after a fault"),
    ] {
        if count > 0 {
            writeln!(text, "  note         {count} ticks {what}")?;
        }
    }
    Ok(())
}

/// How punctual it was, for people.
pub fn describe_timing(text: &mut String, timing: &Timing) -> fmt::Result {
    let mut line = |what: &str, p: Percentiles| {
        let Percentiles { p50, p99, p999, p9999, max, .. } = p;
        writeln!(
            text,
            "  {what:<12} median {p50:.1} us, 99 % {p99:.1}, 99.9 % {p999:.1}, 99.99 % {p9999:.1}, most {max:.1}"
        )
    };
    line("lateness", timing.lateness)?;
    line("tick", timing.tick_cost)?;
    line("frame", timing.frame_cost)?;
    let Timing { missed_deadlines, missed_frames, unrecorded, .. } = timing;
    writeln!(text, "  missed       {missed_deadlines} deadlines, {missed_frames} frames, {unrecorded} records")?;
    let Some(Steal { late, late_beside_steal, seconds }) = timing.steal.filter(|steal| steal.late > 0) else {
        return Ok(());
    };
    write!(text, "  late         {late} ticks by more than half a period")?;
    if late_beside_steal > 0 {
        write!(
            text,
            ", {late_beside_steal} of them while the hypervisor took the processor ({seconds:.2} s in all): give the virtual \
             machine processors of its own"
        )?;
    }
    if late > late_beside_steal {
        let own = late - late_beside_steal;
        write!(text, "; {own} by this system: give the loop real-time priority (haptize doctor) or an idle core")?;
    }
    writeln!(text)
}
