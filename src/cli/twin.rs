//! `haptize twin`: a scene of what was scanned.

use super::{
    Failure,
    bar::Bar,
    import, interrupt,
    output::{self, Content},
    report::{Describe, Report, Text},
    shape::{Found, found, write},
    shell, tell,
};
use crate::{
    JointVector,
    contact::Model,
    object::{LatticeError, Object},
    proxy::Chain,
    report::{PIXELS, scanned::stiffness},
    scene::{Material, Scene},
    twin::{Approaches, Given, KnownRange, Modulus, ScannedShape, Watched, twin_scene},
};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Arguments of `haptize twin`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize twin sponge.csv --ground -0.05
  haptize twin tissue.csv --width 0.008 -o twin.toml")]
pub struct Arguments {
    /// A log written by `haptize scan`.
    log: PathBuf,
    /// Height of the ground on which the object lies (m); by default one distance between approaches below
    /// the lowest place that was reached.
    #[arg(long, value_name = "Z", allow_negative_numbers = true)]
    ground: Option<f64>,
    /// Width over which the dent of a point is rounded (m); by default three edges of the surface. A larger one
    /// makes the object softer.
    #[arg(long, value_name = "W", value_parser = length, allow_negative_numbers = true)]
    width: Option<f64>,
    /// Edge of the cubes that fill the object (m); by default as its surface asks for.
    #[arg(long, value_name = "H", value_parser = length, allow_negative_numbers = true)]
    cell: Option<f64>,
    /// The scene to write, which must not be there yet; by default the log's name in the current folder, ending in
    /// _twin.toml. Its surface (.obj) and a picture (.png) are written beside it.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

/// Misfit over the measured torque from which on it is warned of (1): twice that of elastic bodies (docs/scanned.md).
const MISFIT: f64 = 0.1;

/// Young's modulus from which the search begins (Pa): that of soft tissue.
const YOUNG: f64 = 1e4;

fn length(text: &str) -> Result<f64, String> {
    let length: f64 = text.trim().parse().map_err(|_| format!("{text:?} is no number"))?;
    if length > 0.0 && length.is_finite() { Ok(length) } else { Err("a length is positive".into()) }
}

/// Finds surface and modulus, and writes the scene.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let output = match &arguments.output {
        Some(output) => output.clone(),
        None => {
            let name = arguments.log.file_stem().ok_or("the log's path names no file; give -o")?;
            PathBuf::from(format!("{}_twin.toml", name.to_string_lossy()))
        }
    };
    if !Scene::is_at(&output) {
        return Err(format!("{}: a scene's name ends in .toml", output.display()).into());
    }
    import::refuse_existing(&output)?;
    let [mesh, picture] = ["obj", "png"].map(|extension| output.with_extension(extension));
    for file in [&mesh, &picture] {
        output::check(file, Content::Product, [arguments.log.as_path()])?;
    }
    let given = Given { width: arguments.width, cell: arguments.cell };
    let Twinned { approaches, shape, modulus, range, lattice, scene } =
        Twinned::new((&arguments.log, arguments.ground), given, &output)?;
    write(&picture, &stiffness(&shape, &modulus).pixels(PIXELS)?.png()?)?;
    import::write(&output, &scene.text)?;
    let nodes = Chain::new(&scene.proxy).nodes.len();
    let shape = Found::new((&approaches, nodes), (&shape, arguments.ground), &mesh, &picture);
    let (poisson, width) = taken(&scene);
    let joints = scene.proxy.joints.iter().map(|joint| joint.name.clone()).collect();
    let twin = Twin { scene: output.display().to_string(), modulus, poisson, width, joints, range, lattice, shape };
    twin.doubts().iter().for_each(|doubt| tell(format_args!("haptize: {doubt}")));
    Report::new(&twin)
}

/// What explains a scan.
pub struct Twinned {
    approaches: Approaches,
    shape: ScannedShape,
    modulus: Modulus,
    range: KnownRange,
    lattice: Option<LatticeError>,
    /// With the modulus that was found.
    pub scene: Scene,
}

