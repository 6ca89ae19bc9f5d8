//! Errors of log files and their messages.

use std::path::PathBuf;

/// Result of this module.
pub type Result<T> = std::result::Result<T, Error>;

/// Result of a parser that does not know the file or topic: the error is the reason alone.
pub(crate) type Parsed<T> = std::result::Result<T, String>;

/// An unusable log file, or a message of one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The file cannot be opened or is not a log file.
    #[error("{path}: {reason}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// A message cannot be read: its chunk is damaged or unreadable.
    #[error("{path}: message {index} of topic '{topic}': {reason}", path = path.display())]
    Lost {
        /// The file.
        path: PathBuf,
        /// Name of the topic.
        topic: String,
        /// Index of the message in its topic.
        index: usize,
        /// The reason.
        reason: String,
    },
    /// The bytes of a message do not fit its type.
    #[error("topic '{topic}' ({kind}): {reason}")]
    Message {
        /// Name of the topic.
        topic: String,
        /// Message type.
        kind: String,
        /// The field, what is wrong, and what would be right.
        reason: String,
    },
    /// The wanted streams are missing or ambiguous.
    #[error("{path}: {reason}", path = path.display())]
    Choice {
        /// The file.
        path: PathBuf,
        /// What is missing or ambiguous, and the topics of the file.
        reason: String,
    },
}
