//! Measures grasp-lifts in films of colour and depth, of recordings and of simulated episodes
//! alike.
//!
//! A [`MeasuredLift`] needs the frames of a lift, the organ's mask at rest and one click on it. It
//! tracks points of the organ's front, and gives the lift along the organ over the plane of its
//! surroundings ([`LiftProfile`]), the half-drop distance d50, and landmarks every 5 mm with the
//! references of the paper. [`LiftFigures`] are the numbers in millimetres.
//!
//! ```no_run
//! use trocar_core::Silent;
//! use trocar_measure::{LiftFigures, MeasuredLift, RecordingFilm};
//! use trocar_recording::Recording;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let recording = Recording::open("recording".as_ref())?;
//! let mask = trocar_camera::Mask::read(&recording.organ_mask_file("appendix"))?;
//! let mut film = RecordingFilm::new(&recording);
//! for lift in &recording.info.lifts {
//!     let measured = MeasuredLift::of(&mut film, lift, &mask, None, &Silent)?;
//!     println!("{:?}", LiftFigures::of(&measured).d50_mm);
//! }
//! # Ok(())
//! # }
//! ```

mod centreline;
mod chamfer;
mod depth;
mod error;
mod figures;
mod film;
mod landmarks;
mod lift;
mod lift_landmarks;
mod line;
mod plane;
mod profile;
mod smooth;
mod surroundings;
mod track;

pub use centreline::{Centreline, SPACING, Station};
pub use chamfer::{LOCAL, chamfer};
pub use error::{Error, Result};
pub use figures::{LiftFigures, normalised};
pub use film::{Film, RecordingFilm};
pub use landmarks::{Landmark, displacements, rmse};
pub use lift::{ApexMotion, MeasuredLift, References, SurfacePoint};
pub use line::{Line, PAPER};
pub use plane::Plane;
pub use profile::LiftProfile;
pub use smooth::smooth;
pub use track::Tracks;
