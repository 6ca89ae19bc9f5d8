//! Arms from description files: URDF and MJCF.
//!
//! Both are parsed by `roxmltree`, which expands no entities of a document. The readers use only
//! the elements of a serial chain. (`urdf-rs` replaces a missing inertia by zeros, and `mjcf-rs`
//! does not read torque limits, so neither shows what is missing in a file.)

mod mjcf;
mod mjcf_visual;
mod urdf;
mod urdf_visual;
mod visual;
mod xml;

pub use mjcf_visual::mjcf_visuals;
pub use urdf_visual::urdf_visuals;
pub use visual::{Visual, VisualShape};
