//! `haptize place`: the tip of an arm before an object, or an object before the tip, and a grid and motions there.

use super::{
    Failure, output,
    report::{Describe, Report, Text},
    shell,
};
use crate::{
    object::{Draft, LengthUnit},
    scene::{GraphicsEffects, GraphicsSpec, Scene, SceneText},
    sweep::Placing,
    toml_text::{entry, list, number, vector},
};
use glam::DVec3;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Arguments of `haptize place`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize place arm.toml                              the tip before the point of the object that is nearest to it
  haptize place arm.toml --at 0,0.185,0.03 --write    before the point that is nearest to this one; writes grid and motions
  haptize place arm.toml --mesh liver.obj --write     puts one's own object before the arm
  haptize place arm.toml --move --write               moves the object of the scene before the arm")]
pub struct Arguments {
    /// The scene: an arm and an object. Its grid and motions, if it has some, do not matter.
    scene: PathBuf,
    /// A point (m); the tip is put before the point of the surface that is nearest to it.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    at: Option<DVec3>,
    /// Move the object before the tip of the arm, instead of the tip before the object.
    #[arg(long = "move", conflicts_with = "at")]
    moves: bool,
    /// Take the closed surface in this file (OBJ, STL, PLY, glTF or another mesh) for the object, an elastic solid under a skin, and move
    /// it before the tip.
    #[arg(long, value_name = "FILE", conflicts_with = "at")]
    mesh: Option<PathBuf>,
    /// Unit of the mesh's coordinates; by default millimetres where the object would be longer than two metres.
    #[arg(long, requires = "mesh")]
    unit: Option<LengthUnit>,
    /// Angles by which the mesh is turned about x, then y, then z (rad).
    #[arg(long, value_name = "X,Y,Z", value_parser = point, requires = "mesh", allow_hyphen_values = true)]
    turn: Option<DVec3>,
    /// Young's modulus of the object (Pa); by default that of a healthy liver.
    #[arg(long, value_name = "PASCALS", default_value_t = YOUNG, value_parser = young, requires = "mesh", allow_negative_numbers = true)]
    young: f64,
    /// Write grid and motions into the scene, and the object where it is another or moved. They replace those that are
    /// there; other lines and their comments stay.
    #[arg(long)]
    write: bool,
}

/// Young's modulus of healthy liver (Pa): the mean of 429 people by elastography (Roulot et al., J Hepatol
/// 48, 2008).
const YOUNG: f64 = 5500.0;

fn point(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some([x, y, z]) if [x, y, z].into_iter().all(|x| x.is_finite()) => Ok(DVec3::new(*x, *y, *z)),
        _ => Err("give three finite numbers, X,Y,Z".into()),
    }
}

fn young(text: &str) -> Result<f64, String> {
    let young = text.parse::<f64>().ok().filter(|young| young.is_finite() && *young > 0.0);
    young.ok_or_else(|| "give a positive number of pascals, such as 5000 for 5 kPa".into())
}

/// Puts arm and object before one another. Exit code 1 where the tip does not get there.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let mut scene = Scene::load(&arguments.scene)?;
    if arguments.write {
        output::replaceable(&arguments.scene)?;
    }
    let read = scene.text.clone();
    let mut changed = Vec::new();
    if let Some(mesh) = &arguments.mesh {
        let turn = arguments.turn.unwrap_or_default();
        let draft =
            Draft::new((mesh, &name(mesh, &scene.path)?), arguments.unit, turn, arguments.young, (None, Draft::HELD))?;
        let unit = 1e3 * draft.unit.metres();
        changed.push(format!("{}, whose unit is {unit} mm, {} kPa", mesh.display(), 1e-3 * arguments.young));
        let mut text = SceneText::new(&scene.text, &scene.path)?;
        text.replace(&draft.tables)?;
        if let Some(GraphicsSpec { rate, effects }) = scene.graphics
            && effects == GraphicsEffects::default()
        {
            let mut graphics = "[graphics]\n".to_owned();
            entry(&mut graphics, "rate", &format!("{rate:?}"), "Hz").map_err(|error| error.to_string())?;
            let meaning = "without dynamics: a solid is drawn much sooner";
            entry(&mut graphics, "quasi_static", "true", meaning).map_err(|error| error.to_string())?;
            text.replace(&graphics)?;
            changed.push("drawn in equilibrium, without dynamics: [graphics] quasi_static".into());
        }
        scene = Scene::parse(&text.to_string(), &scene.path)?;
    }
    let mut text = SceneText::new(&scene.text, &scene.path)?;
    let placing = if arguments.moves || arguments.mesh.is_some() {
        let (motion, placing) = Placing::brought(&scene)?.ok_or_else(|| no_node(&scene))?;
        text.move_object(motion);
        changed.push(format!("moved by {} m", vector(motion, 4)));
        placing
    } else {
        Placing::new(&scene, arguments.at)?.ok_or_else(|| no_node(&scene))?
    };
    let refusal = refusal(&placing);
    let (mut tables, mut written) = (None, None);
    if refusal.is_none() {
        let found = placing.tables(&scene.proxy.joints)?;
        text.replace(&found)?;
        if arguments.write {
            written = Some(output::rewrite(&scene.path, &read, &text.to_string())?);
        }
        tables = Some(found);
    }
    let scene = arguments.scene.display().to_string();
    let placed = Placed { placing, object: changed, refusal, tables, written, scene };
    Report::of(&placed, placed.refusal.is_none())
}

