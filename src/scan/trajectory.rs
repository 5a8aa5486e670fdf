//! A scan's plan as a trajectory in time, for a robot that its own controller moves.
//!
//! The commanded position goes from stop to stop in straight lines of C-space at the scan's speed, all joints arriving
//! together, and rests for the dwell time where something is to be measured: a point gives two rows, arrival and
//! departure. A press that is recorded has its own speed, and rests for as long as it is held. Such a controller does
//! not wait until contact is steady, as `haptize scan` does: the dwell time must be long enough for the object to
//! relax.

use super::{Plan, Stop, plan::PressRecord};
use crate::{
    JointVector,
    csv::{Table, plain},
    dataset::JointLabel,
    ros::{JointState, MessageWriter},
};
use std::{
    collections::BTreeMap,
    io::{self, Write},
};

/// Positions at times, joined by straight lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Time (s) and configuration (rad or m), ascending in time.
    pub rows: Vec<(f64, JointVector)>,
}

/// First line of a plan's table. Without it the plan would look like a motion that a person has recorded.
pub const PLAN: &str = "# a plan of haptize";

/// What a plan in MCAP says was written by.
pub const PLAN_LIBRARY: &str = "haptize scan --plan-out";

impl Trajectory {
    /// Returns the trajectory through `plan` at `speed` (rad/s or m/s), resting for `dwell` (s) at each point.
    #[must_use]
    pub fn new(plan: &Plan, speed: f64, dwell: f64) -> Self {
        let mut rows: Vec<(f64, JointVector)> = Vec::new();
        for Stop { q, point, recorded } in &plan.stops {
            let (speed, rest) = match recorded {
                Some(PressRecord { speed, hold }) => (*speed, *hold),
                None => (speed, if point.is_some() { dwell } else { 0.0 }),
            };
            let (time, from) = rows.last().copied().unwrap_or((0.0, *q));
            let farthest = q.iter().zip(from.iter()).map(|(to, from)| (to - from).abs()).fold(0.0, f64::max);
            let arrival = time + farthest / speed;
            // A stop where the one before was takes no time: its row would repeat a time.
            if rows.is_empty() || arrival > time {
                rows.push((arrival, *q));
            }
            if rest > 0.0 {
                rows.push((arrival + rest, *q));
            }
        }
        Self { rows }
    }

    /// Returns its duration (s).
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.rows.last().map_or(0.0, |(time, _)| *time)
    }

    /// Writes it as CSV: [`PLAN`], a header, then time and configuration of each row. `haptize play --motion` reads it, too.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_csv(&self, joints: &[JointLabel], out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "{PLAN}")?;
        let mut table = Table::new(out);
        table.field("time [s]")?;
        table.fields(joints.iter().map(|joint| format!("{} [{}]", plain(&joint.name), joint.unit)))?.end()?;
        for (time, q) in &self.rows {
            table.field(time)?.fields(q.iter())?.end()?;
        }
        Ok(())
    }

    /// Writes it as MCAP: joint states with positions, on the topic `/plan`.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_mcap(&self, joints: &[JointLabel], out: impl Write) -> io::Result<()> {
        let names: Vec<String> = joints.iter().map(|joint| joint.name.clone()).collect();
        let mut writer = MessageWriter::new(out, PLAN_LIBRARY)?;
        let topic = writer.topic::<JointState>("/plan")?;
        for (time, q) in &self.rows {
            let stamp = (time * 1e9).round() as u64;
            let state = JointState { stamp, names: names.clone(), position: q.to_vec(), ..JointState::default() };
            writer.write(topic, &state)?;
        }
        writer.finish(BTreeMap::from([("duration [s]".to_owned(), self.duration().to_string())]))
    }
}
