//! `haptize` without a subcommand: the paper's sections 2.1, 3 and 4.1 from end to end. Its sphere is haptized, pressed
//! through the 1 kHz loop with the graphics loop beside, and drawn. Needs no file, no GPU and no display.
//!
//! The press runs twice: as fast as it goes, which gives the same trace and figures on every machine, and against the
//! clock, which shows what a tick costs on this one and how punctual it is.

use super::{Failure, Report, motion, output::Folder, played, shell, tell, watch};
use crate::{
    dataset::Dataset,
    render::{realtime::Options, setup::Setup},
    report,
    scene::Scene,
    sweep::BackendChoice,
};
use std::{
    fmt::Write,
    path::{Path, PathBuf},
    sync::Arc,
};

/// The paper's sphere, part of the program.
const SCENE: &str = include_str!("../../datasets/sphere.toml");

/// Where everything goes.
const FOLDER: &str = "out";

/// The dataset's file there.
const DATASET: &str = "sphere.haptize";

/// Runs the demo.
pub fn run() -> Result<Report, Failure> {
    let folder = Path::new(FOLDER);
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("cannot make the folder ./{FOLDER}: {error}; change to a folder of yours"))?;
    let names = played::FILES.into_iter().chain(report::FIGURES).chain([DATASET]);
    let earlier = Folder::check(folder, names, [])?;
    let scene = Scene::parse(SCENE, "datasets/sphere.toml")?;
    let file: PathBuf = folder.join(DATASET);

    tell(format_args!("haptizing the sphere, contact at {} configurations ...", points(&scene)));
    let (baked, sweep) = watch::watched(&scene, BackendChoice::Auto, |bake| bake.in_memory())?;
    watch::warn(&sweep);
    baked.save(&file)?;
    let dataset = Arc::new(Dataset::load(&file)?);

    tell(format_args!("pressing it, as fast as it goes and against the clock ..."));
    let setup = Setup::new(&dataset)?;
    let motion = motion::named(&setup, &dataset, "press", None)?;
    let seconds = motion.duration();
    let (mut played, ticks) = played::traced(&dataset, folder, |on_tick| {
        played::play(&setup, &dataset, &mut setup.hand(motion.clone())?, seconds, on_tick)
    })?;
    let (mut hand, mut graphics) = (setup.hand(motion)?, setup.graphics(&dataset)?);
    let plan = setup.plan(&dataset, seconds, 0);
    let timed = played::play_timed(&setup.haptics, &mut hand, graphics.as_mut(), &plan, Options::default())?;
    played.timing = timed.timing;

    tell(format_args!("drawing ..."));
    let mut files = vec![file.clone(), ticks?];
    files.extend(played::write(&setup, &dataset, &played, folder)?);
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();

    let rate = scene.graphics.map_or(0.0, |graphics| graphics.rate);
    let press = played.trace.summary();
    let held = dataset.summary();
    let mut text = String::new();
    watch::describe(&mut text, &file, &sweep, None)?;
    let torque = held.torque.as_flattened().iter().fold(0.0_f64, |most, tau| most.max(tau.abs()));
    writeln!(text, "  torque       at most {torque:.3} N m at a joint")?;
    if let (Some(force), Some(nodes)) = (held.max_force, held.max_contacts) {
        writeln!(text, "  force        at most {force:.2} N on a node of the object, at most {nodes} nodes at once")?;
    }
    write!(text, "press, as fast as it goes: ")?;
    played::describe(&mut text, &press, &played.trace.joints)?;
    if let Some(timing) = &played.timing {
        writeln!(text, "press against the clock, {:.0} ticks and {rate:.0} frames a second:", scene.haptics.rate)?;
        played::describe_timing(&mut text, timing)?;
    }
    writeln!(text, "written: {}", names.join(" "))?;
    writeln!(text, "next: haptize info {0}, haptize play {0} --motion scrape, haptize --help", shell::file(&file))?;
    let mut json = serde_json::json!({ "bake": sweep, "press": press, "timing": played.timing, "files": names });
    earlier.close(&files, &mut text, &mut json)?;
    Ok(Report { text, json, whole: true })
}

/// Grid points of `scene`.
fn points(scene: &Scene) -> usize {
    scene.grid.axes.iter().map(|axis| axis.count).product()
}
