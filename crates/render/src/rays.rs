//! Precomputed rays of a camera's pixels. The lens model costs nothing at render time.

mod projection;

pub(crate) use projection::Projection;

use crate::antialias::FINER;
use crate::lanes::LANES;
use glam::Vec3A;
use rayon::prelude::*;
use std::sync::OnceLock;
use trocar_camera::CameraModel;

/// Side of a tile of pixels.
pub(crate) const TILE: usize = 8;

/// The rays of all pixels of a camera.
#[derive(Clone, Debug)]
pub struct RayGenerator {
    width: usize,
    height: usize,
    model: CameraModel,
    /// Rays through pixel centres, by axis, in rows of `stride`; NaN where nothing is visible and
    /// beyond the picture. Rays of a pinhole have z = 1, rays of a fisheye have length 1.
    centres: [Vec<f32>; 3],
    /// The same, one ray after the other; the last number is not used.
    each: Vec<[f32; 4]>,
    stride: usize,
    /// Rays through pixel corners: one row and one column more than there are pixels. Only paths
    /// need them.
    corners: OnceLock<Vec<[f32; 3]>>,
    /// Radius of the circular image (px).
    circle: Option<f32>,
    projection: Projection,
    tiles: TileBounds,
    /// Of the points of the pixels, see [`Self::finer`].
    finer: OnceLock<Box<RayGenerator>>,
}

/// Least and greatest components of the rays of each tile.
#[derive(Clone, Debug, Default)]
pub(crate) struct TileBounds {
    /// Tiles of a row, rounded up to whole registers.
    pub stride: usize,
    /// By axis; NaN for tiles without a ray.
    pub low: [Vec<f32>; 3],
    pub high: [Vec<f32>; 3],
}

impl RayGenerator {
    /// Computes the rays of all pixels of a camera.
    pub fn new(model: impl Into<CameraModel>) -> Self {
        let model = model.into();
        let (width, height) = (model.camera().width, model.camera().height);
        // Registers that start in the picture end in the row.
        let stride = width.next_multiple_of(LANES) + LANES;
        let mut centres = [0, 1, 2].map(|_| vec![f32::NAN; stride * height]);
        let [x, y, z] = &mut centres;
        let rows = x.par_chunks_mut(stride).zip(y.par_chunks_mut(stride)).zip(z.par_chunks_mut(stride));
        rows.enumerate().for_each(|(v, ((x, y), z))| {
            for u in 0..width {
                [x[u], y[u], z[u]] = ray(&model, u as f64, v as f64);
            }
        });
        let mut rays = Self {
            width,
            height,
            model,
            centres,
            each: Vec::new(),
            stride,
            corners: OnceLock::new(),
            circle: None,
            projection: Projection::default(),
            tiles: TileBounds::default(),
            finer: OnceLock::new(),
        };
        rays.projection = Projection::new(&rays.model, &rays);
        rays.finish();
        rays
    }

    /// Restricts the visible image to a circle around its centre, as an endoscope shows it.
    /// `diameter` is relative to the image height.
    #[must_use]
    pub fn with_circular_image(mut self, diameter: f32) -> Self {
        self.finer = OnceLock::new();
        let radius = 0.5 * diameter * self.height as f32;
        self.circle = Some(radius);
        for pixel in 0..self.width * self.height {
            if self.centre_distance_squared(pixel) > radius * radius {
                let at = pixel / self.width * self.stride + pixel % self.width;
                self.centres.iter_mut().for_each(|axis| axis[at] = f32::NAN);
            }
        }
        self.finish();
        self
    }

