//! The way that joints went, from an MCAP file.

use super::{HAND_TOPIC, JointState, messages::Messages, table};
use crate::{Error, JointVector};
use std::path::Path;

/// Most samples that are read: an hour at 1 kHz.
const MOST_SAMPLES: usize = 3_600_000;

/// Positions of joints over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course {
    /// Topic that they come from.
    pub topic: String,
    /// Time since the first message (s), which ascends, and positions (rad or m).
    pub samples: Vec<(f64, JointVector)>,
    /// Messages that were left out: they lack one of the joints, or come no later than the one before.
    pub left_out: u64,
}

impl Course {
    /// Reads the positions of `joints`, in this order, from `topic` in the file at `path`. By default the topic is that
    /// of the hand in a session of haptize, or the only one.
    ///
    /// # Errors
    /// When the file cannot be read, the topic is not there or not unique, a message is none, or none names
    /// all the joints.
    pub fn read(path: &Path, topic: Option<&str>, joints: &[String]) -> Result<Self, Error> {
        let topics = super::topics(path)?;
        let topic = match topic {
            None if topics.iter().any(|topic| topic.name == HAND_TOPIC) => HAND_TOPIC.to_owned(),
            topic => table::chosen(path, &topics, topic)?,
        };
        let mut course = Self { topic, ..Self::default() };
        let (mut rows, mut stamped, mut number, mut names) = (Vec::new(), false, 0, Vec::new());
        for message in Messages::open(path)? {
            let (name, logged, bytes) = message?;
            if name != course.topic {
                continue;
            }
            number += 1;
            let state = table::decode(path, &course.topic, number, &bytes)?;
            stamped |= state.stamp > 0;
            match positions(&state, joints) {
                Some(q) => rows.push((state.stamp, logged, q)),
                None => (course.left_out, names) = (course.left_out + 1, state.names),
            }
            if rows.len() > MOST_SAMPLES {
                let what = format!("the topic has more than {MOST_SAMPLES} of them, an hour at 1 kHz: cut the file");
                return Err(table::no_state(path, &course.topic, number, &what));
            }
        }
        // Where no stamp says anything, the time counts at which messages were logged.
        let mut times = rows.into_iter().map(|(stamp, logged, q)| (if stamped { stamp } else { logged }, q)).peekable();
        let first = times.peek().map_or(0, |(time, _)| *time);
        let mut last = None;
        for (time, q) in times {
            if last.is_some_and(|last| time <= last) {
                course.left_out += 1;
                continue;
            }
            last = Some(time);
            course.samples.push(((time - first) as f64 * 1e-9, q));
        }
        if course.samples.is_empty() {
            let what = format!(
                "no message of {} gives the positions of {}; its last one names {}: give another topic by --topic, or \
                 the joints these names",
                course.topic,
                joints.join(", "),
                if names.is_empty() { "none".to_owned() } else { names.join(", ") }
            );
            return Err(Error::at(path, what));
        }
        Ok(course)
    }
}

/// Returns the positions of `joints`; `None` if one is missing or no finite number.
fn positions(state: &JointState, joints: &[String]) -> Option<JointVector> {
    let place = |joint: &String| state.names.iter().position(|name| name == joint);
    joints.iter().map(|joint| state.position.get(place(joint)?).copied().filter(|x| x.is_finite())).collect()
}
