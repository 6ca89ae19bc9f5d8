//! Measurements of speed and cost: one file each.

mod cell;
mod embree;
mod episode;
mod grasp;
mod machine;
mod many;
mod meshing;
mod organs;
mod pytetwild;
mod render;
mod scaling;
mod timing;

pub use cell::{CellBench, CellBenchResult};
pub use episode::{EpisodeBench, EpisodeBenchResult};
pub use grasp::{GraspBench, GraspBenchResult, GraspPhaseTiming};
pub use machine::Machine;
pub use many::ManyRow;
pub use meshing::{MeshingBench, MeshingResult, MeshingRow};
pub use organs::{OrganSource, OrgansBench, OrgansResult};
pub use render::{CameraRow, CellRow, RayRow, RenderBench, RenderBenchResult};
pub use scaling::{ScalingBench, ScalingResult, ScalingRow};
pub use timing::Timing;
pub(crate) use timing::median;