impl Twinned {
    /// Explains `log` over a ground at a height (m) with what is `given`, as the scene `output`, beside which the mesh is
    /// written. The scene is not.
    pub fn new((log, ground): (&Path, Option<f64>), given: Given, output: &Path) -> Result<Self, Failure> {
        let (approaches, scan, shape) = found(log, ground)?;
        let mesh = output.with_extension("obj");
        write(&mesh, shape.obj().as_bytes())?;
        let name = mesh.file_name().unwrap_or_default().to_string_lossy();
        let scene = |young: f64, range: &KnownRange| {
            twin_scene((&scan.text, output), (&mesh, &*name), (&shape, range), young, given)
        };
        let around = KnownRange::around(&approaches);
        let first = scene(YOUNG, &around)?;
        let (object, chain) = (Object::build(&first.object)?, Chain::new(&first.proxy));
        let bar = Bar::new("rows", "{wide_bar} {pos}/{len} rows, {msg}");
        let mut progress = |done: usize, rows: usize| bar.set(done as u64, rows as u64, String::new(), None);
        let watched = &mut Watched { stop: interrupt::stop_flag(), progress: &mut progress };
        let rows: Vec<JointVector> = approaches.contact.iter().map(|row| row.q).collect();
        let mut model = Model::reaching(&object, &chain, first.contact, &rows)?;
        let modulus = Modulus::fit(&mut model, YOUNG, (&approaches, &shape), watched);
        bar.finish();
        interrupt::over();
        let modulus = modulus.map_err(|error| error.within(log.display()))?;
        let range = around.no_deeper(modulus.deepest, &shape, &chain);
        let lattice = object.lattice_error(&model.compliance);
        let scene = scene(modulus.young, &range)?;
        Ok(Self { approaches, shape, modulus, range, lattice, scene })
    }
}

/// Poisson's ratio of the object of `scene` (1), and the width of its skin (m; see [`crate::scene::SkinSpec`]).
fn taken(scene: &Scene) -> (f64, f64) {
    let Material::Elastic(elastic) = &scene.object.material else { return (0.0, 0.0) };
    let bending = scene.object.skin.map_or(0.0, |skin| skin.bending);
    (elastic.poisson, (2.0 * (1.0 - elastic.poisson * elastic.poisson) * bending / elastic.young).cbrt())
}

/// The twin of a scanned object.
#[derive(Serialize)]
struct Twin {
    scene: String,
    #[serde(flatten)]
    modulus: Modulus,
    /// What is taken for given: Poisson's ratio (1), width of the skin (m).
    poisson: f64,
    width: f64,
    /// Names of the joints.
    #[serde(skip)]
    joints: Vec<String>,
    range: KnownRange,
    /// Error that the cubes make.
    #[serde(skip_serializing_if = "Option::is_none")]
    lattice: Option<LatticeError>,
    shape: Found,
}

impl Twin {
    /// What a person should know before taking the twin for the object, a sentence each.
    fn doubts(&self) -> Vec<String> {
        let Modulus { misfit, torque, rows, counted, deepest, .. } = self.modulus;
        let mut doubts = Vec::new();
        if misfit > MISFIT * torque {
            doubts.push(format!(
                "the twin leaves {:.0} % of the measured torque unexplained: the object is no linear elastic solid, or the ground \
                 is another (--ground): feel the scan itself, and the twin beyond it (haptize play DATASET --twin)",
                100.0 * misfit / torque
            ));
        }
        if 2 * counted < rows {
            doubts.push(format!(
                "of {rows} rows in contact {} nothing of the twin, as the surface closest to the arm is none that was touched: \
                 it is at a border, or past the middle of the body; the grid leaves out what is deeper than {:.1} mm",
                crate::names::counted(rows - counted, ["row says", "rows say"]),
                1e3 * deepest
            ));
        }
        if let Some(lattice) = self.lattice.filter(LatticeError::is_coarse) {
            doubts.push(format!(
                "the lattice is coarse: cubes of {:.2} mm make its compliance err by an estimated {:.1} % at most, which the modulus makes \
                 up for on the whole, and not place by place: find it again with smaller cubes, --cell {:.4}",
                1e3 * lattice.cell,
                100.0 * lattice.relative,
                0.5 * lattice.cell
            ));
        }
        doubts
    }
}

impl Describe for Twin {
    fn describe(&self, text: &mut Text) {
        let Self { scene, modulus, poisson, width, joints, range, shape, .. } = self;
        let Modulus { young, deviation, friction, misfit, torque, rows, counted, .. } = modulus;
        shape.describe(text);
        text.line(format_args!("{scene}: an elastic solid in this surface"));
        text.row("modulus", format_args!("{:.2} kPa +- {:.1} %", 1e-3 * young, 100.0 * deviation));
        text.row("friction", format_args!("{friction:.2}"));
        text.row(
            "given",
            format_args!(
                "Poisson's ratio {poisson}, a skin that rounds dents over {:.1} mm, the ground: torques do not tell them",
                1e3 * width
            ),
        );
        text.row(
            "misfit",
            format_args!(
                "{:.1} % of the torque, rms over {counted} of {rows} rows in contact",
                100.0 * misfit / torque
            ),
        );
        let ranges: Vec<String> = (joints.iter().zip(&range.joints))
            .map(|(joint, [low, high])| format!("{joint} {low:.3} to {high:.3}"))
            .collect();
        let deep = 1e3 * modulus.deepest;
        text.row(
            "grid",
            format_args!("{}: up to {deep:.1} mm deep, as the deepest row that counts", ranges.join(", ")),
        );
        text.row("gains", "those of the scan, but for proxy_damping: as much as the twin's torque needs to be passive");
        text.row("next", format_args!("haptize play {}", shell::file(Path::new(scene))));
    }
}
