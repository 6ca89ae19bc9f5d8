//! Rendered pictures: colour, depth, labels and normals.

use crate::film::Film;
use crate::lanes::LANES;
use crate::rays::RayGenerator;
use rayon::prelude::*;
use trocar_camera::{ColorImage, DepthImage};

/// A rendered picture, rows from the top. Depth, labels and normals are taken at pixel centres; so
/// is light, except with path tracing.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Colour after exposure and tone mapping by the film.
    pub color: ColorImage,
    /// Depth along the camera's z axis (m); 0 where no body is visible.
    pub depth: DepthImage,
    /// Label of the visible body; 0 where no body is visible.
    pub labels: Vec<u16>,
    /// Unit normals in the camera frame, towards the camera; 0 where no body is visible.
    pub normals: Vec<[f32; 3]>,
    /// Linear radiance before the film is applied.
    pub light: Vec<[f32; 3]>,
}

/// Rows of a picture.
pub(crate) struct Rows<'a> {
    pub color: &'a mut [[u8; 3]],
    pub depth: &'a mut [f32],
    pub labels: &'a mut [u16],
    pub normals: &'a mut [[f32; 3]],
    pub light: &'a mut [[f32; 3]],
}

impl Picture {
    /// A black picture in which no body is visible.
    pub fn new(width: usize, height: usize) -> Self {
        let mut picture = Self::default();
        picture.resize(width, height);
        picture
    }

    pub(crate) fn resize(&mut self, width: usize, height: usize) {
        let count = width * height;
        (self.color.width, self.color.height) = (width, height);
        (self.depth.width, self.depth.height) = (width, height);
        self.color.pixels.resize(count, [0; 3]);
        self.depth.depth.resize(count, 0.0);
        self.labels.resize(count, 0);
        self.normals.resize(count, [0.0; 3]);
        self.light.resize(count, [0.0; 3]);
    }
}

impl Default for Picture {
    fn default() -> Self {
        Self {
            color: ColorImage::new(0, 0, [0; 3]),
            depth: DepthImage::new(0, 0),
            labels: Vec::new(),
            normals: Vec::new(),
            light: Vec::new(),
        }
    }
}

impl Picture {
    /// The first `count` rows.
    pub(crate) fn first_rows(&mut self, count: usize) -> Rows<'_> {
        let pixels = count * self.color.width;
        Rows {
            color: &mut self.color.pixels[..pixels],
            depth: &mut self.depth.depth[..pixels],
            labels: &mut self.labels[..pixels],
            normals: &mut self.normals[..pixels],
            light: &mut self.light[..pixels],
        }
    }

    /// Parts of `pixels` pixels, numbered.
    pub(crate) fn bands(&mut self, pixels: usize) -> impl IndexedParallelIterator<Item = (usize, Rows<'_>)> {
        let pixels = pixels.max(1);
        let parts = (
            self.color.pixels.par_chunks_mut(pixels),
            self.depth.depth.par_chunks_mut(pixels),
            self.labels.par_chunks_mut(pixels),
            self.normals.par_chunks_mut(pixels),
            self.light.par_chunks_mut(pixels),
        );
        let rows = |(color, depth, labels, normals, light)| Rows { color, depth, labels, normals, light };
        parts.into_par_iter().map(rows).enumerate()
    }
}

impl Rows<'_> {
    /// Copies the rows of a picture from pixel `first`.
    pub fn copy_from(&mut self, picture: &Picture, first: usize) {
        let held = first..first + self.depth.len();
        self.color.copy_from_slice(&picture.color.pixels[held.clone()]);
        self.depth.copy_from_slice(&picture.depth.depth[held.clone()]);
        self.labels.copy_from_slice(&picture.labels[held.clone()]);
        self.normals.copy_from_slice(&picture.normals[held.clone()]);
        self.light.copy_from_slice(&picture.light[held]);
    }

    /// Turns light into colour. `first` is the first of these rows.
    pub fn develop(&mut self, film: &Film, rays: &RayGenerator, first: usize) {
        let width = rays.width();
        for (row, (color, light)) in self.color.chunks_mut(width).zip(self.light.chunks(width)).enumerate() {
            film.develop(rays, [0, first + row], light, color);
        }
    }

    /// Like [`Self::develop`], but only those parts of [`LANES`] pixels of a row that `parts` says.
    pub fn develop_parts(&mut self, film: &Film, rays: &RayGenerator, first: usize, parts: &[bool]) {
        let width = rays.width();
        let rows = self.color.chunks_mut(width).zip(self.light.chunks(width));
        for (row, ((color, light), parts)) in rows.zip(parts.chunks(width.div_ceil(LANES))).enumerate() {
            let parts = color.chunks_mut(LANES).zip(light.chunks(LANES)).zip(parts).enumerate();
            for (k, ((color, light), _)) in parts.filter(|(_, (_, is_in))| **is_in) {
                film.develop(rays, [k * LANES, first + row], light, color);
            }
        }
    }
}
