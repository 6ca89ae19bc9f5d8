//! The visible triangle of every pixel.

use super::band::Band;
use crate::rays::RayGenerator;
use crate::stage::Stage;
use fearless_simd::dispatch;
use glam::{Mat3A, Vec3A};
use rayon::prelude::*;

/// Rows of a band, a multiple of a tile's. Fewer give more clusters that are in two bands, more
/// give less to do in parallel.
pub(crate) const BAND: usize = 112;

/// Marks a pixel without a triangle.
pub(crate) const NOTHING: u32 = u32::MAX;

/// A camera at its pose.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub rays: &'a RayGenerator,
    /// From the camera to the world.
    pub rotation: Mat3A,
    pub origin: Vec3A,
}

/// The visible triangle of every pixel, and where its ray meets it. Rows are as long as those of
/// [`RayGenerator::axes`].
#[derive(Debug, Default)]
pub(crate) struct Visibility {
    /// Ray parameters; infinite where there is no triangle.
    pub depth: Vec<f32>,
    /// Numbers of triangles among those of all bodies, see [`Stage::body_of`].
    pub triangle: Vec<u32>,
}

impl Clone for Visibility {
    /// Empty: a picture overwrites all of it.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Visibility {
    /// Finds the visible triangles of the stage.
    pub fn draw(&mut self, stage: &Stage, view: &View<'_>) {
        let (stride, height) = (view.rays.stride(), view.rays.height());
        self.depth.resize(stride * height, f32::INFINITY);
        self.triangle.resize(stride * height, NOTHING);
        let bands = self.depth.par_chunks_mut(stride * BAND).zip(self.triangle.par_chunks_mut(stride * BAND));
        bands.enumerate().for_each(|(k, (depth, triangle))| {
            depth.fill(f32::INFINITY);
            triangle.fill(NOTHING);
            let mut band = Band::new(view, k * BAND, depth, triangle);
            dispatch!(stage.level, simd => band.draw(simd, stage));
        });
    }
}
