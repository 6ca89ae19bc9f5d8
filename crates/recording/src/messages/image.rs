//! Images: `sensor_msgs/Image`, `foxglove.RawImage`, and the contents of compressed ones.
//!
//! Encodings are those of `sensor_msgs/image_encodings.h`, and foxglove's and librealsense's names
//! for the same. Depth is as in ROS REP 118. YCbCr is BT.601 with limited range, as OpenCV and
//! librealsense convert it.

use super::error::Parsed;
use std::borrow::Cow;
use trocar_camera::{ColorImage, DepthImage};

/// Largest side of an image (px).
pub(crate) const MAX_SIDE: u32 = 16_384;

/// An image with the header of its message.
#[derive(Clone, Debug, PartialEq)]
pub struct StampedImage {
    /// Time of exposure by the image's own clock (ns); the log time is when it was written.
    pub stamp: u64,
    /// The frame of its camera; RealSense bags have "0" or "1" here.
    pub frame: String,
    /// The pixels.
    pub image: Image,
    /// Unit of depth (m), which newer librealsense appends to its depth images.
    pub depth_unit: Option<f32>,
}

/// Colour or depth.
#[derive(Clone, Debug, PartialEq)]
pub enum Image {
    /// An 8-bit image; grey ones have three equal channels.
    Color(ColorImage),
    /// A depth image, or any other 16-bit or floating-point image of one channel.
    Depth(RawDepth),
}

/// A depth image as recorded; 0 is invalid.
#[derive(Clone, Debug, PartialEq)]
pub struct RawDepth {
    /// Width (px).
    pub width: usize,
    /// Height (px).
    pub height: usize,
    /// One value per pixel, row by row.
    pub values: DepthValues,
}

/// Values of a depth image.
#[derive(Clone, Debug, PartialEq)]
pub enum DepthValues {
    /// Whole units: millimetres by REP 118; the sensor's option for RealSense.
    Units(Vec<u16>),
    /// Metres; NaN, infinite and negative values of the message are 0 here.
    Metres(Vec<f32>),
}

impl RawDepth {
    /// The image in metres; `unit` (m) is the unit of [`DepthValues::Units`].
    pub fn to_metres(&self, unit: f64) -> DepthImage {
        let depth = match &self.values {
            DepthValues::Units(units) => units.iter().map(|&d| (f64::from(d) * unit) as f32).collect(),
            DepthValues::Metres(metres) => metres.clone(),
        };
        DepthImage { width: self.width, height: self.height, depth }
    }
}

/// An uncompressed image before its pixels are decoded.
#[derive(Default)]
pub(crate) struct Raw<'a> {
    pub stamp: u64,
    pub frame: String,
    pub width: u32,
    pub height: u32,
    pub encoding: String,
    pub big_endian: bool,
    /// Bytes from the start of a row to the start of the next.
    pub step: u32,
    pub data: Cow<'a, [u8]>,
    /// Unit of depth (m), which newer librealsense writes after the data.
    pub depth_unit: Option<f32>,
}

/// A compressed image before it is decompressed.
#[derive(Default)]
pub(crate) struct Packed<'a> {
    pub stamp: u64,
    pub frame: String,
    pub format: String,
    pub data: Cow<'a, [u8]>,
}

/// The layout of a pixel encoding, and its bytes per pixel.
fn layout(encoding: &str) -> Option<(Layout, usize)> {
    Some(match encoding.to_ascii_lowercase().as_str() {
        "rgb8" => (Layout::Rgb, 3),
        "bgr8" | "8uc3" => (Layout::Bgr, 3),
        "rgba8" => (Layout::Rgb, 4),
        "bgra8" | "8uc4" => (Layout::Bgr, 4),
        "mono8" | "8uc1" => (Layout::Grey, 1),
        "yuv422" | "uyvy" => (Layout::Uyvy, 2),
        "yuv422_yuy2" | "yuy2" | "yuyv" => (Layout::Yuyv, 2),
        "16uc1" | "mono16" | "z16" => (Layout::Units, 2),
        "32fc1" => (Layout::Metres, 4),
        _ => return None,
    })
}

