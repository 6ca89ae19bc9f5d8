//! foxglove's messages, as protobuf and as JSON (<https://docs.foxglove.dev/docs/sdk/schemas>).
//!
//! Protobuf's wire format (<https://protobuf.dev/programming-guides/encoding/>) is a sequence of
//! numbered fields. The needed fields are read directly, without generated code.

use super::byte_reader::{ByteReader, stamp};
use super::calibration::Intrinsics;
use super::error::Parsed;
use super::image::{Packed, Raw};
use super::transform::Transform;
use base64::Engine;
use serde::Deserialize;
use std::borrow::Cow;

/// The value of a protobuf field.
enum Value<'a> {
    Varint(u64),
    Fixed64(u64),
    Bytes(&'a [u8]),
    Fixed32(u32),
}

/// Calls `visit` with the number and value of every field of a message. Callers skip a value of an
/// unexpected kind, as protobuf requires for unknown fields.
fn fields<'a>(bytes: &'a [u8], mut visit: impl FnMut(u64, Value<'a>) -> Parsed<()>) -> Parsed<()> {
    let mut reader = ByteReader::packed(bytes);
    while reader.remaining() > 0 {
        let key = varint(&mut reader)?;
        let value = match key & 7 {
            0 => Value::Varint(varint(&mut reader)?),
            1 => Value::Fixed64(reader.u64()?),
            2 => {
                let len = usize::try_from(varint(&mut reader)?).unwrap_or(usize::MAX);
                Value::Bytes(reader.take(len)?)
            }
            5 => Value::Fixed32(reader.u32()?),
            kind => {
                let at = reader.at();
                return Err(format!("not protobuf: the field before byte {at} has the wire type {kind}"));
            }
        };
        visit(key >> 3, value)?;
    }
    Ok(())
}

fn varint(reader: &mut ByteReader<'_>) -> Parsed<u64> {
    let mut value = 0u64;
    for shift in (0..64).step_by(7) {
        let byte = reader.u8()?;
        value |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Ok(value);
        }
    }
    Err(format!("not protobuf: the number before byte {} does not end", reader.at()))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A `google.protobuf.Timestamp` (ns since the epoch); times before 1970 are 0.
fn timestamp(bytes: &[u8]) -> Parsed<u64> {
    let (mut seconds, mut nanoseconds) = (0u64, 0u64);
    fields(bytes, |number, value| {
        match (number, value) {
            (1, Value::Varint(v)) => seconds = v.cast_signed().max(0).cast_unsigned(),
            (2, Value::Varint(v)) => nanoseconds = v.cast_signed().max(0).cast_unsigned(),
            _ => {}
        }
        Ok(())
    })?;
    Ok(stamp(seconds, nanoseconds))
}

/// `foxglove.RawImage`.
pub(crate) fn raw_image(bytes: &[u8]) -> Parsed<Raw<'_>> {
    let mut raw = Raw::default();
    fields(bytes, |number, value| {
        match (number, value) {
            (1, Value::Bytes(b)) => raw.stamp = timestamp(b)?,
            (2, Value::Fixed32(v)) => raw.width = v,
            (3, Value::Fixed32(v)) => raw.height = v,
            (4, Value::Bytes(b)) => raw.encoding = text(b),
            (5, Value::Fixed32(v)) => raw.step = v,
            (6, Value::Bytes(b)) => raw.data = Cow::Borrowed(b),
            (7, Value::Bytes(b)) => raw.frame = text(b),
            _ => {}
        }
        Ok(())
    })?;
    Ok(raw)
}

/// `foxglove.CompressedImage`.
pub(crate) fn compressed_image(bytes: &[u8]) -> Parsed<Packed<'_>> {
    let mut packed = Packed::default();
    fields(bytes, |number, value| {
        match (number, value) {
            (1, Value::Bytes(b)) => packed.stamp = timestamp(b)?,
            (2, Value::Bytes(b)) => packed.data = Cow::Borrowed(b),
            (3, Value::Bytes(b)) => packed.format = text(b),
            (4, Value::Bytes(b)) => packed.frame = text(b),
            _ => {}
        }
        Ok(())
    })?;
    Ok(packed)
}

/// `foxglove.CameraCalibration`.
pub(crate) fn camera_calibration(bytes: &[u8]) -> Parsed<Intrinsics> {
    let mut calibration = Intrinsics::default();
    let mut k = Vec::new();
    fields(bytes, |number, value| {
        match (number, value) {
            (2, Value::Fixed32(v)) => calibration.width = v,
            (3, Value::Fixed32(v)) => calibration.height = v,
            (4, Value::Bytes(b)) => calibration.model = text(b),
            (5, v) => doubles(&v, &mut calibration.d)?,
            (6, v) => doubles(&v, &mut k)?,
            _ => {}
        }
        Ok(())
    })?;
    calibration.k = nine(&k)?;
    Ok(calibration)
}

/// Repeated doubles, packed or single.
fn doubles(value: &Value<'_>, all: &mut Vec<f64>) -> Parsed<()> {
    match value {
        Value::Fixed64(bits) => all.push(f64::from_bits(*bits)),
        Value::Bytes(bytes) => {
            let (numbers, []) = bytes.as_chunks() else {
                return Err(format!("doubles take {} bytes; it must be a multiple of 8", bytes.len()));
            };
            all.extend(numbers.iter().copied().map(f64::from_le_bytes));
        }
        Value::Varint(_) | Value::Fixed32(_) => {}
    }
    Ok(())
}

