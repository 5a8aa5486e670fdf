//! `haptize shape`: the surface of a scanned object, from its torques.

use super::{
    Failure,
    output::{self, Content, Replaced},
    report::{Describe, Report, Text},
};
use crate::{
    dataset::replace_file,
    names::counted,
    proxy::Chain,
    report::{PIXELS, scanned::surface},
    scan::ScanLog,
    scene::ScanScene,
    twin::{Approaches, Carving, ScannedShape},
};
use serde::Serialize;
use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

/// Arguments of `haptize shape`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize shape sponge.csv --ground -0.05
  haptize shape tissue.csv -o tissue.obj")]
pub struct Arguments {
    /// A log written by `haptize scan`.
    log: PathBuf,
    /// Height of the ground on which the object lies (m); by default one distance between approaches below
    /// the lowest place that was reached.
    #[arg(long, value_name = "Z", allow_negative_numbers = true)]
    ground: Option<f64>,
    /// The OBJ file to write; by default the log's name in the current folder, ending in .obj. A picture of the same
    /// name is written beside it.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

/// Finds the surface, and writes it with its picture.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let output = match &arguments.output {
        Some(output) => output.clone(),
        None => PathBuf::from(arguments.log.file_name().ok_or("the log's path names no file; give -o")?)
            .with_extension("obj"),
    };
    let picture = output.with_extension("png");
    if picture == output {
        return Err(format!("{}: its picture would have the same name; name an .obj file", output.display()).into());
    }
    let replaced = output::check(&output, Content::Product, [arguments.log.as_path()])?;
    output::check(&picture, Content::Product, [arguments.log.as_path()])?;
    let (approaches, scan, shape) = found(&arguments.log, arguments.ground)?;
    write(&output, shape.obj().as_bytes())?;
    write(&picture, &surface(&shape).pixels(PIXELS)?.png()?)?;
    let nodes = Chain::new(&scan.proxy).nodes.len();
    Report::new(&Found { replaced, ..Found::new((&approaches, nodes), (&shape, arguments.ground), &output, &picture) })
}

/// The shape of what `log` scanned, with the approaches and the scene of the scan.
pub fn found(log: &Path, ground: Option<f64>) -> Result<(Approaches, ScanScene, ScannedShape), Failure> {
    let rows = ScanLog::read(log)?;
    let scene = ScanScene::parse(&rows.header.scene, log)?;
    let chain = Chain::new(&scene.proxy);
    let at = |error: crate::Error| error.within(log.display());
    let approaches = Approaches::new(&rows, &scene, &chain).map_err(at)?;
    let shape = ScannedShape::new(&approaches, &chain, ground).map_err(at)?;
    Ok((approaches, scene, shape))
}

/// Writes `bytes` to `file`.
pub fn write(file: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let written = replace_file(file, |out| out.write_all(bytes));
    Ok(written
        .map_err(|error| format!("cannot write {}: {error}; free some space or give another place", file.display()))?)
}

/// The surface of a scanned object.
#[derive(Serialize)]
pub struct Found {
    file: String,
    picture: String,
    /// Approaches with an onset, those that never touch, and those that touch from their first row on.
    onsets: usize,
    untouched: usize,
    begun: usize,
    /// How the torque rises behind an onset: with this power of depth (1).
    exponent: f64,
    /// Spacing of the places that were touched, their distance to the surface through all others and the standard
    /// deviation of the surface there, rms (m).
    spacing: f64,
    held_out: f64,
    deviation: f64,
    carving: Carving,
    /// Height of the ground (m), and whether it was given.
    ground: f64,
    ground_is_given: bool,
    /// Contact nodes of the arm.
    arm_nodes: usize,
    nodes: usize,
    triangles: usize,
    #[serde(flatten)]
    replaced: Option<Replaced>,
}

impl Found {
    /// What is told of `shape`.
    pub fn new(
        (approaches, arm_nodes): (&Approaches, usize),
        (shape, ground): (&ScannedShape, Option<f64>),
        output: &Path,
        picture: &Path,
    ) -> Self {
        Self {
            file: output.display().to_string(),
            picture: picture.display().to_string(),
            onsets: approaches.onsets.len(),
            untouched: approaches.untouched,
            begun: approaches.begun,
            exponent: approaches.exponent,
            spacing: shape.spacing,
            held_out: shape.held_out,
            deviation: shape.deviation(),
            carving: shape.carving,
            ground: shape.ground,
            ground_is_given: ground.is_some(),
            arm_nodes,
            nodes: shape.nodes.len(),
            triangles: shape.triangles.len(),
            replaced: None,
        }
    }
}

impl Describe for Found {
    fn describe(&self, text: &mut Text) {
        let Self { file, picture, onsets, untouched, begun, exponent, spacing, held_out, deviation, .. } = self;
        let Self { carving, ground, ground_is_given, arm_nodes, nodes, triangles, replaced, .. } = self;
        let mm = |length: &f64| 1e3 * length;
        text.line(format_args!("{file}: a surface of {nodes} nodes and {triangles} triangles"));
        let others = match begun {
            0 => counted(*untouched, ["never touches", "never touch"]),
            _ => format!(
                "{}, {} left out, in contact from the first row on",
                counted(*untouched, ["never touches", "never touch"]),
                counted(*begun, ["is", "are"])
            ),
        };
        text.row("approaches", format_args!("{onsets} with an onset, {:.1} mm apart; {others}", mm(spacing)));
        text.row("onset", format_args!("torque rises with the power {exponent:.2} of depth"));
        text.row(
            "surface",
            format_args!(
                "held-out places are predicted to {:.2} mm rms, known to {:.2} mm",
                mm(held_out),
                mm(deviation)
            ),
        );
        let Carving { places, carved } = carving;
        text.row(
            "carving",
            format_args!(
                "{} of nodes, {carved} of which moved the surface",
                counted(*places, ["free place", "free places"])
            ),
        );
        let guess = "a guess, one spacing below the lowest place that was reached: give its height by --ground";
        text.row("ground", format_args!("z = {ground:.4} m, {}", if *ground_is_given { "as given" } else { guess }));
        if *arm_nodes > 1 {
            let note = "the node that goes before the others, or lies nearest to the surface, is taken to touch: where a link \
                        leans on the object, another may";
            text.row("note", format_args!("of the arm's {arm_nodes} nodes {note}"));
        }
        text.row("picture", picture);
        replaced.describe(text);
    }
}
