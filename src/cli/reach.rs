//! `haptize reach`: where contact is, before anything is baked, and the grid that follows.

use super::{Failure, Report, interrupt, output, tell, watch};
use crate::{
    dataset::replace_file,
    scene::Scene,
    sweep::{Aim, BackendChoice, Cost, JointReach, Pilot, Reach},
};
use std::{
    fmt::{self, Write},
    io::Write as _,
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering},
};

/// Arguments of `haptize reach`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize reach arm.toml
  haptize reach arm.toml --depth 0.008                only contact up to 8 mm deep
  haptize reach arm.toml --max-error 2% --write       adds the grid to the scene")]
pub struct Arguments {
    /// The scene. Its grid, if it has one, does not matter.
    scene: PathBuf,
    /// Depth up to which the grid is to hold contact (m); by default a fifth of the body's size.
    #[arg(long, value_name = "METRES", value_parser = depth)]
    depth: Option<f64>,
    /// Rms error of the torque that the grid is for: a fraction of the torque's own rms over the grid, or a torque
    /// ("0.002 N m").
    #[arg(long, value_name = "ERROR", default_value = ERROR)]
    max_error: Aim,
    /// Maximum number of points of the grid.
    #[arg(long, default_value_t = POINTS, value_name = "POINTS")]
    max_points: usize,
    /// The backend that solves the pilot.
    #[arg(long, default_value = "auto")]
    backend: BackendChoice,
    /// Add the grid to the scene, which must not have one.
    #[arg(long)]
    write: bool,
}

/// Error for which a grid is chosen where nothing else is said: torques are felt to about a tenth.
const ERROR: &str = "5%";

/// Most points of such a grid (1).
const POINTS: usize = 2_000_000;

/// Errors over the rms torque whose cost is listed (1).
const ERRORS: [f64; 4] = [0.1, 0.05, 0.02, 0.01];

fn depth(text: &str) -> Result<f64, String> {
    let depth = text.parse::<f64>().ok().filter(|depth| depth.is_finite() && *depth > 0.0);
    depth.ok_or_else(|| "give a positive depth in metres, such as 0.008".into())
}

/// Measures, tries coarse grids, and states what they take. Exit code 1 where no grid keeps the error.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let scene = Scene::load(&arguments.scene)?;
    if arguments.write {
        output::replaceable(&arguments.scene)?;
        if !scene.grid.axes.is_empty() {
            let why = "has a [grid] already; delete that first, or leave out --write and copy what is printed";
            return Err(format!("{}: {why}", arguments.scene.display()).into());
        }
    }
    let stop = interrupt::stop_flag();
    let found = find(&scene, arguments, stop);
    interrupt::over();
    let Found { reach, pilot, costs, grid } = found?;
    let mut json = serde_json::to_value(&reach)?;
    json["pilot"] = serde_json::to_value(&pilot)?;
    json["costs"] = serde_json::to_value(&costs)?;
    json["grid"] = grid.as_ref().ok().cloned().into();
    let mut text = String::new();
    describe(&mut text, &reach, arguments)?;
    describe_costs(&mut text, &costs)?;
    let whole = grid.is_ok();
    match grid {
        Err(refusal) => {
            json["refusal"] = refusal.as_str().into();
            writeln!(text, "\n{refusal}")?;
        }
        Ok(table) => {
            write!(text, "\n{table}")?;
            if arguments.write {
                let whole = format!("{}\n\n{table}", scene.text.trim_end());
                Scene::parse(&whole, &arguments.scene)?;
                replace_file(&arguments.scene, |file| file.write_all(whole.as_bytes()))?;
                writeln!(text, "  added to     {}", arguments.scene.display())?;
                json["written"] = arguments.scene.display().to_string().into();
            }
        }
    }
    Ok(Report { text, json, whole })
}

/// `scene`, with a grid where it leaves that out: over the reach of its contact, for the default error; or, where
/// another is `chosen` later, fine enough to begin from.
pub fn complete(scene: Scene, backend: BackendChoice, chosen: bool) -> Result<Scene, Failure> {
    if !scene.grid.axes.is_empty() {
        return Ok(scene);
    }
    tell(format_args!("haptize: the scene leaves the grid out: looking for contact within the joint limits ..."));
    let stop = interrupt::stop_flag();
    let found = || -> Result<Scene, Failure> {
        let reach = Reach::new(&scene, None, stop)?;
        let based = reach.scene(&scene)?;
        if chosen {
            return Ok(based);
        }
        let aim: Aim = ERROR.parse()?;
        let pilot = Pilot::run(&based, aim, backend, stop)?;
        let grid = grid(&reach, &pilot, &based, POINTS)?;
        grid.lines().for_each(|line| tell(format_args!("haptize: {line}")));
        Ok(Scene::parse(&format!("{}\n\n{grid}", scene.text.trim_end()), &scene.path)?)
    };
    let found = found();
    interrupt::over();
    let Scene { text, grid, .. } = found?;
    Ok(Scene { text, grid, ..scene })
}

