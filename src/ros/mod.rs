//! Messages of ROS 2 in MCAP files, read and written without ROS.
//!
//! An MCAP file holds messages of many topics; here those of type `sensor_msgs/msg/JointState` count: names, positions,
//! velocities and efforts of joints at an instant. Files are written without compression; chunks compressed by
//! lz4 or zstd are read.

mod cdr;
mod chunk;
mod course;
mod joint_state;
mod messages;
mod table;
mod write;

pub use course::Course;
pub use joint_state::JointState;
pub use table::{JointStateTable, Topic, is_mcap, topics};
pub use write::JointStateWriter;

use std::path::PathBuf;

/// Name of the message type.
const TYPE: &str = "sensor_msgs/msg/JointState";

/// Most joints of a topic: ten times as many as those of a humanoid with hands.
const MOST_JOINTS: usize = 1 << 10;

/// How its schema and its messages are encoded.
const SCHEMA_ENCODING: &str = "ros2msg";
const MESSAGE_ENCODING: &str = "cdr";

/// Topic of where the hand wants the device, in a session of haptize.
pub const HAND_TOPIC: &str = "/hand";

/// What helps where a file is damaged.
const RECOVER: &str = "what is whole comes back by `mcap recover IN.mcap -o OUT.mcap`";

/// An MCAP file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RosError {
    /// The file cannot be opened.
    #[error("{}: cannot be read: {}", .file.display(), crate::input::remedied(source))]
    File {
        /// The file.
        file: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not MCAP, or damaged.
    #[error("{}: {what}", .file.display())]
    Mcap {
        /// The file.
        file: PathBuf,
        /// Problem and remedy, in words.
        what: String,
    },
    /// The topic is not there, or several are.
    #[error("{}: {what}; its topics of joint states: {topics}", .file.display())]
    Topic {
        /// The file.
        file: PathBuf,
        /// Problem and remedy, in words.
        what: String,
        /// Topics of joint states, with their numbers of messages.
        topics: String,
    },
    /// A message is not what its type says.
    #[error("{}: message {number} of {topic} is no {TYPE}: {what}", .file.display())]
    Message {
        /// The file.
        file: PathBuf,
        /// Its topic.
        topic: String,
        /// From 1, among the messages of its topic.
        number: u64,
        /// Problem, in words.
        what: String,
    },
}

impl RosError {
    /// Returns the error of a file that is no MCAP, with the remedy.
    fn mcap(file: &std::path::Path, error: &mcap::McapError) -> Self {
        let what = match error {
            mcap::McapError::BadMagic => "not an MCAP file".to_owned(),
            mcap::McapError::UnexpectedEof => {
                format!("it ends in the middle: {RECOVER}")
            }
            other => format!("the file is damaged ({other}): {RECOVER}"),
        };
        Self::Mcap { file: file.to_owned(), what }
    }
}
