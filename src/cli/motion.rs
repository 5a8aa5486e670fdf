//! The motion of the hand that a command names: one of the scene, or one in a file.

use super::{Failure, tell};
use crate::{
    dataset::Dataset,
    device::Motion,
    names::counted,
    render::setup::{Setup, labels},
    ros::{Course, is_mcap},
    scene::Waypoint,
};
use std::path::Path;

/// Returns the motion called `name` in the scene of `dataset`, or that in the file `name`: a table, or joint states in
/// MCAP, of which `topic` counts.
pub fn named(setup: &Setup, dataset: &Dataset, name: &str, topic: Option<&str>) -> Result<Motion, Failure> {
    let joints = &setup.chain.joints;
    let waypoints = match name {
        "press" => &setup.scene.motion.press,
        "scrape" => &setup.scene.motion.scrape,
        file if is_mcap(Path::new(file)) => return recorded(setup, dataset, Path::new(file), topic),
        file if Path::new(file).exists() => {
            no_topic(topic, file)?;
            let motion = Motion::from_csv(Path::new(file), &labels(&dataset.grid))?;
            motion.check_limits(joints).map_err(|error| format!("{file}: {error}"))?;
            return Ok(motion);
        }
        file => {
            let known = "the scene may name the motions `press` and `scrape`; a CSV or MCAP file gives any other";
            return Err(format!("{file}: cannot be read: there is no such file; {known}").into());
        }
    };
    no_topic(topic, name)?;
    if waypoints.is_empty() {
        let known = "give its [motion] such waypoints, and bake it again if it was baked, or a CSV file by --motion";
        return Err(format!(
            "the scene has no motion \"{name}\", and its contact is not such that one could be made: {known}"
        )
        .into());
    }
    if setup.made_motions.contains(&name) {
        tell(format_args!(
            "haptize: note: the scene names no {name}; this one was made from where the dataset is in contact"
        ));
    }
    Ok(Motion::through(waypoints, joints.len())?)
}

/// Refuses a topic where there are none.
fn no_topic(topic: Option<&str>, motion: &str) -> Result<(), Failure> {
    topic.map_or(Ok(()), |_| Err(format!("{motion}: --topic is for a --motion in an MCAP file: leave it out").into()))
}

/// The motion in the MCAP file `file`, of the joints of `dataset`.
fn recorded(setup: &Setup, dataset: &Dataset, file: &Path, topic: Option<&str>) -> Result<Motion, Failure> {
    let joints: Vec<String> = labels(&dataset.grid).into_iter().map(|joint| joint.name).collect();
    let course = Course::read(file, topic, &joints)?;
    if course.left_out > 0 {
        tell(format_args!(
            "haptize: note: {}: {} of {} left out, for want of a joint, or because of a time no later than that before",
            file.display(),
            counted(course.left_out, ["message", "messages"]),
            course.topic
        ));
    }
    let samples: Vec<Waypoint> = course.samples.into_iter().map(|(time, q)| Waypoint { time, q }).collect();
    let motion = Motion::along(samples, joints.len()).map_err(|error| format!("{}: {error}", file.display()))?;
    if let Err(error) = motion.check_limits(&setup.chain.joints) {
        tell(format_args!("haptize: note: {}: {error}; the arm stops at its limits", file.display()));
    }
    Ok(motion)
}
