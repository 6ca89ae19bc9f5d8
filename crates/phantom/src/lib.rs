//! Synthetic recordings with known ground truth: procedural anatomies seen by a simulated depth
//! camera.
//!
//! A phantom replaces a recording of real organs in tests and demonstrations. [`record`] writes a
//! recording folder with colour, depth and masks. Its subfolder `truth/` contains the exact
//! picture, depth and organ surfaces. On request, it goes on with filmed grasp-lifts of the
//! appendix, whose truth is in `truth/lifts.toml`.
//!
//! ```
//! use trocar_phantom::{NAMES, RecordOptions, describe};
//!
//! assert_eq!(NAMES, ["phantom-a", "phantom-b", "phantom-c", "phantom-d"]);
//! let info = describe("phantom-c", &RecordOptions::default())?;
//! assert_eq!(info.organs[0].name, "liver");
//! # Ok::<(), trocar_phantom::Error>(())
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

mod anatomy;
mod bed;
mod blend;
mod body;
mod catalog;
mod error;
mod folder;
mod frame;
mod instruments;
mod lifts;
mod noise;
mod pack;
mod paint;
mod phantom_a;
mod phantom_b;
mod phantom_c;
mod phantom_d;
mod record;
mod sensor;
mod spec;
mod static_view;
mod stereo;
mod tube;

#[cfg(test)]
mod tests;

pub use catalog::NAMES;
pub use error::{Error, Result};
pub use folder::phantoms_folder;
pub use lifts::{HiddenSupport, LIFTS_FILE, LiftOptions, LiftTruth, LiftsTruth};
pub use record::{RecordOptions, describe, record};
pub use sensor::Sensor;
