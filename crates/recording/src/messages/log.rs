//! An open log file of either format: its chunks, and where in them each topic's messages are.

use super::byte_source::ByteSource;
use super::chunk::Chunk;
use super::error::{Error, Parsed};
use super::topic::{Encoding, Message, MessageLog, Topic};
use std::path::Path;

/// A record inside a chunk.
pub(crate) enum Record<'a> {
    /// A channel of messages.
    Connection(u32, Connection),
    /// The name of a message type, by its number (MCAP only).
    Schema(u16, String),
    /// A message: connection, log time (ns), content.
    Message(u32, u64, &'a [u8]),
    /// Anything else.
    Other,
}

/// A channel of messages; several may belong to one topic.
#[derive(Clone, Debug)]
pub(crate) struct Connection {
    pub topic: String,
    pub kind: Kind,
    pub encoding: Encoding,
}

/// The message type of a connection.
#[derive(Clone, Debug)]
pub(crate) enum Kind {
    Name(String),
    /// By the number of a schema.
    Schema(u16),
}

/// Parses the record at the start of a slice of a chunk, and returns its length too.
pub(crate) type ParseRecord = fn(&[u8]) -> Parsed<(Record<'_>, usize)>;

/// An open log file.
pub(crate) struct Log {
    pub source: ByteSource,
    pub parse: ParseRecord,
    pub chunks: Vec<Chunk>,
    pub topics: Vec<Topic>,
    pub times: Vec<Vec<u64>>,
    /// A topic's messages: chunk, and offset in it.
    pub places: Vec<Vec<(u32, u32)>>,
    /// The connections of a topic, ascending.
    pub connections: Vec<Vec<u32>>,
    pub problems: Vec<String>,
}

impl MessageLog for Log {
    fn path(&self) -> &Path {
        self.source.path()
    }

    fn topics(&self) -> &[Topic] {
        &self.topics
    }

    fn times(&self, topic: usize) -> &[u64] {
        self.times.get(topic).map_or(&[], Vec::as_slice)
    }

    fn messages<'a>(&'a self, wanted: &[(usize, usize)]) -> Box<dyn Iterator<Item = Message> + Send + 'a> {
        // Missing messages come last, as errors.
        let place = |&(topic, index): &(usize, usize)| -> Option<(u32, u32)> {
            self.places.get(topic).and_then(|places| places.get(index)).copied()
        };
        let mut wanted: Vec<_> = wanted.iter().map(|w| (place(w).unwrap_or((u32::MAX, u32::MAX)), w.0, w.1)).collect();
        wanted.sort_unstable();
        Box::new(Messages { log: self, wanted: wanted.into_iter(), loaded: None })
    }

    fn problems(&self) -> &[String] {
        &self.problems
    }
}

/// Messages in the order of the file, one chunk in memory at a time.
struct Messages<'a> {
    log: &'a Log,
    wanted: std::vec::IntoIter<((u32, u32), usize, usize)>,
    loaded: Option<(u32, Parsed<Vec<u8>>)>,
}

impl Messages<'_> {
    fn read(&mut self, (chunk, offset): (u32, u32), topic: usize) -> Parsed<Vec<u8>> {
        let place = self.log.chunks.get(chunk as usize).ok_or("there is no such message")?;
        if self.loaded.as_ref().is_none_or(|(c, _)| *c != chunk) {
            // Frees the old chunk before the new one is read.
            self.loaded = None;
            self.loaded = Some((chunk, place.load(&self.log.source)));
        }
        let bytes = match &self.loaded {
            Some((_, Ok(bytes))) => bytes,
            Some((_, Err(reason))) => return Err(reason.clone()),
            None => return Err("the chunk is not there".into()),
        };
        let misplaced =
            || format!("the index points to byte {offset} of chunk {chunk}, where no message of this topic begins");
        let record = bytes.get(offset as usize..).ok_or_else(misplaced)?;
        match (self.log.parse)(record)?.0 {
            Record::Message(connection, _, content)
                if self.log.connections[topic].binary_search(&connection).is_ok() =>
            {
                Ok(content.to_vec())
            }
            _ => Err(misplaced()),
        }
    }
}

impl Iterator for Messages<'_> {
    type Item = Message;

    fn next(&mut self) -> Option<Message> {
        let (place, topic, index) = self.wanted.next()?;
        let bytes = self.read(place, topic).map_err(|reason| Error::Lost {
            path: self.log.path().to_owned(),
            topic: self.log.topics.get(topic).map_or_else(|| topic.to_string(), |t| t.name.clone()),
            index,
            reason,
        });
        Some(Message { topic, index, bytes })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.wanted.size_hint()
    }
}
