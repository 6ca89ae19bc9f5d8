//! ROS 1 bags, format 2.0 (<http://wiki.ros.org/Bags/Format/2.0>).
//!
//! A bag is a sequence of records, each a header of named fields and data. Chunks hold the
//! messages. The indices of a chunk's messages follow it, one per connection. Descriptions of
//! connections and chunks are at the end. The file is walked from chunk to chunk without reading
//! their content, which finds every index. The end of the file is only needed to continue after
//! damage.

use super::byte_reader::ByteReader;
use super::byte_source::ByteSource;
use super::chunk::{Chunk, Compression};
use super::error::Parsed;
use super::log::{Connection, Kind, Log, Record};
use super::log_builder::{LogBuilder, next_after};
use super::topic::Encoding;

/// First bytes of the file.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

const MESSAGE: u8 = 2;
const BAG_HEADER: u8 = 3;
const INDEX: u8 = 4;
const CHUNK: u8 = 5;
const CHUNK_INFO: u8 = 6;
const CONNECTION: u8 = 7;

/// Bytes read for a record's header; enough for every header that recorders write.
const FIRST_READ: u64 = 4096;
/// Longest header of a record (bytes); headers are a few short fields.
const MAX_HEADER: u64 = 1 << 16;
/// Longest description of a connection (bytes); it holds the definition of its message type, some
/// kilobytes.
const MAX_DESCRIPTION: u64 = 1 << 20;

/// A record in the file: its header, and where its data is.
struct Walked {
    header: Vec<u8>,
    data_at: u64,
    data_len: u64,
}

impl Walked {
    /// The record at `at`, without its data.
    fn read(source: &ByteSource, at: u64) -> Parsed<Self> {
        let mut bytes = source.up_to(at, FIRST_READ)?;
        let header_len = u64::from(ByteReader::packed(&bytes).u32()?);
        if header_len > MAX_HEADER {
            return Err(format!("a record has a header of {header_len} bytes; the limit is {MAX_HEADER}"));
        }
        if header_len + 8 > bytes.len() as u64 {
            bytes = source.read(at, header_len + 8)?;
        }
        let mut reader = ByteReader::packed(&bytes);
        let header = reader.counted()?.to_vec();
        let data_len = u64::from(reader.u32()?);
        Ok(Self { header, data_at: at + 8 + header_len, data_len })
    }

    fn end(&self) -> u64 {
        self.data_at + self.data_len
    }

    fn connection(&self, source: &ByteSource) -> Parsed<Record<'static>> {
        if self.data_len > MAX_DESCRIPTION {
            return Err(format!(
                "the description of a connection has {} bytes; the limit is {MAX_DESCRIPTION}",
                self.data_len
            ));
        }
        connection(&self.header, &source.read(self.data_at, self.data_len)?)
    }
}

/// A field of a record's header.
fn field<'a>(header: &'a [u8], name: &str) -> Parsed<ByteReader<'a>> {
    let mut reader = ByteReader::packed(header);
    while reader.remaining() > 0 {
        let field = reader.counted()?;
        if let Some(value) = field.strip_prefix(name.as_bytes()).and_then(|rest| rest.strip_prefix(b"=")) {
            return Ok(ByteReader::packed(value));
        }
    }
    Err(format!("a record has no field '{name}'"))
}

/// A text field of a record's header.
fn text<'a>(header: &'a [u8], name: &str) -> Parsed<&'a str> {
    let mut value = field(header, name)?;
    std::str::from_utf8(value.take(value.remaining())?).map_err(|_| format!("the field '{name}' is not UTF-8"))
}

/// Reads a time: seconds, nanoseconds. Returns ns.
fn time(reader: &mut ByteReader<'_>) -> Parsed<u64> {
    Ok(u64::from(reader.u32()?) * 1_000_000_000 + u64::from(reader.u32()?))
}

/// Parses the record at the start of a chunk's content.
fn parse(bytes: &[u8]) -> Parsed<(Record<'_>, usize)> {
    let mut reader = ByteReader::packed(bytes);
    let header = reader.counted()?;
    let data = reader.counted()?;
    let record = match field(header, "op")?.u8()? {
        MESSAGE => Record::Message(field(header, "conn")?.u32()?, time(&mut field(header, "time")?)?, data),
        CONNECTION => connection(header, data)?,
        _ => Record::Other,
    };
    Ok((record, reader.at()))
}

/// A connection: the record's header has the topic, the data has the type among fields of the same
/// form.
fn connection<'a>(header: &[u8], data: &[u8]) -> Parsed<Record<'a>> {
    let connection = Connection {
        topic: text(header, "topic")?.to_owned(),
        kind: Kind::Name(text(data, "type")?.to_owned()),
        encoding: Encoding::Ros1,
    };
    Ok(Record::Connection(field(header, "conn")?.u32()?, connection))
}

