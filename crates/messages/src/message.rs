//! Messages that are a single number.

use crate::Topic;
use crate::error::Result;
use crate::ros::{fields, of_topic, unknown};

/// The number of a `std_msgs/Float32` or `Float64`; RealSense writes a sensor's options so.
///
/// # Errors
/// [`Error::Message`](crate::Error::Message) for another type, or bytes that end too soon.
pub fn decode_float(topic: &Topic, bytes: &[u8]) -> Result<f32> {
    let parsed = match topic.kind.as_str() {
        "std_msgs/Float32" => fields(topic, bytes).and_then(|mut f| f.f32()),
        "std_msgs/Float64" => fields(topic, bytes).and_then(|mut f| f.f64()).map(|v| v as f32),
        _ => Err(unknown(topic)),
    };
    of_topic(topic, parsed)
}
