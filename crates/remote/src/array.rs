//! NumPy arrays in messages: a type of elements, a shape, bytes in C order.

use crate::error::{Error, Result, one_line};

/// Types of elements. Objects, records, complex numbers, text and times are refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dtype {
    /// Booleans, a byte each.
    Bool,
    /// Signed 8-bit integers.
    I8,
    /// Unsigned 8-bit integers: pictures.
    U8,
    /// Signed 16-bit integers.
    I16,
    /// Unsigned 16-bit integers: depth (mm).
    U16,
    /// Signed 32-bit integers.
    I32,
    /// Unsigned 32-bit integers.
    U32,
    /// Signed 64-bit integers.
    I64,
    /// Unsigned 64-bit integers.
    U64,
    /// Half precision.
    F16,
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

/// All types with NumPy's names and sizes (bytes).
const TYPES: [(Dtype, &str, usize); 12] = [
    (Dtype::Bool, "|b1", 1),
    (Dtype::I8, "|i1", 1),
    (Dtype::U8, "|u1", 1),
    (Dtype::I16, "<i2", 2),
    (Dtype::U16, "<u2", 2),
    (Dtype::I32, "<i4", 4),
    (Dtype::U32, "<u4", 4),
    (Dtype::I64, "<i8", 8),
    (Dtype::U64, "<u8", 8),
    (Dtype::F16, "<f2", 2),
    (Dtype::F32, "<f4", 4),
    (Dtype::F64, "<f8", 8),
];

impl Dtype {
    /// NumPy's name, little-endian: `<f4`.
    pub fn name(self) -> &'static str {
        TYPES.iter().find(|t| t.0 == self).map_or("", |t| t.1)
    }

    /// Size of an element (bytes).
    pub fn size(self) -> usize {
        TYPES.iter().find(|t| t.0 == self).map_or(1, |t| t.2)
    }

    /// The type with NumPy's name `name`, and whether the bytes are big-endian.
    pub(crate) fn parse(name: &str) -> Option<(Self, bool)> {
        if let Some(t) = TYPES.iter().find(|t| t.1 == name) {
            return Some((t.0, false));
        }
        let rest = name.strip_prefix('>')?;
        TYPES.iter().find(|t| t.2 > 1 && &t.1[1..] == rest).map(|t| (t.0, true))
    }
}

/// An array of elements of one type, little-endian, in C order (the last index is the fastest).
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl Array {
    /// An array of little-endian elements in C order.
    ///
    /// # Errors
    /// [`Error::WrongShape`] if the number of bytes does not fit the shape.
    pub fn new(dtype: Dtype, shape: &[usize], bytes: Vec<u8>) -> Result<Self> {
        let needed = shape.iter().try_fold(dtype.size(), |n, s| n.checked_mul(*s));
        if needed != Some(bytes.len()) {
            return Err(Error::WrongShape {
                at: String::new(),
                shape: shape_text(shape),
                dtype: dtype.name(),
                needed: needed.map_or_else(|| "more than 2^64".to_owned(), |n| n.to_string()),
                bytes: bytes.len(),
            });
        }
        Ok(Self { dtype, shape: shape.to_vec(), bytes })
    }

    /// An array of unsigned bytes, such as a picture of shape (height, width, 3).
    ///
    /// # Errors
    /// As [`Array::new`].
    pub fn from_u8(shape: &[usize], values: Vec<u8>) -> Result<Self> {
        Self::new(Dtype::U8, shape, values)
    }

    /// An array in single precision.
    ///
    /// # Errors
    /// As [`Array::new`].
    pub fn from_f32(shape: &[usize], values: &[f32]) -> Result<Self> {
        Self::new(Dtype::F32, shape, values.iter().flat_map(|v| v.to_le_bytes()).collect())
    }

    /// An array in double precision.
    ///
    /// # Errors
    /// As [`Array::new`].
    pub fn from_f64(shape: &[usize], values: &[f64]) -> Result<Self> {
        Self::new(Dtype::F64, shape, values.iter().flat_map(|v| v.to_le_bytes()).collect())
    }

    /// Type of the elements.
    pub fn dtype(&self) -> Dtype {
        self.dtype
    }

    /// Length along each axis; empty for a single number.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// The elements, little-endian.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The elements as `f64`. Integers beyond 2^53 are rounded; booleans are 0 and 1.
    pub fn to_f64(&self) -> Vec<f64> {
        let bytes = &self.bytes;
        match self.dtype {
            Dtype::Bool => bytes.iter().map(|b| f64::from(u8::from(*b != 0))).collect(),
            Dtype::I8 => bytes.iter().map(|b| f64::from(*b as i8)).collect(),
            Dtype::U8 => bytes.iter().map(|b| f64::from(*b)).collect(),
            Dtype::I16 => bytes.as_chunks().0.iter().map(|b| f64::from(i16::from_le_bytes(*b))).collect(),
            Dtype::U16 => bytes.as_chunks().0.iter().map(|b| f64::from(u16::from_le_bytes(*b))).collect(),
            Dtype::I32 => bytes.as_chunks().0.iter().map(|b| f64::from(i32::from_le_bytes(*b))).collect(),
            Dtype::U32 => bytes.as_chunks().0.iter().map(|b| f64::from(u32::from_le_bytes(*b))).collect(),
            Dtype::I64 => bytes.as_chunks().0.iter().map(|b| i64::from_le_bytes(*b) as f64).collect(),
            Dtype::U64 => bytes.as_chunks().0.iter().map(|b| u64::from_le_bytes(*b) as f64).collect(),
            Dtype::F16 => bytes.as_chunks().0.iter().map(|b| half(u16::from_le_bytes(*b))).collect(),
            Dtype::F32 => bytes.as_chunks().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect(),
            Dtype::F64 => bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect(),
        }
    }
}

/// The exact value of an IEEE 754 half-precision number.
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
}

/// A shape in error messages.
pub(crate) fn shape_text(shape: &[usize]) -> String {
    one_line(&format!("{shape:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_precision_is_exact() {
        for (bits, value) in
            [(0x3c00, 1.0), (0xc000, -2.0), (0x7bff, 65504.0), (1, 2f64.powi(-24)), (0x3555, 0.333251953125)]
        {
            assert_eq!(half(bits), value);
        }
        assert!(half(0x7e00).is_nan() && half(0xfc00) == f64::NEG_INFINITY);
    }

    #[test]
    fn shapes_that_overflow_are_refused() {
        assert!(matches!(Array::new(Dtype::F64, &[usize::MAX, 2], vec![]), Err(Error::WrongShape { .. })));
        assert!(Array::new(Dtype::F64, &[], vec![0; 8]).is_ok());
        // NumPy takes an empty array of any other lengths, as long as they can be multiplied.
        assert!(Array::new(Dtype::F64, &[0, 7], vec![]).is_ok());
    }
}
