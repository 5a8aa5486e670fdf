//! `haptize` without a subcommand: the paper's sections 2.1, 3 and 4.1 from end to end. Its sphere is haptized, pressed
//! through the 1 kHz loop with the graphics loop beside, and drawn. Needs no file, no GPU and no display.
//!
//! The press runs twice: as fast as it goes, which gives the same trace and figures on every machine, and against the
//! clock, which shows what a tick costs on this one and how punctual it is.

use super::{
    Failure,
    baked::Baked,
    motion,
    output::{Folder, Overwritten},
    played::{self, describe_session},
    report::{self, Describe, Report, Text},
    shell, tell, watch,
};
use crate::{
    dataset::{self, Dataset, JointLabel},
    render::{realtime::Options, setup::Setup, timing::Timing, trace::Summary},
    report::FIGURES,
    scene::Scene,
    sweep::BackendChoice,
};
use serde::Serialize;
use std::{
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
    let names = played::FILES.into_iter().chain(FIGURES).chain([DATASET]);
    let earlier = Folder::check(folder, names, [])?;
    let scene = Scene::parse(SCENE, "datasets/sphere.toml")?;
    let file: PathBuf = folder.join(DATASET);

    tell(format_args!("haptizing the sphere, contact at {} configurations ...", points(&scene)));
    let (baked, sweep) = watch::watched(&scene, BackendChoice::Auto, |bake| bake.in_memory())?;
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
    let demo = Demo {
        bake: Baked::new(sweep, &file, None, None)?,
        press: played.trace.summary(),
        timing: played.timing,
        overwritten: earlier.close(&files)?,
        files: report::names(&files),
        held: dataset.summary(),
        joints: played.trace.joints.clone(),
        rates: [scene.haptics.rate, scene.graphics.map_or(0.0, |graphics| graphics.rate)],
        dataset: shell::file(&file),
    };
    Report::new(&demo)
}

/// What the demo has baked, felt and written.
#[derive(Serialize)]
struct Demo {
    bake: Baked,
    press: Summary,
    timing: Option<Timing>,
    files: Vec<String>,
    #[serde(flatten)]
    overwritten: Overwritten,
    #[serde(skip)]
    held: dataset::Summary,
    #[serde(skip)]
    joints: Vec<JointLabel>,
    /// Ticks and frames a second.
    #[serde(skip)]
    rates: [f64; 2],
    /// The dataset's file, as a shell takes it.
    #[serde(skip)]
    dataset: String,
}

impl Describe for Demo {
    fn describe(&self, text: &mut Text) {
        let Self { bake, press, timing, files, overwritten, held, joints, rates: [ticks, frames], dataset } = self;
        bake.describe(text);
        let torque = held.torque.as_flattened().iter().fold(0.0_f64, |most, tau| most.max(tau.abs()));
        text.row("torque", format_args!("at most {torque:.3} N m at a joint"));
        if let (Some(force), Some(nodes)) = (held.max_force, held.max_contacts) {
            text.row(
                "force",
                format_args!("at most {force:.2} N on a node of the object, at most {nodes} nodes at once"),
            );
        }
        describe_session(text, "press, as fast as it goes: ", press, joints);
        text.line(format_args!("press against the clock, {ticks:.0} ticks and {frames:.0} frames a second:"));
        timing.describe(text);
        overwritten.describe(text);
        text.line(format_args!("written: {}", files.join(" ")));
        text.line(format_args!("next: haptize info {dataset}, haptize play {dataset} --motion scrape, haptize --help"));
    }
}

/// Grid points of `scene`.
fn points(scene: &Scene) -> usize {
    scene.grid.axes.iter().map(|axis| axis.count).product()
}
