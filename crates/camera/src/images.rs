//! Colour, depth and mask images, and their files.

use crate::{Error, Result};
use image::codecs::jpeg::JpegEncoder;
use image::{DynamicImage, ExtendedColorType, ImageDecoder, ImageEncoder, ImageReader};
use std::io::Cursor;
use std::path::Path;

/// Maximum width and height of an image (px). Larger images are rejected before allocation.
const MAX_SIDE: u32 = 16_384;

/// Maximum number of pixel bytes per file byte. Deflate reaches 1032.
const MAX_COMPRESSION: u64 = 1040;

/// JPEG quality (0 to 100), without visible blocks.
const JPEG_QUALITY: u8 = 90;

/// An 8-bit sRGB image, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorImage {
    /// Width (px).
    pub width: usize,
    /// Height (px).
    pub height: usize,
    /// One colour per pixel, row by row.
    pub pixels: Vec<[u8; 3]>,
}

/// A depth image in metres; 0 is invalid.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    /// Width (px).
    pub width: usize,
    /// Height (px).
    pub height: usize,
    /// One depth per pixel (m), row by row.
    pub depth: Vec<f32>,
}

/// A binary image.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Width (px).
    pub width: usize,
    /// Height (px).
    pub height: usize,
    /// One flag per pixel, row by row.
    pub set: Vec<bool>,
}

impl ColorImage {
    /// An image with a single colour.
    pub fn new(width: usize, height: usize, color: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![color; width * height] }
    }

    /// Reads a PNG or JPEG.
    ///
    /// # Errors
    /// A file that is missing, truncated or not an image.
    pub fn read(path: &Path) -> Result<Self> {
        Self::decode(&load(path)?, path)
    }

    /// Decodes the bytes of a PNG or JPEG. `path` is used in errors only.
    ///
    /// # Errors
    /// Bytes that are truncated or not an image.
    pub fn decode(bytes: &[u8], path: &Path) -> Result<Self> {
        let image = decode(bytes, path)?.into_rgb8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        Ok(Self { width, height, pixels: image.as_raw().as_chunks().0.to_vec() })
    }

    /// Writes a PNG.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_png(&self, path: &Path) -> Result<()> {
        write(path, &self.to_png()?)
    }

    /// The PNG file as bytes.
    ///
    /// # Errors
    /// A number of pixels that does not match the size.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        encode(self.width, self.height, png::ColorType::Rgb, png::BitDepth::Eight, self.pixels.as_flattened())
    }

    /// Writes a JPEG without visible blocks.
    ///
    /// # Errors
    /// A file that cannot be written; a number of pixels that does not match the size.
    pub fn write_jpeg(&self, path: &Path) -> Result<()> {
        write(path, &jpeg(self.pixels.as_flattened(), self.width, self.height)?)
    }
}

impl DepthImage {
    /// An image of invalid depths.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, depth: vec![0.0; width * height] }
    }

    /// Reads a 16-bit greyscale PNG whose unit is `scale` (m).
    ///
    /// # Errors
    /// A file that is missing, truncated or not 16-bit greyscale.
    pub fn read(path: &Path, scale: f64) -> Result<Self> {
        Self::decode(&load(path)?, path, scale)
    }

    /// Decodes the bytes of a 16-bit greyscale PNG whose unit is `scale` (m). `path` is used in
    /// errors only.
    ///
    /// # Errors
    /// Bytes that are truncated or not 16-bit greyscale.
    pub fn decode(bytes: &[u8], path: &Path, scale: f64) -> Result<Self> {
        let DynamicImage::ImageLuma16(image) = decode(bytes, path)? else {
            return Err(wrong(path, &"not a 16-bit greyscale image; a depth image must have one 16-bit channel"));
        };
        let (width, height) = (image.width() as usize, image.height() as usize);
        Ok(Self { width, height, depth: image.into_raw().into_iter().map(|d| (f64::from(d) * scale) as f32).collect() })
    }

    /// Writes a 16-bit greyscale PNG whose unit is `scale` (m). Depths beyond its range become
    /// invalid.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_png(&self, path: &Path, scale: f64) -> Result<()> {
        let quantise = |d: &f32| {
            let units = f64::from(*d) / scale + 0.5;
            if units >= 1.0 && units < f64::from(u16::MAX) + 1.0 { units as u16 } else { 0 }
        };
        let bytes: Vec<u8> = self.depth.iter().flat_map(|d| quantise(d).to_be_bytes()).collect();
        write(path, &encode(self.width, self.height, png::ColorType::Grayscale, png::BitDepth::Sixteen, &bytes)?)
    }
}

impl Mask {
    /// A mask without set pixels.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, set: vec![false; width * height] }
    }

    /// Number of set pixels.
    pub fn count(&self) -> usize {
        self.set.iter().filter(|s| **s).count()
    }

    /// Reads an image. Opaque pixels above half brightness are set.
    ///
    /// # Errors
    /// A file that is missing, truncated or not an image.
    pub fn read(path: &Path) -> Result<Self> {
        Self::decode(&load(path)?, path)
    }

    /// Decodes the bytes of an image as [`Mask::read`] does. `path` is used in errors only.
    ///
    /// # Errors
    /// Bytes that are truncated or not an image.
    pub fn decode(bytes: &[u8], path: &Path) -> Result<Self> {
        let image = decode(bytes, path)?.into_luma_alpha8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        Ok(Self { width, height, set: image.pixels().map(|p| p.0[0] > 127 && p.0[1] > 127).collect() })
    }

    /// Writes an 8-bit greyscale PNG with 255 for set pixels and 0 for others.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_png(&self, path: &Path) -> Result<()> {
        let bytes: Vec<u8> = self.set.iter().map(|s| if *s { 255 } else { 0 }).collect();
        write(path, &encode(self.width, self.height, png::ColorType::Grayscale, png::BitDepth::Eight, &bytes)?)
    }
}

