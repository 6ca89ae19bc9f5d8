//! A camera at its pose, and the visible triangle of every pixel.

use crate::rays::RayGenerator;
use glam::{Mat3A, Vec3A};
use rayon::prelude::*;

/// Marks a pixel without a triangle.
pub(crate) const NOTHING: u32 = u32::MAX;

/// A camera at its pose.
#[derive(Clone, Copy, Debug)]
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
    /// Numbers of triangles among those of all bodies.
    pub triangle: Vec<u32>,
}

/// Rows of a [`Visibility`].
pub(crate) struct Seen<'a> {
    pub depth: &'a mut [f32],
    pub triangle: &'a mut [u32],
}

impl Visibility {
    /// Parts of whole rows, each of `rows` or, at the end, fewer.
    pub fn bands(&mut self, rays: &RayGenerator, rows: usize) -> impl IndexedParallelIterator<Item = Seen<'_>> {
        let count = rays.stride() * rays.height();
        self.depth.resize(count, f32::INFINITY);
        self.triangle.resize(count, NOTHING);
        let part = (rays.stride() * rows).max(1);
        let parts = self.depth.par_chunks_mut(part).zip(self.triangle.par_chunks_mut(part));
        parts.map(|(depth, triangle)| Seen { depth, triangle })
    }
}
