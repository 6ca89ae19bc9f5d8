//! What ROS 1 and ROS 2 messages share: the same fields in the same order, written in different ways.

use crate::error::{Error, Parsed, Result};
use crate::reader::Reader;
use crate::{Encoding, Topic};

/// A `std_msgs/Header`.
pub(crate) struct Header {
    /// [ns since the epoch].
    pub stamp: u64,
    pub frame: String,
}

/// A reader of the fields of a ROS message.
pub(crate) fn fields<'a>(topic: &Topic, bytes: &'a [u8]) -> Parsed<Reader<'a>> {
    match topic.encoding {
        Encoding::Ros1 => Ok(Reader::packed(bytes)),
        Encoding::Cdr => Reader::cdr(bytes),
        _ => Err(unknown(topic)),
    }
}

/// The message's header. ROS 1 begins it with a sequence number.
pub(crate) fn header(topic: &Topic, fields: &mut Reader<'_>) -> Parsed<Header> {
    if topic.encoding == Encoding::Ros1 {
        fields.u32()?;
    }
    let (seconds, nanoseconds) = (fields.u32()?, fields.u32()?);
    Ok(Header { stamp: stamp(seconds.into(), nanoseconds.into()), frame: fields.text()?.to_owned() })
}

/// Nanoseconds since the epoch.
pub(crate) fn stamp(seconds: u64, nanoseconds: u64) -> u64 {
    seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds)
}

/// Why a topic cannot be decoded: nothing known is of this type and encoding.
pub(crate) fn unknown(topic: &Topic) -> String {
    format!("messages written as {:?} of this type are not known here", topic.encoding)
}

/// The error of a message.
pub(crate) fn of_topic<T>(topic: &Topic, parsed: Parsed<T>) -> Result<T> {
    parsed.map_err(|reason| Error::Message { topic: topic.name.clone(), kind: topic.kind.clone(), reason })
}
