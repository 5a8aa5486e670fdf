//! Records of a chunk of an MCAP file, taken out of their compression.

use super::RECOVER;
use crate::Error;
use std::{borrow::Cow, io::Read, path::Path};

/// Longest record or chunk that is read (bytes): a chunk of a recorder's is a few MiB.
pub(super) const LONGEST_RECORD: u64 = 1 << 26;

/// A chunk as the file holds it.
pub(super) struct Chunk<'a> {
    /// Length of its records (bytes).
    pub size: u64,
    /// CRC-32 of its records; 0 for none.
    pub checksum: u32,
    /// Name of the compression; empty for none.
    pub compression: &'a [u8],
    /// Its records, compressed.
    pub content: &'a [u8],
}

impl<'a> Chunk<'a> {
    /// Returns the records. No more than their stated length is taken out, and no more than [`LONGEST_RECORD`], so that
    /// a small file cannot fill the memory.
    ///
    /// # Errors
    /// When they are too long, are not as long as stated, do not match their checksum, or are in no
    /// compression that is known.
    pub fn records(self, file: &Path) -> Result<Cow<'a, [u8]>, Error> {
        let refuse = |what: String| Error::at(file, what);
        if self.size > LONGEST_RECORD {
            return Err(refuse(format!(
                "a chunk holds {} bytes, and at most {LONGEST_RECORD} are read: write it with smaller chunks by `mcap \
                 compress --chunk-size 4194304 IN.mcap -o OUT.mcap`",
                self.size
            )));
        }
        let broken = |what: &dyn std::fmt::Display| {
            refuse(format!("the file is damaged, a compressed chunk cannot be read ({what}): {RECOVER}"))
        };
        let taken = |reader: &mut dyn Read| {
            let mut records = Vec::new();
            reader.take(self.size + 1).read_to_end(&mut records).map_err(|error| broken(&error))?;
            Ok::<_, Error>(Cow::Owned(records))
        };
        let records = match self.compression {
            b"" => Cow::Borrowed(self.content),
            b"lz4" => taken(&mut lz4_flex::frame::FrameDecoder::new(self.content))?,
            b"zstd" => {
                let mut decoder =
                    ruzstd::decoding::StreamingDecoder::new_with_max_window_size(self.content, LONGEST_RECORD)
                        .map_err(|error| broken(&error))?;
                taken(&mut decoder)?
            }
            other => {
                let name = String::from_utf8_lossy(other);
                return Err(refuse(format!(
                    "its chunks are compressed by {name}, and lz4 and zstd are read: write it without by `mcap \
                     decompress IN.mcap -o OUT.mcap`"
                )));
            }
        };
        if records.len() as u64 != self.size {
            let (found, size) = (records.len(), self.size);
            let found = if found as u64 > size { "more".to_owned() } else { found.to_string() };
            return Err(broken(&format!("it holds {found} of {size} bytes")));
        }
        let calculated = if self.checksum == 0 { 0 } else { crc32fast::hash(&records) };
        if calculated != self.checksum {
            return Err(refuse(format!(
                "the file is damaged, the checksum of a chunk is {:08x} and that of its records {calculated:08x}: \
                 {RECOVER}",
                self.checksum
            )));
        }
        Ok(records)
    }
}
