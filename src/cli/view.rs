//! `haptize view`: the window, or one picture of it.

use super::{Failure, report::Report};
#[cfg(feature = "viewer")]
use super::{
    output::Replaced,
    report::{Describe, Text},
};
use crate::device::Address;
#[cfg(feature = "viewer")]
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `haptize view`.
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("drawn").args(["screenshot", "video"]))]
#[command(after_help = concat!(
    "\
Examples:
  haptize view                           the sphere of the demo
  haptize view sphere.haptize
  haptize view sponge.haptize --twin sponge_twin.toml
  haptize view touch.haptize --device touch --hold-key
  haptize view datasets/organ.toml       nothing baked: contact is solved in every tick
  haptize view sphere.haptize --screenshot window.png --motion scrape --time 2.5 --dark
  haptize view sphere.haptize --video press.gif --size 640x480",
    adapter_help!()
))]
pub struct Arguments {
    /// A dataset, or a scene, whose contact is solved live, in every tick, by the law `rest`; without one the example
    /// sphere, which is baked first.
    file: Option<PathBuf>,
    /// The scene that `haptize twin` made of the same scan as the dataset: it is drawn, and answers where the dataset
    /// measured nothing.
    #[arg(long, value_name = "SCENE", requires = "file")]
    twin: Option<PathBuf>,
    /// A real device leads the arm instead of the pointer: KIND or KIND:PLACE, as `haptize device list` shows it.
    #[arg(long, value_name = "NAME", conflicts_with = "drawn")]
    device: Option<Address>,
    /// Torque only while the space bar is held in the window (a dead-man key).
    #[arg(long, requires = "device")]
    hold_key: bool,
    /// Write the window to this PNG file instead of opening it: needs a Vulkan driver, of which a software one will do, and no display.
    #[arg(long, value_name = "PNG")]
    screenshot: Option<PathBuf>,
    /// Write the 3-D picture over the motion to this file, whose name ends in .gif, or as PNG files into this new folder.
    #[arg(long, value_name = "FILE")]
    video: Option<PathBuf>,
    /// The picture's size (points).
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1280x800", requires = "drawn", value_parser = size)]
    size: [f32; 2],
    /// The picture in dark colours.
    #[arg(long, requires = "drawn")]
    dark: bool,
    /// The motion that the picture shows, press or scrape; by default the press, where there is one.
    #[arg(long, requires = "drawn", value_parser = ["press", "scrape"])]
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
    let start = match (arguments.file.clone(), arguments.twin.clone()) {
        (Some(file), Some(twin)) => Start::Twinned(file, twin),
        (Some(file), None) => Start::File(file),
        (None, _) => Start::Sphere,
    };
    let picture = Picture {
        size: arguments.size,
        dark: arguments.dark,
        motion: arguments.motion.clone(),
        time: arguments.time,
        ..Picture::default()
    };
    if let Some(path) = &arguments.video {
        let replaced = output::check(path, Content::Product, arguments.file.as_deref())?;
        let stills = viewer::video(&start, &picture, path)?;
        return Report::new(&Shown { file: Some(path.display().to_string()), stills: Some(stills), replaced });
    }
    let Some(file) = &arguments.screenshot else {
        let shown = viewer::open(start, device);
        interrupt::over();
        shown?;
        return Report::new(&Shown { file: None, stills: None, replaced: None });
    };
    if !file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        return Err(format!("{}: the picture is a PNG file: give a name that ends in .png", file.display()).into());
    }
    let replaced =
        output::check(file, Content::Product, arguments.file.iter().chain(&arguments.twin).map(PathBuf::as_path))?;
    if !(0.0..=60.0).contains(&arguments.time) {
        return Err(format!("cannot play {} s: give --time from 0 to 60", arguments.time).into());
    }
    let [least_width, least_height] = viewer::LEAST_WINDOW;
    if arguments.size[0] < least_width || arguments.size[1] < least_height {
        return Err(
            format!("the window has no room below {least_width}x{least_height} points: give a larger --size").into()
        );
    }
    viewer::screenshot(&start, &picture, file)?;
    Report::new(&Shown { file: Some(file.display().to_string()), stills: None, replaced })
}

/// What was shown.
#[cfg(feature = "viewer")]
#[derive(Serialize)]
struct Shown {
    /// The picture, if one was drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<String>,
    /// Stills of a film.
    #[serde(skip_serializing_if = "Option::is_none")]
    stills: Option<usize>,
    #[serde(flatten)]
    replaced: Option<Replaced>,
}

#[cfg(feature = "viewer")]
impl Describe for Shown {
    fn describe(&self, text: &mut Text) {
        if let Some(file) = &self.file {
            match self.stills {
                Some(stills) => {
                    text.line(format_args!("wrote {file}, {}", crate::names::counted(stills, ["still", "stills"])))
                }
                None => text.line(format_args!("wrote {file}")),
            }
        }
        self.replaced.describe(text);
    }
}

/// Says how to get the viewer.
#[cfg(not(feature = "viewer"))]
pub fn run(_: &Arguments) -> Result<Report, Failure> {
    Err("this haptize was built without its window: build it with one (cargo install --path . --features viewer)"
        .into())
}
