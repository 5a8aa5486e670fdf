//! Messages of ROS 2 in MCAP files, read and written without ROS.
//!
//! An MCAP file holds messages of many topics. Those of type `sensor_msgs/msg/JointState` are read: names, positions,
//! velocities and efforts of joints at an instant. What viewers show beside them is written. Files are written without
//! compression; chunks compressed by lz4 or zstd are read.

mod cdr;
mod chunk;
mod course;
mod joint_state;
mod message;
mod messages;
mod shown;
mod table;
mod write;

pub use course::Course;
pub use joint_state::JointState;
pub use message::Message;
pub use shown::{Form, Marker, Markers, RobotDescription, Transforms, WORLD};
pub use table::{JointStateTable, Topic, is_mcap, topics};
pub use write::MessageWriter;

use crate::Error;
use std::path::Path;

/// Name of the message type that is read.
const TYPE: &str = <JointState as Message>::TYPE;

/// Most joints of a topic: ten times as many as those of a humanoid with hands.
const MOST_JOINTS: usize = 1 << 10;

/// How its schema and its messages are encoded.
const SCHEMA_ENCODING: &str = "ros2msg";
const MESSAGE_ENCODING: &str = "cdr";

/// Topic of where the hand wants the device, in a session of haptize.
pub const HAND_TOPIC: &str = "/hand";

/// What helps where a file is damaged.
const RECOVER: &str = "what is whole comes back by `mcap recover IN.mcap -o OUT.mcap`";

/// The error of the file at `path`, which is no MCAP or damaged, with the remedy.
fn refused(path: &Path, error: &mcap::McapError) -> Error {
    match error {
        mcap::McapError::BadMagic => Error::at(path, "not an MCAP file"),
        mcap::McapError::UnexpectedEof => Error::at(path, format_args!("it ends in the middle: {RECOVER}")),
        other => Error::at(path, format_args!("the file is damaged ({other}): {RECOVER}")),
    }
}
