//! `[motion]`: waypoints of the hand.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::{MotionTable, WaypointTable};
use super::super::{JointSpec, MotionSpec, Waypoint};
use crate::JointVector;
use toml::Spanned;

pub(super) fn convert(
    checker: &Checker<'_>,
    table: &MotionTable,
    joints: &[JointSpec],
) -> Result<MotionSpec, SceneError> {
    let motion = |key, list: &Option<Spanned<Vec<WaypointTable>>>| {
        list.as_ref().map_or(Ok(Vec::new()), |list| waypoints(checker, key, list, joints))
    };
    Ok(MotionSpec { press: motion("press", &table.press)?, scrape: motion("scrape", &table.scrape)? })
}

fn waypoints(
    checker: &Checker<'_>,
    key: &str,
    list: &Spanned<Vec<WaypointTable>>,
    joints: &[JointSpec],
) -> Result<Vec<Waypoint>, SceneError> {
    if list.get_ref().len() < 2 {
        return Err(checker.error(list.span(), format!("{key} needs at least two waypoints")));
    }
    let mut waypoints: Vec<Waypoint> = Vec::with_capacity(list.get_ref().len());
    for table in list.get_ref() {
        let time = checker.not_negative("time", &table.time)?;
        match waypoints.last() {
            None if time > 0.0 => {
                return Err(checker.error(table.time.span(), format!("{key} begins at {time} s: it must begin at 0")));
            }
            Some(earlier) if time <= earlier.time => {
                let message =
                    format!("time is {time}: it must be later than the waypoint before, at {} s", earlier.time);
                return Err(checker.error(table.time.span(), message));
            }
            _ => {}
        }
        let q = table.q.get_ref();
        if q.len() != joints.len() {
            let message = format!("q has {} numbers for {} joints", q.len(), joints.len());
            return Err(checker.error(table.q.span(), message));
        }
        checker.all_finite("q", q, table.q.span())?;
        for (value, joint) in q.iter().zip(joints) {
            let [least, greatest] = joint.limits;
            if !(least..=greatest).contains(value) {
                let message = format!("{value} is outside joint {:?}'s limits [{least}, {greatest}]", joint.name);
                return Err(checker.error(table.q.span(), message));
            }
        }
        waypoints.push(Waypoint { time, q: JointVector::from_slice(q) });
    }
    Ok(waypoints)
}
