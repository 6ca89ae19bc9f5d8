//! Builds a [`Log`] while a file is read through.

use super::byte_source::ByteSource;
use super::chunk::{Chunk, Compression};
use super::error::Parsed;
use super::log::{Connection, Kind, Log, ParseRecord, Record};
use super::topic::{Encoding, Topic};
use std::collections::{BTreeMap, BTreeSet};

/// Most problems of a file that are kept, one sentence each.
const MAX_PROBLEMS: usize = 50;

/// Most damaged places after which reading continues, because each costs time.
const MAX_DAMAGES: usize = 200;
/// Opening decompresses chunks without an index up to this many bytes, about a second of work ...
const FREE_GROWTH: u64 = 64 << 20;
/// ... and up to this many times the file's size: LZ4 cannot compress more, and no recording does
/// as a whole.
const MAX_GROWTH: u64 = 256;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Place {
    time: u64,
    chunk: u32,
    offset: u32,
}

/// The messages of a topic, and its connections.
#[derive(Default)]
struct Gathered {
    places: Vec<Place>,
    connections: Vec<u32>,
}

/// The parts of a log that are known so far.
pub(crate) struct LogBuilder {
    source: ByteSource,
    parse: ParseRecord,
    chunks: Vec<Chunk>,
    /// Chunks without a usable index.
    unindexed: BTreeSet<usize>,
    places: BTreeMap<u32, Vec<Place>>,
    connections: BTreeMap<u32, Connection>,
    schemas: BTreeMap<u16, String>,
    problems: Vec<String>,
    damages: usize,
    /// Decompressed bytes of the chunks that were read through.
    grown: u64,
}

impl LogBuilder {
    pub fn new(source: ByteSource, parse: ParseRecord) -> Self {
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

    pub fn source(&self) -> &ByteSource {
        &self.source
    }

    pub fn problem(&mut self, sentence: String) {
        if self.problems.len() < MAX_PROBLEMS {
            self.problems.push(sentence);
        }
    }

    /// Adds a chunk. It has no index until [`Self::index`] is called.
    pub fn chunk(&mut self, chunk: Chunk) {
        self.unindexed.insert(self.chunks.len());
        self.chunks.push(chunk);
    }

    /// Adds an uncompressed chunk of unknown length, up to `end`.
    pub fn cut_chunk(&mut self, at: u64, end: u64) {
        let len = end.saturating_sub(at);
        self.chunk(Chunk { at, len, size: None, compression: Compression::None, crc: 0 });
    }

    /// Adds the index of the last chunk: log time and offset of its messages.
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

    /// Records damage at `at`. Returns where to continue: the next chunk before `end` that the end
    /// of the file lists. The damaged record may have been an index, so the last chunk is read
    /// through.
    pub fn damage(&mut self, at: u64, end: u64, reason: &str, chunk_ats: &[u64]) -> Option<u64> {
        self.unindexed.extend(self.chunks.len().checked_sub(1));
        self.damages += 1;
        let next = next_after(chunk_ats, at).filter(|&c| c < end && self.damages < MAX_DAMAGES);
        let lost = next.unwrap_or(end) - at;
        self.problem(format!("{lost} bytes at byte {at} of {} are lost: {reason}", self.source.len()));
        next
    }

    /// Adds a record that is not a message. The first description of a connection counts.
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

    /// Reads through chunk `c` for descriptions, and for messages if it has no index. Returns the
    /// number of those messages.
    fn read_through(&mut self, c: usize) -> usize {
        self.grown = self.grown.saturating_add(self.chunks[c].size.unwrap_or(self.chunks[c].len));
        let may = FREE_GROWTH + MAX_GROWTH.saturating_mul(self.source.len());
        if self.grown > may {
            self.problem(format!("chunk {c} is not read through: the chunks decompress to more than {may} bytes"));
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

    /// Reads through the chunks that need it, and sorts the messages by topic.
    pub fn finish(mut self) -> Log {
        let unindexed = self.unindexed.clone();
        let found: usize = unindexed.iter().map(|&c| self.read_through(c)).sum();
        if found > 0 {
            let (count, all) = (unindexed.len(), self.chunks.len());
            self.problem(format!("{count} of {all} chunks have no index: {found} messages were found by reading them"));
        }
        // Without descriptions at the end of the file, a connection's description is in the chunk
        // of its first message.
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

/// The first of the ascending `places` after `at`.
pub(crate) fn next_after(places: &[u64], at: u64) -> Option<u64> {
    places.get(places.partition_point(|&p| p <= at)).copied()
}

/// One form of a type's name: ROS 2 writes `sensor_msgs/msg/Image`, ROS 1 `sensor_msgs/Image`.
fn normalised(kind: &str) -> String {
    kind.replacen("/msg/", "/", 1)
}
