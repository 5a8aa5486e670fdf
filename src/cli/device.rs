//! `haptize device`: which real devices this machine has, and a careful first run of one.

use super::{Failure, Report, interrupt, keyboard::Keyboard, tell};
use crate::{
    control::{CheckReport, PUSH_SHARE, Phase, check},
    device::{Address, Guard, Key, Kind, LIMIT_SHARE, OpenError, Watchdog, open},
    scene::Rendering,
};
use serde_json::json;
use std::{
    fmt::{self, Write},
    path::PathBuf,
    sync::atomic::Ordering,
};

/// Arguments of `device`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize device list                           kinds of devices, and what each is missing here
  haptize device check 2diy                     reads it, then holds zero torque
  haptize device check woodenhaptics --push     drives each coordinate with little torque while the space bar is held")]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand)]
enum What {
    /// Show the kinds of devices, those that this machine has, and what is missing for the others.
    List,
    /// Run a device carefully for the first time: read it, hold zero torque, and with --push drive it with little
    /// torque.
    Check(Check),
}

/// Which device, and how far to go.
#[derive(clap::Args)]
struct Check {
    /// KIND or KIND:PLACE, as `haptize device list` shows it.
    device: Address,
    /// How long each phase takes (s).
    #[arg(long, default_value_t = 3.0)]
    seconds: f64,
    /// Drive each coordinate in turn with at most a tenth of the device's torque, while the space bar is held.
    #[arg(long)]
    push: bool,
    /// Keep within the `effort_limit` that [device] in this scene gives, too.
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
}

/// Longest phase (s).
const LONGEST: f64 = 600.0;

/// Lists or checks devices.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    match &arguments.what {
        What::List => list(),
        What::Check(arguments) => examine(arguments),
    }
}

fn list() -> Result<Report, Failure> {
    let mut text = String::new();
    let mut devices = Vec::new();
    for kind in Kind::ALL {
        let found = kind.find();
        writeln!(text, "{:<18} {}", kind.name(), kind.title())?;
        for place in &found.places {
            writeln!(text, "{:<18}   {place}", "")?;
        }
        for missing in &found.missing {
            writeln!(text, "{:<18}   -> {missing}", "")?;
        }
        devices.push(json!({ "kind": kind.name(), "title": kind.title(), "found": found }));
    }
    writeln!(text, "`haptize device check NAME` runs one carefully for the first time.")?;
    Ok(Report { text, json: json!({ "devices": devices }), whole: true })
}

fn examine(arguments: &Check) -> Result<Report, Failure> {
    if !(arguments.seconds > 0.0 && arguments.seconds <= LONGEST) {
        return Err(format!("cannot check for {} s: give --seconds between 0 and {LONGEST}", arguments.seconds).into());
    }
    let spec = arguments.scene.as_ref().map(Rendering::load).transpose()?.map(|scene| scene.device);
    let stop = interrupt::stop_flag_of_device();
    let (key, input) = Key::new();
    let hardware = open(&arguments.device, None)?;
    let mut guard =
        Guard::new(hardware, arguments.push.then_some(key)).map_err(|halt| format!("{}: {halt}", arguments.device))?;
    if let Some(limit) = spec.and_then(|spec| spec.effort_limit) {
        let device = guard.coordinates().count();
        guard.limit_each(&limit).map_err(|given| OpenError::EffortLimit { given, device })?;
    }
    let _keyboard = if arguments.push { Some(Keyboard::start(input)?) } else { None };
    tell(format_args!("haptize: {}", guard.description()));
    let phases: &[Phase] = if arguments.push {
        &[Phase::Reading, Phase::ZeroTorque, Phase::Push]
    } else {
        &[Phase::Reading, Phase::ZeroTorque]
    };
    let mut reports = Vec::new();
    for phase in phases {
        tell(format_args!("haptize: {}", instruction(*phase)));
        let report = check(&mut guard, *phase, arguments.seconds, stop)
            .map_err(|error| format!("{}: {error}", arguments.device))?;
        let ended = report.tally.stopped.is_some() || stop.load(Ordering::Relaxed);
        reports.push(report);
        if ended {
            break;
        }
    }
    let (coordinates, limits) = (guard.coordinates(), *guard.limits());
    let unit = coordinates.effort_unit();
    let description = guard.description();
    let limit: Vec<f64> = limits.effort.to_vec();
    let most: Vec<f64> = guard.most().to_vec();
    drop(guard);
    interrupt::over();
    let whole = reports.len() == phases.len() && reports.iter().all(CheckReport::is_good);
    let mut text = String::new();
    writeln!(text, "{}: {description}", arguments.device)?;
    writeln!(
        text,
        "  limit        {limit:.4?} {unit}; used: {LIMIT_SHARE} of it, {PUSH_SHARE} in this check, at most {most:.4?}"
    )?;
    match limits.watchdog {
        Watchdog::After(time) => {
            writeln!(text, "  watchdog     the device lets go {:.0} ms after the last command", 1e3 * time)?
        }
        Watchdog::Unstated => writeln!(
            text,
            "  watchdog     the device lets go when commands stop, after a time that its maker does not state"
        )?,
        Watchdog::None => writeln!(
            text,
            "  watchdog     NONE in the device: if haptize is killed or the machine hangs, the last torque stays on; \
             keep its power switch at hand"
        )?,
    }
    reports.iter().try_for_each(|report| describe(&mut text, report, coordinates.unit()))?;
    let json = json!({
        "device": arguments.device.to_string(),
        "description": description,
        "limit": limit,
        "most": most,
        "watchdog": limits.watchdog,
        "phases": reports,
    });
    Ok(Report { text, json, whole })
}

fn instruction(phase: Phase) -> &'static str {
    match phase {
        Phase::Reading => "motors off: move the device through its range",
        Phase::ZeroTorque => "motors on, zero torque: it should move as freely as before",
        Phase::Push => "hold the device loosely and the space bar: each coordinate is pushed in turn",
    }
}

fn describe(text: &mut String, report: &CheckReport, unit: &str) -> fmt::Result {
    let name = match report.phase {
        Phase::Reading => "reading",
        Phase::ZeroTorque => "zero torque",
        Phase::Push => "push",
    };
    let rate = report.fresh as f64 / report.seconds.max(f64::MIN_POSITIVE);
    writeln!(text, "  {name:<12} {rate:.0} new positions a second, the oldest {:.1} ms old", 1e3 * report.oldest)?;
    for (a, [least, most]) in report.range.iter().enumerate() {
        // Without a sign of zero.
        let [least, most] = [least, most].map(|end| (1e4 * end).round() / 1e4 + 0.0);
        write!(text, "    {a}: {least:.4} to {most:.4} {unit}")?;
        match (report.phase, report.moves_along[a]) {
            (Phase::Push, _) if !report.pushed[a] => write!(text, ", NOT pushed: hold the space bar all the time")?,
            (Phase::Push, along) => {
                let how = if along < 0.0 { ": it moves AGAINST the push" } else { "" };
                write!(text, ", work of the push {along:.1e} J{how}")?;
            }
            _ => (),
        }
        writeln!(text)?;
    }
    for (reason, ticks) in &report.tally.halted {
        writeln!(text, "    without torque for {ticks} ticks: {reason}")?;
    }
    Ok(())
}
