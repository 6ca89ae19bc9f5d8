//! The pinhole camera with OpenCV's lens distortion.

use crate::{Distortion, Error, Result};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// A pinhole camera. Image lengths are in pixels.
///
/// ```
/// use glam::{DVec2, DVec3};
/// use trocar_camera::Camera;
///
/// let camera = Camera::centred(640, 480, 60_f64.to_radians());
/// let pixel = camera.project(DVec3::new(0.0, 0.0, 0.3));
/// assert_eq!(pixel, Some(DVec2::new(319.5, 239.5)));
/// let point = 0.3 * camera.ray(0.0, 0.0);
/// assert!(camera.project(point).is_some_and(|p| p.length() < 1e-9));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Image width (px).
    pub width: usize,
    /// Image height (px).
    pub height: usize,
    /// Focal length along x (px).
    pub fx: f64,
    /// Focal length along y (px).
    pub fy: f64,
    /// Principal point, x (px).
    pub cx: f64,
    /// Principal point, y (px).
    pub cy: f64,
    /// Lens distortion; none by default.
    #[serde(default, skip_serializing_if = "Distortion::is_none")]
    pub distortion: Distortion,
}

impl Camera {
    /// A camera with square pixels, a horizontal field of view of `width_rad` (rad), a centred
    /// principal point and no distortion.
    pub fn centred(width: usize, height: usize, width_rad: f64) -> Self {
        let f = width as f64 / 2.0 / libm::tan(width_rad / 2.0);
        Self {
            width,
            height,
            fx: f,
            fy: f,
            cx: (width as f64 - 1.0) / 2.0,
            cy: (height as f64 - 1.0) / 2.0,
            distortion: Distortion::default(),
        }
    }

    /// The depth stream of a RealSense D405 at 848 x 480: 87 x 58 degrees (datasheet), square
    /// pixels, centred.
    pub fn d405() -> Self {
        Self::centred(848, 480, 87.0_f64.to_radians())
    }

    /// The camera with `times` as many pixels along each side, for the same picture.
    #[must_use]
    pub fn finer(&self, times: usize) -> Self {
        let k = times as f64;
        Self {
            width: times * self.width,
            height: times * self.height,
            fx: k * self.fx,
            fy: k * self.fy,
            cx: (self.cx + 0.5) * k - 0.5,
            cy: (self.cy + 0.5) * k - 0.5,
            distortion: self.distortion,
        }
    }

    /// Checks the parameters.
    ///
    /// # Errors
    /// A size of zero, a focal length that is not positive, or a number that is not finite, with
    /// the name of the field.
    pub fn validate(&self) -> Result<()> {
        let reject =
            |field: &str, value: String, right: &str| Err(Error::Camera(format!("camera.{field} is {value}; {right}")));
        if self.width == 0 || self.height == 0 || self.width > 65_536 || self.height > 65_536 {
            return reject("width x height", format!("{} x {}", self.width, self.height), "each must be in [1, 65536]");
        }
        for (name, f) in [("fx", self.fx), ("fy", self.fy)] {
            if !(1e-3..=1e7).contains(&f) {
                return reject(name, format!("{f:?}"), "it must be in [0.001, 1e7] px");
            }
        }
        for (name, c) in [("cx", self.cx), ("cy", self.cy)] {
            if c.is_nan() || c.abs() > 1e6 {
                return reject(name, c.to_string(), "it must be in [-1e6, 1e6] px");
            }
        }
        if self.distortion.0.iter().any(|k| !k.is_finite()) {
            return reject("distortion", format!("{:?}", self.distortion.0), "every coefficient must be finite");
        }
        Ok(())
    }

    /// Pixel of a point (m) in the camera frame; `None` behind the camera.
    pub fn project(&self, p: DVec3) -> Option<DVec2> {
        if p.z <= 0.0 {
            return None;
        }
        let mut q = DVec2::new(p.x / p.z, p.y / p.z);
        if !self.distortion.is_none() {
            q = self.distortion.apply(q);
        }
        Some(DVec2::new(q.x * self.fx + self.cx, q.y * self.fy + self.cy))
    }

    /// Direction (x, y, 1) of the ray through pixel (u, v) in the camera frame. Its product with a
    /// depth is the point at that depth.
    pub fn ray(&self, u: f64, v: f64) -> DVec3 {
        let mut q = DVec2::new((u - self.cx) / self.fx, (v - self.cy) / self.fy);
        if !self.distortion.is_none() {
            q = self.distortion.invert_or_fold(q);
        }
        q.extend(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distorted() -> Camera {
        Camera {
            distortion: Distortion([0.5479, -0.0210, -7.21e-5, 2.06e-5, -0.00265, 0.8897, 0.0861, -0.0139]),
            ..Camera::d405()
        }
    }

    #[test]
    fn ray_inverts_project() {
        for camera in [Camera::d405(), distorted()] {
            for (u, v) in [(0.0, 0.0), (400.0, 100.0), (847.0, 479.0), (12.5, 470.25)] {
                let pixel = camera.project(camera.ray(u, v) * 0.37).unwrap();
                assert!((pixel - DVec2::new(u, v)).length() < 1e-8, "{pixel} for {u}, {v}");
            }
        }
    }

    #[test]
    fn the_field_of_view_matches_the_datasheet() {
        let camera = Camera::d405();
        let left = camera.ray(-0.5, camera.cy);
        assert!((2.0 * (-left.x).atan().to_degrees() - 87.0).abs() < 1e-9);
        let top = camera.ray(camera.cx, -0.5);
        assert!(
            (2.0 * (-top.y).atan().to_degrees() - 58.0).abs() < 2.0,
            "848 x 480 is slightly wider than 16:9 of the datasheet"
        );
    }

    #[test]
    fn points_behind_the_camera_have_no_pixel() {
        assert_eq!(Camera::d405().project(DVec3::new(0.0, 0.0, -1.0)), None);
    }

    #[test]
    fn invalid_parameters_are_rejected_by_field() {
        let mut camera = Camera::d405();
        camera.fy = -1.0;
        assert!(camera.validate().unwrap_err().to_string().contains("fy"));
        camera = Camera { cx: f64::NAN, ..Camera::d405() };
        assert!(camera.validate().unwrap_err().to_string().contains("cx"));
        assert!(Distortion::try_from(vec![0.1; 6]).is_err());
    }
}
