//! MCAP files (<https://mcap.dev/spec>).
//!
//! A file is a sequence of records: a byte for the kind, a length, content. Chunks hold schemas,
//! channels and messages. The indices of a chunk's messages follow it, one per channel. A summary
//! is at the end. As with bags, the file is walked from chunk to chunk; the summary is only needed
//! for the channels and to continue after damage.

use super::byte_reader::ByteReader;
use super::byte_source::ByteSource;
use super::chunk::{Chunk, Compression};
use super::error::Parsed;
use super::log::{Connection, Kind, Log, Record};
use super::log_builder::{LogBuilder, next_after};
use super::topic::Encoding;

/// First and last bytes of the file.
pub(crate) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

const FOOTER: u8 = 2;
const SCHEMA: u8 = 3;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const MESSAGE_INDEX: u8 = 7;
const CHUNK_INDEX: u8 = 8;
const DATA_END: u8 = 15;

/// Bytes of a record's kind and length.
const RECORD_HEADER: u64 = 9;
/// Bytes of the footer record and the final magic.
const FILE_END: u64 = RECORD_HEADER + 20 + MAGIC.len() as u64;
/// Bytes read for the part of a chunk before its content; the name of the compression is short.
const CHUNK_HEADER: u64 = 256;
/// Bytes read of a schema or channel: numbers and names at its beginning.
const NAMES: u64 = 1 << 16;

/// Parses the record at the start of a chunk's content.
fn parse(bytes: &[u8]) -> Parsed<(Record<'_>, usize)> {
    let mut reader = ByteReader::packed(bytes);
    let kind = reader.u8()?;
    let len = reader.u64()?;
    let content = reader.take(usize::try_from(len).unwrap_or(usize::MAX))?;
    Ok((record(kind, content)?, reader.at()))
}

/// Parses the parts of a record that matter inside a chunk.
fn record(kind: u8, content: &[u8]) -> Parsed<Record<'_>> {
    let mut reader = ByteReader::packed(content);
    Ok(match kind {
        SCHEMA => Record::Schema(reader.u16()?, reader.text()?.to_owned()),
        CHANNEL => {
            let (id, schema) = (reader.u16()?, reader.u16()?);
            let topic = reader.text()?.to_owned();
            let encoding = match reader.text()? {
                "ros1" => Encoding::Ros1,
                "cdr" => Encoding::Cdr,
                "protobuf" => Encoding::Protobuf,
                "json" => Encoding::Json,
                other => Encoding::Other(other.to_owned()),
            };
            Record::Connection(id.into(), Connection { topic, kind: Kind::Schema(schema), encoding })
        }
        MESSAGE => {
            let channel = reader.u16()?;
            let (_sequence, log_time, _publish_time) = (reader.u32()?, reader.u64()?, reader.u64()?);
            Record::Message(channel.into(), log_time, reader.take(reader.remaining())?)
        }
        _ => Record::Other,
    })
}

/// The kind, and the start and length of the content, of the record at `at`.
fn walk(source: &ByteSource, at: u64) -> Parsed<(u8, u64, u64)> {
    let bytes = source.read(at, RECORD_HEADER)?;
    let mut reader = ByteReader::packed(&bytes);
    Ok((reader.u8()?, at + RECORD_HEADER, reader.u64()?))
}

/// Opens an MCAP file.
pub(crate) fn open(source: ByteSource) -> Log {
    let mut log = LogBuilder::new(source, parse);
    let len = log.source().len();
    let mut chunk_ats = Vec::new();
    match summary_at(log.source()) {
        Ok(0) => {}
        Ok(at) => {
            if let Err(reason) = read_summary(&mut log, at, &mut chunk_ats) {
                log.problem(format!("the summary at byte {at} is damaged: {reason}"));
            }
        }
        Err(reason) => log.problem(reason),
    }
    chunk_ats.sort_unstable();
    let mut at = MAGIC.len() as u64;
    while at < len {
        match step(&mut log, at, &chunk_ats) {
            Ok(Some(next)) => at = next,
            Ok(None) => break,
            Err(reason) => match log.damage(at, len, &reason, &chunk_ats) {
                Some(resume) => at = resume,
                None => break,
            },
        }
    }
    log.finish()
}

