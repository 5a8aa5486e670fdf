//! What is common to all messages: a type, its definition, a stamp and bytes.

use super::cdr::Encoder;

/// Nanoseconds of a second.
pub(super) const NANOSECONDS: u64 = 1_000_000_000;

/// A message of ROS 2.
pub trait Message {
    /// Name of its type.
    const TYPE: &str;
    /// Text of its definition, as MCAP files carry it. Field names and types are those of ROS 2.
    const SCHEMA: &str;

    /// Time stamp (ns).
    fn stamp(&self) -> u64;

    /// Returns the message in CDR, little-endian.
    fn encode(&self) -> Vec<u8>;
}

/// Writes a `std_msgs/Header`.
pub(super) fn header(encoder: &mut Encoder, stamp: u64, frame: &str) {
    encoder.u32((stamp / NANOSECONDS) as u32);
    encoder.u32((stamp % NANOSECONDS) as u32);
    encoder.string(frame);
}
