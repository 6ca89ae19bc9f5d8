//! From a fixed-view RGB-D recording to watertight, tetrahedral organs (paper section III).
//!
//! ```text
//! Recording -> composite -> masks -> outline -> front (fill) -> thickness -> closed_surface
//!           -> resample -> body -> check -> Specimen
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

mod binary_grid;
mod body;
mod check;
mod closed_surface;
mod colour;
mod composite;
mod distance_map;
mod error;
mod fill;
mod from_surface;
mod front;
mod masks;
mod motion;
mod organ;
mod outline;
mod pipeline;
mod resample;
mod settings;
mod thickness;
pub mod truth;

pub use check::{DepthCheck, check as depth_error};
pub use composite::{Composite, CompositeTimes};
pub use error::{Error, Result};
pub use from_surface::from_surface;
pub use masks::drawn_mask;
pub use pipeline::{OrganView, Reconstruction, reconstruct};
pub use settings::{BackRule, MesherRule, Settings, SurfaceRule};
pub use thickness::modelled_volume;

/// Colour of tissue that no image shows.
const TISSUE_COLOR: [u8; 3] = [150, 60, 55];
