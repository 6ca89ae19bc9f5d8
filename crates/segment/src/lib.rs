//! Finds organs and instruments in pictures of a recording.
//!
//! One trait, [`Segmenter`], has four implementations: mask files ([`MaskFolder`]), an outline
//! drawn by hand ([`Polygon`]), instruments by the appearance of metal ([`MetalDetector`], no
//! weights), and SAM 2.1 from a few clicks ([`Sam2`], with weights that the user provides).
//! [`Tracker`] follows a target through a recording with SAM 2.1.
//!
//! Pixel coordinates: the centre of the first pixel is (0, 0), x points right, y down.

mod distance;
mod error;
mod folder;
mod metal;
mod picture;
mod polygon;
mod sam;

pub use error::{Error, Result};
pub use folder::MaskFolder;
pub use metal::{MetalDetector, MetalParameters};
pub use picture::{Picture, Segmenter, Target};
pub use polygon::{Polygon, fill_polygon};
pub use sam::{Sam2, Tracker, WantedFile, wanted_files};
