//! The bytes of a Gmsh file as numbers and words, in either encoding.

use super::super::file::Parsed;
use glam::DVec3;

/// A cursor over the bytes of a file.
pub(super) struct Source<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Whether numbers are binary; set after the file's format section.
    pub(super) binary: bool,
}

impl<'a> Source<'a> {
    /// Starts at the beginning of `bytes`, in text.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, binary: false }
    }

    /// The rest of the current line, without surrounding white space.
    pub(super) fn line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n');
        self.at += end.map_or(rest.len(), |e| e + 1);
        rest[..end.unwrap_or(rest.len())].trim_ascii()
    }

    /// The name of the next section, `$Name`; `None` at the end of the file.
    pub(super) fn section(&mut self) -> Option<String> {
        while self.at < self.bytes.len() {
            let line = self.line();
            if line.first() == Some(&b'$') {
                return Some(String::from_utf8_lossy(line).into_owned());
            }
        }
        None
    }

    /// Moves past the next `mark`.
    pub(super) fn skip_past(&mut self, mark: &str) -> Parsed<()> {
        let found = self.bytes[self.at..].windows(mark.len()).position(|w| w == mark.as_bytes());
        self.at += found.ok_or_else(|| format!("the file is truncated: {mark} is missing"))? + mark.len();
        Ok(())
    }

    /// The next word of text.
    pub(super) fn word(&mut self) -> Parsed<&'a str> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or("the file is truncated")?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        self.at += start + length;
        std::str::from_utf8(&rest[start..start + length]).map_err(|_| format!("byte {} is not text", self.at - length))
    }

    pub(super) fn parsed<T: std::str::FromStr>(&mut self) -> Parsed<T> {
        let word = self.word()?;
        let shown: String = word.chars().take(20).collect();
        word.parse().map_err(|_| format!("{shown:?} before byte {} must be a number", self.at))
    }

    pub(super) fn raw<const N: usize>(&mut self) -> Parsed<[u8; N]> {
        let chunk = self.bytes[self.at..].first_chunk::<N>().ok_or("the file is truncated")?;
        self.at += N;
        Ok(*chunk)
    }

    /// A count in text on a line of its own, which version 2.2 has even in binary files.
    pub(super) fn text_count(&mut self) -> Parsed<u64> {
        let count = self.parsed()?;
        self.line();
        Ok(count)
    }

    pub(super) fn int(&mut self) -> Parsed<i64> {
        if self.binary { Ok(i64::from(i32::from_le_bytes(self.raw()?))) } else { self.parsed() }
    }

    /// A non-negative number that version 2.2 stores as an `int`.
    pub(super) fn tag_2(&mut self) -> Parsed<u64> {
        let tag = self.int()?;
        u64::try_from(tag).map_err(|_| format!("{tag} before byte {} must not be negative", self.at))
    }

    pub(super) fn size(&mut self) -> Parsed<u64> {
        if self.binary { Ok(u64::from_le_bytes(self.raw()?)) } else { self.parsed() }
    }

    pub(super) fn real(&mut self) -> Parsed<f64> {
        if self.binary { Ok(f64::from_le_bytes(self.raw()?)) } else { self.parsed() }
    }

    pub(super) fn point(&mut self) -> Parsed<DVec3> {
        Ok(DVec3::new(self.real()?, self.real()?, self.real()?))
    }

    /// Rejects a count of items of at least `bytes_each` bytes that exceeds the rest of the file.
    pub(super) fn expect(&self, count: u64, bytes_each: u64, what: &str) -> Parsed<()> {
        let left = (self.bytes.len() - self.at) as u64;
        if count.saturating_mul(bytes_each) > left {
            return Err(format!("the file is truncated: {count} {what} do not fit into the remaining {left} bytes"));
        }
        Ok(())
    }
}
