//! Ray-cast pictures of meshes: colour, metric depth, labels, wireframes. Deterministic and parallel by rows.

mod scene;

pub use scene::{Frame, Instance, Scene, Shading};
