//! A small ray caster in double precision with Blinn-Phong shading: one light, wireframes, ambient
//! occlusion.
//!
//! It draws recorded phantoms and the figures of reports. Recorded phantoms depend on its bits.
//! Cameras of a running simulation use [`crate::Stage`] instead, which deforms and is faster.

mod scene;
mod shade;
mod trace;

pub use scene::{Instance, PhongImage, PhongScene, Shading, label_mask};