fn no_node(scene: &Scene) -> Failure {
    format!("{}: the arm has no contact node", scene.path.display()).into()
}

/// What the scene at `scene` calls the file `mesh`: its name, where it lies beside it.
fn name(mesh: &Path, scene: &Path) -> Result<String, Failure> {
    let absolute = |path: &Path| std::path::absolute(path).map_err(|error| format!("{}: {error}", path.display()));
    let (file, scene) = (absolute(mesh)?, absolute(scene)?);
    let name = scene.parent().and_then(|folder| file.strip_prefix(folder).ok()).unwrap_or(&file);
    let name = name.to_str().ok_or_else(|| format!("{}: a scene cannot hold this name", mesh.display()))?;
    Ok(name.to_owned())
}

/// Where the tip of an arm stands before an object.
#[derive(Serialize)]
struct Placed {
    #[serde(flatten)]
    placing: Placing,
    /// What is new about the object.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    object: Vec<String>,
    /// Why it gets nowhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    refusal: Option<String>,
    /// Grid and motions, as a scene has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    tables: Option<String>,
    /// The scene into which they were written.
    #[serde(skip_serializing_if = "Option::is_none")]
    written: Option<String>,
    #[serde(skip)]
    scene: String,
}

/// Returns what to do where the tip does not reach the point, or another part of the arm is in the way.
fn refusal(placing: &Placing) -> Option<String> {
    if !placing.reaches() {
        // A little farther than the joints fall short, so that they need not be stretched to their ends.
        let short = placing.short + placing.standoff * placing.short.normalize_or_zero();
        let [moved, centre] = [-short, placing.centre - short].map(|place| vector(place, 4));
        return Some(format!(
            "move the object by {moved} m: centre = {centre}; or before the arm with --move; or widen the arm's limits"
        ));
    }
    let in_the_way = "choose a point from which the rest of the arm keeps away (--at), or move the object (--move)";
    (!placing.is_clear()).then(|| in_the_way.to_owned())
}

impl Describe for Placed {
    fn describe(&self, text: &mut Text) {
        let Self { placing, object, refusal, tables, written, scene } = self;
        let Placing { body: [low, high], link, tip, at, point, normal, q, short, gap, .. } = placing;
        let size: Vec<String> = (*high - *low).to_array().map(|side| format!("{:.1}", 1e3 * side)).to_vec();
        let [low, high, at, point] = [low, high, at, point].map(|place| vector(*place, 4));
        text.line(format_args!("{scene}: the tip of the arm before the object"));
        text.rows("new", object);
        text.row("object", format_args!("{} mm, from {low} to {high} m", size.join(" x ")));
        let middle = "with every joint in the middle of its limits";
        text.row("tip", format_args!("contact node {tip}, of link `{link}`: at {at} m {middle}"));
        let normal = vector(*normal, 3);
        text.row("pressed", format_args!("{point} m on the surface, which looks along {normal} there"));
        text.row("q", list(q, |x| number(*x, 5)));
        let gap = 1e3 * gap;
        match () {
            () if !placing.reaches() => {
                let short = 1e3 * short.length();
                text.row("out of reach", format_args!("{short:.1} mm: the joints bring the tip no nearer"));
            }
            () if !placing.is_clear() => {
                text.row("in the way", format_args!("the arm is {:.1} mm inside the object elsewhere", -gap));
            }
            () => text.row("clear", format_args!("the whole arm is {gap:.1} mm or more from the object")),
        }
        match written {
            Some(scene) => {
                text.row("written to", scene);
                text.row("next", format_args!("haptize view {0}, or haptize play {0}", shell::file(Path::new(scene))));
            }
            None => refusal.iter().chain(tables).for_each(|found| text.line(format_args!("\n{}", found.trim_end()))),
        }
    }
}
