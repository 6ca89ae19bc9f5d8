//! A log file as both formats share it: chunks, and where in them each topic's messages lie.

use crate::chunk::{Chunk, Compression};
use crate::error::{Error, Parsed, Result};
use crate::source::Source;
use crate::{Encoding, Message, MessageLog, Topic};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// A sentence for each of the first so many problems of a file.
const MAX_PROBLEMS: usize = 50;

/// A file with more damaged places than this is not read to its end: trying each costs time.
const MAX_DAMAGES: usize = 200;
/// Opening decompresses chunks without an index up to this many bytes, which are a second's work ...
const FREE_GROWTH: u64 = 64 << 20;
/// ... and up to this many times the file's size: LZ4 cannot shrink more, and no recording does as a whole.
const MAX_GROWTH: u64 = 256;

/// A record inside a chunk.
pub(crate) enum Record<'a> {
    /// A channel of messages.
    Connection(u32, Connection),
    /// The name of a message type, by number (MCAP only).
    Schema(u16, String),
    /// A message: connection, log time [ns], content.
    Message(u32, u64, &'a [u8]),
    /// Anything else.
    Other,
}

/// A channel of messages; several may feed one topic.
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
    /// Number of a schema.
    Schema(u16),
}

/// Parses the record at the start of some bytes of a chunk and gives its length.
pub(crate) type ParseRecord = fn(&[u8]) -> Parsed<(Record<'_>, usize)>;

/// Where a message lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    time: u64,
    chunk: u32,
    offset: u32,
}

/// The messages of a topic, and the connections they came by.
#[derive(Default)]
struct Gathered {
    places: Vec<Place>,
    connections: Vec<u32>,
}

/// What is known of a file while it is read through.
pub(crate) struct Draft {
    source: Source,
    parse: ParseRecord,
    chunks: Vec<Chunk>,
    /// Chunks without a usable index.
    unindexed: BTreeSet<usize>,
    places: BTreeMap<u32, Vec<Place>>,
    connections: BTreeMap<u32, Connection>,
    schemas: BTreeMap<u16, String>,
    problems: Vec<String>,
    damages: usize,
    /// Bytes of the chunks read through.
    grown: u64,
}

impl Draft {
    pub fn new(source: Source, parse: ParseRecord) -> Self {
        Self {
            source,
            parse,
            chunks: Vec::new(),
            unindexed: BTreeSet::new(),
            places: BTreeMap::new(),
            connections: BTreeMap::new(),
            schemas: BTreeMap::new(),
            problems: Vec::new(),
            damages: 0,
            grown: 0,
        }
    }

    pub fn source(&self) -> &Source {
        &self.source
    }

    pub fn problem(&mut self, sentence: String) {
        if self.problems.len() < MAX_PROBLEMS {
            self.problems.push(sentence);
        }
    }

    /// Adds a chunk; it counts as without an index until [`Self::index`].
    pub fn chunk(&mut self, chunk: Chunk) {
        self.unindexed.insert(self.chunks.len());
        self.chunks.push(chunk);
    }

    /// Adds an uncompressed chunk whose length is unknown: as much of it as lies before `end`.
    pub fn cut_chunk(&mut self, at: u64, end: u64) {
        let len = end.saturating_sub(at);
        self.chunk(Chunk { at, len, size: None, compression: Compression::None, crc: 0 });
    }

    /// Messages of the last chunk: log time, offset in it. The chunk has an index now.
    pub fn index(&mut self, connection: u32, entries: &[(u64, u32)]) -> Parsed<()> {
        let last = self.chunks.len().checked_sub(1).ok_or("an index comes before the first chunk")?;
        let chunk = u32::try_from(last).map_err(|_| "too many chunks")?;
        let places = entries.iter().map(|&(time, offset)| Place { time, chunk, offset });
        if !entries.is_empty() {
            self.places.entry(connection).or_default().extend(places);
        }
        self.unindexed.remove(&last);
        Ok(())
    }

    /// The record at `at` is damaged: gives the next chunk that the end of the file knows of before `end`, to go on there.
    /// It may have been an index, so the last chunk is read through.
    pub fn damage(&mut self, at: u64, end: u64, reason: &str, chunk_ats: &[u64]) -> Option<u64> {
        self.unindexed.extend(self.chunks.len().checked_sub(1));
        self.damages += 1;
        let next = next_after(chunk_ats, at).filter(|&c| c < end && self.damages < MAX_DAMAGES);
        let lost = next.unwrap_or(end) - at;
        self.problem(format!("{lost} bytes at byte {at} of {} are lost: {reason}", self.source.len()));
        next
    }

    /// Takes in a record that is no message; the first description of a connection holds.
    pub fn record(&mut self, record: Record<'_>) {
        match record {
            Record::Connection(id, connection) => drop(self.connections.entry(id).or_insert(connection)),
            Record::Schema(id, name) => drop(self.schemas.entry(id).or_insert(name)),
            Record::Message(..) | Record::Other => {}
        }
    }

    fn described(&self, connection: u32) -> bool {
        self.connections.get(&connection).is_some_and(|c| match c.kind {
            Kind::Name(_) => true,
            Kind::Schema(id) => id == 0 || self.schemas.contains_key(&id),
        })
    }

