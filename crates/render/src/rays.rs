//! Precomputed rays of a camera's pixels. The lens model costs nothing at render time.

use glam::Vec3A;
use rayon::prelude::*;
use trocar_camera::CameraModel;

/// The rays of all pixels of a camera.
#[derive(Clone, Debug)]
pub struct RayGenerator {
    width: usize,
    height: usize,
    /// Rays through pixel centres; NaN where nothing is visible. Rays of a pinhole have z = 1, rays
    /// of a fisheye have length 1.
    centres: Vec<[f32; 3]>,
    /// Rays through pixel corners: one row and one column more than there are pixels.
    corners: Vec<[f32; 3]>,
    /// Radius of the circular image (px).
    circle: Option<f32>,
}

impl RayGenerator {
    /// Computes the rays of all pixels of a camera.
    pub fn new(model: impl Into<CameraModel>) -> Self {
        let model = model.into();
        let (width, height) = (model.camera().width, model.camera().height);
        let flat = matches!(model, CameraModel::Pinhole(_));
        let ray = |u: f64, v: f64| {
            let ray = model.unproject(u, v).map(|d| if flat { d / d.z } else { d });
            ray.map_or([f32::NAN; 3], |d| d.as_vec3().to_array())
        };
        let grid = |columns: usize, rows: usize, shift: f64| -> Vec<[f32; 3]> {
            (0..columns * rows)
                .into_par_iter()
                .map(|i| ray((i % columns) as f64 - shift, (i / columns) as f64 - shift))
                .collect()
        };
        Self {
            width,
            height,
            centres: grid(width, height, 0.0),
            corners: grid(width + 1, height + 1, 0.5),
            circle: None,
        }
    }

    /// Restricts the visible image to a circle around its centre, as an endoscope shows it.
    /// `diameter` is relative to the image height.
    #[must_use]
    pub fn with_circular_image(mut self, diameter: f32) -> Self {
        let radius = 0.5 * diameter * self.height as f32;
        self.circle = Some(radius);
        for i in 0..self.centres.len() {
            if self.centre_distance_squared(i) > radius * radius {
                self.centres[i] = [f32::NAN; 3];
            }
        }
        self
    }

    /// Width (px).
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height (px).
    pub fn height(&self) -> usize {
        self.height
    }

    /// Ray through the centre of a pixel; `None` where nothing is visible.
    pub(crate) fn centre(&self, pixel: usize) -> Option<Vec3A> {
        let ray = Vec3A::from(self.centres[pixel]);
        ray.is_finite().then_some(ray)
    }

    /// Ray through position (`a`, `b`) in a pixel, with (0, 0) at its upper left corner; `None`
    /// where nothing is visible.
    pub(crate) fn at(&self, pixel: usize, a: f32, b: f32) -> Option<Vec3A> {
        let at = pixel / self.width * (self.width + 1) + pixel % self.width;
        let corner = |i: usize| Vec3A::from(self.corners[i]);
        let above = corner(at).lerp(corner(at + 1), a);
        let below = corner(at + self.width + 1).lerp(corner(at + self.width + 2), a);
        let ray = above.lerp(below, b);
        ray.is_finite().then_some(ray)
    }

    /// Squared distance of a pixel from the image centre, 1 at the rim of the circular image or at
    /// the corner of a rectangular one.
    pub(crate) fn eccentricity_squared(&self, pixel: usize) -> f32 {
        let (width, height) = (self.width as f32, self.height as f32);
        let rim = self.circle.map_or(0.25 * (width * width + height * height), |radius| radius * radius);
        self.centre_distance_squared(pixel) / rim.max(1e-12)
    }

    fn centre_distance_squared(&self, pixel: usize) -> f32 {
        let x = (pixel % self.width) as f32 - 0.5 * (self.width as f32 - 1.0);
        let y = (pixel / self.width) as f32 - 0.5 * (self.height as f32 - 1.0);
        x * x + y * y
    }
}