/// Opens a bag.
pub(crate) fn open(source: ByteSource) -> Parsed<Log> {
    let mut log = LogBuilder::new(source, parse);
    let first = Walked::read(log.source(), MAGIC.len() as u64)?;
    if field(&first.header, "op")?.u8()? != BAG_HEADER {
        return Err("the first record is not the bag's header".into());
    }
    if text(&first.header, "encryptor").is_ok_and(|e| !e.is_empty()) {
        return Err("the bag is encrypted; decrypt it first".into());
    }
    let len = log.source().len();
    let index_at = field(&first.header, "index_pos")?.u64()?;
    let mut chunk_ats = Vec::new();
    let end = if index_at >= first.end() && index_at < len {
        if let Err(reason) = read_end(&mut log, index_at, &mut chunk_ats) {
            log.problem(format!("the index at the end is damaged: {reason}"));
        }
        index_at
    } else {
        // The index of a complete bag without messages begins at the end of the file.
        if index_at != len || field(&first.header, "chunk_count")?.u32()? > 0 {
            log.problem("no index at the end: the recorder did not finish, or the file was cut".into());
        }
        len
    };
    chunk_ats.sort_unstable();
    let mut at = first.end();
    while at < end {
        match step(&mut log, at, end, &chunk_ats) {
            Ok(next) => at = next,
            Err(reason) => match log.damage(at, end, &reason, &chunk_ats) {
                Some(resume) => at = resume,
                None => break,
            },
        }
    }
    Ok(log.finish())
}

/// The index section: connections, and where the chunks are.
fn read_end(log: &mut LogBuilder, mut at: u64, chunk_ats: &mut Vec<u64>) -> Parsed<()> {
    while at < log.source().len() {
        let walked = Walked::read(log.source(), at)?;
        match field(&walked.header, "op")?.u8()? {
            CONNECTION => {
                let record = walked.connection(log.source())?;
                log.record(record);
            }
            CHUNK_INFO => chunk_ats.push(field(&walked.header, "chunk_pos")?.u64()?),
            _ => {}
        }
        at = walked.end();
    }
    Ok(())
}

/// Adds the record at `at`. Returns the position of the next.
fn step(log: &mut LogBuilder, at: u64, end: u64, chunk_ats: &[u64]) -> Parsed<u64> {
    let walked = Walked::read(log.source(), at)?;
    let op = field(&walked.header, "op")?.u8()?;
    if walked.end() > end {
        // The chunk was cut, or its length is damaged. An uncompressed one is used as far as it
        // goes.
        if op == CHUNK && text(&walked.header, "compression")? == "none" {
            log.cut_chunk(walked.data_at, next_after(chunk_ats, at).unwrap_or(end));
        }
        return Err(format!("the record claims to end at byte {}", walked.end()));
    }
    match op {
        CHUNK => {
            let size = u64::from(field(&walked.header, "size")?.u32()?);
            let compression = match text(&walked.header, "compression")? {
                "none" => Compression::None,
                "bz2" => Compression::Bzip2,
                "lz4" => Compression::Lz4,
                other => return Err(format!("a chunk is compressed with '{other}'; supported are none, bz2 and lz4")),
            };
            let size = (compression != Compression::None).then_some(size);
            log.chunk(Chunk { at: walked.data_at, len: walked.data_len, size, compression, crc: 0 });
            if walked.data_len == 0 {
                // A killed recorder was writing this chunk: its length was never filled in, and its
                // messages follow.
                log.index(0, &[])?;
            }
        }
        INDEX => {
            let connection = field(&walked.header, "conn")?.u32()?;
            if !walked.data_len.is_multiple_of(12) {
                return Err(format!("an index has {} bytes; it must be a multiple of 12", walked.data_len));
            }
            let data = log.source().read(walked.data_at, walked.data_len)?;
            let mut reader = ByteReader::packed(&data);
            let mut entries = Vec::with_capacity(data.len() / 12);
            while reader.remaining() > 0 {
                entries.push((time(&mut reader)?, reader.u32()?));
            }
            log.index(connection, &entries)?;
        }
        CONNECTION => {
            let record = walked.connection(log.source())?;
            log.record(record);
        }
        MESSAGE => {
            let connection = field(&walked.header, "conn")?.u32()?;
            let time = time(&mut field(&walked.header, "time")?)?;
            let len = walked.end() - at;
            log.chunk(Chunk { at, len, size: None, compression: Compression::None, crc: 0 });
            log.index(connection, &[(time, 0)])?;
        }
        BAG_HEADER | CHUNK_INFO => {}
        other => return Err(format!("a record has the unknown kind {other}")),
    }
    Ok(walked.end())
}
