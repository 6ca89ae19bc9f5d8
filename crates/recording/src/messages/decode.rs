//! Decodes messages. The topic's message type and encoding select the parser.

use super::calibration::camera;
use super::error::{Error, Parsed, Result};
use super::image::{Image, Packed, Raw, StampedImage, pixels};
use super::topic::{Encoding, Topic};
use super::transform::Transform;
use super::{compressed, foxglove, ros};
use trocar_camera::Camera;

/// Decodes an image: `sensor_msgs/Image` or `CompressedImage` (ROS 1, ROS 2), `foxglove.RawImage`
/// or `CompressedImage` (protobuf, JSON).
///
/// # Errors
/// [`Error::Message`](super::Error::Message) for another type, an unknown pixel encoding or
/// compression, more than 16384 pixels on a side, or data that do not fit the size.
pub fn decode_image(topic: &Topic, bytes: &[u8]) -> Result<StampedImage> {
    let parsed = match (topic.kind.as_str(), &topic.encoding) {
        ("sensor_msgs/Image", _) => ros::raw_image(topic, bytes).and_then(|r| plain(&r)),
        ("sensor_msgs/CompressedImage", _) => ros::compressed_image(topic, bytes).and_then(|p| unpacked(&p)),
        ("foxglove.RawImage", Encoding::Protobuf) => foxglove::raw_image(bytes).and_then(|r| plain(&r)),
        ("foxglove.RawImage", Encoding::Json) => foxglove::raw_image_json(bytes).and_then(|r| plain(&r)),
        ("foxglove.CompressedImage", Encoding::Protobuf) => {
            foxglove::compressed_image(bytes).and_then(|p| unpacked(&p))
        }
        ("foxglove.CompressedImage", Encoding::Json) => {
            foxglove::compressed_image_json(bytes).and_then(|p| unpacked(&p))
        }
        _ => Err(unknown(topic)),
    };
    of_topic(topic, parsed)
}

fn unpacked(packed: &Packed<'_>) -> Parsed<StampedImage> {
    let image = compressed::decode(&packed.format, &packed.data)?;
    Ok(StampedImage { stamp: packed.stamp, frame: packed.frame.clone(), image, depth_unit: None })
}

fn plain(raw: &Raw<'_>) -> Parsed<StampedImage> {
    let image = pixels(raw)?;
    let depth_unit = raw.depth_unit.filter(|_| matches!(image, Image::Depth(_)));
    Ok(StampedImage { stamp: raw.stamp, frame: raw.frame.clone(), image, depth_unit })
}

/// Decodes a camera calibration: `sensor_msgs/CameraInfo` (ROS 1, ROS 2) or
/// `foxglove.CameraCalibration` (protobuf, JSON).
///
/// The result is the camera of the raw image, with K and D. A rectified image has P and no
/// distortion; RealSense's aligned and depth images share K with their raw ones. Region and binning
/// are applied as ROS's `image_geometry` does. OpenCV's model is fitted to librealsense's inverse
/// and modified Brown-Conrady models, to half a pixel or an error.
///
/// # Errors
/// [`Error::Message`](super::Error::Message) for another type, a camera that was never calibrated
/// (K of zeros), a fisheye, or numbers out of range.
pub fn decode_calibration(topic: &Topic, bytes: &[u8]) -> Result<Camera> {
    let parsed = match (topic.kind.as_str(), &topic.encoding) {
        ("sensor_msgs/CameraInfo", _) => ros::camera_info(topic, bytes),
        ("foxglove.CameraCalibration", Encoding::Protobuf) => foxglove::camera_calibration(bytes),
        ("foxglove.CameraCalibration", Encoding::Json) => foxglove::camera_calibration_json(bytes),
        _ => Err(unknown(topic)),
    };
    of_topic(topic, parsed.and_then(|intrinsics| camera(&intrinsics)))
}

/// Decodes transforms: one from `geometry_msgs/Transform`, `TransformStamped` or
/// `foxglove.FrameTransform`, all from `tf2_msgs/TFMessage` or `foxglove.FrameTransforms`.
///
/// # Errors
/// [`Error::Message`](super::Error::Message) for another type, truncated bytes, or a quaternion
/// that is not a rotation.
pub fn decode_transforms(topic: &Topic, bytes: &[u8]) -> Result<Vec<Transform>> {
    let fields = || ros::fields(topic, bytes);
    let parsed = match (topic.kind.as_str(), &topic.encoding) {
        ("geometry_msgs/Transform", _) => fields().and_then(|mut f| Ok(vec![ros::transform(&mut f)?])),
        ("geometry_msgs/TransformStamped", _) => {
            fields().and_then(|mut f| Ok(vec![ros::transform_stamped(topic, &mut f)?]))
        }
        ("tf2_msgs/TFMessage" | "tf/tfMessage", _) => fields().and_then(|mut f| {
            let count = f.u32()? as usize;
            // Each takes at least 56 bytes, so the end of the bytes limits a wrong count.
            (0..count).map(|_| ros::transform_stamped(topic, &mut f)).collect()
        }),
        ("foxglove.FrameTransform", Encoding::Protobuf) => foxglove::frame_transform(bytes).map(|t| vec![t]),
        ("foxglove.FrameTransform", Encoding::Json) => foxglove::frame_transform_json(bytes).map(|t| vec![t]),
        ("foxglove.FrameTransforms", Encoding::Protobuf) => foxglove::frame_transforms(bytes),
        ("foxglove.FrameTransforms", Encoding::Json) => foxglove::frame_transforms_json(bytes),
        _ => Err(unknown(topic)),
    };
    of_topic(topic, parsed.and_then(|all| all.into_iter().map(Transform::check).collect()))
}

/// Decodes a `std_msgs/Float32` or `Float64`, as which RealSense writes a sensor's options.
///
/// # Errors
/// [`Error::Message`](super::Error::Message) for another type, or truncated bytes.
pub fn decode_float(topic: &Topic, bytes: &[u8]) -> Result<f32> {
    let parsed = match topic.kind.as_str() {
        "std_msgs/Float32" => ros::fields(topic, bytes).and_then(|mut f| f.f32()),
        "std_msgs/Float64" => ros::fields(topic, bytes).and_then(|mut f| f.f64()).map(|v| v as f32),
        _ => Err(unknown(topic)),
    };
    of_topic(topic, parsed)
}

/// The reason why a topic cannot be decoded: no parser for its type and encoding.
fn unknown(topic: &Topic) -> String {
    format!("this type in {:?} encoding is not supported", topic.encoding)
}

/// The result with the topic named in its error.
fn of_topic<T>(topic: &Topic, parsed: Parsed<T>) -> Result<T> {
    parsed.map_err(|reason| Error::Message { topic: topic.name.clone(), kind: topic.kind.clone(), reason })
}
