//! Camera calibrations: `sensor_msgs/CameraInfo` and `foxglove.CameraCalibration`.

use crate::error::{Parsed, Result};
use crate::ros::{self, fields, of_topic, unknown};
use crate::{Encoding, Topic, distortion, foxglove};
use trocar_camera::Camera;

/// What both kinds of message say.
#[derive(Default)]
pub(crate) struct Intrinsics {
    pub width: u32,
    pub height: u32,
    /// Name of the distortion model.
    pub model: String,
    /// Its coefficients.
    pub d: Vec<f64>,
    /// Camera matrix, row by row.
    pub k: [f64; 9],
    /// Camera pixels a pixel of the image, horizontally and vertically; 0 means 1.
    pub binning: [u32; 2],
    /// The part of the camera's image that was taken: left, top, height, width [px]; zeros mean all.
    pub region: [u32; 4],
}

/// Decodes a camera calibration: `sensor_msgs/CameraInfo` (ROS 1, ROS 2) or `foxglove.CameraCalibration` (protobuf, JSON).
///
/// This is the camera of the raw image, with K and D; a rectified image has P and no distortion, which RealSense's aligned
/// and depth images share with their raw ones. Region and binning are taken into account as ROS's `image_geometry` does.
/// librealsense's inverse and modified Brown-Conrady models are fitted by OpenCV's (to half a pixel, or an error).
///
/// # Errors
/// [`Error::Message`](crate::Error::Message) for another type, a camera that was never calibrated (K of zeros), a fisheye,
/// or numbers that make no sense.
pub fn decode_calibration(topic: &Topic, bytes: &[u8]) -> Result<Camera> {
    let parsed = match (topic.kind.as_str(), &topic.encoding) {
        ("sensor_msgs/CameraInfo", _) => from_ros(topic, bytes),
        ("foxglove.CameraCalibration", Encoding::Protobuf) => foxglove::camera_calibration(bytes),
        ("foxglove.CameraCalibration", Encoding::Json) => foxglove::camera_calibration_json(bytes),
        _ => Err(unknown(topic)),
    };
    of_topic(topic, parsed.and_then(|intrinsics| camera(&intrinsics)))
}

fn from_ros(topic: &Topic, bytes: &[u8]) -> Parsed<Intrinsics> {
    let mut f = fields(topic, bytes)?;
    ros::header(topic, &mut f)?;
    let (height, width) = (f.u32()?, f.u32()?);
    let model = f.text()?.to_owned();
    let d = f.counted_f64s()?;
    let k = f.f64s()?;
    let (_r, _p) = (f.f64s::<9>()?, f.f64s::<12>()?);
    let binning = [f.u32()?, f.u32()?];
    let region = [f.u32()?, f.u32()?, f.u32()?, f.u32()?];
    Ok(Intrinsics { width, height, model, d, k, binning, region })
}

fn camera(i: &Intrinsics) -> Parsed<Camera> {
    let [fx, skew, cx, _, fy, cy, ..] = i.k;
    if i.k == [0.0; 9] {
        return Err("K is all zeros: the camera was not calibrated".into());
    }
    if skew != 0.0 {
        return Err(format!("K has a skew of {skew}; only pixels without skew are known here"));
    }
    let mut camera = Camera {
        width: i.width as usize,
        height: i.height as usize,
        fx,
        fy,
        cx,
        cy,
        distortion: trocar_camera::Distortion::default(),
    };
    let valid = |camera: &Camera| camera.validate().map_err(|e| e.to_string());
    valid(&camera)?;
    camera.distortion = distortion::convert(&i.model, &i.d, &camera)?;
    let [left, top, height, width] = i.region;
    if width > 0 && height > 0 {
        (camera.width, camera.height) = (width as usize, height as usize);
        camera.cx -= f64::from(left);
        camera.cy -= f64::from(top);
    }
    let [across, down] = i.binning.map(|b| b.max(1));
    camera.width /= across as usize;
    camera.height /= down as usize;
    camera.fx /= f64::from(across);
    camera.cx /= f64::from(across);
    camera.fy /= f64::from(down);
    camera.cy /= f64::from(down);
    valid(&camera)?;
    Ok(camera)
}
