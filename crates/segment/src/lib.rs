//! Finds organs and instruments in pictures of a recording.
//!
//! One trait, [`Segmenter`], and four ways to fill it: masks on disk ([`MaskFolder`]), an outline
//! drawn by hand ([`Polygon`]), instruments by the looks of metal ([`MetalDetector`], no weights),
//! and SAM 2.1 from a few clicks ([`Sam2`], with weights the user points to, followed through a
//! recording by [`Tracker`]).
//!
//! Pixels as everywhere in Trocar: the centre of the first pixel is (0, 0), x right, y down.

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
