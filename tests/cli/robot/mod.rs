//! Arms from URDF and MJCF: kinematics and inertia against the file's own links, nodes on the links' shapes, scenes that bake,
//! and bad files refused at their line.

mod mjcf;
mod motion;
mod refusals;
mod scenes;

use haptize::{
    Error,
    robot::{Arm, Lock, Robot},
};
use std::path::{Path, PathBuf};

/// A robot file of these tests.
fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/robots").join(name)
}

/// The arm of `text`, read as if it lay among the robots of these tests.
fn arm(text: &str, tip: &str, locks: &[(&str, f64)]) -> Result<(Robot, Arm), Error> {
    let robot = Robot::parse(text.to_owned(), file("robot.urdf"))?;
    let locks: Vec<Lock> = locks.iter().map(|(joint, value)| Lock { joint: (*joint).into(), value: *value }).collect();
    let arm = Arm::new(&robot, tip, &locks)?;
    Ok((robot, arm))
}
