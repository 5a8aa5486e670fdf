//! `haptize device`: which real devices this machine has, and a careful first run of one.

use super::{
    Failure, interrupt,
    keyboard::Keyboard,
    report::{Describe, Report, Text},
    tell,
};
use crate::{
    control::{CheckReport, PUSH_SHARE, Phase, check},
    device::{Address, Coordinates, Finding, Guard, Key, Kind, LIMIT_SHARE, Watchdog, open},
    names::counted,
    scene::Rendering,
};
use serde::Serialize;
use std::{path::PathBuf, sync::atomic::Ordering};

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

/// Kinds of devices, and what of them is here.
#[derive(Serialize)]
struct Devices {
    devices: Vec<Listed>,
}

/// A kind of device.
#[derive(Serialize)]
pub struct Listed {
    /// Its name, as commands take it.
    pub kind: &'static str,
    title: &'static str,
    /// Where it is, and what is missing.
    pub found: Finding,
}

impl Listed {
    /// Looks for devices of `kind`.
    pub fn look(kind: Kind) -> Self {
        Self { kind: kind.name(), title: kind.title(), found: kind.find() }
    }
}

fn list() -> Result<Report, Failure> {
    Report::new(&Devices { devices: Kind::ALL.map(Listed::look).into() })
}

impl Describe for Devices {
    fn describe(&self, text: &mut Text) {
        text.line("kinds of devices:");
        for Listed { kind, title, found } in &self.devices {
            text.row(*kind, title);
            found.places.iter().for_each(|place| text.row("", format_args!("  {place}")));
            found.missing.iter().for_each(|missing| text.row("", format_args!("  -> {missing}")));
        }
        text.line("`haptize device check NAME` runs one carefully for the first time.");
    }
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
        guard.limit_each(&limit)?;
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
    let checked = Checked {
        device: arguments.device.to_string(),
        description: guard.description(),
        limit: limits.effort.to_vec(),
        most: guard.most().to_vec(),
        watchdog: limits.watchdog,
        phases: reports,
        coordinates,
    };
    drop(guard);
    interrupt::over();
    Report::of(&checked, checked.phases.len() == phases.len() && checked.phases.iter().all(CheckReport::is_good))
}

/// A device that was checked.
#[derive(Serialize)]
struct Checked {
    device: String,
    description: String,
    /// Effort of each coordinate that the device bears, and the most that is used (N m or N).
    limit: Vec<f64>,
    most: Vec<f64>,
    watchdog: Watchdog,
    phases: Vec<CheckReport>,
    #[serde(skip)]
    coordinates: Coordinates,
}

fn instruction(phase: Phase) -> &'static str {
    match phase {
        Phase::Reading => "motors off: move the device through its range",
        Phase::ZeroTorque => "motors on, zero torque: it should move as freely as before",
        Phase::Push => "hold the device loosely and the space bar: each coordinate is pushed in turn",
    }
}

impl Describe for Checked {
    fn describe(&self, text: &mut Text) {
        let Self { device, description, limit, most, watchdog, phases, coordinates } = self;
        text.line(format_args!("{device}: {description}"));
        let unit = coordinates.effort_unit();
        text.row(
            "limit",
            format_args!(
                "{limit:.4?} {unit}; used: {LIMIT_SHARE} of it, {PUSH_SHARE} in this check, at most {most:.4?}"
            ),
        );
        let lets_go = "the device lets go";
        text.row(
            "watchdog",
            match watchdog {
                Watchdog::After(time) => format!("{lets_go} {:.0} ms after the last command", 1e3 * time),
                Watchdog::Unstated => {
                    format!("{lets_go} when commands stop, after a time that its maker does not state")
                }
                Watchdog::None => {
                    "NONE in the device: if haptize is killed or the machine hangs, the last torque stays \
                                   on; keep its power switch at hand"
                        .into()
                }
            },
        );
        phases.iter().for_each(|phase| describe_phase(text, phase, coordinates.unit()));
    }
}

/// Describes a phase, whose coordinates are in `unit`.
fn describe_phase(text: &mut Text, report: &CheckReport, unit: &str) {
    let name = match report.phase {
        Phase::Reading => "reading",
        Phase::ZeroTorque => "zero torque",
        Phase::Push => "push",
    };
    let rate = report.fresh as f64 / report.seconds.max(f64::MIN_POSITIVE);
    let oldest = 1e3 * report.oldest;
    text.row(name, format_args!("{rate:.0} new positions a second, the oldest {oldest:.1} ms old"));
    for (a, range) in report.range.iter().enumerate() {
        // Without a sign of zero.
        let [least, most] = range.map(|end| (1e4 * end).round() / 1e4 + 0.0);
        let pushed = match (report.phase, report.moves_along[a]) {
            (Phase::Push, _) if !report.pushed[a] => ", NOT pushed: hold the space bar all the time".to_owned(),
            (Phase::Push, along) => {
                let how = if along < 0.0 { ": it moves AGAINST the push" } else { "" };
                format!(", work of the push {along:.1e} J{how}")
            }
            _ => String::new(),
        };
        text.row("", format_args!("{a}: {least:.4} to {most:.4} {unit}{pushed}"));
    }
    for (reason, count) in &report.tally.halted {
        text.row("", format_args!("without torque for {}: {reason}", counted(*count, ["tick", "ticks"])));
    }
}