    /// Reads through chunk `c`: its descriptions, and its messages too if it has no index. Returns how many those are.
    fn read_through(&mut self, c: usize) -> usize {
        self.grown = self.grown.saturating_add(self.chunks[c].size.unwrap_or(self.chunks[c].len));
        let may = FREE_GROWTH + MAX_GROWTH.saturating_mul(self.source.len());
        if self.grown > may {
            self.problem(format!("chunk {c} is not read through: the chunks grow to more than {may} bytes"));
            return 0;
        }
        let bytes = match self.chunks[c].load(&self.source) {
            Ok(bytes) => bytes,
            Err(reason) => {
                self.problem(format!("chunk {c} is lost: {reason}"));
                return 0;
            }
        };
        let (mut at, mut found) = (0, 0);
        let wanted = self.unindexed.contains(&c);
        while at < bytes.len() {
            match (self.parse)(&bytes[at..]) {
                Ok((Record::Message(connection, time, _), len)) => {
                    if wanted && let Ok(offset) = u32::try_from(at) {
                        self.places.entry(connection).or_default().push(Place { time, chunk: c as u32, offset });
                        found += 1;
                    }
                    at += len;
                }
                Ok((record, len)) => {
                    self.record(record);
                    at += len;
                }
                Err(reason) => {
                    let lost = bytes.len() - at;
                    self.problem(format!("the last {lost} bytes of chunk {c} (byte {at} of it) are lost: {reason}"));
                    break;
                }
            }
        }
        found
    }

    /// Reads through the chunks that need it and sorts everything into topics.
    pub fn finish(mut self) -> Log {
        let unindexed = self.unindexed.clone();
        let found: usize = unindexed.iter().map(|&c| self.read_through(c)).sum();
        if found > 0 {
            let (count, all) = (unindexed.len(), self.chunks.len());
            self.problem(format!("{count} of {all} chunks have no index: {found} messages were found by reading them"));
        }
        // Descriptions lie in the chunk of a connection's first message when there is none at the end of the file.
        let undescribed: Vec<u32> = self.places.keys().copied().filter(|&id| !self.described(id)).collect();
        let mut candidates: Vec<(usize, u32)> = undescribed
            .iter()
            .flat_map(|id| self.places[id].iter().map(|p| (p.chunk as usize, *id)))
            .filter(|(c, _)| !unindexed.contains(c))
            .collect();
        candidates.sort_unstable();
        candidates.dedup();
        let mut read = None;
        for (c, id) in candidates {
            if read != Some(c) && !self.described(id) {
                self.read_through(c);
                read = Some(c);
            }
        }
        self.into_log()
    }

    fn into_log(mut self) -> Log {
        let mut topics: BTreeMap<(String, String, Encoding), Gathered> = BTreeMap::new();
        for (id, places) in std::mem::take(&mut self.places) {
            let Some(connection) = self.connections.get(&id).cloned() else {
                let count = places.len();
                self.problem(format!(
                    "{count} messages of connection {id}, which the file does not describe, are lost"
                ));
                continue;
            };
            let kind = match connection.kind {
                Kind::Name(name) => name,
                Kind::Schema(number) => self.schemas.get(&number).cloned().unwrap_or_default(),
            };
            let key = (connection.topic, normalised(&kind), connection.encoding);
            let gathered = topics.entry(key).or_default();
            gathered.places.extend(places);
            gathered.connections.push(id);
        }
        let mut log = Log {
            source: self.source,
            parse: self.parse,
            chunks: self.chunks,
            topics: Vec::new(),
            times: Vec::new(),
            places: Vec::new(),
            connections: Vec::new(),
            problems: self.problems,
        };
        for ((name, kind, encoding), Gathered { mut places, connections }) in topics {
            places.sort_unstable();
            places.dedup();
            log.topics.push(Topic { name, kind, encoding, count: places.len() });
            log.times.push(places.iter().map(|p| p.time).collect());
            log.places.push(places.iter().map(|p| (p.chunk, p.offset)).collect());
            log.connections.push(connections);
        }
        log
    }
}

/// The first of the ascending places that is behind `at`.
pub(crate) fn next_after(places: &[u64], at: u64) -> Option<u64> {
    places.get(places.partition_point(|&p| p <= at)).copied()
}

/// One form for a type's name: ROS 2 says `sensor_msgs/msg/Image`, ROS 1 `sensor_msgs/Image`.
fn normalised(kind: &str) -> String {
    kind.replacen("/msg/", "/", 1)
}

/// An open log file.
pub(crate) struct Log {
    source: Source,
    parse: ParseRecord,
    chunks: Vec<Chunk>,
    topics: Vec<Topic>,
    times: Vec<Vec<u64>>,
    /// A topic's messages: chunk, offset in it.
    places: Vec<Vec<(u32, u32)>>,
    /// The connections that feed a topic, ascending.
    connections: Vec<Vec<u32>>,
    problems: Vec<String>,
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
        // What is not there comes last, as an error.
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
            // The old chunk's memory goes back before the new one's is taken.
            self.loaded = None;
            self.loaded = Some((chunk, place.load(&self.log.source)));
        }
        let bytes = match &self.loaded {
            Some((_, Ok(bytes))) => bytes,
            Some((_, Err(reason))) => return Err(reason.clone()),
            None => return Err("the chunk is not there".into()),
        };
        let misplaced =
            || format!("the index points to byte {offset} of chunk {chunk}, where there is no such message");
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

/// The one message wanted.
///
/// # Errors
/// As for [`Message::bytes`].
pub fn read_one(log: &dyn MessageLog, topic: usize, index: usize) -> Result<Vec<u8>> {
    let missing =
        || Error::Choice { path: log.path().to_owned(), reason: format!("topic {topic} has no message {index}") };
    log.messages(&[(topic, index)]).next().ok_or_else(missing)?.bytes
}
