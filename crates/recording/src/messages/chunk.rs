//! A chunk: the unit in which both formats write and compress messages.

use super::byte_source::ByteSource;
use super::error::Parsed;
use std::io::Read;

/// Largest chunk (bytes); recorders write chunks of about a megabyte, or of one message.
const MAX_CHUNK: u64 = 1 << 30;
/// A compressed chunk may decompress to this size (bytes) whatever its own ...
const FREE_GROWTH: u64 = 16 << 20;
/// ... and to this many times its compressed size: blank images compress well, but a chunk of 16 MB
/// is not all blank.
const MAX_GROWTH: u64 = 1024;
/// Largest window of a Zstandard chunk (bytes), which its decoder allocates; level 22 asks for 128
/// MiB, the default level for 2 MiB.
const MAX_WINDOW: u64 = 128 << 20;

/// How a chunk is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compression {
    None,
    Bzip2,
    Lz4,
    Zstd,
}

/// The place of a chunk in the file.
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    /// First byte of its content, after the record's header.
    pub at: u64,
    /// Bytes of content in the file.
    pub len: u64,
    /// Bytes of content after decompression; `None` where the file does not say.
    pub size: Option<u64>,
    pub compression: Compression,
    /// CRC32 of the decompressed content; 0 when the file has none.
    pub crc: u32,
}

impl Chunk {
    /// Reads, decompresses and checks the chunk's content.
    pub fn load(&self, source: &ByteSource) -> Parsed<Vec<u8>> {
        let size = self.size.unwrap_or(self.len);
        if size.max(self.len) > MAX_CHUNK {
            return Err(format!("a chunk has {size} bytes; the limit is {MAX_CHUNK}"));
        }
        if size > FREE_GROWTH && size / MAX_GROWTH > self.len {
            return Err(format!(
                "a chunk of {} bytes claims to decompress to {size}; no recording compresses so well",
                self.len
            ));
        }
        let bytes = source.read(self.at, self.len)?;
        let bytes = match self.compression {
            Compression::None => Ok(bytes),
            Compression::Bzip2 => grow(bzip2::read::BzDecoder::new(&bytes[..]), size),
            Compression::Lz4 => grow(lz4_flex::frame::FrameDecoder::new(&bytes[..]), size),
            Compression::Zstd => {
                let window = size.next_power_of_two().clamp(8 << 20, MAX_WINDOW);
                ruzstd::decoding::StreamingDecoder::new_with_max_window_size(&bytes[..], window)
                    .map_err(|e| e.to_string())
                    .and_then(|decoder| grow(decoder, size))
            }
        }
        .map_err(|e| format!("the {:?} chunk at byte {} is damaged ({e})", self.compression, self.at))?;
        if self.crc != 0 && crc32fast::hash(&bytes) != self.crc {
            return Err(format!("the chunk at byte {} is damaged (wrong checksum)", self.at));
        }
        Ok(bytes)
    }
}

/// Decompresses exactly `size` bytes. Memory grows as they come, because `size` is only what the
/// file claims.
fn grow(decoder: impl Read, size: u64) -> Parsed<Vec<u8>> {
    let mut bytes = Vec::new();
    decoder.take(size + 1).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    if bytes.len() as u64 != size {
        let more = if bytes.len() as u64 > size { " or more" } else { "" };
        return Err(format!("it decompresses to {} bytes{more} instead of {size}", bytes.len()));
    }
    Ok(bytes)
}
