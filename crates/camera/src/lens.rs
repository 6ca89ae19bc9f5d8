//! Calibrated cameras: OpenCV's pinhole and fisheye models.

use crate::{Camera, ColorImage, Error, Fisheye, Result};
use glam::{DVec2, DVec3};

/// A calibrated camera of one of OpenCV's two models.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraModel {
    /// Pinhole, with 0, 4, 5 or 8 distortion coefficients.
    Pinhole(Camera),
    /// Fisheye: a [`Camera`] for size, focal lengths and principal point (its `distortion` is
    /// ignored), and the lens.
    Fisheye(Camera, Fisheye),
}

impl From<Camera> for CameraModel {
    fn from(camera: Camera) -> Self {
        Self::Pinhole(camera)
    }
}

/// For each pixel of an undistorted picture, its position in the distorted one. Equivalent to
/// OpenCV's `initUndistortRectifyMap`.
#[derive(Clone, Debug, PartialEq)]
pub struct UndistortionMap {
    /// Width of the undistorted picture (px).
    pub width: usize,
    /// Height of the undistorted picture (px).
    pub height: usize,
    /// Position in the distorted picture (px), row by row; NaN outside the field of view.
    pub from: Vec<DVec2>,
}

impl CameraModel {
    /// Size, focal lengths and principal point.
    pub fn camera(&self) -> &Camera {
        match self {
            Self::Pinhole(camera) | Self::Fisheye(camera, _) => camera,
        }
    }

    /// The camera with `times` as many pixels along each side, for the same picture.
    #[must_use]
    pub fn finer(&self, times: usize) -> Self {
        match self {
            Self::Pinhole(camera) => Self::Pinhole(camera.finer(times)),
            Self::Fisheye(camera, lens) => Self::Fisheye(camera.finer(times), *lens),
        }
    }

    /// Checks the parameters as [`Camera::validate`] does, and the coefficients of a fisheye lens.
    ///
    /// # Errors
    /// An invalid parameter, with the name of the field.
    pub fn validate(&self) -> Result<()> {
        if let Self::Fisheye(_, Fisheye(k)) = self
            && k.iter().any(|k| !k.is_finite())
        {
            return Err(Error::Camera(format!("camera.fisheye is {k:?}; every coefficient must be finite")));
        }
        self.camera().validate()
    }

    /// Pixel of a point (m) in the camera frame. `None` behind a pinhole camera, and for a fisheye
    /// at its centre or exactly behind it.
    pub fn project(&self, p: DVec3) -> Option<DVec2> {
        match self {
            Self::Pinhole(camera) => camera.project(p),
            Self::Fisheye(camera, lens) => {
                let aside = p.truncate();
                let angle = libm::atan2(aside.length(), p.z);
                if aside == DVec2::ZERO && p.z <= 0.0 {
                    return None;
                }
                let q = aside.normalize_or_zero() * lens.apply(angle);
                Some(DVec2::new(q.x * camera.fx + camera.cx, q.y * camera.fy + camera.cy))
            }
        }
    }

    /// Unit direction of the ray through pixel (u, v) in the camera frame; `None` outside the field
    /// of view.
    pub fn unproject(&self, u: f64, v: f64) -> Option<DVec3> {
        let camera = self.camera();
        let q = DVec2::new((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy);
        match self {
            Self::Pinhole(camera) => Some(camera.distortion.invert(q)?.extend(1.0).normalize()),
            Self::Fisheye(_, lens) => {
                let (sin, cos) = libm::sincos(lens.invert(q.length())?);
                Some((q.normalize_or_zero() * sin).extend(cos))
            }
        }
    }

    /// Maps the pixels of `plain`, a camera without distortion, to this camera's picture.
    pub fn undistortion_map(&self, plain: &Camera) -> UndistortionMap {
        let place = |u: usize, v: usize| self.project(plain.ray(u as f64, v as f64)).unwrap_or(DVec2::NAN);
        let from = (0..plain.height).flat_map(|v| (0..plain.width).map(move |u| place(u, v))).collect();
        UndistortionMap { width: plain.width, height: plain.height, from }
    }
}

impl UndistortionMap {
    /// The undistorted picture, with bilinear interpolation of sRGB values as in OpenCV's `remap`.
    /// Black outside the field of view.
    pub fn apply(&self, image: &ColorImage) -> ColorImage {
        let mut out = ColorImage::new(self.width, self.height, [0; 3]);
        let (right, below) = (image.width as f64 - 1.0, image.height as f64 - 1.0);
        for (pixel, from) in out.pixels.iter_mut().zip(&self.from) {
            // This form treats NaN as outside.
            let inside = from.x >= 0.0 && from.y >= 0.0 && from.x <= right && from.y <= below;
            if !inside {
                continue;
            }
            let (x, y) = (from.x as usize, from.y as usize);
            let (a, b) = (from.x - x as f64, from.y - y as f64);
            let at = |i: usize, j: usize| image.pixels[j.min(image.height - 1) * image.width + i.min(image.width - 1)];
            let corners = [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)];
            let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b];
            *pixel = std::array::from_fn(|k| {
                let sum: f64 = corners.iter().zip(weights).map(|(c, w)| w * f64::from(c[k])).sum();
                sum.round() as u8
            });
        }
        out
    }
}
