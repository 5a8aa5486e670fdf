//! `haptize play`: a dataset felt by a simulated hand, and the object seen to deform; traces and figures of it.

use super::{Failure, Report};
use haptize::{
    dataset::{Dataset, replace_file},
    device::Motion,
    render::{
        realtime,
        session::{self, SessionError},
        setup::Setup,
        timing::{Percentiles, Timing},
        trace::{Summary, Trace},
    },
    report,
};
use serde_json::Value;
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
    #[arg(long)]
    seconds: Option<f64>,
    /// Against the clock, in a real-time thread where permitted, instead of as fast as it goes.
    #[arg(long)]
    realtime: bool,
    /// The folder to write traces and figures to.
    #[arg(short, long, default_value = "out")]
    output: PathBuf,
}

/// Shapes of the object that are kept.
const SNAPSHOTS: usize = 60;

/// Longest session [s]: all its ticks are kept in memory, half a gigabyte for each ten minutes at 1 kHz.
const LONGEST: f64 = 3600.0;

/// Plays the dataset.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let dataset = Dataset::open(&arguments.dataset)?;
    let setup = Setup::new(&dataset).map_err(|error| format!("{}: {error}", arguments.dataset.display()))?;
    let motion = motion(&setup, &arguments.motion)?;
    let seconds = arguments.seconds.unwrap_or_else(|| motion.duration());
    if !(seconds > 0.0 && seconds <= LONGEST) {
        return Err(format!("cannot play {seconds} s: give --seconds between 0 and {LONGEST}").into());
    }
    for exceeded in &setup.exceeded {
        eprintln!("haptize: note: {exceeded}");
    }
    let played = play(&setup, &dataset, motion, seconds, arguments.realtime)?;
    if let Some(timing) = &played.timing {
        timing.refused.iter().for_each(|refused| eprintln!("haptize: note: {refused}"));
    }
    let files = write(&setup, &dataset, &played, &arguments.output)?;
    let summary = played.trace.summary();
    let mut json = serde_json::to_value(summary)?;
    json["notes"] = setup.exceeded.iter().map(ToString::to_string).collect();
    json["timing"] = serde_json::to_value(&played.timing)?;
    json["files"] = files.iter().map(|file| Value::from(file.display().to_string())).collect();
    let mut text = String::new();
    describe(&mut text, &summary)?;
    if let Some(timing) = &played.timing {
        describe_timing(&mut text, timing)?;
    }
    writeln!(text, "{} files in {}", files.len(), arguments.output.display())?;
    Ok(Report { text, json, whole: true })
}

/// A session that was played.
pub struct Played {
    /// Its recording.
    pub trace: Trace,
    /// How punctual it was, if it ran against the clock.
    pub timing: Option<Timing>,
}

/// Plays `motion` for `seconds`, by a simulated hand.
pub fn play(
    setup: &Setup,
    dataset: &Dataset,
    motion: Motion,
    seconds: f64,
    against_the_clock: bool,
) -> Result<Played, Failure> {
    let mut hand = setup.hand(motion)?;
    let mut graphics = setup.graphics(dataset)?;
    let plan = setup.plan(dataset, seconds, SNAPSHOTS);
    if against_the_clock {
        let (trace, timing) = realtime::run(&setup.haptics, &mut hand, graphics.as_mut(), &plan)?;
        return Ok(Played { trace, timing: Some(timing) });
    }
    let played: Result<Trace, SessionError> = session::run(&setup.haptics, &mut hand, graphics.as_mut(), &plan);
    Ok(Played { trace: played?, timing: None })
}

/// Writes traces and figures of `played` into `folder`, and returns their paths.
pub fn write(setup: &Setup, dataset: &Dataset, played: &Played, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("cannot make the folder {}: {error}; give another by -o", folder.display()))?;
    let unwritten =
        |path: &Path, error| format!("cannot write {}: {error}; free some space or give -o", path.display());
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
        (s.outside, "outside the grid"),
        (s.absent, "beside absent grid points"),
        (s.unconverged, "beside unconverged grid points"),
        (s.limited, "with the device's torque limited"),
        (s.faults, "with a fault of the device"),
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
    writeln!(text, "  missed       {missed_deadlines} deadlines, {missed_frames} frames, {unrecorded} records")
}
