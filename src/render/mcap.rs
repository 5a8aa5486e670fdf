//! A session as an MCAP file, for programs that plot and replay logs of robots.
//!
//! Four topics of joint states, one message a tick: `/device` (position y, velocity, torque that the device held),
//! `/proxy` (position x, contact torque), `/hand` (where the hand wants the device), `/command` (position y, torque
//! that the loop asked for). Stamps count from the session's start. `/hand` is a motion that `play` takes again; what
//! is needed to replay a session bit for bit is in its CSV recording only.

use super::trace::{Tick, Trace};
use crate::{
    JointVector,
    ros::{HAND_TOPIC, JointState, JointStateWriter},
};
use std::{
    collections::BTreeMap,
    io::{self, Write},
};

/// Writes `trace` to `out`; `facts` about the session go into the file's metadata.
///
/// # Errors
/// Those of `out`.
pub fn write(trace: &Trace, facts: BTreeMap<String, String>, out: impl Write) -> io::Result<()> {
    let names: Vec<String> = trace.joints.iter().map(|joint| joint.name.clone()).collect();
    let mut writer = JointStateWriter::new(out)?;
    let topics = ["/device", "/proxy", HAND_TOPIC, "/command"].map(|name| writer.topic(name));
    let mut before: Option<&Tick> = None;
    for tick in &trace.ticks {
        let mut velocity = JointVector::zeros(names.len());
        if let Some(before) = before.filter(|before| before.time < tick.time) {
            for (a, velocity) in velocity.iter_mut().enumerate() {
                *velocity = (tick.device[a] - before.device[a]) / (tick.time - before.time);
            }
        }
        before = Some(tick);
        let none = JointVector::zeros(0);
        let states = [
            (&tick.device, &velocity, &tick.applied.torque),
            (&tick.proxy, &none, &tick.sample.torque),
            (&tick.hand, &none, &none),
            (&tick.device, &none, &tick.device_torque),
        ];
        for (topic, (position, velocity, effort)) in topics.iter().zip(states) {
            let topic = topic.as_ref().map_err(|error| io::Error::other(error.to_string()))?;
            let state = JointState {
                stamp: nanoseconds(tick.time),
                frame: String::new(),
                names: names.clone(),
                position: position.to_vec(),
                velocity: velocity.to_vec(),
                effort: effort.to_vec(),
            };
            writer.write(*topic, &state)?;
        }
    }
    writer.finish(facts)
}

/// Returns `seconds` in whole nanoseconds.
fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}
