//! A camera at its pose, and the visible triangle of every pixel.

use crate::rays::RayGenerator;
use glam::{Mat3A, Vec3A};

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
