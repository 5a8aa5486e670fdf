//! A session that was played: its files, and what there is to say about it.

use super::{
    Failure, interrupt,
    report::{Describe, Text},
    tell, telling_faults,
};
use crate::{
    dataset::{Dataset, JointLabel, Replacement, discard_unfinished, replace_file},
    device::Device,
    names::counted,
    render::{
        graphics::Graphics,
        haptic::Haptics,
        realtime::{self, Options},
        session::{self, Plan},
        setup::{Setup, labels},
        timing::{Percentiles, Timing},
        trace::{Summary, Tick, TickTable, Trace},
    },
    report,
    scene::effort_norms,
};
use std::{
    fmt,
    path::{Path, PathBuf},
    sync::Arc,
};

/// Files beside [`report::FIGURES`].
pub const FILES: [&str; 6] = [TICKS, "frames.csv", "jitter.svg", "jitter.png", "twin.svg", "twin.png"];

/// File of the ticks.
const TICKS: &str = "trace.csv";

/// Shapes of the object that are kept.
pub const SNAPSHOTS: usize = 60;

/// Says that a file cannot be written, and why.
pub fn unwritten(path: &Path, error: impl fmt::Display) -> String {
    format!("cannot write {}: {error}; free some space or give another place", path.display())
}

/// A session that was played.
pub struct Played {
    /// Its recording.
    pub trace: Arc<Trace>,
    /// How punctual it was, if it ran against the clock.
    pub timing: Option<Timing>,
}

/// Plays for `seconds` what `device` does, as fast as it goes, and hands over the ticks.
pub fn play(
    setup: &Setup,
    dataset: &Dataset,
    device: &mut dyn Device,
    seconds: f64,
    on_tick: &mut dyn FnMut(&Tick),
) -> Result<Played, Failure> {
    let mut graphics = setup.graphics(dataset)?;
    let plan = setup.plan(dataset, seconds, SNAPSHOTS);
    let trace = session::run(&setup.haptics, device, graphics.as_mut(), &plan)?;
    trace.ticks.iter().for_each(on_tick);
    Ok(Played { trace: trace.into(), timing: None })
}

/// Plays as `plan` says what `device` does, against the clock.
pub fn play_timed(
    haptics: &Haptics,
    device: &mut dyn Device,
    graphics: Option<&mut Graphics<'_>>,
    plan: &Plan,
    options: Options<'_>,
) -> Result<Played, Failure> {
    let (mut nobody, Options { stop, on_tick }) = (|_: &Tick| (), options);
    let mut on_tick = telling_faults(on_tick.unwrap_or(&mut nobody));
    let options = Options { stop, on_tick: Some(&mut on_tick) };
    let (trace, timing) = realtime::run(haptics, device, graphics, plan, options)?;
    Ok(Played { trace: trace.into(), timing: Some(timing) })
}

/// Runs `session`, which hands over its ticks, and writes them to `trace.csv` in `folder` as they come: however long
/// the session, little is left to be written when a signal ends it. Returns the file, or why it cannot be written,
/// beside what was played.
pub fn traced(
    dataset: &Dataset,
    folder: &Path,
    session: impl FnOnce(&mut dyn FnMut(&Tick)) -> Result<Played, Failure>,
) -> Result<(Played, Result<PathBuf, String>), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("cannot make the folder {}: {error}; give another by -o", folder.display()))?;
    let file = folder.join(TICKS);
    let unwritten = |error| unwritten(&file, error);
    let growing = Replacement::begin(&file).map_err(unwritten)?;
    let mut table = TickTable::new(&labels(&dataset.grid), growing.writer()).map_err(unwritten)?;
    let mut written = Ok(());
    let played = session(&mut |tick| {
        if written.is_ok() {
            written = table.add(tick);
        }
    })?;
    let written = written.and_then(|()| table.finish()).and_then(|()| growing.finish());
    Ok((played, written.map(|()| file.clone()).map_err(unwritten)))
}

