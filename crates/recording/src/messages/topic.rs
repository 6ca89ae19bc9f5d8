//! The topics and messages of a log file.

use super::error::{Error, Result};
use std::path::Path;

/// A log file of stamped messages.
pub trait MessageLog: Send + Sync {
    /// The file.
    fn path(&self) -> &Path;

    /// Topics with messages, ordered by name.
    fn topics(&self) -> &[Topic];

    /// Log times (ns since the epoch) of a topic's messages, ascending; index i here is message i
    /// in [`Self::messages`]. Empty when there is no such topic.
    fn times(&self, topic: usize) -> &[u64];

    /// The `wanted` messages (topic, index) in the order of the file. Only their chunks are read,
    /// one in memory at a time. A message that is damaged, missing or in a damaged chunk is an
    /// error; the others follow.
    fn messages<'a>(&'a self, wanted: &[(usize, usize)]) -> Box<dyn Iterator<Item = Message> + Send + 'a>;

    /// Problems of the file as a whole, one sentence each; empty for an undamaged file.
    fn problems(&self) -> &[String];
}

/// A named stream of messages of one type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, such as `/camera/color/image_raw`.
    pub name: String,
    /// Message type in ROS 1's form for both versions of ROS: `sensor_msgs/Image`,
    /// `foxglove.RawImage`.
    pub kind: String,
    /// Serialization of the messages.
    pub encoding: Encoding,
    /// Number of messages.
    pub count: usize,
}

/// Serialization of messages.
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
    /// Another serialization, by the file's name for it; such messages cannot be decoded.
    Other(String),
}

/// A message read from a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Index of its topic.
    pub topic: usize,
    /// Index among the messages of its topic, ordered by time.
    pub index: usize,
    /// Its content, or the reason why it cannot be read.
    pub bytes: Result<Vec<u8>>,
}

/// Reads one message.
///
/// # Errors
/// As for [`Message::bytes`].
pub fn read_one(log: &dyn MessageLog, topic: usize, index: usize) -> Result<Vec<u8>> {
    let missing =
        || Error::Choice { path: log.path().to_owned(), reason: format!("topic {topic} has no message {index}") };
    log.messages(&[(topic, index)]).next().ok_or_else(missing)?.bytes
}
