//! Camera models, images and their files, sensor noise and picture metrics.
//!
//! The camera frame is OpenCV's: x right, y down, z forward. Depth is z in metres, not ray length;
//! 0 is invalid. The centre of the first pixel is at (0, 0).
//!
//! ```
//! use trocar_camera::{Camera, DepthImage, DepthNoise};
//!
//! let camera = Camera::d405();
//! let mut depth = DepthImage::new(camera.width, camera.height);
//! depth.depth.fill(0.2);
//! let noisy = DepthNoise::d405().apply(&depth, None, &camera, 1, 0)?;
//! let mean = noisy.depth.iter().filter(|z| **z > 0.0).sum::<f32>() / noisy.depth.len() as f32;
//! assert!((mean - 0.2).abs() < 0.002);
//! # Ok::<(), trocar_camera::Error>(())
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

mod calibration;
mod depth_noise;
mod distortion;
mod endoscope;
mod error;
mod images;
mod lens;
pub mod metrics;
mod model;
mod raster;

pub use depth_noise::DepthNoise;
pub use distortion::{Distortion, Fisheye};
pub use endoscope::Endoscope;
pub use error::{Error, Result};
pub use images::{ColorImage, DepthImage, Mask, jpeg, pixel_neighbours};
pub use lens::{CameraModel, UndistortionMap};
pub use model::Camera;
pub use raster::draw_triangle;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
