//! `haptize view`: the window, or one picture of it.

use super::{Failure, Report, on_demand::Choices};
use crate::device::Address;
use std::path::PathBuf;

/// Arguments of `haptize view`.
#[derive(clap::Args)]
#[command(after_help = concat!(
    "\
Examples:
  haptize view                           the sphere of the demo
  haptize view sphere.haptize
  haptize view touch.haptize --device touch --hold-key
  haptize view datasets/organ.toml --on-demand organ.haptize
  haptize view sphere.haptize --screenshot window.png --motion scrape --time 2.5 --dark",
    adapter_help!()
))]
pub struct Arguments {
    /// A scene, which is baked first, or a dataset; without one the paper's sphere.
    file: Option<PathBuf>,
    /// A real device leads the arm instead of the pointer: KIND or KIND:PLACE, as `haptize device list` shows it.
    #[arg(long, value_name = "NAME", conflicts_with = "screenshot")]
    device: Option<Address>,
    /// Torque only while the space bar is held in the window (a dead-man key).
    #[arg(long, requires = "device")]
    hold_key: bool,
    /// Bake nothing: solve contact ahead of the motion while it is felt, and keep what was explored in this file, from
    /// time to time and when the window is closed. Of an earlier session of the same scene, it is where this one goes
    /// on.
    #[arg(long, value_name = "FILE", requires = "file", conflicts_with = "screenshot")]
    on_demand: Option<PathBuf>,
    #[command(flatten)]
    choices: Choices,
    /// Write the window to this PNG file instead of opening it: needs no display, but some Vulkan, software too.
    #[arg(long, value_name = "PNG")]
    screenshot: Option<PathBuf>,
    /// The picture's size (points).
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1280x800", requires = "screenshot", value_parser = size)]
    size: [f32; 2],
    /// The picture in dark colours.
    #[arg(long, requires = "screenshot")]
    dark: bool,
    /// The motion that the picture shows, press or scrape; by default the press, where there is one.
    #[arg(long, requires = "screenshot", value_parser = ["press", "scrape"])]
    motion: Option<String>,
    /// When in that motion the picture is taken (s).
    #[arg(long, default_value_t = 2.2, requires = "screenshot")]
    time: f64,
}

/// Greatest side of a picture (points).
const GREATEST: f32 = 4000.0;

fn size(text: &str) -> Result<[f32; 2], String> {
    let sides = text.split_once('x').and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
    let within = |sides: &[f32; 2]| sides.iter().all(|side| (0.0..=GREATEST).contains(side));
    sides.filter(within).ok_or_else(|| "give two sides of at most 4000 points, such as 1280x800".into())
}

/// Opens the window, or draws it.
#[cfg(feature = "viewer")]
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    use super::{
        interrupt,
        output::{self, Content},
    };
    use crate::viewer::{self, DeviceChoice, Picture, Start};
    let device = arguments.device.clone().map(|address| {
        let (hold_key, stop) = (arguments.hold_key, interrupt::stop_flag_of_device());
        DeviceChoice { address, hold_key, stop }
    });
    if let (Some(scene), Some(kept)) = (&arguments.file, &arguments.on_demand) {
        return explore(scene, kept, arguments.choices, device);
    }
    let start = arguments.file.clone().map_or(Start::Sphere, Start::File);
    let Some(file) = &arguments.screenshot else {
        let shown = viewer::open(start, device);
        interrupt::over();
        shown?;
        return Ok(Report { text: String::new(), json: serde_json::json!({}), whole: true });
    };
    if !file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        return Err(format!("{}: the picture is a PNG file: give a name that ends in .png", file.display()).into());
    }
    let earlier = output::check(file, Content::Product, arguments.file.as_deref())?;
    if !(0.0..=60.0).contains(&arguments.time) {
        return Err(format!("cannot play {} s: give --time from 0 to 60", arguments.time).into());
    }
    let [least_width, least_height] = viewer::LEAST_WINDOW;
    if arguments.size[0] < least_width || arguments.size[1] < least_height {
        return Err(
            format!("the window has no room below {least_width}x{least_height} points: give a larger --size").into()
        );
    }
    let picture = Picture {
        size: arguments.size,
        dark: arguments.dark,
        motion: arguments.motion.clone(),
        time: arguments.time,
        ..Picture::default()
    };
    viewer::screenshot(&start, &picture, file)?;
    let (mut text, mut json) =
        (format!("wrote {}\n", file.display()), serde_json::json!({ "file": file.display().to_string() }));
    earlier.tell(&mut text, &mut json);
    Ok(Report { text, json, whole: true })
}

/// Opens the window on a scene whose contact is solved while it is felt, and keeps what was explored, however the
/// window ends, by a signal, too.
#[cfg(feature = "viewer")]
fn explore(
    scene: &std::path::Path,
    kept: &std::path::Path,
    choices: Choices,
    device: Option<crate::viewer::DeviceChoice>,
) -> Result<Report, Failure> {
    use super::{
        interrupt,
        output::{self, Content},
    };
    use crate::viewer::{self, Start};
    let earlier = output::check(kept, Content::Dataset, Some(scene))?;
    let exploring = choices.open(scene, kept)?;
    // The program ends soon after a signal, as by any.
    exploring.keep(Some(interrupt::stop_flag()), || {
        let shown = viewer::open(Start::OnDemand(std::sync::Arc::clone(&exploring.on_demand)), device);
        interrupt::over();
        Ok(shown?)
    })?;
    let blocks = exploring.on_demand.blocks();
    let mut text = format!("{blocks} blocks explored, kept in {}\n", kept.display());
    let mut json = serde_json::json!({ "blocks": blocks, "file": kept.display().to_string() });
    earlier.tell(&mut text, &mut json);
    Ok(Report { text, json, whole: true })
}

/// Says how to get the viewer.
#[cfg(not(feature = "viewer"))]
pub fn run(_: &Arguments) -> Result<Report, Failure> {
    Err("this haptize was built without its window: build it with one (cargo install --path . --features viewer)"
        .into())
}
