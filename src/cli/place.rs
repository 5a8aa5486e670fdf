//! `haptize place`: the tip of an arm before an object, and a grid and a press there.

use super::{Failure, Report, output};
use crate::{
    dataset::replace_file,
    proxy::Chain,
    scene::Scene,
    sweep::Placing,
    toml_text::{list, number, vector},
};
use glam::DVec3;
use std::{fmt::Write, io::Write as _, path::PathBuf};

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
    let mut json = serde_json::to_value(&placing)?;
    let mut text = String::new();
    let Placing { body: [low, high], link, tip, at, point, normal, q, short, gap, .. } = &placing;
    let size: Vec<String> = (*high - *low).to_array().map(|side| format!("{:.1}", 1e3 * side)).to_vec();
    let place = |point: DVec3| vector(point, 4);
    writeln!(text, "{}: the tip of the arm before the object", arguments.scene.display())?;
    writeln!(text, "  object       {} mm, from {} to {} m", size.join(" x "), place(*low), place(*high))?;
    let middle = "with every joint in the middle of its limits";
    writeln!(text, "  tip          contact node {tip}, of link `{link}`: at {} m {middle}", place(*at))?;
    writeln!(
        text,
        "  pressed      {} m on the surface, which looks along {} there",
        place(*point),
        vector(*normal, 3)
    )?;
    writeln!(text, "  q            {}", list(q, |x| number(*x, 5)))?;
    let refusal = if !placing.reaches() {
        writeln!(text, "  out of reach {:.1} mm: the joints bring the tip no nearer", 1e3 * short.length())?;
        let moved = place(-*short);
        let centre = place(placing.centre - *short);
        Some(format!(
            "move the object by {moved} m: centre = {centre}; or the arm by the opposite; or widen its limits"
        ))
    } else if !placing.is_clear() {
        writeln!(text, "  in the way   the arm is {:.1} mm inside the object elsewhere", -1e3 * gap)?;
        Some("choose a point from which the rest of the arm keeps away (--at), or move the object".to_owned())
    } else {
        writeln!(text, "  clear        the whole arm is {:.1} mm or more from the object", 1e3 * gap)?;
        None
    };
    if let Some(refusal) = &refusal {
        writeln!(text, "\n{refusal}")?;
        json["refusal"] = refusal.as_str().into();
    } else {
        let mut tables = String::new();
        placing.press.write_grid(&mut tables, &scene.proxy.joints)?;
        tables.push('\n');
        placing.press.write_motion(&mut tables)?;
        write!(text, "\n{tables}")?;
        json["tables"] = tables.as_str().into();
        if arguments.write {
            let whole = format!("{}\n\n{tables}", scene.text.trim_end());
            Scene::parse(&whole, &arguments.scene)?;
            replace_file(&arguments.scene, |file| file.write_all(whole.as_bytes()))?;
            writeln!(text, "  added to     {}", arguments.scene.display())?;
            json["written"] = arguments.scene.display().to_string().into();
        }
    }
    Ok(Report { text, json, whole: refusal.is_none() })
}
