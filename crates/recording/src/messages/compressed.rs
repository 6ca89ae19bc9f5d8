//! Compressed images: JPEG and PNG, and the depth images of ROS's
//! `compressed_depth_image_transport`.
//!
//! The latter is a PNG behind twelve bytes: a format number and two `f32`. For `16UC1` the PNG has
//! the units; for `32FC1` it has inverse depth: depth = a / (value - b) with those two numbers (the
//! package's `codec.cpp`).

use super::byte_reader::ByteReader;
use super::error::Parsed;
use super::image::{DepthValues, Image, MAX_SIDE, RawDepth};
use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use std::io::Cursor;
use trocar_camera::ColorImage;

/// A small image's pixels may take this much memory whatever its file's size ...
const FREE_GROWTH: u64 = 1 << 20;
/// ... and larger ones this many times the file's size; PNG shrinks an 8-bit channel 1032 times at
/// best.
const MAX_GROWTH: u64 = 4096;

/// Decodes an image by its message's `format` and its content.
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
        return Err("depth compressed with RVL is not known here; record with the png format".into());
    }
    let mut head = ByteReader::packed(data);
    let (_format, a, b) = (head.u32()?, head.f32()?, head.f32()?);
    let DynamicImage::ImageLuma16(image) = unpack(head.take(head.remaining())?)? else {
        return Err("the compressed depth is no 16-bit greyscale PNG".into());
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

/// Decodes a PNG or JPEG, refusing those whose header asks for much more than their file can hold.
fn unpack(data: &[u8]) -> Parsed<DynamicImage> {
    let unreadable = |e: &dyn std::fmt::Display| format!("unreadable image ({e}); expected a whole PNG or JPEG");
    let format = ::image::guess_format(data).map_err(|e| unreadable(&e))?;
    if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg) {
        return Err(format!("an image of kind {format:?}; known are PNG and JPEG"));
    }
    let mut reader = ImageReader::with_format(Cursor::new(data), format);
    reader.no_limits();
    let decoder = reader.into_decoder().map_err(|e| unreadable(&e))?;
    let (width, height) = decoder.dimensions();
    if width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!("an image of {width} x {height} pixels; at most {MAX_SIDE} on a side are read"));
    }
    if decoder.total_bytes() > FREE_GROWTH + MAX_GROWTH * data.len() as u64 {
        return Err(format!("{} bytes are too few for an image of {width} x {height} pixels", data.len()));
    }
    DynamicImage::from_decoder(decoder).map_err(|e| unreadable(&e))
}
