//! Benchmarks: one file or folder each.

mod cell;
mod embree;
mod episode;
mod grasp;
mod instances;
mod lift;
mod many;
mod meshing;
mod organs;
mod pytetwild;
mod render;
mod scaling;
mod timing;
mod view;

pub use cell::CellBench;
pub use episode::EpisodeBench;
pub use grasp::GraspBench;
pub use instances::ManyBench;
pub use lift::LiftBench;
pub use meshing::MeshingBench;
pub use organs::OrgansBench;
pub use render::RenderBench;
pub use scaling::ScalingBench;
pub use view::ViewBench;
