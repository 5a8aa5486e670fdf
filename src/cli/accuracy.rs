//! `haptize accuracy`: what accuracy costs in time, for one scene.

use super::{Failure, Report, tell};
use crate::{
    report::accuracy::{self, Extent},
    scene::Scene,
};
use serde_json::Value;
use std::path::PathBuf;

/// What to measure, and how much.
#[derive(clap::Args)]
pub struct Arguments {
    /// The scene's file.
    scene: PathBuf,
    /// The folder to write figures, table and page to.
    #[arg(short, long, default_value = "out/accuracy")]
    output: PathBuf,
    /// Random configurations that are solved as the reference.
    #[arg(long, default_value_t = 2000)]
    configurations: usize,
    /// Grids with more points than this are left out.
    #[arg(long, default_value_t = 100_000)]
    points: usize,
    /// Runs of each work that is timed; the least counts.
    #[arg(long, default_value_t = 5)]
    rounds: usize,
    /// Price every effect, too: the scene with it and without it, haptized, felt and drawn.
    #[arg(long)]
    effects: bool,
}

/// Measures the scene and writes what was found.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let scene = Scene::load(&arguments.scene)?;
    let extent = Extent {
        configurations: arguments.configurations.max(1),
        points: arguments.points,
        rounds: arguments.rounds.max(1),
    };
    let mut progress = |what: &str| tell(format_args!("haptize: {what} ..."));
    let mut found = accuracy::measure(&scene, extent, &mut progress)?;
    if arguments.effects {
        found.effects = Some(accuracy::effects::price(&scene, extent.rounds, &mut progress)?);
    }
    let files = accuracy::write_all(&arguments.output, &found)?;
    let mut json = serde_json::to_value(&found)?;
    json["offers"] = serde_json::to_value(accuracy::offers(&found))?;
    json["limits"] = serde_json::to_value(accuracy::limits(&found))?;
    json["files"] = files.iter().map(|file| Value::from(file.display().to_string())).collect();
    let mut text = String::new();
    accuracy::describe(&mut text, &found)?;
    text.push_str(&format!("{} files in {}\n", files.len(), arguments.output.display()));
    Ok(Report { text, json, whole: true })
}
