//! Topics of a log file, their messages, and how a log is read.

use super::error::{Error, Result};
use std::path::Path;

/// A log file of stamped messages.
pub trait MessageLog: Send + Sync {
    /// The file.
    fn path(&self) -> &Path;

    /// Topics in the order of their names; those without messages are left out.
    fn topics(&self) -> &[Topic];

    /// Log times [ns since the epoch] of a topic's messages, ascending; index i here is message i
    /// below. Empty when there is no such topic.
    fn times(&self, topic: usize) -> &[u64];

    /// The wanted messages (topic, index), in the order they lie in the file; only their chunks are
    /// read, and memory holds one at a time. A message that is damaged, or lies in a damaged chunk,
    /// is an error and the rest goes on; so is one that is not there.
    fn messages<'a>(&'a self, wanted: &[(usize, usize)]) -> Box<dyn Iterator<Item = Message> + Send + 'a>;

    /// What was wrong with the file as a whole, a sentence each; empty for a whole file.
    fn problems(&self) -> &[String];
}

/// A named stream of messages of one type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name: `/camera/color/image_raw`.
    pub name: String,
    /// Message type, in ROS 1's form for both ROS: `sensor_msgs/Image`, `foxglove.RawImage`.
    pub kind: String,
    /// How the messages are written.
    pub encoding: Encoding,
    /// Number of messages.
    pub count: usize,
}

/// How messages are written.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Encoding {
    /// ROS 1 serialization.
    Ros1,
    /// ROS 2's CDR.
    Cdr,
    /// Protocol buffers.
    Protobuf,
    /// JSON.
    Json,
    /// Something else, by the file's name for it; cannot be decoded.
    Other(String),
}

/// A message read from a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Index of its topic.
    pub topic: usize,
    /// Its place among the messages of its topic, by time.
    pub index: usize,
    /// Its content, or why it cannot be had.
    pub bytes: Result<Vec<u8>>,
}

/// The one message wanted.
///
/// # Errors
/// As for [`Message::bytes`].
pub fn read_one(log: &dyn MessageLog, topic: usize, index: usize) -> Result<Vec<u8>> {
    let missing =
        || Error::Choice { path: log.path().to_owned(), reason: format!("topic {topic} has no message {index}") };
    log.messages(&[(topic, index)]).next().ok_or_else(missing)?.bytes
}
