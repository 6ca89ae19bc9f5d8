//! Reads numbers and texts from bytes, never past their end.
//!
//! Three layouts: packed little-endian (ROS 1 messages, bag and MCAP records), and CDR of either
//! endianness, where a number of n bytes starts at a multiple of n (OMG CORBA 3.3, part 2, 9.3; the
//! encapsulation header is OMG RTPS 2.5, 10).

use super::error::Parsed;

/// A read position in a slice of bytes.
#[derive(Clone)]
pub(crate) struct ByteReader<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
    /// CDR: numbers are aligned, and texts end with a zero that their length includes.
    cdr: bool,
}

macro_rules! number {
    ($name:ident, $type:ty) => {
        /// The next number.
        pub fn $name(&mut self) -> Parsed<$type> {
            const SIZE: usize = size_of::<$type>();
            if self.cdr {
                self.take(self.at.next_multiple_of(SIZE) - self.at)?;
            }
            let mut bytes = [0; SIZE];
            bytes.copy_from_slice(self.take(SIZE)?);
            Ok(if self.big_endian { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) })
        }
    };
}

impl<'a> ByteReader<'a> {
    /// Packed little-endian: ROS 1 messages and the records of both file formats.
    pub fn packed(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, big_endian: false, cdr: false }
    }

    /// A CDR message with its encapsulation header. Plain CDR is the only kind that ROS 2 writes.
    pub fn cdr(bytes: &'a [u8]) -> Parsed<Self> {
        let Some((&[kind_high, kind_low, _, _], body)) = bytes.split_first_chunk() else {
            return Err(format!("a CDR message needs a header of 4 bytes; it has {}", bytes.len()));
        };
        match (kind_high, kind_low) {
            (0, kind @ (0 | 1)) => Ok(Self { bytes: body, at: 0, big_endian: kind == 0, cdr: true }),
            _ => Err(format!(
                "the CDR representation is {kind_high:#04x}{kind_low:02x}; it must be plain CDR, 0x0000 or 0x0001"
            )),
        }
    }

    number!(u8, u8);
    number!(u16, u16);
    number!(u32, u32);
    number!(u64, u64);
    number!(f32, f32);
    number!(f64, f64);

    /// Number of bytes read so far.
    pub fn at(&self) -> usize {
        self.at
    }

    /// Number of bytes left.
    pub fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next `count` bytes.
    pub fn take(&mut self, count: usize) -> Parsed<&'a [u8]> {
        let Some(taken) = self.bytes[self.at..].get(..count) else {
            return Err(format!(
                "cut short: {count} bytes expected at byte {}, {} are left",
                self.at,
                self.remaining()
            ));
        };
        self.at += count;
        Ok(taken)
    }

    /// Bytes after their count.
    pub fn counted(&mut self) -> Parsed<&'a [u8]> {
        let count = self.u32()? as usize;
        self.take(count)
    }

    /// A text after its length.
    pub fn text(&mut self) -> Parsed<&'a str> {
        let mut bytes = self.counted()?;
        if self.cdr {
            bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        }
        std::str::from_utf8(bytes).map_err(|_| format!("the text before byte {} is not UTF-8", self.at))
    }

    /// A fixed count of numbers.
    pub fn f64s<const N: usize>(&mut self) -> Parsed<[f64; N]> {
        let mut all = [0.0; N];
        for value in &mut all {
            *value = self.f64()?;
        }
        Ok(all)
    }

    /// Numbers after their count.
    pub fn counted_f64s(&mut self) -> Parsed<Vec<f64>> {
        let count = self.u32()? as usize;
        if count > self.remaining() / 8 {
            return Err(format!(
                "cut short: {count} numbers expected at byte {}, {} bytes are left",
                self.at,
                self.remaining()
            ));
        }
        (0..count).map(|_| self.f64()).collect()
    }
}

/// Nanoseconds since the epoch.
pub(crate) fn stamp(seconds: u64, nanoseconds: u64) -> u64 {
    seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds)
}
