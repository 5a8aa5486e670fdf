//! `[motion]`: named motions of the hand.

use super::JointSpec;
use super::check::Checker;
use super::value::{KEY, coordinates, not_negative};
use crate::JointVector;
use crate::{Error, names::counted};
use serde::de::{Deserialize, Deserializer, Error as _};

/// Named motions of the hand, as waypoints in C-space.
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSpec {
    /// Approach, press into the object, release; empty where the scene has none.
    #[serde(deserialize_with = "waypoints")]
    pub press: Vec<Waypoint>,
    /// Slide across the object in contact; empty where the scene has none.
    #[serde(deserialize_with = "waypoints")]
    pub scrape: Vec<Waypoint>,
}

/// The hand passes `q` at `time`; between waypoints it moves along a smooth (minimum-jerk) path.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Waypoint {
    /// Since the motion began (s).
    #[serde(deserialize_with = "not_negative")]
    pub time: f64,
    /// Configuration (rad or m).
    #[serde(deserialize_with = "coordinates")]
    pub q: JointVector,
}

impl MotionSpec {
    /// Checks it against the arm's `joints`.
    pub(super) fn check(&self, checker: &Checker<'_>, joints: &[JointSpec]) -> Result<(), Error> {
        for (key, waypoints) in [("press", &self.press), ("scrape", &self.scrape)] {
            for (number, waypoint) in waypoints.iter().enumerate() {
                let at = |part, message: String| Err(checker.at(&format!("motion.{key}.{number}.{part}"), message));
                let Waypoint { time, q } = waypoint;
                match number.checked_sub(1).map(|before| waypoints[before].time) {
                    None if *time > 0.0 => return at("time", format!("{key} begins at {time} s: it must begin at 0")),
                    Some(earlier) if *time <= earlier => {
                        let message = "it must be later than the waypoint before";
                        return at("time", format!("time is {time}: {message}, at {earlier} s"));
                    }
                    _ => {}
                }
                if q.len() != joints.len() {
                    return at(
                        "q",
                        format!(
                            "q has {} for {}",
                            counted(q.len(), ["number", "numbers"]),
                            counted(joints.len(), ["joint", "joints"])
                        ),
                    );
                }
                for (value, JointSpec { name, limits: [least, greatest], .. }) in q.iter().zip(joints) {
                    if !(least..=greatest).contains(&value) {
                        return at("q", format!("{value} is outside joint {name:?}'s limits [{least}, {greatest}]"));
                    }
                }
            }
        }
        Ok(())
    }
}

fn waypoints<'de, D: Deserializer<'de>>(value: D) -> Result<Vec<Waypoint>, D::Error> {
    let waypoints = Vec::deserialize(value)?;
    if waypoints.len() < 2 {
        return Err(D::Error::custom(format!("{KEY}needs at least two waypoints")));
    }
    Ok(waypoints)
}
