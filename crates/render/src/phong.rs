//! The simple renderer: first hits of rays in double precision with Blinn-Phong shading, one light,
//! wireframes and ambient occlusion. Hits are found by drawing the triangles, shadows and occlusion
//! by a search tree.
//!
//! It renders recorded phantoms and the figures of reports. Recordings depend on its exact output,
//! so it must not change. The cameras of a running simulation use [`crate::Stage`], which is faster
//! and follows deforming shapes.

mod drawn;
mod scene;
mod shade;
mod trace;

pub use scene::{Instance, PhongImage, PhongScene, Shading, label_mask};
