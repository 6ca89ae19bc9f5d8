//! Measurements of speed and cost: one file each.

mod cell;
mod embree;
mod episode;
mod grasp;
mod lifts;
mod machine;
mod many;
mod meshing;
mod organs;
mod pytetwild;
mod render;
mod scaling;
mod timing;

pub use episode::EpisodeBench;
pub use lifts::{CellSpeed, GraspCost};
pub use meshing::MeshingBench;
pub use organs::OrgansBench;
pub use render::RenderBench;
pub use scaling::ScalingBench;
pub(crate) use timing::median;
