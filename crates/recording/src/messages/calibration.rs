//! Camera calibrations: `sensor_msgs/CameraInfo` and `foxglove.CameraCalibration`.

use super::distortion;
use super::error::Parsed;
use trocar_camera::Camera;

/// The contents of both kinds of message.
#[derive(Default)]
pub(crate) struct Intrinsics {
    pub width: u32,
    pub height: u32,
    /// Name of the distortion model.
    pub model: String,
    /// Distortion coefficients.
    pub d: Vec<f64>,
    /// Camera matrix, row by row.
    pub k: [f64; 9],
    /// Camera pixels per image pixel, horizontally and vertically; 0 means 1.
    pub binning: [u32; 2],
    /// Region of the camera's image: left, top, height, width (px); all zeros mean the whole image.
    pub region: [u32; 4],
}

/// The camera of the calibrated image.
pub(crate) fn camera(i: &Intrinsics) -> Parsed<Camera> {
    let [fx, skew, cx, _, fy, cy, ..] = i.k;
    if i.k == [0.0; 9] {
        return Err("K is all zeros: the camera was not calibrated".into());
    }
    if skew != 0.0 {
        return Err(format!("K has a skew of {skew}; it must be 0"));
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
