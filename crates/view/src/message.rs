//! Binary messages: a JSON header that names arrays, and the arrays (docs/guides/view-wire.md).

use serde_json::{Map, Value, json};

/// Numbers of an array.
pub(crate) enum Data<'a> {
    F32(Vec<f32>),
    U32(Vec<u32>),
    /// Little-endian bytes of 16-bit numbers, made before.
    U16(&'a [u8]),
    U8(&'a [u8]),
}

/// A message while it is put together.
pub(crate) struct Binary<'a> {
    header: Map<String, Value>,
    arrays: Map<String, Value>,
    data: Vec<Data<'a>>,
    size: usize,
}

impl<'a> Binary<'a> {
    /// A message with the fields of `header`, which is an object.
    pub fn new(header: Value) -> Self {
        let header = match header {
            Value::Object(map) => map,
            _ => Map::new(),
        };
        Self { header, arrays: Map::new(), data: Vec::new(), size: 0 }
    }

    /// Adds an array.
    pub fn add(&mut self, name: String, shape: &[usize], data: Data<'a>) {
        let (dtype, bytes) = match &data {
            Data::F32(all) => ("f32", 4 * all.len()),
            Data::U32(all) => ("u32", 4 * all.len()),
            Data::U16(all) => ("u16", all.len()),
            Data::U8(all) => ("u8", all.len()),
        };
        self.arrays.insert(name, json!({"dtype": dtype, "shape": shape, "offset": self.size}));
        self.size = (self.size + bytes).next_multiple_of(8);
        self.data.push(data);
    }

    /// The message's bytes.
    pub fn into_bytes(mut self) -> Vec<u8> {
        self.header.insert("arrays".to_owned(), Value::Object(self.arrays));
        let mut text = Value::Object(self.header).to_string().into_bytes();
        text.resize((text.len() + 4).next_multiple_of(8) - 4, b' ');
        let mut bytes = Vec::with_capacity(4 + text.len() + self.size);
        bytes.extend((text.len() as u32).to_le_bytes());
        bytes.extend(text);
        for data in self.data {
            match data {
                Data::F32(all) => all.iter().for_each(|x| bytes.extend(x.to_le_bytes())),
                Data::U32(all) => all.iter().for_each(|x| bytes.extend(x.to_le_bytes())),
                Data::U16(all) | Data::U8(all) => bytes.extend(all),
            }
            bytes.resize(bytes.len().next_multiple_of(8), 0);
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_lie_where_the_header_says() {
        let mut message = Binary::new(json!({"type": "x"}));
        message.add("a".to_owned(), &[3], Data::U8(&[1, 2, 3]));
        message.add("b".to_owned(), &[1, 2], Data::F32(vec![1.5, -2.0]));
        let bytes = message.into_bytes();
        let length = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]) as usize;
        assert_eq!((4 + length) % 8, 0);
        let header: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
        let at = |name: &str| 4 + length + header["arrays"][name]["offset"].as_u64().unwrap() as usize;
        assert_eq!(bytes[at("a")..at("a") + 3], [1, 2, 3]);
        assert_eq!(bytes[at("b") + 4..at("b") + 8], (-2.0_f32).to_le_bytes());
        assert_eq!(header["arrays"]["b"]["shape"], json!([1, 2]));
        assert_eq!(bytes.len() % 8, 0);
    }
}