fn nine(k: &[f64]) -> Parsed<[f64; 9]> {
    k.try_into().map_err(|_| format!("K has {} numbers; it must have 9", k.len()))
}

/// `foxglove.FrameTransforms`.
pub(crate) fn frame_transforms(bytes: &[u8]) -> Parsed<Vec<Transform>> {
    let mut all = Vec::new();
    fields(bytes, |number, value| {
        if let (1, Value::Bytes(b)) = (number, value) {
            all.push(frame_transform(b)?);
        }
        Ok(())
    })?;
    Ok(all)
}

/// `foxglove.FrameTransform`.
pub(crate) fn frame_transform(bytes: &[u8]) -> Parsed<Transform> {
    let mut transform = Transform::default();
    fields(bytes, |number, value| {
        match (number, value) {
            (1, Value::Bytes(b)) => transform.stamp = timestamp(b)?,
            (2, Value::Bytes(b)) => transform.parent = text(b),
            (3, Value::Bytes(b)) => transform.child = text(b),
            (4, Value::Bytes(b)) => transform.translation = components(b)?,
            (5, Value::Bytes(b)) => transform.rotation = components(b)?,
            _ => {}
        }
        Ok(())
    })?;
    Ok(transform)
}

/// Fields 1 to N of a vector or quaternion.
fn components<const N: usize>(bytes: &[u8]) -> Parsed<[f64; N]> {
    let mut all = [0.0; N];
    fields(bytes, |number, value| {
        if let (Some(i), Value::Fixed64(bits)) = (number.checked_sub(1), value)
            && let Some(component) = usize::try_from(i).ok().and_then(|i| all.get_mut(i))
        {
            *component = f64::from_bits(bits);
        }
        Ok(())
    })?;
    Ok(all)
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct JsonTime {
    sec: i64,
    #[serde(alias = "nanosec")]
    nsec: u32,
}

impl JsonTime {
    fn stamp(&self) -> u64 {
        stamp(self.sec.max(0).cast_unsigned(), self.nsec.into())
    }
}

/// The fields of both kinds of image.
#[derive(Default, Deserialize)]
#[serde(default)]
struct JsonImage {
    timestamp: JsonTime,
    frame_id: String,
    width: u32,
    height: u32,
    encoding: String,
    step: u32,
    format: String,
    data: String,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct JsonCalibration {
    width: u32,
    height: u32,
    distortion_model: String,
    #[serde(rename = "D")]
    d: Vec<f64>,
    #[serde(rename = "K")]
    k: Vec<f64>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct JsonTransform {
    timestamp: JsonTime,
    parent_frame_id: String,
    child_frame_id: String,
    translation: JsonComponents,
    rotation: JsonComponents,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct JsonComponents {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct JsonTransforms {
    transforms: Vec<JsonTransform>,
}

fn json<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Parsed<T> {
    serde_json::from_slice(bytes).map_err(|e| format!("the JSON cannot be read ({e})"))
}

fn image_json(bytes: &[u8]) -> Parsed<(JsonImage, Vec<u8>)> {
    let image: JsonImage = json(bytes)?;
    let data = base64::engine::general_purpose::STANDARD
        .decode(&image.data)
        .map_err(|e| format!("data is not base64 ({e})"))?;
    Ok((image, data))
}

/// `foxglove.RawImage` as JSON.
pub(crate) fn raw_image_json(bytes: &[u8]) -> Parsed<Raw<'static>> {
    let (image, data) = image_json(bytes)?;
    Ok(Raw {
        stamp: image.timestamp.stamp(),
        frame: image.frame_id,
        width: image.width,
        height: image.height,
        encoding: image.encoding,
        step: image.step,
        data: Cow::Owned(data),
        ..Raw::default()
    })
}

/// `foxglove.CompressedImage` as JSON.
pub(crate) fn compressed_image_json(bytes: &[u8]) -> Parsed<Packed<'static>> {
    let (image, data) = image_json(bytes)?;
    let stamp = image.timestamp.stamp();
    Ok(Packed { stamp, frame: image.frame_id, format: image.format, data: Cow::Owned(data) })
}

/// `foxglove.CameraCalibration` as JSON.
pub(crate) fn camera_calibration_json(bytes: &[u8]) -> Parsed<Intrinsics> {
    let c: JsonCalibration = json(bytes)?;
    let k = nine(&c.k)?;
    Ok(Intrinsics { width: c.width, height: c.height, model: c.distortion_model, d: c.d, k, ..Intrinsics::default() })
}

/// `foxglove.FrameTransform` as JSON.
pub(crate) fn frame_transform_json(bytes: &[u8]) -> Parsed<Transform> {
    Ok(from_json(json(bytes)?))
}

/// `foxglove.FrameTransforms` as JSON.
pub(crate) fn frame_transforms_json(bytes: &[u8]) -> Parsed<Vec<Transform>> {
    Ok(json::<JsonTransforms>(bytes)?.transforms.into_iter().map(from_json).collect())
}

fn from_json(t: JsonTransform) -> Transform {
    Transform {
        stamp: t.timestamp.stamp(),
        parent: t.parent_frame_id,
        child: t.child_frame_id,
        translation: [t.translation.x, t.translation.y, t.translation.z],
        rotation: [t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w],
    }
}
