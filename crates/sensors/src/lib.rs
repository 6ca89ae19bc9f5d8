//! What the cameras of a cell see.
//!
//! A [`CameraRig`] joins a scene's cameras, a cell that is stepped, and the ray tracer: organs with their surfaces (in their pieces after a cut), what they lie on,
//! instruments with jaws that open, arms, ports and the room. [`CameraRig::render`] gives colour, metric depth, labels and normals. The same state gives the same bits for any
//! number of threads.

mod arm;
mod camera;
mod described;
mod error;
mod field;
mod furniture;
mod instrument;
mod organ;
mod rig;
mod section;
mod solid;

pub use camera::OUTSIDE;
pub use error::{Error, Result};
pub use rig::{CameraRig, SensorNoise};
pub use trocar_camera::DepthNoise;
