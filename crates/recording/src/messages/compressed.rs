//! Compressed images: JPEG, PNG, and the depth images of ROS's `compressed_depth_image_transport`.
//!
//! The last is a PNG after twelve bytes: a format number and two `f32`, a and b. For `16UC1` the
//! PNG holds depth in units; for `32FC1` it holds inverse depth: depth = a / (value - b) (the
//! package's `codec.cpp`).

use super::byte_reader::ByteReader;
use super::error::Parsed;
use super::image::{DepthValues, Image, MAX_SIDE, RawDepth};
use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use std::io::Cursor;
use trocar_camera::ColorImage;

/// A small image may decode to this much memory (bytes) whatever its file's size ...
const FREE_GROWTH: u64 = 1 << 20;
/// ... and a larger one to this many times its file's size; PNG shrinks an 8-bit channel 1032 times
/// at best.
const MAX_GROWTH: u64 = 4096;

/// Decodes an image from its message's `format` and content.
pub(crate) fn decode(format: &str, data: &[u8]) -> Parsed<Image> {
    let format = format.to_ascii_lowercase();
    if !format.contains("compresseddepth") {
        return match unpack(data)? {
            DynamicImage::ImageLuma16(image) => {
                let (width, height) = (image.width() as usize, image.height() as usize);
                Ok(Image::Depth(RawDepth { width, height, values: DepthValues::Units(image.into_raw()) }))
            }
            image => {
                let image = image.into_rgb8();
                let (width, height) = (image.width() as usize, image.height() as usize);
                let pixels = image.into_raw().as_chunks().0.to_vec();
                Ok(Image::Color(ColorImage { width, height, pixels }))
            }
        };
    }
    if format.contains("rvl") {
        return Err("depth is compressed with RVL, which is not supported; record with the png format".into());
    }
    let mut head = ByteReader::packed(data);
    let (_format, a, b) = (head.u32()?, head.f32()?, head.f32()?);
    let DynamicImage::ImageLuma16(image) = unpack(head.take(head.remaining())?)? else {
        return Err("the compressed depth is not a 16-bit greyscale PNG".into());
    };
    let (width, height) = (image.width() as usize, image.height() as usize);
    let values = if format.trim_start().starts_with("32fc1") {
        let metres = |&inverse: &u16| {
            let depth = a / (f32::from(inverse) - b);
            if inverse > 0 && depth.is_finite() && depth > 0.0 { depth } else { 0.0 }
        };
        DepthValues::Metres(image.as_raw().iter().map(metres).collect())
    } else {
        DepthValues::Units(image.into_raw())
    };
    Ok(Image::Depth(RawDepth { width, height, values }))
}

/// Decodes a PNG or JPEG. Refuses one whose header claims far more pixels than its file can hold.
fn unpack(data: &[u8]) -> Parsed<DynamicImage> {
    let unreadable =
        |e: &dyn std::fmt::Display| format!("the image cannot be decoded ({e}); it must be a complete PNG or JPEG");
    let format = ::image::guess_format(data).map_err(|e| unreadable(&e))?;
    if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg) {
        return Err(format!("the image is of kind {format:?}; supported are PNG and JPEG"));
    }
    let mut reader = ImageReader::with_format(Cursor::new(data), format);
    reader.no_limits();
    let decoder = reader.into_decoder().map_err(|e| unreadable(&e))?;
    let (width, height) = decoder.dimensions();
    if width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!("the image has {width} x {height} pixels; a side must be at most {MAX_SIDE}"));
    }
    if decoder.total_bytes() > FREE_GROWTH + MAX_GROWTH * data.len() as u64 {
        return Err(format!("{} bytes are too few for an image of {width} x {height} pixels", data.len()));
    }
    DynamicImage::from_decoder(decoder).map_err(|e| unreadable(&e))
}
