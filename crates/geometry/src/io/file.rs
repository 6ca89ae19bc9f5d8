//! Reading and writing of whole files, with errors that name the file.

use crate::{Error, Result};
use std::path::Path;

/// The result of a parser, or the reason of the failure. The caller adds the path.
pub(super) type Parsed<T> = std::result::Result<T, String>;

/// An [`Error::Parse`] with the reason in one line.
pub(super) fn bad(path: &Path, reason: impl Into<String>) -> Error {
    let reason: String = reason.into();
    Error::Parse { path: path.into(), reason: reason.split_whitespace().collect::<Vec<_>>().join(" ") }
}

/// Reads a whole file.
pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    if !path.exists() {
        let source = std::io::Error::new(std::io::ErrorKind::NotFound, "no such file");
        return Err(Error::Io { path: path.into(), source });
    }
    std::fs::read(path).map_err(|source| Error::Io { path: path.into(), source })
}

/// Writes a whole file.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|source| Error::Io { path: path.into(), source })
}