/// Result for a scene.
struct Found {
    reach: Reach,
    /// Absent where it was stopped.
    pilot: Option<Pilot>,
    costs: Vec<Cost>,
    /// The table of the grid, or why there is none.
    grid: Result<String, String>,
}

fn find(scene: &Scene, arguments: &Arguments, stop: &AtomicBool) -> Result<Found, Failure> {
    let reach = Reach::new(scene, arguments.depth, stop)?;
    // What is known stands on the terminal, however the rest ends.
    for JointReach { name, unit, range: [low, high], .. } in &reach.joints {
        tell(format_args!("haptize: contact along {name}: {low:.4} to {high:.4} {unit}"));
    }
    let based = reach.scene(scene)?;
    tell(format_args!("haptize: coarse grids over these ranges against random configurations ..."));
    let pilot = match Pilot::run(&based, arguments.max_error, arguments.backend, stop) {
        Err(_) if stop.load(Ordering::Relaxed) => {
            let grid = Err("stopped before its grids were tried: the ranges hold, a grid was not chosen".to_owned());
            return Ok(Found { reach, pilot: None, costs: Vec::new(), grid });
        }
        pilot => pilot?,
    };
    let costs = ERRORS.iter().filter_map(|error| pilot.cost(&based, *error)).collect();
    let grid = grid(&reach, &pilot, &based, arguments.max_points);
    Ok(Found { reach, pilot: Some(pilot), costs, grid })
}

/// The table of a grid that keeps the pilot's aim, of at most `limit` points.
fn grid(reach: &Reach, pilot: &Pilot, based: &Scene, limit: usize) -> Result<String, String> {
    let cost = pilot.cost(based, pilot.relative).filter(|cost| cost.is_known && cost.points <= limit as f64);
    let cost = cost.ok_or_else(|| pilot.refusal(based, limit))?;
    Ok(reach.table(&pilot.spaced(based, cost.finer)))
}

fn describe(text: &mut String, reach: &Reach, arguments: &Arguments) -> fmt::Result {
    let Reach { configurations, contact, contact_in_ranges, volume, body, shallow, deepest, depths, joints } = reach;
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    writeln!(
        text,
        "{}: {} of {configurations} configurations within the joint limits touch",
        arguments.scene.display(),
        percent(*contact)
    )?;
    writeln!(
        text,
        "  body         {:.1} mm across where it is least; contact up to {:.1} mm deep is to be held",
        body * 1e3,
        shallow * 1e3
    )?;
    writeln!(
        text,
        "  ranges       {} of the limits' volume, {} of it in contact, {:.1} mm deep at most",
        percent(*volume),
        percent(*contact_in_ranges),
        deepest * 1e3
    )?;
    let shares: Vec<_> = depths.iter().map(|at| format!("{} to {:.1} mm", percent(at.share), at.depth * 1e3)).collect();
    writeln!(text, "  depth        of all contact {}", shares.join(", "))?;
    writeln!(
        text,
        "\njoint          range                   of limits               share in contact, by tenths of the limits [%]"
    )?;
    for JointReach { name, unit, limits, range, contact } in joints {
        let ends = |[low, high]: &[f64; 2]| format!("{low:.3} to {high:.3} {unit}");
        let shares: Vec<_> = contact.iter().map(|share| format!("{:>3.0}", 100.0 * share)).collect();
        writeln!(text, "{name:<14} {:<23} {:<23} {}", ends(range), ends(limits), shares.join(" "))?;
    }
    Ok(())
}

fn describe_costs(text: &mut String, costs: &[Cost]) -> fmt::Result {
    if costs.is_empty() {
        return Ok(());
    }
    writeln!(text, "\nrms error      points        solving from rest   file")?;
    for Cost { relative, points, seconds, bytes, is_known, .. } in costs {
        let doubt = if *is_known { "" } else { "   far beyond what was tried" };
        writeln!(
            text,
            "{:<14} {:<13} {:<19} {}{doubt}",
            format!("{} %", 100.0 * relative),
            format!("{points:.2e}"),
            watch::duration(*seconds),
            watch::megabytes(*bytes as usize)
        )?;
    }
    Ok(())
}
