//! Parses ROS 1 and ROS 2 messages: the same fields in the same order, in different encodings.

use super::byte_reader::{ByteReader, stamp};
use super::calibration::Intrinsics;
use super::error::Parsed;
use super::image::{Packed, Raw};
use super::topic::{Encoding, Topic};
use super::transform::Transform;
use std::borrow::Cow;

/// A `std_msgs/Header`.
pub(crate) struct Header {
    /// Time (ns since the epoch).
    pub stamp: u64,
    pub frame: String,
}

/// A reader of the fields of a ROS message.
pub(crate) fn fields<'a>(topic: &Topic, bytes: &'a [u8]) -> Parsed<ByteReader<'a>> {
    match topic.encoding {
        Encoding::Ros1 => Ok(ByteReader::packed(bytes)),
        Encoding::Cdr => ByteReader::cdr(bytes),
        _ => Err(format!("messages written as {:?} are not ROS messages", topic.encoding)),
    }
}

/// Reads the message's header. In ROS 1 it begins with a sequence number.
pub(crate) fn header(topic: &Topic, fields: &mut ByteReader<'_>) -> Parsed<Header> {
    if topic.encoding == Encoding::Ros1 {
        fields.u32()?;
    }
    let (seconds, nanoseconds) = (fields.u32()?, fields.u32()?);
    Ok(Header { stamp: stamp(seconds.into(), nanoseconds.into()), frame: fields.text()?.to_owned() })
}

/// A `sensor_msgs/Image`.
pub(crate) fn raw_image<'a>(topic: &Topic, bytes: &'a [u8]) -> Parsed<Raw<'a>> {
    let mut f = fields(topic, bytes)?;
    let header = header(topic, &mut f)?;
    let (height, width) = (f.u32()?, f.u32()?);
    let encoding = f.text()?.to_owned();
    let (big_endian, step) = (f.u8()? != 0, f.u32()?);
    let data = Cow::Borrowed(f.counted()?);
    // Newer librealsense writes version "1" as the frame's name, and the unit after the data.
    let has_unit = topic.encoding == Encoding::Ros1 && header.frame == "1" && f.remaining() == 4;
    let depth_unit = if has_unit { Some(f.f32()?).filter(|u| u.is_finite() && *u > 0.0) } else { None };
    Ok(Raw { stamp: header.stamp, frame: header.frame, width, height, encoding, big_endian, step, data, depth_unit })
}

/// A `sensor_msgs/CompressedImage`.
pub(crate) fn compressed_image<'a>(topic: &Topic, bytes: &'a [u8]) -> Parsed<Packed<'a>> {
    let mut f = fields(topic, bytes)?;
    let header = header(topic, &mut f)?;
    let format = f.text()?.to_owned();
    Ok(Packed { stamp: header.stamp, frame: header.frame, format, data: Cow::Borrowed(f.counted()?) })
}

/// A `sensor_msgs/CameraInfo`.
pub(crate) fn camera_info(topic: &Topic, bytes: &[u8]) -> Parsed<Intrinsics> {
    let mut f = fields(topic, bytes)?;
    header(topic, &mut f)?;
    let (height, width) = (f.u32()?, f.u32()?);
    let model = f.text()?.to_owned();
    let d = f.counted_f64s()?;
    let k = f.f64s()?;
    let (_r, _p) = (f.f64s::<9>()?, f.f64s::<12>()?);
    let binning = [f.u32()?, f.u32()?];
    let region = [f.u32()?, f.u32()?, f.u32()?, f.u32()?];
    Ok(Intrinsics { width, height, model, d, k, binning, region })
}

/// A `geometry_msgs/Transform`.
pub(crate) fn transform(f: &mut ByteReader<'_>) -> Parsed<Transform> {
    Ok(Transform { translation: f.f64s()?, rotation: f.f64s()?, ..Transform::default() })
}

/// A `geometry_msgs/TransformStamped`.
pub(crate) fn transform_stamped(topic: &Topic, f: &mut ByteReader<'_>) -> Parsed<Transform> {
    let header = header(topic, f)?;
    let child = f.text()?.to_owned();
    Ok(Transform { stamp: header.stamp, parent: header.frame, child, ..transform(f)? })
}
