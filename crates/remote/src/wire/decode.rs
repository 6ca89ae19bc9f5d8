//! Decoding. Memory is allocated only for bytes that have arrived, never for sizes in headers.

use super::format::{ARRAY, MAX_DEPTH, MAX_VALUES, NUMBER};
use crate::array::{Array, Dtype};
use crate::error::{Error, Result, one_line};
use crate::value::{Map, Value};
use rmp::Marker;

/// Decodes a message.
///
/// # Errors
/// [`Error::Malformed`], [`Error::TooDeep`], [`Error::TooMany`], [`Error::WrongDtype`],
/// [`Error::WrongShape`].
pub fn unpack(bytes: &[u8]) -> Result<Value> {
    let mut reader = Reader { bytes, at: 0, left: MAX_VALUES };
    let value = reader.value(0)?;
    if reader.at < bytes.len() {
        return reader.wrong(format!("{} bytes follow the end of the message", bytes.len() - reader.at));
    }
    Ok(value)
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Number of values that are still allowed.
    left: usize,
}

/// A key and whether it is a byte string.
type Key = (String, bool);

impl<'a> Reader<'a> {
    fn wrong<T>(&self, reason: impl Into<String>) -> Result<T> {
        Err(Error::Malformed { at: String::new(), byte: self.at, reason: reason.into() })
    }

    fn take(&mut self, n: usize) -> Result<&'a [u8]> {
        match self.bytes[self.at..].split_at_checked(n) {
            Some((taken, _)) => {
                self.at += n;
                Ok(taken)
            }
            None => self.wrong(format!("{n} bytes are expected; {} are left", self.bytes.len() - self.at)),
        }
    }

    /// The next `N` bytes.
    fn fixed<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        Ok(bytes)
    }

    /// A length of one, two or four bytes.
    fn length(&mut self, size: usize) -> Result<usize> {
        Ok(self.take(size)?.iter().fold(0, |n, b| n << 8 | usize::from(*b)))
    }

    fn value(&mut self, depth: usize) -> Result<Value> {
        self.left = self.left.checked_sub(1).ok_or(Error::TooMany { at: String::new(), limit: MAX_VALUES })?;
        let marker = Marker::from_u8(self.fixed::<1>()?[0]);
        Ok(match marker {
            Marker::Null => Value::Nil,
            Marker::True => Value::Bool(true),
            Marker::False => Value::Bool(false),
            Marker::FixPos(n) => Value::Int(i64::from(n)),
            Marker::FixNeg(n) => Value::Int(i64::from(n)),
            Marker::U8 => Value::Int(i64::from(self.fixed::<1>()?[0])),
            Marker::U16 => Value::Int(i64::from(u16::from_be_bytes(self.fixed()?))),
            Marker::U32 => Value::Int(i64::from(u32::from_be_bytes(self.fixed()?))),
            Marker::U64 => match i64::try_from(u64::from_be_bytes(self.fixed()?)) {
                Ok(n) => Value::Int(n),
                Err(_) => return self.wrong("an integer of 2^63 or more"),
            },
            Marker::I8 => Value::Int(i64::from(self.fixed::<1>()?[0] as i8)),
            Marker::I16 => Value::Int(i64::from(i16::from_be_bytes(self.fixed()?))),
            Marker::I32 => Value::Int(i64::from(i32::from_be_bytes(self.fixed()?))),
            Marker::I64 => Value::Int(i64::from_be_bytes(self.fixed()?)),
            Marker::F32 => Value::Float(f64::from(f32::from_be_bytes(self.fixed()?))),
            Marker::F64 => Value::Float(f64::from_be_bytes(self.fixed()?)),
            Marker::FixStr(_) | Marker::Str8 | Marker::Str16 | Marker::Str32 => {
                Value::Text(self.text(marker)?.to_owned())
            }
            Marker::Bin8 | Marker::Bin16 | Marker::Bin32 => Value::Bytes(self.binary(marker)?.to_vec()),
            Marker::FixArray(_) | Marker::Array16 | Marker::Array32 => {
                let n = match marker {
                    Marker::FixArray(n) => usize::from(n),
                    Marker::Array16 => self.length(2)?,
                    _ => self.length(4)?,
                };
                self.check_size(n, 1, depth)?;
                let mut list = Vec::with_capacity(n.min(1024));
                for i in 0..n {
                    list.push(self.value(depth + 1).map_err(|e| e.within(&i.to_string()))?);
                }
                Value::List(list)
            }
            Marker::FixMap(_) | Marker::Map16 | Marker::Map32 => {
                let n = match marker {
                    Marker::FixMap(n) => usize::from(n),
                    Marker::Map16 => self.length(2)?,
                    _ => self.length(4)?,
                };
                self.check_size(n, 2, depth)?;
                self.map(n, depth)?
            }
            Marker::Reserved => return self.wrong("a byte that starts no value (0xc1)"),
            // The extension types.
            _ => return self.wrong("an extension type; the protocol has none"),
        })
    }

    /// Refuses a list or map of `n` items of at least `each` bytes that cannot be in the message,
    /// before memory is allocated for it.
    fn check_size(&self, n: usize, each: usize, depth: usize) -> Result<()> {
        if depth >= MAX_DEPTH {
            return Err(Error::TooDeep { at: String::new(), limit: MAX_DEPTH });
        }
        let left = self.bytes.len() - self.at;
        if n > left / each {
            return self.wrong(format!("{n} items are expected; {left} bytes are left"));
        }
        if n > self.left {
            return Err(Error::TooMany { at: String::new(), limit: MAX_VALUES });
        }
        Ok(())
    }

    fn text(&mut self, marker: Marker) -> Result<&'a str> {
        let n = match marker {
            Marker::FixStr(n) => usize::from(n),
            Marker::Str8 => self.length(1)?,
            Marker::Str16 => self.length(2)?,
            _ => self.length(4)?,
        };
        let start = self.at;
        match std::str::from_utf8(self.take(n)?) {
            Ok(text) => Ok(text),
            Err(_) => Err(Error::Malformed { at: String::new(), byte: start, reason: "text that is not UTF-8".into() }),
        }
    }

    fn binary(&mut self, marker: Marker) -> Result<&'a [u8]> {
        let n = match marker {
            Marker::Bin8 => self.length(1)?,
            Marker::Bin16 => self.length(2)?,
            _ => self.length(4)?,
        };
        self.take(n)
    }

    fn key(&mut self) -> Result<Key> {
        let start = self.at;
        let marker = Marker::from_u8(self.fixed::<1>()?[0]);
        let reason = match marker {
            Marker::FixStr(_) | Marker::Str8 | Marker::Str16 | Marker::Str32 => {
                return Ok((self.text(marker)?.to_owned(), false));
            }
            Marker::Bin8 | Marker::Bin16 | Marker::Bin32 => match std::str::from_utf8(self.binary(marker)?) {
                Ok(key) => return Ok((key.to_owned(), true)),
                Err(_) => "a key that is not UTF-8",
            },
            _ => "a key that is neither text nor bytes",
        };
        Err(Error::Malformed { at: String::new(), byte: start, reason: reason.into() })
    }

    fn map(&mut self, n: usize, depth: usize) -> Result<Value> {
        let start = self.at;
        let mut map = Map::new();
        let (mut array, mut number) = (false, false);
        for _ in 0..n {
            let (key, binary) = self.key()?;
            array |= binary && key == ARRAY;
            number |= binary && key == NUMBER;
            if !binary && (key == ARRAY || key == NUMBER) {
                return self.wrong(format!("the key {key} is text; it must be a byte string"));
            }
            if binary && key == "nd" {
                return self.wrong("an array of the package msgpack-numpy; it must have the key __ndarray__");
            }
            let value = self.value(depth + 1).map_err(|e| e.within(&key))?;
            if map.contains_key(&key) {
                return self.wrong(format!("the key '{}' occurs twice", one_line(&key)));
            }
            map.insert(key, value);
        }
        let here = |reason: String| Error::Malformed { at: String::new(), byte: start, reason };
        if array {
            return to_array(map, here).map(Value::Array);
        }
        if number { to_number(map, here) } else { Ok(Value::Map(map)) }
    }
}

