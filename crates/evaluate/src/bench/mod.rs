//! Measurements of speed and cost: one file each.

mod meshing;
mod pytetwild;

pub use meshing::{MeshingBench, MeshingResult, MeshingRow};
