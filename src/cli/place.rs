//! `haptize place`: the tip of an arm before an object, and a grid and a press there.

use super::{
    Failure, output,
    report::{Describe, Report, Text},
};
use crate::{
    proxy::Chain,
    scene::Scene,
    sweep::Placing,
    toml_text::{list, number, vector},
};
use glam::DVec3;
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `haptize place`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize place arm.toml                              before the point of the object that is nearest to the tip
  haptize place arm.toml --at 0,0.185,0.03            before the point of the object that is nearest to this one
  haptize place arm.toml --at 0,0.185,0.03 --write    adds grid and motion to the scene")]
pub struct Arguments {
    /// The scene: an arm and an object. Its grid and motion, if it has some, do not matter.
    scene: PathBuf,
    /// A point (m); the tip is put before the point of the surface that is nearest to it.
    #[arg(long, value_name = "X,Y,Z", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    at: Option<Vec<f64>>,
    /// Add grid and motion to the scene, which must have neither.
    #[arg(long)]
    write: bool,
}

/// Puts the tip before the object. Exit code 1 where it does not get there.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let wanted = match arguments.at.as_deref() {
        None => None,
        Some([x, y, z]) if [x, y, z].into_iter().all(|x| x.is_finite()) => Some(DVec3::new(*x, *y, *z)),
        Some(_) => return Err("--at must be three finite numbers: X,Y,Z (m)".into()),
    };
    let scene = Scene::load(&arguments.scene)?;
    if arguments.write {
        output::replaceable(&arguments.scene)?;
        if !(scene.grid.axes.is_empty() && scene.motion.press.is_empty() && scene.motion.scrape.is_empty()) {
            let why =
                "has a [grid] or a [motion] already; delete them first, or leave out --write and copy what is printed";
            return Err(format!("{}: {why}", arguments.scene.display()).into());
        }
    }
    if Chain::new(&scene.proxy).nodes.is_empty() {
        return Err(format!("{}: the arm has no contact node", arguments.scene.display()).into());
    }
    let placing = Placing::new(&scene, wanted)?;
    let refusal = refusal(&placing);
    let tables = if refusal.is_some() { None } else { Some(tables(&placing, &scene)?) };
    let written = tables.as_deref().filter(|_| arguments.write).map(|tables| output::append(&scene, tables));
    let placed = Placed {
        placing,
        refusal,
        tables,
        written: written.transpose()?,
        scene: arguments.scene.display().to_string(),
    };
    Report::of(&placed, placed.refusal.is_none())
}

/// Where the tip of an arm stands before an object.
#[derive(Serialize)]
struct Placed {
    #[serde(flatten)]
    placing: Placing,
    /// Why it gets nowhere.
    #[serde(skip_serializing_if = "Option::is_none")]
    refusal: Option<String>,
    /// Grid and motion, as a scene has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    tables: Option<String>,
    /// The scene to which they were added.
    #[serde(skip_serializing_if = "Option::is_none")]
    written: Option<String>,
    #[serde(skip)]
    scene: String,
}

/// Returns what to do where the tip does not reach the point, or another part of the arm is in the way.
fn refusal(placing: &Placing) -> Option<String> {
    if !placing.reaches() {
        let [moved, centre] = [-placing.short, placing.centre - placing.short].map(|place| vector(place, 4));
        return Some(format!(
            "move the object by {moved} m: centre = {centre}; or the arm by the opposite; or widen its limits"
        ));
    }
    let in_the_way = "choose a point from which the rest of the arm keeps away (--at), or move the object";
    (!placing.is_clear()).then(|| in_the_way.to_owned())
}

/// Returns the tables of grid and press.
fn tables(placing: &Placing, scene: &Scene) -> Result<String, Failure> {
    let mut tables = String::new();
    placing.press.write_grid(&mut tables, &scene.proxy.joints)?;
    tables.push('\n');
    placing.press.write_motion(&mut tables)?;
    Ok(tables)
}

impl Describe for Placed {
    fn describe(&self, text: &mut Text) {
        let Self { placing, refusal, tables, written, scene } = self;
        let Placing { body: [low, high], link, tip, at, point, normal, q, short, gap, .. } = placing;
        let size: Vec<String> = (*high - *low).to_array().map(|side| format!("{:.1}", 1e3 * side)).to_vec();
        let [low, high, at, point] = [low, high, at, point].map(|place| vector(*place, 4));
        text.line(format_args!("{scene}: the tip of the arm before the object"));
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
        for found in refusal.iter().chain(tables) {
            text.line(format_args!("\n{}", found.trim_end()));
        }
        written.iter().for_each(|scene| text.row("added to", scene));
    }
}
