//! Colour, depth and mask images, and their files.

use crate::Result;
use std::path::Path;

/// An 8-bit sRGB image, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorImage {
    /// Width [px].
    pub width: usize,
    /// Height [px].
    pub height: usize,
    /// One colour a pixel, row by row.
    pub pixels: Vec<[u8; 3]>,
}

/// A depth image in metres; 0 is invalid.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    /// Width [px].
    pub width: usize,
    /// Height [px].
    pub height: usize,
    /// One depth a pixel [m], row by row.
    pub depth: Vec<f32>,
}

/// A yes/no image.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Width [px].
    pub width: usize,
    /// Height [px].
    pub height: usize,
    /// One flag a pixel, row by row.
    pub set: Vec<bool>,
}

impl ColorImage {
    /// An image of one colour.
    pub fn new(width: usize, height: usize, color: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![color; width * height] }
    }
    /// Reads a PNG or JPEG.
    pub fn read(path: &Path) -> Result<Self> {
        let _ = path;
        todo!()
    }
    /// Writes a PNG.
    pub fn write_png(&self, path: &Path) -> Result<()> {
        let _ = path;
        todo!()
    }
    /// The PNG file as bytes.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        todo!()
    }
}

impl DepthImage {
    /// An image without a single valid depth.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, depth: vec![0.0; width * height] }
    }
    /// Reads a 16-bit greyscale PNG whose unit is `scale` metres.
    pub fn read(path: &Path, scale: f64) -> Result<Self> {
        let _ = (path, scale);
        todo!()
    }
    /// Writes a 16-bit greyscale PNG whose unit is `scale` metres.
    pub fn write_png(&self, path: &Path, scale: f64) -> Result<()> {
        let _ = (path, scale);
        todo!()
    }
}

impl Mask {
    /// A mask with no pixel set.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, set: vec![false; width * height] }
    }
    /// Number of pixels set.
    pub fn count(&self) -> usize {
        self.set.iter().filter(|s| **s).count()
    }
    /// Reads an 8-bit image; pixels above half brightness (or with alpha and not transparent) are set.
    pub fn read(path: &Path) -> Result<Self> {
        let _ = path;
        todo!()
    }
    /// Writes an 8-bit greyscale PNG: 255 set, 0 not.
    pub fn write_png(&self, path: &Path) -> Result<()> {
        let _ = path;
        todo!()
    }
}
