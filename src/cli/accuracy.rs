//! `haptize accuracy`: what accuracy costs in time, for one scene.

use super::{
    Failure,
    output::{Folder, Overwritten},
    reach,
    report::{self, Describe, Report, Text},
    tell,
};
use crate::{
    names::counted,
    scene::{Interpolation, Scene},
    studies::accuracy::{self, Accuracy, Extent, LIVE, Limit, Offer, Row, Study},
    sweep::BackendChoice,
};
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `haptize accuracy`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize accuracy sphere.toml
  haptize accuracy sphere.toml --points 20000 --configurations 500     less time, rougher figures")]
pub struct Arguments {
    /// The scene's file.
    scene: PathBuf,
    /// The folder to write figures and table to.
    #[arg(short, long, default_value = "out/accuracy")]
    output: PathBuf,
    /// Number of random configurations that are solved as the reference.
    #[arg(long, default_value_t = 2000)]
    configurations: usize,
    /// Maximum number of points of a grid.
    #[arg(long, default_value_t = 100_000)]
    points: usize,
    /// Number of timed runs of each measurement; the fastest counts.
    #[arg(long, default_value_t = 5)]
    rounds: usize,
}

/// Measures the scene and writes what was found.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let scene = Scene::load(&arguments.scene)?;
    let extent = Extent {
        configurations: arguments.configurations.max(1),
        points: arguments.points,
        rounds: arguments.rounds.max(1),
    };
    let folder = Folder::check(&arguments.output, accuracy::FILES, [arguments.scene.as_path()])?;
    let mut progress = |what: &str| tell(format_args!("haptize: {what} ..."));
    let scene = reach::complete(scene, BackendChoice::Cpu, false)?;
    let found = accuracy::measure(&scene, extent, &mut progress)?;
    let files = accuracy::write_all(&arguments.output, &found)?;
    let measured = Measured {
        offers: accuracy::offers(&found),
        limits: accuracy::limits(&found),
        found,
        overwritten: folder.close(&files)?,
        files: report::names(&files),
        folder: arguments.output.display().to_string(),
    };
    Report::new(&measured)
}

/// What accuracy costs.
#[derive(Serialize)]
struct Measured {
    #[serde(flatten)]
    found: Accuracy,
    /// Cheapest grid for each error.
    offers: Vec<Offer>,
    /// What limits the scene's own accuracy.
    limits: Vec<Limit>,
    files: Vec<String>,
    #[serde(flatten)]
    overwritten: Overwritten,
    #[serde(skip)]
    folder: String,
}

impl Describe for Measured {
    fn describe(&self, text: &mut Text) {
        let Self { found, offers, limits, files, overwritten, folder } = self;
        let Accuracy { scene, configurations, in_contact, left_out, norm, torque, reference_error, .. } = found;
        text.line(format_args!(
            "{scene}: {}, {in_contact} in contact, {left_out} left out; rms torque {torque:.4} {norm}, the reference errs by \
             {reference_error:.1e}",
            counted(*configurations, ["random configuration", "random configurations"])
        ));
        for name in Interpolation::ALL.map(Interpolation::name) {
            if let Some(order) = found.order(Study::Spacing, name) {
                text.row("order", format_args!("{name:<9} error falls with spacing to the power {order:.2}"));
            }
        }
        for Offer { target, series, spacing, points, cost, .. } in offers {
            let (percent, unit) = (100.0 * target, found.unit);
            text.row(
                format!("for {percent:>4.0} %"),
                format_args!("take {series} at {spacing:.4} {unit}: {points} points, {cost:.2} of the scene's bake"),
            );
        }
        for study in [Study::Mesh, Study::Links, Study::Skin, Study::Stiffness] {
            let Some(own) = found.of(study).find(|row| row.value == 1.0) else { continue };
            let falls = match found.order(study, &own.series) {
                Some(order) => format!("changes fall with the power {order:.2}"),
                None => "changes do not fall".to_owned(),
            };
            let change = 100.0 * found.relative(own);
            text.row(&own.series, format_args!("the next step changes {change:.2} %; {falls}"));
        }
        let errs = |row: &Row| match 100.0 * found.relative(row) {
            error if error < 0.01 => format!("{} below 0.01 %", row.setting),
            error => format!("{} {error:.2} %", row.setting),
        };
        let [looked, followed] = [false, true].map(|live| {
            let rows = found.of(Study::Lookup).filter(|row| (row.series == LIVE) == live);
            rows.map(errs).collect::<Vec<_>>().join(", ")
        });
        text.row("look-up", format_args!("`linear` {:.0} ns; errors: {looked}", 1e9 * found.look_up));
        text.row(
            "live",
            format_args!(
                "{:.0} us a solution in contact, by the law at rest; errors, solved {followed}",
                1e6 * found.solution
            ),
        );
        let limits: Vec<_> = limits.iter().map(|limit| format!("{} {:.2} %", limit.of, 100.0 * limit.error)).collect();
        if !limits.is_empty() {
            text.row("limited by", limits.join(", "));
        }
        found.notes.iter().for_each(|note| text.row("note", note));
        text.row("written to", format_args!("{folder}, {}", counted(files.len(), ["file", "files"])));
        overwritten.describe(text);
    }
}
