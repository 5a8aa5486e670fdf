//! `haptize accuracy`: what accuracy costs in time, for one scene.

use super::{Failure, Report, output::Folder, reach, tell};
use crate::{
    scene::Scene,
    studies::accuracy::{self, Extent},
    sweep::BackendChoice,
};
use serde_json::Value;
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
    let mut json = serde_json::to_value(&found)?;
    json["offers"] = serde_json::to_value(accuracy::offers(&found))?;
    json["limits"] = serde_json::to_value(accuracy::limits(&found))?;
    json["files"] = files.iter().map(|file| Value::from(file.display().to_string())).collect();
    let mut text = String::new();
    accuracy::describe(&mut text, &found)?;
    text.push_str(&format!("{} files in {}\n", files.len(), arguments.output.display()));
    folder.close(&files, &mut text, &mut json)?;
    Ok(Report { text, json, whole: true })
}