/// The dtype of an array or number.
fn dtype_of(map: &mut Map, here: impl Fn(String) -> Error) -> Result<String> {
    match map.remove("dtype") {
        Some(Value::Text(name)) => Ok(name),
        // The dtype of a record is a list of fields.
        Some(other) => Err(here(format!("an array's dtype is {}; it must be text", other.kind()))),
        None => Err(here("an array without dtype".into())),
    }
}

fn to_array(mut map: Map, here: impl Fn(String) -> Error) -> Result<Array> {
    let name = dtype_of(&mut map, &here)?;
    let Some((dtype, big_endian)) = Dtype::parse(&name) else {
        let wanted = "must be boolean, integer or float of up to 8 bytes";
        return Err(Error::WrongDtype { at: String::new(), dtype: one_line(&name), wanted });
    };
    let mut bytes = match map.remove("data") {
        Some(Value::Bytes(bytes)) => bytes,
        Some(other) => return Err(here(format!("an array's data are {}; they must be bytes", other.kind()))),
        None => return Err(here("an array without data".into())),
    };
    let Some(Value::List(sides)) = map.remove("shape") else {
        return Err(here("an array's shape is missing or not a list".into()));
    };
    let mut shape = Vec::with_capacity(sides.len());
    for side in &sides {
        match side {
            Value::Int(n) if *n >= 0 => shape.push(usize::try_from(*n).unwrap_or(usize::MAX)),
            _ => return Err(here("an array's shape has a value that is not a length".into())),
        }
    }
    // NumPy's limit is 64.
    if shape.len() > 64 {
        return Err(here(format!("an array has {} dimensions; the maximum is 64", shape.len())));
    }
    if big_endian {
        bytes.chunks_exact_mut(dtype.size()).for_each(<[u8]>::reverse);
    }
    Array::new(dtype, &shape, bytes)
}

fn to_number(mut map: Map, here: impl Fn(String) -> Error) -> Result<Value> {
    let name = dtype_of(&mut map, &here)?;
    match map.remove("data") {
        Some(value @ Value::Text(_)) if name.contains('U') => Ok(value),
        Some(value @ (Value::Bool(_) | Value::Int(_) | Value::Float(_))) if Dtype::parse(&name).is_some() => Ok(value),
        Some(other) => Err(here(format!("a NumPy number of type '{}' is {}", one_line(&name), other.kind()))),
        None => Err(here("a NumPy number without data".into())),
    }
}
