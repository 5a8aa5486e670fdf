//! `haptize new`: a commented scene to begin with, one of those that are part of the program.

use super::{
    Failure, output,
    report::{Describe, Report, Text},
    shell,
};
use crate::dataset::replace_file;
use clap::ValueEnum;
use serde::Serialize;
use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

/// Which scene to begin with, and where to write it.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize new                            writes sphere.toml
  haptize new --from mesh -o my.toml     writes my.toml, and bean.obj beside it
  haptize new --from touch               writes a scene for the Touch (Phantom Omni)
  haptize new --from organ               writes a scene of six joints, felt while it is solved

Next: edit the file, then do what the command names: bake the scene, scan it, or feel it at once.")]
pub struct Arguments {
    /// The scene to begin with.
    #[arg(long, default_value = "sphere")]
    from: Example,
    /// The file to write; by default the scene's name in the current folder, ending in .toml.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Takes no value: a first argument is answered with the option that it belongs to.
    #[arg(hide = true, value_parser = misplaced)]
    misplaced: Option<String>,
}

/// Refuses a first argument, and says what to type.
fn misplaced(text: &str) -> Result<String, String> {
    Err(match Example::from_str(text, true) {
        Ok(_) => format!("type `haptize new --from {text}` to begin with this scene"),
        Err(_) => format!("type `haptize new -o {text}` to write this file"),
    })
}

/// A scene that is part of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Example {
    /// A sphere with a skin under an arm of three joints: the result settles as mesh, contact nodes and grid get finer.
    Sphere,
    /// The paper's sphere of 102 nodes joined by springs.
    Paper,
    /// A triangle mesh from a file under an arm of four joints, one of them prismatic.
    Mesh,
    /// A soft organ under a hooked probe on six joints, whose contact is solved live.
    Organ,
    /// A soft ball within reach of the 3D Systems Touch (Phantom Omni).
    Touch,
    /// A soft ball in the workspace of the open device WoodenHaptics.
    Woodenhaptics,
    /// A soft ball before the planar Haply 2DIY.
    TwoDiy,
    /// A spongy block, scanned by a simulated rig and scraped.
    Sponge,
    /// The same block under a fabric.
    SpongeFabric,
    /// The same block, touched from the side.
    SpongeSide,
}

impl Example {
    /// Returns the default name of the scene's file, and its text.
    fn scene(self) -> (&'static str, &'static str) {
        match self {
            Self::Sphere => ("sphere.toml", include_str!("../../datasets/sphere.toml")),
            Self::Paper => ("paper.toml", include_str!("../../datasets/paper.toml")),
            Self::Mesh => ("mesh.toml", include_str!("../../datasets/mesh.toml")),
            Self::Organ => ("organ.toml", include_str!("../../datasets/organ.toml")),
            Self::Touch => ("touch.toml", include_str!("../../datasets/touch.toml")),
            Self::Woodenhaptics => ("woodenhaptics.toml", include_str!("../../datasets/woodenhaptics.toml")),
            Self::TwoDiy => ("two_diy.toml", include_str!("../../datasets/two_diy.toml")),
            Self::Sponge => ("sponge.toml", include_str!("../../datasets/sponge.toml")),
            Self::SpongeFabric => ("sponge_fabric.toml", include_str!("../../datasets/sponge_fabric.toml")),
            Self::SpongeSide => ("sponge_side.toml", include_str!("../../datasets/sponge_side.toml")),
        }
    }

