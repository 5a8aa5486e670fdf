//! An MCAP file of messages.

use super::{
    MESSAGE_ENCODING, SCHEMA_ENCODING,
    message::{Message, schema},
};
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
pub struct MessageWriter<W: Write> {
    writer: Writer<NoSeek<W>>,
    sequence: u32,
}

fn failed(error: mcap::McapError) -> io::Error {
    match error {
        mcap::McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

impl<W: Write> MessageWriter<W> {
    /// Begins a file in `out`, written by `library`.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(out: W, library: &str) -> io::Result<Self> {
        let options = WriteOptions::new().compression(None).profile("ros2").library(library).disable_seeking(true);
        Ok(Self { writer: options.create(NoSeek::new(out)).map_err(failed)?, sequence: 0 })
    }

    /// Adds a topic of messages `M`; returns its number.
    ///
    /// # Errors
    /// Those of the file.
    pub fn topic<M: Message>(&mut self, name: &str) -> io::Result<u16> {
        let schema = self.writer.add_schema(M::TYPE, SCHEMA_ENCODING, schema::<M>().as_bytes()).map_err(failed)?;
        self.writer.add_channel(schema, name, MESSAGE_ENCODING, &BTreeMap::new()).map_err(failed)
    }

    /// Appends `message` to `topic`, at the time of its stamp.
    ///
    /// # Errors
    /// Those of the file.
    pub fn write(&mut self, topic: u16, message: &impl Message) -> io::Result<()> {
        self.sequence = self.sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id: topic,
            sequence: self.sequence,
            log_time: message.stamp(),
            publish_time: message.stamp(),
        };
        self.writer.write_to_known_channel(&header, &message.encode()).map_err(failed)
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
