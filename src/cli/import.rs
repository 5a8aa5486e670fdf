//! `haptize import`: a robot's file becomes a scene.

use super::{
    Failure, output as files,
    report::{Describe, Report, Text},
    shell, tell,
};
use crate::MAX_AXES;
use crate::dataset::replace_file;
use crate::names::{counted, escaped};
use crate::robot::{self, Arm, ArmJoint, Lock, Robot};
use serde::{Serialize, Serializer};
use std::{
    fs::OpenOptions,
    io::{ErrorKind, Write as _},
    path::{Path, PathBuf},
};

/// Arguments of `haptize import`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize import panda.urdf --tip panda_hand --lock panda_joint7=0.8
  haptize import sawyer/robot.xml --tip right_hand --lock right_j6=0
  haptize import arm.urdf --tip wrist --spacing 0.01 --package-path ~/ros/src -o arm.toml")]
pub struct Arguments {
    /// The robot's file, URDF or MJCF. Xacro is expanded first: `xacro FILE > ROBOT.urdf`.
    robot: PathBuf,
    /// The link (in MJCF the body) at the end of the arm; its chain to the root becomes the arm.
    #[arg(long, value_name = "LINK")]
    tip: String,
    /// Hold a joint at a value (rad or m); a scene has at most twelve that move, and six if it is to be baked. May be
    /// given several times.
    #[arg(long, value_name = "JOINT=VALUE", value_parser = lock, allow_hyphen_values = true)]
    lock: Vec<Lock>,
    /// Least distance between contact nodes on the links' shapes (m); by default 0.005, or as much as keeps them below
    /// 4,096.
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    spacing: Option<f64>,
    /// Folder that holds the ROS packages that `package://` names, if they are in no folder above the robot's file.
    #[arg(long, value_name = "DIR")]
    package_path: Option<PathBuf>,
    /// The scene to write, which must not be there yet; by default the robot's file in the current folder, ending in
    /// .toml.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

/// Reads JOINT=VALUE.
fn lock(text: &str) -> Result<Lock, String> {
    let (joint, value) = text.rsplit_once('=').ok_or("it must be JOINT=VALUE")?;
    let value: f64 = value.trim().parse().map_err(|_| format!("{value:?} is no number"))?;
    if !value.is_finite() {
        return Err(format!("{value} is no place for a joint"));
    }
    Ok(Lock { joint: joint.trim().to_owned(), value })
}

/// Writes the scene, and lists what the robot's file lacks.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let robot = Robot::load(&arguments.robot)?;
    let mut arm = Arm::new(&robot, &arguments.tip, &arguments.lock)?;
    let nodes = robot::sample(&robot, &arm, arguments.spacing, arguments.package_path.as_deref())?;
    let (shapes, missing) = robot::drawn_shapes(&robot, &arm, arguments.package_path.as_deref());
    arm.notes.extend(missing);
    let scene = robot::write_scene(&robot, &arm, &nodes, &shapes, &command(arguments))?;
    let output = match &arguments.output {
        Some(output) => output.clone(),
        None => PathBuf::from(arguments.robot.file_name().ok_or("the robot's path names no file; give -o")?)
            .with_extension("toml"),
    };
    write(&output, &scene)?;
    let notes: Vec<String> = (arm.notes.iter())
        .map(|note| format!("{}:{}: {}", arguments.robot.display(), note.line, note.message))
        .collect();
    notes.iter().for_each(|note| tell(format_args!("haptize: {note}")));
    let nodes: Vec<usize> = nodes.of_joints.iter().map(Vec::len).collect();
    Report::new(&Imported { file: output.display().to_string(), joints: arm.joints, nodes, notes })
}

/// A scene made of a robot.
#[derive(Serialize)]
struct Imported {
    file: String,
    #[serde(serialize_with = "names")]
    joints: Vec<ArmJoint>,
    /// Contact nodes of each joint's link.
    nodes: Vec<usize>,
    /// What the robot's file lacks.
    notes: Vec<String>,
}

/// Writes joints as their names.
fn names<S: Serializer>(joints: &[ArmJoint], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(joints.iter().map(|joint| &joint.name))
}

impl Describe for Imported {
    fn describe(&self, text: &mut Text) {
        let Self { file, joints, nodes, .. } = self;
        let all: usize = nodes.iter().sum();
        text.line(format_args!(
            "{file}: {}, {}",
            counted(joints.len(), ["joint", "joints"]),
            counted(all, ["contact node", "contact nodes"])
        ));
        for (joint, count) in joints.iter().zip(nodes) {
            let ([lower, upper], kind) = (joint.limits, format!("{:?}", joint.kind).to_lowercase());
            let follows = joint.follows.iter().map(|mimic| format!(", follows {}", mimic.joint)).collect::<String>();
            text.row(
                &joint.name,
                format_args!("{kind:9} {lower:8.3} to {upper:.3}, {}{follows}", counted(*count, ["node", "nodes"])),
            );
        }
        // More joints than a grid has axes are felt live.
        let independent = joints.iter().filter(|joint| joint.follows.is_none()).count();
        let command = if independent > MAX_AXES { "view" } else { "bake" };
        text.row("next", format_args!("haptize {command} {}", shell::file(Path::new(file))));
    }
}

/// The command line again, for the head of the scene; files without their folders.
fn command(arguments: &Arguments) -> String {
    let robot = shell::file(Path::new(arguments.robot.file_name().unwrap_or_default()));
    let mut command = format!("haptize import {robot} {}", shell::option("--tip", &arguments.tip));
    for Lock { joint, value } in &arguments.lock {
        command += &format!(" {}", shell::option("--lock", &format!("{joint}={value}")));
    }
    if let Some(spacing) = arguments.spacing {
        command += &format!(" --spacing {spacing}");
    }
    // It stays on one line.
    escaped(&command).into_owned()
}

/// Refuses a scene that is there, before the work that makes another.
pub fn refuse_existing(output: &Path) -> Result<(), Failure> {
    let is_there = std::fs::symlink_metadata(output).is_ok();
    if is_there && !files::is_forced() { Err(taken(output)) } else { Ok(()) }
}

fn taken(output: &Path) -> Failure {
    format!(
        "{}: there is a file already; nothing is written: name another file, or replace it with --force",
        output.display()
    )
    .into()
}

/// Writes a new file. A scene that is there may hold the work of a person, and is left as it is.
pub fn write(output: &Path, scene: &str) -> Result<(), Failure> {
    if files::is_forced() {
        return Ok(replace_file(output, |file| file.write_all(scene.as_bytes()))?);
    }
    let failed =
        |error: std::io::Error| -> Failure { format!("{}: cannot be written: {error}", output.display()).into() };
    let mut file = match OpenOptions::new().write(true).create_new(true).open(output) {
        Ok(file) => file,
        Err(error) if error.kind() == ErrorKind::AlreadyExists => return Err(taken(output)),
        Err(error) => return Err(failed(error)),
    };
    let written = file.write_all(scene.as_bytes()).and_then(|()| file.sync_all());
    written.map_err(|error| {
        // Half a scene is worse than none.
        let _ = std::fs::remove_file(output);
        failed(error)
    })
}
