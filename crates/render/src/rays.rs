//! The rays of a camera's pixels, worked out once; a lens costs nothing after that.

use glam::Vec3A;
use rayon::prelude::*;
use trocar_camera::CameraModel;

/// A camera made ready for rendering.
#[derive(Clone, Debug)]
pub struct RayGenerator {
    width: usize,
    height: usize,
    /// Rays through the pixels' centres; not a number where nothing is seen. A pinhole's have z = 1, a fisheye's length 1.
    centres: Vec<[f32; 3]>,
    /// Rays through the pixels' corners, one more a row and column.
    corners: Vec<[f32; 3]>,
    /// Radius of the round picture and the picture's half diagonal [px].
    circle: Option<f32>,
}

impl RayGenerator {
    /// All pixels of a camera.
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

    /// Only what lies in a circle about the image's middle is seen, as through an endoscope; `diameter` is in image heights.
    #[must_use]
    pub fn round(mut self, diameter: f32) -> Self {
        let radius = 0.5 * diameter * self.height as f32;
        self.circle = Some(radius);
        for i in 0..self.centres.len() {
            if self.middle_distance_squared(i) > radius * radius {
                self.centres[i] = [f32::NAN; 3];
            }
        }
        self
    }

    /// Width [px].
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height [px].
    pub fn height(&self) -> usize {
        self.height
    }

    /// The ray through a pixel's centre; `None` where nothing is seen.
    pub(crate) fn centre(&self, pixel: usize) -> Option<Vec3A> {
        let ray = Vec3A::from(self.centres[pixel]);
        ray.is_finite().then_some(ray)
    }

    /// The ray through a place in a pixel, (0, 0) its upper left corner; `None` where nothing is seen.
    pub(crate) fn within(&self, pixel: usize, a: f32, b: f32) -> Option<Vec3A> {
        let at = pixel / self.width * (self.width + 1) + pixel % self.width;
        let corner = |i: usize| Vec3A::from(self.corners[i]);
        let above = corner(at).lerp(corner(at + 1), a);
        let below = corner(at + self.width + 1).lerp(corner(at + self.width + 2), a);
        let ray = above.lerp(below, b);
        ray.is_finite().then_some(ray)
    }

    /// The square of how far a pixel is from the image's middle, 1 at the rim of the round picture or at the image's corner.
    pub(crate) fn eccentricity_squared(&self, pixel: usize) -> f32 {
        let (width, height) = (self.width as f32, self.height as f32);
        let rim = self.circle.map_or(0.25 * (width * width + height * height), |radius| radius * radius);
        self.middle_distance_squared(pixel) / rim.max(1e-12)
    }

    fn middle_distance_squared(&self, pixel: usize) -> f32 {
        let x = (pixel % self.width) as f32 - 0.5 * (self.width as f32 - 1.0);
        let y = (pixel / self.width) as f32 - 0.5 * (self.height as f32 - 1.0);
        x * x + y * y
    }
}