/// Writes shapes and figures of `played` into `folder`, and returns their paths.
pub fn write(setup: &Setup, dataset: &Arc<Dataset>, played: &Played, folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    if !played.trace.frames.is_empty() {
        let frames = folder.join("frames.csv");
        replace_file(&frames, |out| played.trace.write_frames(out)).map_err(|error| unwritten(&frames, error))?;
        files.push(frames);
    }
    let mut figures =
        report::figures(dataset, Some((&Arc::new(setup.chain.clone()), &played.trace)), setup.haptics.source().live());
    if let Some(timing) = played.timing.clone() {
        figures.push(report::Figure::drawing("jitter", move || report::jitter::jitter(&timing)));
    }
    let report::Files { written, left_out } = report::write_until(interrupt::is_late, folder, figures)?;
    files.extend(written);
    if !left_out.is_empty() {
        discard_unfinished();
        let names: Vec<_> = left_out.iter().filter_map(|file| file.file_name()?.to_str()).collect();
        tell(format_args!(
            "haptize: note: for want of time after the signal these are left out: {}; a session that ends by --seconds \
             has them all, and `haptize play` draws a session that --record wrote (--replay FILE)",
            names.join(", ")
        ));
    }
    Ok(files)
}

/// Says in millijoules what was added to the loop's energy, or taken from it.
fn exchanged(joules: f64) -> String {
    let verb = if joules > 0.0 { "injected" } else { "removed" };
    format!("{verb} {:.2} mJ", 1e3 * joules.abs())
}

/// Returns a number of ticks in words.
pub fn ticks(count: usize) -> String {
    counted(count, ["tick", "ticks"])
}

/// Describes what was felt along `joints`, below a first line that begins with `head`.
pub fn describe_session(text: &mut Text, head: &str, s: &Summary, joints: &[JointLabel]) {
    let sizes = |torque: f64, force: f64| effort_norms([torque, force], joints.iter().map(|joint| joint.unit.as_str()));
    let contact = 100.0 * s.contact_share;
    text.line(format_args!("{head}{:.2} s, {}, {contact:.0} % in contact", s.seconds, ticks(s.ticks)));
    // What was measured, and a store, do not say how many nodes of the object are in contact.
    let nodes = match s.max_contact_nodes {
        0 => String::new(),
        nodes => format!(", {}", counted(nodes, ["object node", "object nodes"])),
    };
    text.row("contact", format_args!("at most {}{nodes}", sizes(s.max_contact_torque, s.max_contact_force)));
    let proxy = sizes(s.max_contact_torque_step, s.max_contact_force_step);
    let device = sizes(s.max_device_torque_step, s.max_device_force_step);
    text.row("steepest", format_args!("{proxy} in a millisecond on the proxy, {device} on the device"));
    text.row(
        "energy",
        format_args!(
            "time step and interpolation {}, sample-and-hold {}; the balance closes to {:.0e} (relative)",
            exchanged(s.leak),
            exchanged(s.hold_gain),
            s.max_relative_account_residual
        ),
    );
    for (count, what) in [
        (s.outside, "in free space outside the haptized range"),
        (s.held, "held at the border of the haptized range: for more room, bake a wider grid"),
        (s.absent, "beside absent grid points"),
        (s.unconverged, "beside unconverged grid points, or not solved in time"),
        (s.limited, "with the device's torque limited"),
        (s.faults, "without torque, after a fault"),
    ] {
        if count > 0 {
            text.row("note", format_args!("{} {what}", ticks(count)));
        }
    }
}

impl Describe for Timing {
    fn describe(&self, text: &mut Text) {
        let Self { interval, lateness, tick_cost, frame_cost, .. } = self;
        for (what, p) in [("period", interval), ("lateness", lateness), ("tick", tick_cost), ("frame", frame_cost)] {
            let Percentiles { p50, p99, p999, p9999, max, .. } = p;
            text.row(
                what,
                format_args!("median {p50:.1} us, 99 % {p99:.1}, 99.9 % {p999:.1}, 99.99 % {p9999:.1}, most {max:.1}"),
            );
        }
        let Self { missed_deadlines, missed_frames, unrecorded, late, refused, stolen, .. } = self;
        text.row(
            "missed",
            format_args!(
                "{} (ticks left out because an earlier one ran late), {}, {}",
                counted(*missed_deadlines, ["deadline", "deadlines"]),
                counted(*missed_frames, ["frame", "frames"]),
                counted(*unrecorded, ["record", "records"])
            ),
        );
        if *late == 0 {
            return;
        }
        // Who has the priority already is not told to give it.
        let remedy = if refused.is_empty() {
            "give the loop an idle core"
        } else {
            "give the loop real-time priority (haptize doctor) or an idle core"
        };
        let stolen = stolen.filter(|seconds| *seconds > 0.0).map_or(String::new(), |seconds| {
            format!("; the hypervisor took {seconds:.2} s from this virtual machine: give it processors of its own")
        });
        text.row("late", format_args!("{} by more than half a period: {remedy}{stolen}", ticks(*late as usize)));
    }
}
