//! `haptize paper`: the figures and numbers of the paper, remade with the scenes that are part of the program.

use super::{
    Failure,
    baked::Baked,
    bar::Bar,
    gridize::{self, Source},
    interrupt, motion,
    new::SPONGE_GROUND,
    output::{self, Folder, Overwritten},
    played,
    report::{self, Describe, Report, Text},
    scan::{self, Course},
    tell,
    twin::Twinned,
    watch,
};
use crate::{
    JointVector,
    contact::{Model, Solver},
    dataset::{Dataset, replace_file},
    draw::canvas::Canvas,
    gridize::GridizeOptions,
    object::Object,
    paper::{Comparison, PressedTwin, Scanned, Scans, Sphere, haptize, hardest, procedure, specimen},
    proxy::Chain,
    render::{
        setup::Setup,
        trace::{Summary, Trace},
    },
    report::{
        self as figures,
        force::{EndForce, force},
        gridized::gridized,
        object, press,
        slices::slices,
        space::space,
    },
    scan::{ScanLog, ScanProgress},
    scene::{ScanScene, Scene},
    sweep::BackendChoice,
};
use glam::DVec3;
use serde::Serialize;
use std::{
    io::Write as _,
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicBool},
    time::Instant,
};

/// The virtual object of section 4.1.
const SPHERE: &str = include_str!("../../datasets/paper.toml");
/// The scans of section 4.2.
const BARE: Specimen = Specimen { name: "sponge", scene: include_str!("../../datasets/sponge.toml") };
const FABRIC: Specimen = Specimen { name: "sponge_fabric", scene: include_str!("../../datasets/sponge_fabric.toml") };
const SIDE: Specimen = Specimen { name: "sponge_side", scene: include_str!("../../datasets/sponge_side.toml") };

/// Interval of the gridized datasets, the paper's (rad).
const STEP: f64 = 0.03;

/// Instants of Fig. 6.
const INSTANTS: usize = 6;

/// Files that it writes.
const FILES: [&str; 28] = [
    "paper.haptize",
    "sponge.csv",
    "sponge.haptize",
    "sponge_fabric.csv",
    "sponge_fabric.haptize",
    "sponge_side.csv",
    "sponge_side.haptize",
    "sponge_twin.obj",
    "fig2-procedure.svg",
    "fig2-procedure.png",
    "fig3-cspace.png",
    "fig4-gridization.svg",
    "fig4-gridization.png",
    "fig5-press.svg",
    "fig5-press.png",
    "fig6-deformation.png",
    "fig7-sponge.png",
    "fig8-scrape.svg",
    "fig8-scrape.png",
    "fig9-side-press.svg",
    "fig9-side-press.png",
    "torque.svg",
    "torque.png",
    "energy.svg",
    "energy.png",
    "scrape.svg",
    "scrape.png",
    "table.md",
];

/// Where the figures go.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize paper
  haptize paper -o figures")]
pub struct Arguments {
    /// The folder to write figures, tables, datasets and scan logs to; files of an earlier run are replaced.
    #[arg(short, long, default_value = "out/paper")]
    output: PathBuf,
}

