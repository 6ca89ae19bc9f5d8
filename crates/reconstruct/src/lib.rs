//! From a fixed-view RGB-D recording to watertight, tetrahedral organs.
//!
//! [`Recording`] -> [`composite`] -> masks -> closed surface -> tetrahedra -> specimen. See paper section III.

mod error;
mod pipeline;
pub mod recording;

pub use error::{Error, Result};
pub use pipeline::{OrganView, Reconstruction, Settings, from_surface, reconstruct};
pub use recording::{OrganInfo, Recording, RecordingInfo, RecordingWriter};