#[derive(Clone, Copy, PartialEq)]
enum Layout {
    Rgb,
    Bgr,
    Grey,
    Uyvy,
    Yuyv,
    Units,
    Metres,
}

/// The pixels of an uncompressed image.
pub(crate) fn pixels(raw: &Raw<'_>) -> Parsed<Image> {
    let Raw { width, height, step, .. } = *raw;
    let Some((layout, pixel_len)) = layout(&raw.encoding) else {
        return Err(format!(
            "encoding is '{}'; supported are rgb8, bgr8, rgba8, bgra8, mono8, 8UC1, 8UC3, 8UC4, yuv422, yuyv, 16UC1, mono16, z16, 32FC1",
            raw.encoding
        ));
    };
    if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
        return Err(format!("the image has {width} x {height} pixels; a side must be in [1, {MAX_SIDE}]"));
    }
    let (width, height) = (width as usize, height as usize);
    let row_len = width * pixel_len;
    if matches!(layout, Layout::Uyvy | Layout::Yuyv) && !width.is_multiple_of(2) {
        return Err(format!("width is {width}; it must be even for '{}'", raw.encoding));
    }
    // Some writers leave the step at 0.
    let step = if step == 0 { row_len } else { step as usize };
    let needed = step * (height - 1) + row_len;
    if step < row_len || raw.data.len() < needed {
        return Err(format!(
            "the data have {} bytes in rows of {step}; {width} x {height} pixels of '{}' need {needed} in rows of at least {row_len}",
            raw.data.len(),
            raw.encoding
        ));
    }
    let rows = raw.data.chunks(step).take(height).map(|row| &row[..row_len]);
    let color = |pixels| Image::Color(ColorImage { width, height, pixels });
    let depth = |values| Image::Depth(RawDepth { width, height, values });
    Ok(match layout {
        Layout::Rgb => color(rows.flat_map(|r| r.chunks_exact(pixel_len).map(|p| [p[0], p[1], p[2]])).collect()),
        Layout::Bgr => color(rows.flat_map(|r| r.chunks_exact(pixel_len).map(|p| [p[2], p[1], p[0]])).collect()),
        Layout::Grey => color(rows.flat_map(|r| r.iter().map(|&g| [g; 3])).collect()),
        Layout::Uyvy => {
            color(rows.flat_map(|r| r.as_chunks().0.iter().flat_map(|&[u, a, v, b]| pair(a, b, u, v))).collect())
        }
        Layout::Yuyv => {
            color(rows.flat_map(|r| r.as_chunks().0.iter().flat_map(|&[a, u, b, v]| pair(a, b, u, v))).collect())
        }
        Layout::Units => {
            let unit = if raw.big_endian { u16::from_be_bytes } else { u16::from_le_bytes };
            depth(DepthValues::Units(rows.flat_map(|r| r.as_chunks().0.iter().map(|&b| unit(b))).collect()))
        }
        Layout::Metres => {
            let metres = if raw.big_endian { f32::from_be_bytes } else { f32::from_le_bytes };
            let valid = |d: f32| if d.is_finite() && d > 0.0 { d } else { 0.0 };
            depth(DepthValues::Metres(rows.flat_map(|r| r.as_chunks().0.iter().map(|&b| valid(metres(b)))).collect()))
        }
    })
}

/// Two pixels of a YCbCr 4:2:2 image (ITU-R BT.601, limited range, 8-bit fixed point).
fn pair(first: u8, second: u8, u: u8, v: u8) -> [[u8; 3]; 2] {
    let (d, e) = (i32::from(u) - 128, i32::from(v) - 128);
    let part = |sum: i32| ((sum + 128) >> 8).clamp(0, 255) as u8;
    [first, second].map(|y| {
        let c = 298 * (i32::from(y) - 16);
        [part(c + 409 * e), part(c - 100 * d - 208 * e), part(c + 516 * d)]
    })
}