    /// Derives what follows from the rays.
    fn finish(&mut self) {
        let [x, y, z] = &self.centres;
        self.each = x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z, 0.0]).collect();
        self.tiles = TileBounds::of(self);
    }

    /// Width (px).
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height (px).
    pub fn height(&self) -> usize {
        self.height
    }

    /// The rays of the points of all pixels, [`FINER`] along each side.
    pub(crate) fn finer(&self) -> &Self {
        if let Some(fine) = self.finer.get() {
            return fine;
        }
        // Not within the lock: a thread that waits for others may take work that needs these rays.
        let fine = Self::new(self.model.finer(FINER));
        let fine = match self.circle {
            Some(radius) => fine.with_circular_image(2.0 * radius / self.height as f32),
            None => fine,
        };
        self.finer.get_or_init(|| Box::new(fine))
    }

    /// The lens that determines the rays: the camera model, and the radius of the circular image
    /// (px).
    pub(crate) fn lens(&self) -> (CameraModel, Option<f32>) {
        (self.model, self.circle)
    }

    /// Numbers of a row of [`Self::axes`].
    pub(crate) fn stride(&self) -> usize {
        self.stride
    }

    /// Rays through pixel centres by axis, in rows of [`Self::stride`]; NaN where nothing is
    /// visible and beyond the picture.
    pub(crate) fn axes(&self) -> &[Vec<f32>; 3] {
        &self.centres
    }

    /// The rays of [`Self::axes`] one after the other; the last number is not used.
    pub(crate) fn each(&self) -> &[[f32; 4]] {
        &self.each
    }

    pub(crate) fn projection(&self) -> &Projection {
        &self.projection
    }

    pub(crate) fn tiles(&self) -> &TileBounds {
        &self.tiles
    }

    /// Ray through the centre of pixel (`u`, `v`); NaN where nothing is visible.
    #[inline]
    pub(crate) fn through(&self, u: usize, v: usize) -> Vec3A {
        let at = v * self.stride + u;
        let [x, y, z] = &self.centres;
        Vec3A::new(x[at], y[at], z[at])
    }

    /// Ray through the centre of a pixel; `None` where nothing is visible.
    #[inline]
    pub(crate) fn centre(&self, pixel: usize) -> Option<Vec3A> {
        let ray = self.through(pixel % self.width, pixel / self.width);
        ray.is_finite().then_some(ray)
    }

    /// Ray through position (`a`, `b`) in a pixel, with (0, 0) at its upper left corner; `None`
    /// where nothing is visible.
    pub(crate) fn at(&self, pixel: usize, a: f32, b: f32) -> Option<Vec3A> {
        let corners = self.corners.get_or_init(|| {
            let (columns, rows) = (self.width + 1, self.height + 1);
            let corner = |i: usize| ray(&self.model, (i % columns) as f64 - 0.5, (i / columns) as f64 - 0.5);
            (0..columns * rows).map(corner).collect()
        });
        let at = pixel / self.width * (self.width + 1) + pixel % self.width;
        let corner = |i: usize| Vec3A::from(corners[i]);
        let above = corner(at).lerp(corner(at + 1), a);
        let below = corner(at + self.width + 1).lerp(corner(at + self.width + 2), a);
        let ray = above.lerp(below, b);
        ray.is_finite().then_some(ray)
    }

    /// Squared distance of a pixel from the image centre, 1 at the rim of the circular image or at
    /// the corner of a rectangular one.
    #[inline]
    pub(crate) fn eccentricity_squared(&self, u: usize, v: usize) -> f32 {
        let (width, height) = (self.width as f32, self.height as f32);
        let rim = self.circle.map_or(0.25 * (width * width + height * height), |radius| radius * radius);
        self.distance_squared(u, v) / rim.max(1e-12)
    }

    fn centre_distance_squared(&self, pixel: usize) -> f32 {
        self.distance_squared(pixel % self.width, pixel / self.width)
    }

    #[inline]
    fn distance_squared(&self, u: usize, v: usize) -> f32 {
        let x = u as f32 - 0.5 * (self.width as f32 - 1.0);
        let y = v as f32 - 0.5 * (self.height as f32 - 1.0);
        x * x + y * y
    }
}

/// Ray through an image point; NaN where nothing is visible.
fn ray(model: &CameraModel, u: f64, v: f64) -> [f32; 3] {
    let flat = matches!(model, CameraModel::Pinhole(_));
    let ray = model.unproject(u, v).map(|d| if flat { d / d.z } else { d });
    ray.map_or([f32::NAN; 3], |d| d.as_vec3().to_array())
}

impl TileBounds {
    fn of(rays: &RayGenerator) -> Self {
        let (columns, rows) = (rays.width.div_ceil(TILE), rays.height.div_ceil(TILE));
        let stride = columns.next_multiple_of(LANES);
        let empty = || [0, 1, 2].map(|_| vec![f32::NAN; stride * rows]);
        let mut tiles = Self { stride, low: empty(), high: empty() };
        for v in 0..rays.height {
            for u in 0..rays.width {
                let ray = rays.through(u, v);
                if ray.is_finite() {
                    let at = v / TILE * stride + u / TILE;
                    for k in 0..3 {
                        tiles.low[k][at] = tiles.low[k][at].min(ray[k]);
                        tiles.high[k][at] = tiles.high[k][at].max(ray[k]);
                    }
                }
            }
        }
        tiles
    }
}
