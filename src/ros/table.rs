//! Joint states of an MCAP file as a table of text: what the import of logs reads.
//!
//! A header line names the columns: `time`, then `position NAME`, `velocity NAME` and `effort NAME` for each joint that
//! the topic names anywhere, in the order in which they first appear. Each message is a row; what it does not say is an
//! empty field, which the import drops or refuses as its mapping says. Time is the message's stamp; if all stamps are
//! zero, the time at which it was logged.

use super::{JointState, MOST_JOINTS, TYPE, messages::Messages};
use crate::{Error, csv::plain, input, names::counted};
use std::{
    collections::BTreeMap,
    fmt::Write as _,
    io::{self, Read},
    path::Path,
};

/// A topic of joint states.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// Its messages.
    pub messages: u64,
}

/// Returns whether the file at `path` begins like an MCAP file.
#[must_use]
pub fn is_mcap(path: &Path) -> bool {
    input::begins(path, mcap::MAGIC)
}

/// Returns the topics of joint states in the file at `path`, by name.
///
/// # Errors
/// When the file cannot be read.
pub fn topics(path: &Path) -> Result<Vec<Topic>, Error> {
    let mut counts: BTreeMap<String, u64> = BTreeMap::new();
    for message in Messages::open(path)? {
        *counts.entry(message?.0).or_default() += 1;
    }
    Ok(counts.into_iter().map(|(name, messages)| Topic { name, messages }).collect())
}

/// What the messages of a topic tell together.
#[derive(Default)]
struct Survey {
    messages: u64,
    joints: Vec<String>,
    /// Number of each joint.
    numbers: BTreeMap<String, usize>,
    stamped: bool,
    has_effort: bool,
    /// The first message that is no joint state, by its number from one, and why.
    refused: Option<(u64, String)>,
}

impl Survey {
    /// Takes a message in.
    fn take(&mut self, bytes: &[u8]) {
        self.messages += 1;
        if self.refused.is_none() {
            let added = JointState::decode(bytes).and_then(|state| self.add(state));
            self.refused = added.err().map(|what| (self.messages, what));
        }
    }

    fn add(&mut self, state: JointState) -> Result<(), String> {
        self.stamped |= state.stamp > 0;
        self.has_effort |= state.effort.iter().any(|effort| effort.is_finite());
        for joint in state.names {
            if !self.numbers.contains_key(&joint) {
                self.numbers.insert(joint.clone(), self.joints.len());
                self.joints.push(joint);
            }
        }
        if self.joints.len() > MOST_JOINTS {
            return Err(format!("its messages name more than {MOST_JOINTS} joints"));
        }
        Ok(())
    }
}

/// The table of one topic; reading it gives the text. The file is read twice: what its messages tell together names the
/// columns, and then each message is a row.
pub struct JointStateTable {
    messages: Messages,
    topic: String,
    survey: Survey,
    number: u64,
    text: String,
    read: usize,
}

impl JointStateTable {
    /// Opens the table of `topic` in the file at `path`, or of its only one.
    ///
    /// # Errors
    /// When the file cannot be read, the topic is not there or not unique, or a message is none.
    pub fn open(path: &Path, topic: Option<&str>) -> Result<Self, Error> {
        let mut surveys: BTreeMap<String, Survey> = BTreeMap::new();
        for message in Messages::open(path)? {
            let (name, _, bytes) = message?;
            surveys.entry(name).or_default().take(&bytes);
        }
        let count = |(name, survey): (&String, &Survey)| Topic { name: name.clone(), messages: survey.messages };
        let topic = chosen(path, &surveys.iter().map(count).collect::<Vec<_>>(), topic)?;
        let survey = surveys.remove(&topic).unwrap_or_default();
        if let Some((number, what)) = &survey.refused {
            return Err(no_state(path, &topic, *number, what));
        }
        if survey.joints.is_empty() {
            let what = format!("no message of {topic} names a joint: give the joints names where they are published");
            return Err(Error::at(path, what));
        }
        if !survey.has_effort {
            let what = format!(
                "no message of {topic} gives an effort, of {} in all, and a torque is made of it: record from a driver that \
                 publishes efforts",
                survey.messages
            );
            return Err(Error::at(path, what));
        }
        let mut text = "time".to_owned();
        for joint in &survey.joints {
            for what in ["position", "velocity", "effort"] {
                let _ = write!(text, ",{what} {}", plain(joint));
            }
        }
        text.push('\n');
        Ok(Self { messages: Messages::open(path)?, topic, survey, number: 0, text, read: 0 })
    }

    /// Returns the names of all joints.
    #[must_use]
    pub fn joints(&self) -> &[String] {
        &self.survey.joints
    }

    /// Returns the topic.
    #[must_use]
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Puts the next message's row into `text`; false at the end.
    fn next_row(&mut self) -> Result<bool, Error> {
        let (logged, bytes) = loop {
            match self.messages.next().transpose()? {
                None => return Ok(false),
                Some((name, logged, bytes)) if name == self.topic => break (logged, bytes),
                Some(_) => {}
            }
        };
        self.number += 1;
        let state = decode(&self.messages.path, &self.topic, self.number, &bytes)?;
        let nanoseconds = if self.survey.stamped { state.stamp } else { logged };
        (self.read, self.text) = (0, String::new());
        let _ = write!(self.text, "{}.{:09}", nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
        let mut places = vec![None; self.survey.joints.len()];
        for (place, name) in state.names.iter().enumerate().rev() {
            if let Some(&joint) = self.survey.numbers.get(name) {
                places[joint] = Some(place);
            }
        }
        for place in places {
            for values in [&state.position, &state.velocity, &state.effort] {
                self.text.push(',');
                if let Some(value) = place.and_then(|place: usize| values.get(place)) {
                    let _ = write!(self.text, "{value}");
                }
            }
        }
        self.text.push('\n');
        Ok(true)
    }
}

impl Read for JointStateTable {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.read == self.text.len() && !self.next_row().map_err(io::Error::other)? {
            return Ok(0);
        }
        let rest = &self.text.as_bytes()[self.read..];
        let count = rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        self.read += count;
        Ok(count)
    }
}

pub(super) fn decode(path: &Path, topic: &str, number: u64, bytes: &[u8]) -> Result<JointState, Error> {
    JointState::decode(bytes).map_err(|what| no_state(path, topic, number, &what))
}

/// The error of message `number`, counted from one, of `topic`.
pub(super) fn no_state(path: &Path, topic: &str, number: u64, what: &str) -> Error {
    Error::at(path, format_args!("message {number} of {topic} is no {TYPE}: {what}"))
}

/// Returns which of the `topics` of the file at `path` to read: `topic`, or the only one.
pub(super) fn chosen(path: &Path, topics: &[Topic], topic: Option<&str>) -> Result<String, Error> {
    let wrong = |what: &str| {
        let listed: Vec<String> = topics
            .iter()
            .map(|topic| format!("{} ({})", topic.name, counted(topic.messages, ["message", "messages"])))
            .collect();
        let topics = if listed.is_empty() { "none".to_owned() } else { listed.join(", ") };
        Error::at(path, format_args!("{what}; its topics of joint states: {topics}"))
    };
    match (topic, topics) {
        (Some(name), topics) if topics.iter().any(|topic| topic.name == name) => Ok(name.to_owned()),
        (Some(name), _) => Err(wrong(&format!("there is no topic {name}"))),
        (None, [only]) => Ok(only.name.clone()),
        (None, []) => Err(wrong(&format!("no message of it is a {TYPE}"))),
        (None, _) => Err(wrong("name one of several topics by --topic")),
    }
}