/// Haptizes, scans, plays, draws and compares.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let started = Instant::now();
    let folder = &arguments.output;
    let (logs, made): (Vec<_>, Vec<_>) = FILES.into_iter().partition(|name| name.ends_with(".csv"));
    let earlier = Folder::check(folder, made, [])?;
    for log in logs.into_iter().map(|name| folder.join(name)).filter(|log| log.symlink_metadata().is_ok()) {
        if output::replaceable(&log)?.is_some() && !ScanLog::is_simulated(&log) {
            let why = "is no log of a simulated scan, and is not replaced: move it away, or give another folder by -o";
            return Err(format!("{}: {why}", log.display()).into());
        }
    }
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("cannot make the folder {}: {error}; give another by -o", folder.display()))?;
    let scene = Scene::parse(SPHERE, "datasets/paper.toml")?;
    tell(format_args!("section 4.1: haptizing and pressing the sphere ..."));
    let (dataset, sweep) = watch::watched(&scene, BackendChoice::Cpu, haptize)?;
    dataset.save(&folder.join("paper.haptize"))?;
    let (setup, pressed) = felt(&dataset, "press")?;
    let (_, scraped) = felt(&dataset, "scrape")?;
    let sphere = Sphere { scene: &scene, dataset: &dataset, press: &pressed };

    tell(format_args!("section 4.2: scanning three simulated spongy blocks ..."));
    let [bare, fabric, side] = scan_all(folder)?;
    let (on_bare, on_fabric, on_side) =
        (felt(&bare.dataset, "scrape")?, felt(&fabric.dataset, "scrape")?, felt(&side.dataset, "press")?);
    let scans = Scans { bare: bare.felt(&on_bare), fabric: fabric.felt(&on_fabric), side: side.felt(&on_side) };

    tell(format_args!("drawing ..."));
    let figures = Figures { folder };
    let instants = object::instants(&dataset, &setup.chain, &pressed, INSTANTS, None)?;
    let mut files = figures.sheet("fig2-procedure", &procedure(sphere, scans))?;
    files.extend(figures.picture("fig3-cspace", &space(&dataset))?);
    files.extend(figures.sheet("fig4-gridization", &gridized(&bare.source.samples, &bare.dataset))?);
    files.extend(figures.sheet("fig5-press", &press::press(&pressed))?);
    files.extend(figures.picture("fig6-deformation", &object::object(&dataset, &setup.chain, &instants)?)?);
    files.extend(figures.picture("fig7-sponge", &specimen(scans, &pressed_twin(folder, scans)?))?);
    files.extend(figures.sheet("fig8-scrape", &forces(scans))?);
    files.extend(
        figures
            .sheet("fig9-side-press", &press::titled("Press on the side of the simulated block", scans.side.trace))?,
    );
    files.extend(figures.sheet("torque", &slices(&dataset, None))?);
    files.extend(figures.sheet("energy", &press::energy(&pressed))?);
    files.extend(figures.sheet("scrape", &press::titled("Scraping over the sphere", &scraped))?);

    let comparison = Comparison::new(sphere, scans);
    let table = folder.join("table.md");
    replace_file(&table, |out| out.write_all(comparison.markdown().as_bytes()))
        .map_err(|error| format!("cannot write {}: {error}", table.display()))?;
    files.push(table);
    let written = report::names(&files);
    let data = FILES.iter().filter(|name| name.ends_with(".csv") || name.ends_with(".haptize"));
    files.extend(data.map(|name| folder.join(name)));
    let remade = Remade {
        comparison,
        bake: Baked::new(sweep, &folder.join("paper.haptize"), None, None)?,
        press: pressed.summary(),
        scrape: scraped.summary(),
        seconds: started.elapsed().as_secs_f64(),
        files: written,
        overwritten: earlier.close(&files)?,
        folder: folder.display().to_string(),
    };
    Report::new(&remade)
}

/// The paper's figures and numbers, remade.
#[derive(Serialize)]
struct Remade {
    comparison: Comparison,
    bake: Baked,
    press: Summary,
    scrape: Summary,
    /// Wall time (s).
    seconds: f64,
    files: Vec<String>,
    #[serde(flatten)]
    overwritten: Overwritten,
    #[serde(skip)]
    folder: String,
}

impl Describe for Remade {
    fn describe(&self, text: &mut Text) {
        let Self { comparison: Comparison { figures, rows }, seconds, overwritten, folder, .. } = self;
        let drawn = figures.iter().filter(|figure| !figure.file.is_empty()).count();
        text.line(format_args!("{drawn} of the paper's {} figures remade in {seconds:.0} s", figures.len()));
        text.line(format_args!("{} numbers compared; those that differ:", rows.len()));
        for row in rows.iter().filter(|row| row.differs()) {
            text.line(format_args!("  {}: {} in the paper, {} here", row.quantity, row.paper, row.ours));
        }
        text.line(format_args!("table, figures and datasets in {folder}; begin with table.md"));
        overwritten.describe(text);
    }
}

/// Plays the `motion` of the dataset's scene with a simulated hand, as fast as it goes.
fn felt(dataset: &Dataset, motion: &str) -> Result<(Setup, Arc<Trace>), Failure> {
    let setup = Setup::new(dataset)?;
    let motion = motion::named(&setup, dataset, motion, None)?;
    let seconds = motion.duration();
    let played = played::play(&setup, dataset, &mut setup.hand(motion)?, seconds, &mut |_| ())?;
    Ok((setup, played.trace))
}

