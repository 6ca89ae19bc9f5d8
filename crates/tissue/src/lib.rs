//! Deformable tissue: materials, model builder, state, implicit integration, grasp.
//!
//! A [`Model`] is built once by [`ModelBuilder`] and never changes; a [`State`] is plain data that can be cloned, saved
//! and restored exactly; a [`Stepper`] owns the scratch memory and advances a state. No robot, no camera, no files.

mod builder;
mod error;
mod grasp;
mod material;
mod model;
pub mod pins;
mod schedule;
mod state;
mod stepper;

pub use builder::{BodyDescription, ModelBuilder, SupportPlane};
pub use error::{Error, Result};
pub use grasp::{Grasp, ToolMotion};
pub use material::{ConstitutiveModel, Material};
pub use model::{Body, Model};
pub use schedule::{Schedule, Start};
pub use state::State;
pub use stepper::{Divergence, StepReport, Stepper};
