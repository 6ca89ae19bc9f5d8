//! The simple renderer: a ray caster in double precision with Blinn-Phong shading, one light,
//! wireframes and ambient occlusion.
//!
//! It renders recorded phantoms and the figures of reports. Recordings depend on its exact output,
//! so it must not change. The cameras of a running simulation use [`crate::Stage`], which is faster
//! and follows deforming shapes.

mod drawn;
mod scene;
mod shade;
mod trace;

pub use scene::{Instance, PhongImage, PhongScene, Shading, label_mask};