/// The start of the summary; 0 when there is none.
fn summary_at(source: &ByteSource) -> Parsed<u64> {
    let missing = || "no footer: the recorder did not finish, or the file was cut".to_string();
    let at = source.len().checked_sub(FILE_END).ok_or_else(missing)?;
    let bytes = source.read(at, FILE_END)?;
    let mut reader = ByteReader::packed(&bytes);
    if !bytes.ends_with(MAGIC) || reader.u8()? != FOOTER || reader.u64()? != 20 {
        return Err(missing());
    }
    let summary = reader.u64()?;
    if summary >= at || (summary > 0 && summary < MAGIC.len() as u64) {
        return Err(format!("the footer is damaged: it places the summary at byte {summary}"));
    }
    Ok(summary)
}

/// Reads the summary: schemas, channels, and the places of the chunks.
fn read_summary(log: &mut LogBuilder, mut at: u64, chunk_ats: &mut Vec<u64>) -> Parsed<()> {
    loop {
        let (kind, content_at, content_len) = walk(log.source(), at)?;
        match kind {
            FOOTER => return Ok(()),
            SCHEMA | CHANNEL => {
                let content = log.source().up_to(content_at, content_len.min(NAMES))?;
                log.record(record(kind, &content)?);
            }
            CHUNK_INDEX => {
                let content = log.source().read(content_at, content_len)?;
                let mut reader = ByteReader::packed(&content);
                let (_start, _end) = (reader.u64()?, reader.u64()?);
                chunk_ats.push(reader.u64()?);
            }
            _ => {}
        }
        at = content_at.checked_add(content_len).ok_or("a record does not end")?;
    }
}

/// Adds the record at `at`. Returns the position of the next; `None` after the last with messages.
fn step(log: &mut LogBuilder, at: u64, chunk_ats: &[u64]) -> Parsed<Option<u64>> {
    let (kind, content_at, content_len) = walk(log.source(), at)?;
    let len = log.source().len();
    let end = content_at.checked_add(content_len).filter(|&end| end <= len);
    match kind {
        0 => return Err("the record has kind 0".into()),
        DATA_END | FOOTER => return Ok(None),
        CHUNK => {
            let bytes = log.source().up_to(content_at, CHUNK_HEADER)?;
            let mut reader = ByteReader::packed(&bytes);
            let (_start, _end, size, crc) = (reader.u64()?, reader.u64()?, reader.u64()?, reader.u32()?);
            let compression = match reader.text()? {
                "" => Compression::None,
                "lz4" => Compression::Lz4,
                "zstd" => Compression::Zstd,
                other => return Err(format!("a chunk is compressed with '{other}'; supported are none, lz4 and zstd")),
            };
            let records_len = reader.u64()?;
            let chunk_at = content_at + reader.at() as u64;
            let whole = end.filter(|&end| chunk_at.checked_add(records_len).is_some_and(|e| e <= end));
            let Some(end) = whole else {
                // The chunk was cut, or its length is damaged. An uncompressed one is used as far
                // as it goes.
                if compression == Compression::None {
                    log.cut_chunk(chunk_at, next_after(chunk_ats, at).unwrap_or(len));
                }
                return Err(format!("the chunk claims {records_len} bytes from byte {chunk_at}"));
            };
            let size = (compression != Compression::None).then_some(size);
            log.chunk(Chunk { at: chunk_at, len: records_len, size, compression, crc });
            return Ok(Some(end));
        }
        _ => {}
    }
    let end = end.ok_or_else(|| format!("the record claims to be {content_len} bytes long"))?;
    match kind {
        MESSAGE_INDEX => {
            let content = log.source().read(content_at, content_len)?;
            let mut reader = ByteReader::packed(&content);
            let channel = reader.u16()?;
            let mut reader = ByteReader::packed(reader.counted()?);
            let mut entries = Vec::with_capacity(reader.remaining() / 16);
            while reader.remaining() > 0 {
                let time = reader.u64()?;
                let offset = reader.u64()?;
                let offset =
                    u32::try_from(offset).map_err(|_| format!("an index points to byte {offset} of a chunk"))?;
                entries.push((time, offset));
            }
            log.index(channel.into(), &entries)?;
        }
        SCHEMA | CHANNEL => {
            let content = log.source().up_to(content_at, content_len.min(NAMES))?;
            log.record(record(kind, &content)?);
        }
        MESSAGE => {
            let head = log.source().read(content_at, content_len.min(22))?;
            if let Record::Message(channel, time, _) = record(kind, &head)? {
                log.chunk(Chunk { at, len: end - at, size: None, compression: Compression::None, crc: 0 });
                log.index(channel, &[(time, 0)])?;
            }
        }
        _ => {}
    }
    Ok(Some(end))
}