/// The existing pixels left, right, above and below pixel `i` (row by row) of a `width` x `height`
/// image.
pub fn pixel_neighbours(i: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let (u, v) = (i % width, i / width);
    let near = [
        (u > 0).then(|| i - 1),
        (u + 1 < width).then_some(i + 1),
        (v > 0).then(|| i - width),
        (v + 1 < height).then_some(i + width),
    ];
    near.into_iter().flatten()
}

fn wrong(path: &Path, reason: &dyn std::fmt::Display) -> Error {
    // Some decoders' messages have several lines; ours have one.
    let reason = reason.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    Error::Image { path: path.to_owned(), reason: reason.replace(" )", ")") }
}

fn load(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|e| wrong(path, &e))
}

/// Decodes by content; the extension is ignored.
fn decode(bytes: &[u8], path: &Path) -> Result<DynamicImage> {
    let unreadable =
        |e: image::ImageError| wrong(path, &format!("unreadable image ({e}); it must be a complete PNG or JPEG"));
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| wrong(path, &e))?;
    reader.no_limits();
    let decoder = reader.into_decoder().map_err(unreadable)?;
    let (width, height) = decoder.dimensions();
    if width > MAX_SIDE || height > MAX_SIDE {
        return Err(wrong(
            path,
            &format!("the image has {width} x {height} pixels; each side must be at most {MAX_SIDE}"),
        ));
    }
    // No image format compresses more than deflate can. A file that claims to is damaged, and is
    // rejected before allocation.
    if decoder.total_bytes() > MAX_COMPRESSION * bytes.len() as u64 {
        return Err(wrong(
            path,
            &format!(
                "{width} x {height} pixels do not fit into its {} bytes; the file is truncated or damaged",
                bytes.len()
            ),
        ));
    }
    DynamicImage::from_decoder(decoder).map_err(unreadable)
}

/// Uses fast compression: recordings are written frame by frame and read soon after.
fn encode(width: usize, height: usize, color: png::ColorType, depth: png::BitDepth, bytes: &[u8]) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| Error::Camera(format!("a {width} x {height} image cannot be written: {e}"));
    let mut out = Vec::with_capacity(bytes.len() / 2);
    let mut encoder = png::Encoder::new(&mut out, width as u32, height as u32);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Up);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(bytes).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(out)
}

/// A JPEG of `bytes`, three a pixel, without visible blocks.
///
/// # Errors
/// A number of bytes that does not match the size; sides that a JPEG cannot have.
pub fn jpeg(bytes: &[u8], width: usize, height: usize) -> Result<Vec<u8>> {
    let wrong = || Error::Camera(format!("{} bytes cannot be a JPEG of {width} x {height} pixels", bytes.len()));
    let (Ok(wide), Ok(high)) = (u32::try_from(width), u32::try_from(height)) else {
        return Err(wrong());
    };
    if bytes.len() != 3 * width * height {
        return Err(wrong());
    }
    let mut out = Vec::new();
    let encoder = JpegEncoder::new_with_quality(&mut out, JPEG_QUALITY);
    encoder.write_image(bytes, wide, high, ExtendedColorType::Rgb8).map_err(|_| wrong())?;
    Ok(out)
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|e| wrong(path, &e))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gradient() -> ColorImage {
        let mut image = ColorImage::new(7, 5, [0; 3]);
        for (i, p) in image.pixels.iter_mut().enumerate() {
            *p = [i as u8, (7 * i) as u8, 255 - i as u8];
        }
        image
    }

    #[test]
    fn images_are_read_back_as_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("image.png");
        gradient().write_png(&path).unwrap();
        assert_eq!(ColorImage::read(&path).unwrap(), gradient());

        let mut depth = DepthImage::new(3, 2);
        depth.depth = vec![0.0, 0.25, 0.2504, 65.535, 70.0, 0.001];
        depth.write_png(&path, 0.001).unwrap();
        assert_eq!(DepthImage::read(&path, 0.001).unwrap().depth, [0.0, 0.25, 0.25, 65.535, 0.0, 0.001]);

        let mut mask = Mask::new(3, 2);
        mask.set[4] = true;
        mask.write_png(&path).unwrap();
        assert_eq!(Mask::read(&path).unwrap(), mask);
    }

    #[test]
    fn a_jpeg_is_near_the_picture() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("image.jpg");
        let mut picture = ColorImage::new(48, 32, [200, 60, 40]);
        picture.write_jpeg(&path).unwrap();
        let back = ColorImage::read(&path).unwrap();
        assert_eq!((back.width, back.height), (48, 32));
        let farthest = back.pixels.iter().flat_map(|p| (0..3).map(|c| p[c].abs_diff(picture.pixels[0][c]))).max();
        assert!(farthest.unwrap() <= 3, "{farthest:?}");
        picture.pixels.pop();
        assert!(picture.write_jpeg(&path).is_err());
    }

    #[test]
    fn bad_files_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.png");
        assert!(ColorImage::read(&path).unwrap_err().to_string().contains("frame.png"));
        let png = gradient().to_png().unwrap();
        for length in 0..png.len() - 12 {
            std::fs::write(&path, &png[..length]).unwrap();
            assert!(ColorImage::read(&path).is_err(), "{length} of {} bytes were taken for an image", png.len());
        }
        std::fs::write(&path, &png).unwrap();
        assert!(DepthImage::read(&path, 0.001).unwrap_err().to_string().contains("16-bit"));
    }
}
