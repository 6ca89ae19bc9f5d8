//! What a camera sees and where it stands.
//!
//! Camera frame: OpenCV's (x right, y down, z forward). Depth is z in metres, not ray length; 0 is
//! invalid. The centre of the first pixel is (0, 0).

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
pub use images::{ColorImage, DepthImage, Mask, pixel_neighbours};
pub use lens::{CameraModel, UndistortionMap};
pub use model::Camera;
pub use raster::draw_triangle;
pub use trocar_core::Pose;
