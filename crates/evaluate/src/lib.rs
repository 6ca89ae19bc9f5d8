//! The commands' work from folder to folder, and the reports: what came out, beside what the paper says.

mod demo;
mod error;
pub mod report;
mod workflow;

pub use demo::{Demo, DemoResult};
pub use error::{Error, Result};
pub use workflow::{
    CompositeFigures, OrganRow, Reconstructed, SimulatedRun, reconstruct_recording, reconstruct_surface, simulate,
};
