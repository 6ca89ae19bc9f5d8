//! Measurements of speed and cost: one file each.

mod machine;
mod meshing;
mod organs;
mod pytetwild;
mod timing;

pub use machine::Machine;
pub use meshing::{MeshingBench, MeshingResult, MeshingRow};
pub use organs::{OrganSource, OrgansBench, OrgansResult};
pub use timing::Timing;
pub(crate) use timing::median;
