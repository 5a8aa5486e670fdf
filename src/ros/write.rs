//! An MCAP file of joint states.

use super::{JointState, MESSAGE_ENCODING, SCHEMA_ENCODING, TYPE, joint_state::SCHEMA};
use mcap::{
    WriteOptions, Writer,
    records::{MessageHeader, Metadata},
    write::NoSeek,
};
use std::{
    collections::BTreeMap,
    io::{self, Write},
};

/// A file under way.
pub struct JointStateWriter<W: Write> {
    writer: Writer<NoSeek<W>>,
    schema: u16,
    sequence: u32,
}

fn failed(error: mcap::McapError) -> io::Error {
    match error {
        mcap::McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

impl<W: Write> JointStateWriter<W> {
    /// Begins a file in `out`.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(out: W) -> io::Result<Self> {
        let options = WriteOptions::new().compression(None).profile("ros2").library("haptize").disable_seeking(true);
        let mut writer = options.create(NoSeek::new(out)).map_err(failed)?;
        let schema = writer.add_schema(TYPE, SCHEMA_ENCODING, SCHEMA.as_bytes()).map_err(failed)?;
        Ok(Self { writer, schema, sequence: 0 })
    }

    /// Adds a topic; returns its number.
    ///
    /// # Errors
    /// Those of the file.
    pub fn topic(&mut self, name: &str) -> io::Result<u16> {
        self.writer.add_channel(self.schema, name, MESSAGE_ENCODING, &BTreeMap::new()).map_err(failed)
    }

    /// Appends `state` to `topic`, at the time of its stamp.
    ///
    /// # Errors
    /// Those of the file.
    pub fn write(&mut self, topic: u16, state: &JointState) -> io::Result<()> {
        self.sequence = self.sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id: topic,
            sequence: self.sequence,
            log_time: state.stamp,
            publish_time: state.stamp,
        };
        self.writer.write_to_known_channel(&header, &state.encode()).map_err(failed)
    }

    /// Appends a record of names and values that are no messages, and ends the file.
    ///
    /// # Errors
    /// Those of the file.
    pub fn finish(mut self, facts: BTreeMap<String, String>) -> io::Result<()> {
        self.writer.write_metadata(&Metadata { name: "haptize".into(), metadata: facts }).map_err(failed)?;
        self.writer.finish().map(drop).map_err(failed)
    }
}