/// The twin of the bare block that was scanned in `folder`, where the arm pushes hardest.
fn pressed_twin(folder: &Path, scans: Scans<'_>) -> Result<PressedTwin, Failure> {
    let mesh = folder.join("sponge_twin.obj");
    let twin = Twinned::new(
        (&folder.join("sponge.csv"), Some(SPONGE_GROUND)),
        crate::twin::Given::default(),
        &mesh.with_extension("toml"),
    )?;
    let (object, chain) = (Object::build(&twin.scene.object)?, Chain::new(&twin.scene.proxy));
    let q: Vec<JointVector> = hardest(scans.bare).into_iter().collect();
    let model = Model::reaching(&object, &chain, twin.scene.contact, &q)?;
    let mut solver = Solver::new(&model);
    q.iter().for_each(|q| drop(solver.solve(q)));
    let moved: Vec<DVec3> = solver.displacement().chunks_exact(3).map(DVec3::from_slice).collect();
    Ok(PressedTwin {
        nodes: object.rest.iter().zip(&moved).map(|(x, moved)| *x + *moved).collect(),
        displacements: moved.iter().map(|moved| moved.length()).collect(),
        triangles: object.triangles.clone(),
    })
}

/// Draws the scrapes over both covers in one figure (Fig. 8).
fn forces(scans: Scans<'_>) -> Canvas {
    let covers = [("bare (simulated)", scans.bare), ("under a fabric (simulated)", scans.fabric)];
    let felt: Vec<EndForce> =
        covers.into_iter().filter_map(|(name, of)| EndForce::new(name, of.chain, of.trace)).collect();
    force(&felt, scans.bare.trace)
}

/// A scene to scan.
struct Specimen {
    name: &'static str,
    scene: &'static str,
}

/// An object that was scanned and gridized.
struct Measured {
    scene: ScanScene,
    source: Source,
    dataset: Dataset,
}

impl Measured {
    /// Returns the measurement together with how it was felt.
    fn felt<'a>(&'a self, (setup, trace): &'a (Setup, Arc<Trace>)) -> Scanned<'a> {
        let Self { scene, source, dataset } = self;
        Scanned { scene, samples: &source.samples, dataset, chain: &setup.chain, trace }
    }
}

/// Scans and gridizes all specimens, side by side.
fn scan_all(folder: &Path) -> Result<[Measured; 3], Failure> {
    let stop = interrupt::stop_flag();
    let bar = Bar::new("points", "{wide_bar} {pos}/{len} points, {msg}");
    let measure = |specimen: Specimen| specimen.measure(folder, stop, &bar);
    let (bare, (fabric, side)) = rayon::join(|| measure(BARE), || rayon::join(|| measure(FABRIC), || measure(SIDE)));
    bar.finish();
    interrupt::over();
    Ok([bare?, fabric?, side?])
}

impl Specimen {
    /// Scans, and gridizes what was measured.
    fn measure(self, folder: &Path, stop: &AtomicBool, bar: &Bar) -> Result<Measured, Failure> {
        let scene = ScanScene::parse(self.scene, Path::new("datasets").join(self.name).with_extension("toml"))?;
        let log = folder.join(self.name).with_extension("csv");
        if log.exists() {
            std::fs::remove_file(&log).map_err(|error| format!("cannot replace {}: {error}", log.display()))?;
        }
        let mut announced = false;
        let mut progress = |progress: ScanProgress| {
            if !std::mem::replace(&mut announced, true) {
                bar.lengthen(progress.points);
            }
            bar.step();
        };
        let report = scan::measure(&scene, &log, Course::default(), stop, &mut progress)?;
        if !report.whole {
            return Err("interrupted while scanning; nothing is drawn, run it again".into());
        }
        let source = gridize::scanned(std::slice::from_ref(&log))?;
        let options = GridizeOptions {
            // As in the paper the convex hull alone ends what was measured.
            within: f64::INFINITY,
            epsilon: source.epsilon,
            ..GridizeOptions::new(vec![STEP])
        };
        let (dataset, _) = source.gridize(&options)?;
        dataset.save(&folder.join(self.name).with_extension("haptize"))?;
        Ok(Measured { scene, source, dataset })
    }
}

/// Where figures are written.
struct Figures<'a> {
    folder: &'a Path,
}

impl Figures<'_> {
    /// Writes a figure of lines and text, as SVG and PNG.
    fn sheet(&self, name: &str, canvas: &Canvas) -> Result<Vec<PathBuf>, Failure> {
        Ok(figures::write_both(self.folder, name, canvas)?.to_vec())
    }

    /// Writes a figure with pictures in it, as PNG.
    fn picture(&self, name: &str, canvas: &Canvas) -> Result<Vec<PathBuf>, Failure> {
        Ok(vec![figures::write_png(self.folder, name, canvas)?])
    }
}
