//! What can go wrong with a log file and its messages.

use std::path::PathBuf;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// What a parser gives before the file or topic is known: the thing or the reason why not.
pub(crate) type Parsed<T> = std::result::Result<T, String>;

/// An unusable log file, or a message of one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The file cannot be opened or is no log file.
    #[error("{path}: {reason}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// A message cannot be had from the file: its chunk is damaged or cannot be read.
    #[error("{path}: message {index} of topic '{topic}': {reason}", path = path.display())]
    Lost {
        /// The file.
        path: PathBuf,
        /// Name of the topic.
        topic: String,
        /// The message's place among those of its topic.
        index: usize,
        /// Why.
        reason: String,
    },
    /// The bytes of a message are not what its type says.
    #[error("topic '{topic}' ({kind}): {reason}")]
    Message {
        /// Name of the topic.
        topic: String,
        /// Message type.
        kind: String,
        /// Field, what is wrong, what would be right.
        reason: String,
    },
    /// The wanted streams are not there, or there are several.
    #[error("{path}: {reason}", path = path.display())]
    Choice {
        /// The file.
        path: PathBuf,
        /// What is missing or ambiguous, and the topics there are.
        reason: String,
    },
}