    /// Returns name and text of the mesh that the scene reads, if it reads one.
    fn mesh(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Mesh => Some(("bean.obj", include_str!("../../datasets/bean.obj"))),
            Self::Organ => Some(("organ.obj", include_str!("../../datasets/organ.obj"))),
            _ => None,
        }
    }

    /// The commands that the file `scene` is for, one after the other.
    fn next(self, scene: &Path) -> Vec<String> {
        let file = shell::file(scene);
        let stem = scene.file_stem().map_or(String::new(), |stem| stem.to_string_lossy().into_owned());
        let beside = |end: &str| shell::file(Path::new(&format!("{stem}{end}"))).to_string();
        let (log, dataset, twin) = (beside(".csv"), beside(".haptize"), beside("_twin.toml"));
        match self {
            // From joint torques to an object that is seen, and felt beyond what was measured.
            Self::Sponge => vec![
                format!("haptize scan {file}"),
                format!("haptize gridize {log} --step 0.03"),
                format!("haptize shape {log} --ground {SPONGE_GROUND}"),
                format!("haptize twin {log} --ground {SPONGE_GROUND}"),
                format!("haptize play {dataset} --twin {twin}"),
            ],
            _ if self.is_scanned() => vec![format!("haptize scan {file}")],
            Self::Organ => vec![format!("haptize play {file}")],
            _ => vec![format!("haptize bake {file}")],
        }
    }

    fn is_scanned(self) -> bool {
        matches!(self, Self::Sponge | Self::SpongeFabric | Self::SpongeSide)
    }
}

/// Height of the ground on which the simulated sponge lies (m), which no torque tells.
pub const SPONGE_GROUND: f64 = -0.05;

/// Writes the scene, and the mesh that it reads. No file is replaced.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let (name, text) = arguments.from.scene();
    let scene = arguments.output.clone().unwrap_or_else(|| name.into());
    let mut files = vec![(scene.clone(), text)];
    files.extend(arguments.from.mesh().map(|(name, text)| (scene.with_file_name(name), text)));
    let missing = |(path, text): &(PathBuf, &str)| -> Result<bool, Failure> {
        // What is no regular file is not read: a pipe would be waited for.
        match std::fs::metadata(path) {
            Err(_) => Ok(true),
            Ok(there) if there.is_file() && std::fs::read(path).is_ok_and(|found| found == text.as_bytes()) => {
                Ok(false)
            }
            Ok(there) if there.is_file() && output::is_forced() => Ok(true),
            Ok(_) => Err(taken(path)),
        }
    };
    let missing = files.iter().map(missing).collect::<Result<Vec<_>, _>>()?;
    for ((path, text), _) in files.iter().zip(&missing).filter(|(_, missing)| **missing) {
        output::probe(path, path.parent().unwrap_or(Path::new("")))?;
        replace_file(path, |out| out.write_all(text.as_bytes()))
            .map_err(|error| format!("cannot write {}: {error}; give another place by -o", path.display()))?;
    }
    let files = files.iter().map(|(path, _)| path.display().to_string()).collect();
    Report::new(&Written { files, next: arguments.from.next(&scene) })
}

/// A scene to begin with.
#[derive(Serialize)]
struct Written {
    files: Vec<String>,
    #[serde(skip)]
    next: Vec<String>,
}

impl Describe for Written {
    fn describe(&self, text: &mut Text) {
        text.line(format_args!("wrote {}", self.files.join(" and ")));
        self.next.iter().for_each(|command| text.line(format_args!("next: {command}")));
    }
}

fn taken(path: &Path) -> Failure {
    format!(
        "{}: this file exists already, and nothing is written: name another by -o, or replace it with --force",
        path.display()
    )
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{ScanScene, Scene};

    #[test]
    fn every_example_is_a_valid_scene_of_the_kind_that_its_next_step_reads() {
        for example in Example::value_variants() {
            let (name, text) = example.scene();
            let (scene, scan) = (Scene::parse(text, name), ScanScene::parse(text, name));
            assert_eq!((scene.is_ok(), scan.is_ok()), (!example.is_scanned(), example.is_scanned()), "{name}");
            let mesh = example.mesh().map_or("", |(mesh, _)| mesh);
            assert_eq!(text.contains("[object.mesh]"), !mesh.is_empty() && text.contains(mesh), "{name}");
        }
    }
}
