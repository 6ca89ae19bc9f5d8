//! The pinhole camera with OpenCV's lens distortion.

use crate::{Distortion, Error, Result};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// A pinhole camera; lengths of the image in pixels.
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
    /// A camera with square pixels that sees `width_rad` from left to right, the principal point in
    /// the middle, no distortion.
    pub fn centred(width: usize, height: usize, width_rad: f64) -> Self {
        let f = width as f64 / 2.0 / (width_rad / 2.0).tan();
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

    /// The D405's depth stream at 848x480: 87 x 58 degrees (datasheet), square pixels, centred.
    pub fn d405() -> Self {
        Self::centred(848, 480, 87.0_f64.to_radians())
    }

    /// Refuses sizes of zero, focal lengths that are not positive, and numbers that are not finite.
    pub fn validate(&self) -> Result<()> {
        let refuse =
            |field: &str, value: String, right: &str| Err(Error::Camera(format!("camera.{field} is {value}; {right}")));
        if self.width == 0 || self.height == 0 || self.width > 65_536 || self.height > 65_536 {
            return refuse("width x height", format!("{} x {}", self.width, self.height), "1 to 65536 pixels each");
        }
        for (name, f) in [("fx", self.fx), ("fy", self.fy)] {
            if !(1e-3..=1e7).contains(&f) {
                return refuse(name, format!("{f:?}"), "a focal length is a positive number of pixels (0.001 to 1e7)");
            }
        }
        for (name, c) in [("cx", self.cx), ("cy", self.cy)] {
            if c.is_nan() || c.abs() > 1e6 {
                return refuse(name, c.to_string(), "a principal point is a number of pixels (-1e6 to 1e6)");
            }
        }
        if self.distortion.0.iter().any(|k| !k.is_finite()) {
            return refuse("distortion", format!("{:?}", self.distortion.0), "every coefficient is a finite number");
        }
        Ok(())
    }

    /// Pixel of a point in the camera frame (m); `None` behind the camera.
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

    /// Direction (x, y, 1) of the ray through pixel (u, v): multiplied by a depth it is the point
    /// in the camera frame.
    pub fn ray(&self, u: f64, v: f64) -> DVec3 {
        let mut q = DVec2::new((u - self.cx) / self.fx, (v - self.cy) / self.fy);
        if !self.distortion.is_none() {
            q = self.distortion.undo(q);
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
    fn ray_undoes_project() {
        for camera in [Camera::d405(), distorted()] {
            for (u, v) in [(0.0, 0.0), (400.0, 100.0), (847.0, 479.0), (12.5, 470.25)] {
                let pixel = camera.project(camera.ray(u, v) * 0.37).unwrap();
                assert!((pixel - DVec2::new(u, v)).length() < 1e-8, "{pixel} for {u}, {v}");
            }
        }
    }

    #[test]
    fn the_field_of_view_is_the_data_sheets() {
        let camera = Camera::d405();
        let left = camera.ray(-0.5, camera.cy);
        assert!((2.0 * (-left.x).atan().to_degrees() - 87.0).abs() < 1e-9);
        let top = camera.ray(camera.cx, -0.5);
        assert!(
            (2.0 * (-top.y).atan().to_degrees() - 58.0).abs() < 2.0,
            "848x480 is a little wider than the sheet's 16:9"
        );
    }

    #[test]
    fn nothing_is_seen_behind_the_camera() {
        assert_eq!(Camera::d405().project(DVec3::new(0.0, 0.0, -1.0)), None);
    }

    #[test]
    fn nonsense_is_refused_by_field() {
        let mut camera = Camera::d405();
        camera.fy = -1.0;
        assert!(camera.validate().unwrap_err().to_string().contains("fy"));
        camera = Camera { cx: f64::NAN, ..Camera::d405() };
        assert!(camera.validate().unwrap_err().to_string().contains("cx"));
        assert!(Distortion::try_from(vec![0.1; 6]).is_err());
    }
}
