//! From a fixed-view RGB-D recording to watertight, tetrahedral organs (paper section III).
//!
//! ```text
//! Recording -> composite -> outline -> front (fill) -> thickness -> closed_surface -> body -> check -> Specimen
//! ```

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
mod organ;
mod outline;
mod pipeline;
mod polygon;
mod thickness;

pub use error::{Error, Result};
pub use from_surface::from_surface;
pub use pipeline::{OrganView, Reconstruction, Settings, reconstruct};

/// Colour of tissue that no photograph shows.
const TISSUE_COLOR: [u8; 3] = [150, 60, 55];
