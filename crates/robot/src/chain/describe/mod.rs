//! Arms from description files: URDF and MJCF.
//!
//! Both are read with `roxmltree`, which expands no entity of a document's own, and from each only
//! what makes a serial chain. (`urdf-rs` fills in zeros where a link has no inertia, `mjcf-rs` does
//! not read torque limits; neither can tell these from what the file says.)

mod mjcf;
mod mjcf_visual;
mod urdf;
mod urdf_visual;
mod visual;
mod xml;

pub use mjcf_visual::mjcf_visuals;
pub use urdf_visual::urdf_visuals;
pub use visual::{Visual, VisualShape};
