//! `haptize reach`: where contact is, before anything is baked, and the grid that follows.

use super::{
    Failure, interrupt, output,
    report::{Describe, Report, Text},
    tell, watch,
};
use crate::{
    names::duration,
    scene::{Scene, SceneText},
    sweep::{Aim, BackendChoice, Cost, Direct, JointReach, Pilot, Reach},
};
use serde::Serialize;
use std::{
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering},
};

/// Arguments of `haptize reach`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize reach arm.toml
  haptize reach arm.toml --depth 0.008                only contact up to 8 mm deep
  haptize reach arm.toml --max-error 2% --write       writes the grid into the scene")]
pub struct Arguments {
    /// The scene. Its grid, if it has one, does not matter.
    scene: PathBuf,
    /// Deepest contact that the grid is to cover (m); by default a fifth of the body's size.
    #[arg(long, value_name = "METRES", value_parser = depth)]
    depth: Option<f64>,
    /// Rms error of the torque that the grid is for: a fraction of the torque's own rms over the grid, or a torque
    /// ("0.002 N m").
    #[arg(long, value_name = "ERROR", default_value = ERROR)]
    max_error: Aim,
    /// Maximum number of points of the grid.
    #[arg(long, default_value_t = POINTS, value_name = "POINTS")]
    max_points: usize,
    /// What solves the trial grids.
    #[arg(long, default_value = "auto")]
    backend: BackendChoice,
    /// Write the grid into the scene, in the place of one that is there. Comments stay.
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
    }
    let stop = interrupt::stop_flag();
    let found = find(&scene, arguments, stop);
    interrupt::over();
    let Found { reach, pilot, costs, grid } = found?;
    let (grid, refusal) = match grid {
        Ok(grid) => (Some(grid), None),
        Err(refusal) => (None, Some(refusal)),
    };
    let written = match grid.as_deref().filter(|_| arguments.write) {
        None => None,
        Some(grid) => {
            let mut text = SceneText::new(&scene.text, &scene.path)?;
            text.replace(grid)?;
            Some(output::rewrite(&scene.path, &scene.text, &text.to_string())?)
        }
    };
    let scene = arguments.scene.display().to_string();
    let reached = Reached { reach, pilot, costs, grid, refusal, written, scene };
    Report::of(&reached, reached.refusal.is_none())
}

/// Where contact is, and the grid that follows.
#[derive(Serialize)]
struct Reached {
    #[serde(flatten)]
    reach: Reach,
    /// Absent where it was stopped.
    pilot: Option<Pilot>,
    costs: Vec<Cost>,
    /// The table of the grid, as a scene has it.
    grid: Option<String>,
    /// Why there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    refusal: Option<String>,
    /// The scene into which it was written.
    #[serde(skip_serializing_if = "Option::is_none")]
    written: Option<String>,
    #[serde(skip)]
    scene: String,
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
        let direct = Direct::at_rest(&scene)?;
        let reach = Reach::new(&scene, direct.model(), None, stop)?;
        let based = reach.scene(&scene)?;
        if chosen {
            return Ok(based);
        }
        let aim: Aim = ERROR.parse()?;
        let pilot = Pilot::run(&based, direct.model(), aim, backend, stop)?;
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
    let direct = Direct::at_rest(scene)?;
    let reach = Reach::new(scene, direct.model(), arguments.depth, stop)?;
    // What is known stands on the terminal, however the rest ends.
    for JointReach { name, unit, range: [low, high], .. } in &reach.joints {
        tell(format_args!("haptize: contact along {name}: {low:.4} to {high:.4} {unit}"));
    }
    let based = reach.scene(scene)?;
    tell(format_args!("haptize: coarse grids over these ranges against random configurations ..."));
    let pilot = match Pilot::run(&based, direct.model(), arguments.max_error, arguments.backend, stop) {
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

impl Describe for Reached {
    fn describe(&self, text: &mut Text) {
        let Reach { configurations, contact, contact_in_ranges, volume, body, shallow, deepest, depths, joints } =
            &self.reach;
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        let [body, shallow, deepest] = [body, shallow, deepest].map(|length| format!("{:.1} mm", length * 1e3));
        text.line(format_args!(
            "{}: {} of {configurations} configurations within the joint limits touch",
            self.scene,
            percent(*contact)
        ));
        text.row("body", format_args!("{body} across where it is least; contact up to {shallow} deep is to be held"));
        let [volume, inside] = [volume, contact_in_ranges].map(|share| percent(*share));
        text.row(
            "ranges",
            format_args!("{volume} of the limits' volume, {inside} of it in contact, {deepest} deep at most"),
        );
        let shares: Vec<_> =
            depths.iter().map(|at| format!("{} to {:.1} mm", percent(at.share), at.depth * 1e3)).collect();
        text.row("depth", format_args!("of all contact {}", shares.join(", ")));
        let [ranges, limits] = ["range", "of limits"];
        let shares = "share in contact, by tenths of the limits [%]";
        text.line(format_args!("\n{:<14} {ranges:<23} {limits:<23} {shares}", "joint"));
        for JointReach { name, unit, limits, range, contact } in joints {
            let [range, limits] = [range, limits].map(|[low, high]| format!("{low:.3} to {high:.3} {unit}"));
            let shares: Vec<_> = contact.iter().map(|share| format!("{:>3.0}", 100.0 * share)).collect();
            text.line(format_args!("{name:<14} {range:<23} {limits:<23} {}", shares.join(" ")));
        }
        if !self.costs.is_empty() {
            text.line("\nrms error      points        solving from rest   file");
        }
        self.costs.iter().for_each(|cost| text.line(costs(cost)));
        for found in self.grid.iter().chain(&self.refusal) {
            text.line(format_args!("\n{}", found.trim_end()));
        }
        self.written.iter().for_each(|scene| text.row("written to", scene));
    }
}

/// What an error takes. Time and size are told within what errors are extrapolated to.
fn costs(Cost { relative, points, seconds, bytes, is_known, .. }: &Cost) -> String {
    let [error, points] = [format!("{} %", 100.0 * relative), format!("{points:.2e}")];
    if *is_known {
        let [time, size] = [duration(*seconds), watch::megabytes(*bytes as usize)];
        format!("{error:<14} {points:<13} {time:<19} {size}")
    } else {
        format!("{error:<14} {points:<13} far beyond what was tried")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_and_size_of_what_was_not_nearly_tried_are_not_told() {
        let cost = Cost { relative: 0.05, points: 1.9e13, finer: 193.0, seconds: 4e9, bytes: 4e15, is_known: false };
        assert_eq!(costs(&cost), "5 %            1.90e13       far beyond what was tried");
        let known = Cost { points: 1.9e4, seconds: 2.0, bytes: 1.5e6, is_known: true, ..cost };
        assert_eq!(costs(&known), "5 %            1.90e4        2.0 s               2 MB");
    }
}
