//! Encoding.

use super::format::{ARRAY, MAX_DEPTH, MAX_VALUES};
use crate::array::Array;
use crate::error::{Error, Result};
use crate::value::{Map, Value};
use rmp::encode as msgpack;

/// Encodes a map, with the same bytes as Python's packer for a dictionary sorted by key.
///
/// # Errors
/// [`Error::TooDeep`] and [`Error::TooMany`] beyond the limits of [`unpack`](crate::unpack);
/// [`Error::WrongField`] for text, bytes or lists of 2^32 items and more.
pub fn pack(map: &Map) -> Result<Vec<u8>> {
    let mut writer = Writer { bytes: Vec::new(), left: MAX_VALUES - 1 };
    writer.map(map, 1)?;
    Ok(writer.bytes)
}

struct Writer {
    bytes: Vec<u8>,
    /// Number of values that are still allowed.
    left: usize,
}

impl Writer {
    fn value(&mut self, value: &Value, depth: usize) -> Result<()> {
        let too_many = Error::TooMany { at: String::new(), limit: MAX_VALUES };
        self.left = self.left.checked_sub(1).ok_or(too_many)?;
        let out = &mut self.bytes;
        // Writing to memory cannot fail: the results are ignored.
        match value {
            Value::Nil => drop(msgpack::write_nil(out)),
            Value::Bool(b) => drop(msgpack::write_bool(out, *b)),
            Value::Int(i) => drop(msgpack::write_sint(out, *i)),
            Value::Float(f) => drop(msgpack::write_f64(out, *f)),
            Value::Text(text) => {
                length(text.len())?;
                drop(msgpack::write_str(out, text));
            }
            Value::Bytes(bytes) => {
                length(bytes.len())?;
                drop(msgpack::write_bin(out, bytes));
            }
            Value::List(list) => {
                deeper(depth)?;
                drop(msgpack::write_array_len(out, length(list.len())?));
                for (i, item) in list.iter().enumerate() {
                    self.value(item, depth + 1).map_err(|e| e.within(&i.to_string()))?;
                }
            }
            Value::Map(map) => self.map(map, depth + 1)?,
            Value::Array(array) => self.array(array, depth)?,
        }
        Ok(())
    }

    fn map(&mut self, map: &Map, depth: usize) -> Result<()> {
        deeper(depth.saturating_sub(1))?;
        drop(msgpack::write_map_len(&mut self.bytes, length(map.len())?));
        for (key, value) in map {
            length(key.len())?;
            drop(msgpack::write_str(&mut self.bytes, key));
            self.value(value, depth).map_err(|e| e.within(key))?;
        }
        Ok(())
    }

    fn array(&mut self, array: &Array, depth: usize) -> Result<()> {
        // It counts as a map with a list in it, as in the decoder.
        deeper(depth + 1)?;
        let too_many = Error::TooMany { at: String::new(), limit: MAX_VALUES };
        self.left = self.left.checked_sub(4 + array.shape().len()).ok_or(too_many)?;
        let data = array.bytes();
        length(data.len())?;
        let out = &mut self.bytes;
        out.reserve(data.len() + 64);
        drop(msgpack::write_map_len(out, 4));
        drop(msgpack::write_bin(out, ARRAY.as_bytes()));
        drop(msgpack::write_bool(out, true));
        drop(msgpack::write_bin(out, b"data"));
        drop(msgpack::write_bin(out, data));
        drop(msgpack::write_bin(out, b"dtype"));
        drop(msgpack::write_str(out, array.dtype().name()));
        drop(msgpack::write_bin(out, b"shape"));
        drop(msgpack::write_array_len(out, length(array.shape().len())?));
        for side in array.shape() {
            drop(msgpack::write_uint(out, *side as u64));
        }
        Ok(())
    }
}

fn deeper(depth: usize) -> Result<()> {
    if depth < MAX_DEPTH { Ok(()) } else { Err(Error::TooDeep { at: String::new(), limit: MAX_DEPTH }) }
}

fn length(n: usize) -> Result<u32> {
    let reason = || format!("has {n} bytes or items; MessagePack allows less than 2^32");
    u32::try_from(n).map_err(|_| Error::WrongField { at: String::new(), reason: reason() })
}
