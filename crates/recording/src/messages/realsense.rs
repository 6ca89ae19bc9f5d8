//! The topics of a bag that RealSense Viewer or librealsense recorded (librealsense,
//! `ros_file_format.h`, version 3).
//!
//! ```text
//! /device_0/sensor_0/Depth_0/image/data        sensor_msgs/Image, mono16
//! /device_0/sensor_0/Depth_0/info/camera_info  sensor_msgs/CameraInfo
//! /device_0/sensor_0/Depth_0/tf/0              geometry_msgs/Transform
//! /device_0/sensor_0/option/Depth Units/value  std_msgs/Float32 (m), or Depth_Units
//! /device_0/sensor_1/Color_0/...               same; one sensor on some D405
//! ```
//!
//! Calibration, options and transforms have the log time 1 ns. A stream's transform maps points
//! *from* the reference stream of its group *to* the stream's own frame (librealsense's
//! `device::get_extrinsics` asks for reference to stream; `rs2_extrinsics` has the same direction).

use super::topic::Topic;
use super::transform::Transform;
use trocar_core::Pose;

/// Indices of the topics of one depth and one colour stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RealSenseTopics {
    /// Depth images.
    pub depth: usize,
    /// Colour images.
    pub color: usize,
    /// Calibration of the depth stream.
    pub depth_info: Option<usize>,
    /// Calibration of the colour stream.
    pub color_info: Option<usize>,
    /// Unit of depth (m).
    pub depth_units: Option<usize>,
    /// From the reference to the depth stream's frame.
    pub depth_transform: Option<usize>,
    /// From the reference to the colour stream's frame.
    pub color_transform: Option<usize>,
}

/// The first depth and the first colour stream of a RealSense recording. `None` for other
/// recordings, or without both streams.
pub fn find(topics: &[Topic]) -> Option<RealSenseTopics> {
    let stream = |name: &str| {
        topics.iter().enumerate().find_map(|(i, topic)| {
            let base = topic.name.strip_suffix("/image/data")?;
            let (sensor, stream) = base.rsplit_once('/')?;
            let device = sensor.strip_prefix("/device_")?;
            let is = device.contains("/sensor_") && stream.strip_prefix(name).is_some_and(|n| n.starts_with('_'));
            (is && topic.kind == "sensor_msgs/Image").then_some((i, base, sensor))
        })
    };
    let ((depth, depth_base, depth_sensor), (color, color_base, _)) = (stream("Depth")?, stream("Color")?);
    let of_kind = |kind: &str, is: &dyn Fn(&str) -> bool| topics.iter().position(|t| t.kind == kind && is(&t.name));
    let info =
        |base: &str| of_kind("sensor_msgs/CameraInfo", &|name| name.strip_prefix(base) == Some("/info/camera_info"));
    let transform = |base: &str| {
        of_kind("geometry_msgs/Transform", &|name| name.strip_prefix(base).is_some_and(|n| n.starts_with("/tf/")))
    };
    let is_unit = |name: &str| {
        let option = name.strip_prefix(depth_sensor).and_then(|n| n.strip_prefix("/option/")?.strip_suffix("/value"));
        option.is_some_and(|o| o.replace(['_', '-'], " ").eq_ignore_ascii_case("depth units"))
    };
    Some(RealSenseTopics {
        depth,
        color,
        depth_info: info(depth_base),
        color_info: info(color_base),
        depth_units: of_kind("std_msgs/Float32", &is_unit),
        depth_transform: transform(depth_base),
        color_transform: transform(color_base),
    })
}

/// The transform from the depth stream's frame to the colour stream's.
pub fn color_from_depth(color: &Transform, depth: &Transform) -> Pose {
    let (color, back) = (color.pose(), depth.pose().inverse());
    Pose { rotation: color.rotation * back.rotation, translation: color.transform(back.translation) }
}
