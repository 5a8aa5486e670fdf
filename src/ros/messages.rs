//! Messages of joint states in an MCAP file, record by record.
//!
//! Records and chunks are taken apart here and not by `mcap` (0.26): its `parse_record` sets aside as many bytes as a
//! text's length says, up to 4 GB, before it looks whether they are there, and its reader takes a record that is longer
//! than its chunk for one that is not. Memory is that of the longest record or chunk.

use super::{
    MESSAGE_ENCODING, RECOVER, TYPE,
    chunk::{Chunk, LONGEST_RECORD},
    is_mcap, refused,
};
use crate::{Error, input, names::escaped};
use mcap::{
    McapError,
    records::op,
    sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions},
};
use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::{BufReader, ErrorKind, Read},
    path::{Path, PathBuf},
};

/// The messages: topic, log time (ns), bytes.
pub(super) struct Messages {
    pub path: PathBuf,
    file: BufReader<File>,
    reader: LinearReader,
    /// Records of the chunk that is being read, and how many of its bytes have been.
    chunk: Vec<u8>,
    taken: usize,
    topics: Topics,
    over: bool,
}

/// A message: topic, log time (ns), bytes.
type Logged = (String, u64, Vec<u8>);

/// Topics that the records so far have declared.
#[derive(Default)]
struct Topics {
    /// Schemas of the type.
    schemas: BTreeSet<u16>,
    /// Topics of its channels.
    channels: BTreeMap<u16, String>,
}

impl Messages {
    pub fn open(path: &Path) -> Result<Self, Error> {
        let unreadable = |source| Error::unreadable(path, &source);
        let file = input::open(path).map_err(unreadable)?;
        if !is_mcap(path) {
            return Err(refused(path, &McapError::BadMagic));
        }
        // No record is longer than its file, whatever it says.
        let longest = file.metadata().map_err(unreadable)?.len().min(LONGEST_RECORD);
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_record_length_limit(usize::try_from(longest).unwrap_or(usize::MAX));
        Ok(Self {
            path: path.to_owned(),
            file: BufReader::with_capacity(1 << 16, file),
            reader: LinearReader::new_with_options(options),
            chunk: Vec::new(),
            taken: 0,
            topics: Topics::default(),
            over: false,
        })
    }

    /// Returns the next message; `None` at the end.
    fn advance(&mut self) -> Result<Option<Logged>, Error> {
        loop {
            while self.taken < self.chunk.len() {
                let mut rest = Fields(&self.chunk[self.taken..]);
                let (opcode, record) = rest.record().ok_or_else(|| damaged(&self.path))?;
                self.taken = self.chunk.len() - rest.0.len();
                let message = self.topics.take(opcode, Fields(record)).ok_or_else(|| damaged(&self.path))?;
                if message.is_some() {
                    return Ok(message);
                }
            }
            let failed = |error: McapError| refused(&self.path, &error);
            let Some(event) = self.reader.next_event() else { return Ok(None) };
            match event.map_err(failed)? {
                LinearReadEvent::ReadRequest(length) => {
                    let read = loop {
                        match self.file.read(self.reader.insert(length)) {
                            Err(error) if error.kind() == ErrorKind::Interrupted => {}
                            read => break read.map_err(|error| failed(error.into()))?,
                        }
                    };
                    self.reader.notify_read(read);
                }
                LinearReadEvent::Record { data, opcode: op::CHUNK } => {
                    let chunk = Fields(data).chunk().ok_or_else(|| damaged(&self.path))?;
                    (self.chunk, self.taken) = (chunk.records(&self.path)?.into_owned(), 0);
                }
                LinearReadEvent::Record { data, opcode } => {
                    let message = self.topics.take(opcode, Fields(data)).ok_or_else(|| damaged(&self.path))?;
                    if message.is_some() {
                        return Ok(message);
                    }
                }
            }
        }
    }
}

/// The error of a file whose records are not as long as they say.
fn damaged(path: &Path) -> Error {
    Error::at(path, format_args!("the file is damaged, a record is shorter than it says: {RECOVER}"))
}

impl Iterator for Messages {
    type Item = Result<Logged, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.over {
            return None;
        }
        let next = self.advance().transpose();
        self.over = !matches!(next, Some(Ok(_)));
        next
    }
}

impl Topics {
    /// Takes note of a record, and returns the message of joint states that it is, if it is one. `None` if it is
    /// shorter than it says.
    fn take(&mut self, opcode: u8, mut record: Fields<'_>) -> Option<Option<Logged>> {
        match opcode {
            op::SCHEMA => {
                let (schema, name) = (record.u16()?, record.text()?);
                if name == TYPE.as_bytes() {
                    self.schemas.insert(schema);
                }
            }
            op::CHANNEL => {
                let (channel, schema) = (record.u16()?, record.u16()?);
                let (topic, encoding) = (record.text()?, record.text()?);
                if self.schemas.contains(&schema) && encoding == MESSAGE_ENCODING.as_bytes() {
                    // It is printed, and chosen by as it is printed.
                    self.channels.insert(channel, escaped(&String::from_utf8_lossy(topic)).into_owned());
                }
            }
            op::MESSAGE => {
                let (channel, _sequence) = (record.u16()?, record.u32()?);
                let (logged, _published) = (record.u64()?, record.u64()?);
                let topic = self.channels.get(&channel);
                return Some(topic.map(|topic| (topic.clone(), logged, record.0.to_vec())));
            }
            _ => {}
        }
        Some(None)
    }
}

/// Rest of a record: numbers are little-endian, a text is preceded by its length.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (array, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*array)
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Operation code and content of the next record.
    fn record(&mut self) -> Option<(u8, &'a [u8])> {
        let [opcode] = self.array()?;
        let length = self.u64()?;
        Some((opcode, self.bytes(length)?))
    }

    /// The chunk whose record this is.
    fn chunk(&mut self) -> Option<Chunk<'a>> {
        let (_first, _last, size) = (self.u64()?, self.u64()?, self.u64()?);
        let (checksum, compression, length) = (self.u32()?, self.text()?, self.u64()?);
        Some(Chunk { size, checksum, compression, content: self.bytes(length)? })
    }

    fn text(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()?;
        self.bytes(length.into())
    }

    fn bytes(&mut self, length: u64) -> Option<&'a [u8]> {
        let length = usize::try_from(length).ok()?;
        let (bytes, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(bytes)
    }
}
