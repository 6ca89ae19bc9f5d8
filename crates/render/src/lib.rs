//! Ray-cast pictures of meshes: colour, metric depth, labels, wireframes. Deterministic and parallel by rows.

mod scene;
mod shade;
pub mod srgb;
mod trace;

pub use scene::{Frame, Instance, Scene, Shading, label_mask};
