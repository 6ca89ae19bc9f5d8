//! Builds a [`Log`] while a file is read through.

use super::byte_source::ByteSource;
use super::chunk::{Chunk, Compression};
use super::error::Parsed;
use super::log::{Connection, Kind, Log, ParseRecord, Record};
use super::topic::{Encoding, Topic};
use std::collections::{BTreeMap, BTreeSet};

/// A sentence for each of the first so many problems of a file.
const MAX_PROBLEMS: usize = 50;

/// A file with more damaged places than this is not read to its end: trying each costs time.
const MAX_DAMAGES: usize = 200;
/// Opening decompresses chunks without an index up to this many bytes, which are a second's work
/// ...
const FREE_GROWTH: u64 = 64 << 20;
/// ... and up to this many times the file's size: LZ4 cannot shrink more, and no recording does as
/// a whole.
const MAX_GROWTH: u64 = 256;

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
    /// Bytes of the chunks read through.
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

    /// The record at `at` is damaged: gives the next chunk that the end of the file knows of before
    /// `end`, to go on there. It may have been an index, so the last chunk is read through.
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

    /// Reads through chunk `c`: its descriptions, and its messages too if it has no index. Returns
    /// how many those are.
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
        // Descriptions lie in the chunk of a connection's first message when there is none at the
        // end of the file.
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
