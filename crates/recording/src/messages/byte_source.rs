//! The file of a log: read in pieces, never mapped and never whole.

use super::error::{Error, Parsed, Result};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// A reader that a log can be opened from.
pub trait ReadSeek: Read + Seek + Send {}

impl<T: Read + Seek + Send> ReadSeek for T {}

/// An open file of known length.
pub(crate) struct ByteSource {
    path: PathBuf,
    /// Seek and read share the file's position, so both happen under one lock.
    file: Mutex<Box<dyn ReadSeek>>,
    len: u64,
}

impl ByteSource {
    pub fn new(path: &Path, mut file: Box<dyn ReadSeek>) -> Result<Self> {
        let len = file
            .seek(SeekFrom::End(0))
            .map_err(|e| Error::File { path: path.to_owned(), reason: format!("cannot be read ({e})") })?;
        Ok(Self { path: path.to_owned(), file: Mutex::new(file), len })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length of the file.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Exactly `count` bytes at `at`. Allocates nothing for bytes that the file does not have.
    pub fn read(&self, at: u64, count: u64) -> Parsed<Vec<u8>> {
        if at.checked_add(count).is_none_or(|end| end > self.len) {
            return Err(format!("{count} bytes expected at byte {at}, but the file ends at byte {}", self.len));
        }
        let count = usize::try_from(count).map_err(|_| format!("{count} bytes do not fit into memory"))?;
        let mut bytes = vec![0; count];
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(at))
            .and_then(|_| file.read_exact(&mut bytes))
            .map_err(|e| format!("{count} bytes at byte {at} cannot be read ({e})"))?;
        Ok(bytes)
    }

    /// Up to `count` bytes at `at`, fewer at the end of the file.
    pub fn up_to(&self, at: u64, count: u64) -> Parsed<Vec<u8>> {
        self.read(at, count.min(self.len.saturating_sub(at)))
    }
}
